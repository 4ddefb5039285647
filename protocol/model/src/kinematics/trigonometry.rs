//! Sine and cosine together, the same on every machine.
//!
//! The C library's answers differ in the last bit from version to version; these do not, so equal
//! inputs give equal motions everywhere. Without a call or a branch on the way, the processor works
//! on several joints at once: about half the time.

/// Angles up to this \[rad\] are reduced here, others by the standard library.
const LARGEST: f64 = 1e5;

/// `pi / 2` in three parts; multiples of the first two by the numbers of quadrants up to
/// [`LARGEST`] are exact.
const QUARTER: [f64; 3] =
    [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];

/// Adding it rounds to a whole number, which then stands in the lowest bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Of sine: powers 3, 5, ... 13.
const SINE: [f64; 6] = [
    -0.166_666_666_666_666_32,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];

/// Of cosine: powers 4, 6, ... 14.
const COSINE: [f64; 6] = [
    0.041_666_666_666_666_6,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Sine and cosine of `angle` \[rad\], each within 2.5e-16 of the exact value.
///
/// Source: reduction by W. Cody and W. Waite, "Software Manual for the Elementary Functions", 1980;
/// constants and polynomials of Sun's freely distributable mathematics library fdlibm 5.3,
/// `e_rem_pio2.c`, `k_sin.c`, `k_cos.c`.
#[inline]
pub(crate) fn sin_cos(angle: f64) -> (f64, f64) {
    // Not `>`: what is no number goes to the library as well.
    if angle.abs() <= LARGEST { near_zero(angle) } else { angle.sin_cos() }
}

/// Sines and cosines of `angles`, which is faster than one by one.
#[inline]
pub(crate) fn sin_cos_of<const N: usize>(angles: &[f64; N]) -> [(f64, f64); N] {
    if angles.iter().all(|angle| angle.abs() <= LARGEST) {
        angles.map(near_zero)
    } else {
        angles.map(f64::sin_cos)
    }
}

#[inline(always)]
fn near_zero(angle: f64) -> (f64, f64) {
    let rounded = angle * std::f64::consts::FRAC_2_PI + ROUNDER;
    let quadrant = rounded.to_bits();
    let turns = rounded - ROUNDER;
    let near = angle - turns * QUARTER[0];
    let shift = turns * QUARTER[1];
    let high = near - shift;
    let r = high + (((near - high) - shift) - turns * QUARTER[2]);

    let z = r * r;
    let [s1, s2, s3, s4, s5, s6] = SINE;
    let [c1, c2, c3, c4, c5, c6] = COSINE;
    let zz = z * z;
    let sine = (s1 + z * s2) + zz * ((s3 + z * s4) + zz * (s5 + z * s6));
    let cosine = (c1 + z * c2) + zz * ((c3 + z * c4) + zz * (c5 + z * c6));
    let sine = r + r * z * sine;
    let half = 0.5 * z;
    let lead = 1.0 - half;
    let cosine = lead + (((1.0 - lead) - half) + zz * cosine);

    let (sine, cosine) = if quadrant & 1 == 0 { (sine, cosine) } else { (cosine, sine) };
    let negative = |bit: u64, value: f64| f64::from_bits(value.to_bits() ^ (bit & 2) << 62);
    (negative(quadrant, sine), negative(quadrant.wrapping_add(1), cosine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_agrees_with_the_standard_library() {
        for step in -200_000_i32..200_000 {
            let spread = f64::from(step) * 1e-4;
            for angle in [spread, spread * 4e3, f64::from(step / 2) * std::f64::consts::FRAC_PI_2] {
                let (sin, cos) = sin_cos(angle);
                let error = (sin - angle.sin()).abs().max((cos - angle.cos()).abs());
                assert!(error <= 2.5e-16, "{angle}: {error:e}");
            }
        }
    }

    #[test]
    fn zero_and_right_angles_are_exact_where_the_library_is() {
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        assert_eq!(sin_cos(std::f64::consts::FRAC_PI_2).0, 1.0);
        assert_eq!(sin_cos(-std::f64::consts::PI).1, -1.0);
    }

    #[test]
    fn far_angles_and_what_is_no_number_go_to_the_library() {
        for angle in [1e5, 1.000_001e5, -3e9, 1e300] {
            let (sin, cos) = sin_cos(angle);
            assert!((sin - angle.sin()).abs() <= 2.5e-16 && (cos - angle.cos()).abs() <= 2.5e-16);
        }
        assert!(sin_cos(f64::NAN).0.is_nan() && sin_cos(f64::INFINITY).1.is_nan());
    }
}
