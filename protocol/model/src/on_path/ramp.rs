//! One step of a changing rate.

use super::curve::TimedCurve;
use super::legality::Legality;
use super::rate::{RATE_TOLERANCE, Rate};

/// Shares of the strongest step that are tried, from that of the way back at 0.
const SHARES: [f64; 6] = [1.0, 0.97, 0.9, 0.75, 0.5, 0.2];

/// The strongest legal step of `length_s` from `from` toward the rate `asked`, and the curvature of
/// the way back from its end; `None` if none is better than the way back from `from`.
pub(super) fn strongest<C: TimedCurve>(
    legality: &mut Legality<'_, C>,
    from: Rate,
    way_back: f64,
    asked: f64,
    length_s: f64,
) -> Option<(Rate, f64)> {
    let sign = (asked - from.settled(way_back)).signum();
    // Bounds of twice the step, so that the next one can begin with the slope that this one ends.
    legality.load(from.phase_s, from.phase_s + 2.0 * from.rate * length_s);
    let local = legality.local(from, 2.0 * length_s);
    let calm = local.calm;
    let reach = local.curvatures.scaled(length_s);
    let strongest = landing(from, sign, asked, calm, length_s)
        .clamp(local.slopes.low, local.slopes.high)
        .clamp(from.slope + reach.low, from.slope + reach.high);
    let known = from.slope - from.slope.clamp(-way_back * length_s, way_back * length_s);
    if (strongest - known) * sign <= 0.0 {
        return None;
    }
    for share in SHARES {
        let slope = known + share * (strongest - known);
        let piece = from.piece((slope - from.slope) / length_s, length_s);
        let lands = (asked - piece.end.settled(calm)) * sign >= -RATE_TOLERANCE;
        if lands && legality.allows_cut(&piece) && legality.allows_return(piece.end, calm) {
            return Some((piece.end, calm));
        }
    }
    None
}

/// The slope at the end of a step of `length_s` from which the way back with curvature `calm` ends
/// at the rate `asked`; zero if the step is too long for that.
fn landing(from: Rate, sign: f64, asked: f64, calm: f64, length_s: f64) -> f64 {
    // (y + z) h / 2 + z² / 2c = e, with y and z the slopes at both ends of the step.
    let (y, error) = (sign * from.slope, sign * (asked - from.rate));
    let constant = calm * (length_s * y - 2.0 * error);
    let linear = calm * length_s;
    let root = (linear * linear - 4.0 * constant).max(0.0).sqrt();
    sign * (0.5 * (root - linear)).max(0.0)
}
