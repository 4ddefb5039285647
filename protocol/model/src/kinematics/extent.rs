//! How far a chain can stretch.

#![allow(non_snake_case, reason = "R_LT is the rotation of frame T in frame L")]

use nalgebra::{Matrix3, Vector3};

use super::chain::Chain;
use super::reduce::Step;

/// Rounds over all joints; each brings the points nearer to their best places.
const ROUNDS: usize = 50;

/// An upper bound of the distance between a point of the base and one of the tool.
///
/// The points lie on the first and on the last axis of the chain.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// The point of the base, in the base \[m\].
    pub(crate) base: Vector3<f64>,
    /// The point of the tool, in the TCP's frame \[m\].
    pub(crate) tool: Vector3<f64>,
    /// The distance is never larger \[m\]; infinite if a joint that slides has no limits.
    pub(crate) longest: f64,
}

/// A point and a line along z: coordinate along it and distance from it.
type Beside = (f64, f64);

impl Chain {
    /// The bound, where `farthest` tells the largest absolute position of a variable that slides,
    /// `None` if there is none.
    ///
    /// Each link holds a point on its axis to its parent and one on the axis to its child, at a
    /// fixed distance; the distances add up. Any points on axes that turn will do; they are chosen
    /// for a small sum, each in turn where the way over it from its neighbours is shortest.
    pub(crate) fn extent(&self, farthest: impl Fn(usize) -> Option<f64>) -> Extent {
        let steps = &self.reduced.steps;
        let mut heights = vec![0.0; steps.len()];
        for _ in 0..ROUNDS {
            for k in 0..steps.len() {
                if let Some(height) = best_height(steps, &heights, k) {
                    heights[k] = height;
                }
            }
        }
        let slide = |step: &Step| {
            if step.turns {
                return 0.0;
            }
            let slide = |q: f64| (step.multiplier * q).abs() + step.offset.abs();
            farthest(step.variable).map_or(f64::INFINITY, slide)
        };
        let links: f64 =
            steps.windows(2).zip(heights.windows(2)).map(|(s, h)| span(&s[0], h)).sum();
        let slides: f64 = steps.iter().map(slide).sum();
        let (R, p) = &self.reduced.first;
        let (R_LT, p_LT) = &self.last;
        let (first, last) = (heights.first().copied(), heights.last().copied());
        Extent {
            base: p + along(R, first.unwrap_or_default()),
            tool: R_LT.transpose() * (Vector3::z() * last.unwrap_or_default() - p_LT),
            longest: links + slides,
        }
    }
}

fn along(R: &Matrix3<f64>, height: f64) -> Vector3<f64> {
    R.column(2) * height
}

/// The next axis in the frame of `step`.
fn next_axis(step: &Step) -> Vector3<f64> {
    Vector3::new(0.0, -step.twist.1, step.twist.0)
}

/// Distance between the points at these heights on the axis of `step` and on the next one.
fn span(step: &Step, heights: &[f64]) -> f64 {
    let (own, next) = (heights[0], heights[1]);
    (step.shift + next_axis(step) * next - Vector3::z() * own).norm()
}

/// Height on the axis of joint `k` that makes the way from its neighbours' points shortest; `None`
/// for joints that slide, whose points stay in the origin.
fn best_height(steps: &[Step], heights: &[f64], k: usize) -> Option<f64> {
    let step = steps.get(k).filter(|step| step.turns)?;
    let before = k.checked_sub(1).and_then(|j| Some((steps.get(j)?, *heights.get(j)?)));
    let before = before.map(|(step, height)| {
        let axis = next_axis(step);
        let point = Vector3::z() * height - step.shift;
        beside(&axis, &point)
    });
    let after = heights.get(k + 1).map(|&height| {
        let point = step.shift + next_axis(step) * height;
        beside(&Vector3::z(), &point)
    });
    match (before, after) {
        // As light goes over a mirror: heights in proportion to the distances.
        (Some((a, da)), Some((b, db))) if da + db > 0.0 => Some((a * db + b * da) / (da + db)),
        (Some((height, _)), _) | (None, Some((height, _))) => Some(height),
        (None, None) => None,
    }
}

fn beside(axis: &Vector3<f64>, point: &Vector3<f64>) -> Beside {
    let height = axis.dot(point);
    (height, (point - axis * height).norm())
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::Extent;
    use crate::{Chain, RobotModel};

    fn extent(text: &str, tip: &str) -> (Chain, Extent) {
        let model = RobotModel::from_urdf(text, "r.urdf").expect("a robot");
        let chain = Chain::from_root(&model, tip).expect("a chain");
        let limits: Vec<_> = chain.variables().iter().map(|v| v.limits.upper).collect();
        let extent = chain.extent(|variable| limits[variable]);
        (chain, extent)
    }

    #[test]
    fn offsets_along_parallel_axes_count_once_and_together() {
        // Two links of 0.4 m and 0.3 m whose planes are 0.2 m apart and back again.
        let (_, extent) = extent(
            r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
            <joint name="i" type="continuous"><origin xyz="0 0 0.5"/>
              <parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
            <joint name="j" type="continuous"><origin xyz="0.4 0 0.2"/>
              <parent link="b"/><child link="c"/><axis xyz="0 0 1"/></joint>
            <joint name="k" type="continuous"><origin xyz="0.3 0 -0.2"/>
              <parent link="c"/><child link="d"/><axis xyz="0 0 1"/></joint></robot>"#,
            "d",
        );
        assert!((extent.longest - 0.7).abs() < 1e-9, "{extent:?}");
    }

    #[test]
    fn no_posture_stretches_further() {
        let text = include_str!("../../../../config/robots/seven_axis_arm.urdf");
        let (chain, extent) = extent(text, "tool0");
        let mut farthest = 0.0_f64;
        for step in 0_u32..20_000 {
            let q: [f64; 7] =
                std::array::from_fn(|k| 3.0 * (f64::from(step) * (0.37 + 0.11 * k as f64)).sin());
            let X = chain.forward(&q).expect("fits");
            let point = X * nalgebra::Point3::from(extent.tool);
            farthest = farthest.max((point.coords - extent.base).norm());
        }
        assert!(farthest <= extent.longest, "{farthest} {extent:?}");
        assert!(farthest > 0.9 * extent.longest, "{farthest} {extent:?}");
    }

    #[test]
    fn slides_add_their_range() {
        let (_, extent) = extent(
            r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
            <joint name="i" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
              <limit lower="0" upper="0.5" velocity="1"/></joint>
            <joint name="j" type="continuous"><origin xyz="0.3 0 0"/>
              <parent link="b"/><child link="c"/><axis xyz="0 0 1"/></joint></robot>"#,
            "c",
        );
        assert!((extent.longest - 0.8).abs() < 1e-12, "{extent:?}");
        assert!(extent.tool.norm() < 1e-12 && extent.base == Vector3::zeros(), "{extent:?}");
    }
}
