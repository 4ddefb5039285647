//! Jerk-limited motions against the durations that PyPI ruckig finds, and against its bug reports.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod uniform;

use armada_model::{
    JerkLimitedMove, JerkLimitedStop, JointLimits, JointVector, MotionLimits, OnlineOptions,
    OnlineState, Synchronisation,
};
use serde::Deserialize;
use uniform::Uniform;

/// Largest difference to the peer, relative; the file has eleven digits.
const TOLERANCE: f64 = 1e-9;

/// What `golden/online.py` wrote.
#[derive(Deserialize)]
struct Golden {
    ruckig: String,
    moves_s: Vec<f64>,
    stops_s: Vec<f64>,
}

/// One motion that is asked for.
struct Case {
    from: OnlineState,
    to: OnlineState,
    limits: MotionLimits,
    options: OnlineOptions,
}

fn golden() -> Golden {
    let golden: Golden =
        serde_json::from_str(include_str!("golden/online.json")).expect("the file is JSON");
    assert_eq!(golden.ruckig, "0.19.4");
    golden
}

/// The same as `case` in `golden/online.py`, operation by operation.
fn case(index: usize) -> Case {
    let mut random = Uniform::seeded(index as u64 * 1_000_003);
    let joints = 1 + random.below(10.0);
    let kind = random.below(4.0);
    let is_free = random.next() < 0.25;
    let minimum = random.next() * 12.0 - 8.0;
    let mut columns: [Vec<f64>; 6] = Default::default();
    let mut limits = Vec::new();
    for _ in 0..joints {
        let velocity = 0.5 + 2.0 * random.next();
        let acceleration = 2.0 + 8.0 * random.next();
        let jerk = 10.0 + 190.0 * random.next();
        let start = 6.0 * random.next() - 3.0;
        let end = 6.0 * random.next() - 3.0;
        let mut v0 = random.signed() * velocity;
        let mut a0 = random.signed() * acceleration;
        let mut vf = random.signed() * velocity;
        let most = (2.0 * jerk * (velocity - vf.abs())).sqrt() * 0.99;
        let mut af = random.signed() * acceleration.min(most);
        if kind == 0 {
            (v0, a0) = (0.0, 0.0);
        }
        if kind == 3 {
            (v0, a0) = (v0 * 1.5, a0 * 1.5);
        }
        if kind != 2 {
            (vf, af) = (0.0, 0.0);
        }
        for (column, value) in columns.iter_mut().zip([start, v0, a0, end, vf, af]) {
            column.push(value);
        }
        limits.push(joint(velocity, acceleration, jerk));
    }
    let (synchronisation, minimum_duration_s) = if is_free {
        (Synchronisation::None, 0.0)
    } else {
        (Synchronisation::Time, minimum.max(0.0))
    };
    let [start, v0, a0, end, vf, af] = columns;
    Case {
        from: state(&start, &v0, &a0),
        to: state(&end, &vf, &af),
        limits: MotionLimits::new(&limits).expect("complete limits"),
        options: OnlineOptions { synchronisation, minimum_duration_s },
    }
}

fn joint(velocity: f64, acceleration: f64, jerk: f64) -> JointLimits {
    let (acceleration, jerk) = (Some(acceleration), Some(jerk));
    JointLimits { velocity, acceleration, jerk, ..JointLimits::default() }
}

fn state(position: &[f64], velocity: &[f64], acceleration: &[f64]) -> OnlineState {
    let vector = |values| JointVector::from_slice(values).expect("finite");
    OnlineState {
        position: vector(position),
        velocity: vector(velocity),
        acceleration: vector(acceleration),
    }
}

/// Fails at the first case whose duration is not the expected one.
fn compare(expected: &[f64], duration: impl Fn(usize) -> f64) {
    for (index, &expected) in expected.iter().enumerate() {
        assert!(expected >= 0.0, "case {index}: the peer failed");
        let difference = (duration(index) - expected).abs();
        assert!(difference <= TOLERANCE * expected, "case {index}: off by {difference:e} s");
    }
}

#[test]
fn twenty_thousand_moves_take_as_long_as_the_peer_says() {
    let golden = golden();
    assert_eq!(golden.moves_s.len(), 20_000);
    compare(&golden.moves_s, |index| {
        let Case { from, to, limits, options } = case(index);
        JerkLimitedMove::plan(&from, &to, &limits, &options)
            .unwrap_or_else(|error| panic!("case {index}: {error}"))
            .duration_s()
    });
}

#[test]
fn stops_take_as_long_as_the_velocity_interface_of_the_peer() {
    let golden = golden();
    assert_eq!(golden.stops_s.len(), 2_000);
    compare(&golden.stops_s, |index| {
        let Case { from, limits, .. } = case(index);
        JerkLimitedStop::plan(&from, &limits).expect("a stop exists").duration_s()
    });
}

/// What made some version of the peer fail, in the words of its issues on GitHub.
struct Report {
    issue: &'static str,
    /// Start position, velocity and acceleration, target position and velocity of each joint.
    joints: &'static [[f64; 5]],
    /// Limits of velocity, acceleration and jerk of each joint.
    limits: &'static [[f64; 3]],
}

/// Near-zero distances, states at their limits and roots that are double.
const REPORTS: &[Report] = &[
    Report {
        issue: "pantor/ruckig 19",
        joints: &[
            [-0.843763019702056, -0.0303436943534115, 0.0941203950600968, -0.847254234340315, 0.0],
            [-1.26164314329262, 0.0371785718477563, -0.152313813731685, -1.25777615061367, 0.0],
            [1.62592703780797, -0.0294029319779939, 0.134100351460333, 1.62279392916203, 0.0],
            [-1.26322670514057, -0.0129669308625882, 0.0630571844324987, -1.26518389118862, 0.0],
            [-0.900133529360832, -0.030242580748223, 0.0116214644247746, -0.90368278625599, 0.0],
            [1.09819107359504, 0.00636710830722948, -0.0622068786789912, 1.09921788488865, 0.0],
        ],
        limits: &[[1.0, 4.0, 100.0]; 6],
    },
    Report {
        issue: "pantor/ruckig 24",
        joints: &[
            [0.01073568005271233, 0.05656281587106524, -5.348847133445708, 0.0698, 0.0],
            [-0.7002627264230739, 1.0, -3.400994300842285, 0.6283, 0.0],
            [0.08182424814164639, 0.9677565166950226, -3.708171844482422, 0.6981, 0.0],
            [-2.453889055015553, 0.9125879855751985, -3.951635360717773, -2.1642, 0.0],
            [-0.08363270962592464, -0.9937611499130723, 3.508039474487305, -0.733, 0.0],
            [1.829417851685384, 0.9963710898160936, -3.532837390899658, 2.5482, 0.0],
            [0.7163509366199623, -0.8048512544333941, 4.73619270324707, 0.5061, 0.0],
        ],
        limits: &[[1.0, 7.0, 1000.0]; 7],
    },
    Report {
        issue: "pantor/ruckig 96",
        joints: &[
            [0.2473592757796861, -0.2426115138900957, 0.01877538437863763, 0.2308075286416321, 0.0],
            [0.2921606775204735, 0.2200706500820608, -0.6573642866096158, 0.3066442218484541, 0.0],
            [0.7758663276711127, -0.01891492763905089, 0.5, 0.7733155040940536, 0.0],
        ],
        limits: &[[0.25, 2.5, 62.5]; 3],
    },
    Report {
        issue: "pantor/ruckig 100",
        joints: &[[0.02853333333333339, 0.6800000000000006, 7.999999999999993, 0.0, 0.0]],
        limits: &[[1.0, 10.0, 100.0]],
    },
    Report {
        issue: "pantor/ruckig 130",
        joints: &[
            [0.1720894642466409, 0.0, 0.0, 0.1703441349946466, 0.0],
            [3.62255615705579, -0.06422550797049381, 0.0, 3.587689540855463, -0.06423623454575711],
            [1.675754445058354, -0.006910864193129071, 0.0, 1.671344092861895, -0.007006078877926],
            [2.181127634157466, 0.1207111377965507, -0.3999999999978001, 2.271916653384632, 0.1187],
        ],
        limits: &[
            [0.06981317, 0.034906585, 100.0],
            [0.06423623454575711, 0.261799388, 100.0],
            [0.007006078877926925, 0.043633231, 100.0],
            [0.1187909578397501, 0.4, 100.0],
        ],
    },
    Report {
        issue: "pantor/ruckig 141",
        joints: &[[0.0049921875, 0.0, 0.0, 0.005, 0.0]],
        limits: &[[0.1, 2.5, 2000.0]],
    },
    Report {
        issue: "pantor/ruckig 160",
        joints: &[
            [
                -0.04895883258572608,
                1.425883388427091e-14,
                -2.370282711878416e-12,
                -0.04895883258572691,
                0.0,
            ],
            [0.1992637939208025, -9.520201039439915e-20, 0.0, 0.1992637939208025, 0.0],
            [
                -0.2914660630142018,
                -9.656571194417352e-20,
                3.469446951953614e-18,
                -0.2914660630142018,
                0.0,
            ],
        ],
        limits: &[[5.0, 10.0, 150.0]; 3],
    },
    Report {
        issue: "pantor/ruckig 194",
        joints: &[[0.0, 0.0, 0.0, 719.0, 0.0]],
        limits: &[[546.454545454545, 27272.72727272725, 1363636.363636363]],
    },
];

#[test]
fn states_that_made_the_peer_fail_are_solved_and_end_at_their_targets() {
    for Report { issue, joints, limits } in REPORTS {
        let column = |index: usize| joints.iter().map(|row| row[index]).collect::<Vec<_>>();
        let none = vec![0.0; joints.len()];
        let (from, to) =
            (state(&column(0), &column(1), &column(2)), state(&column(3), &column(4), &none));
        let limits: Vec<_> = limits.iter().map(|&[v, a, j]| joint(v, a, j)).collect();
        let limits = MotionLimits::new(&limits).expect("complete limits");
        for synchronisation in
            [Synchronisation::Time, Synchronisation::Phase, Synchronisation::None]
        {
            let options = OnlineOptions { synchronisation, minimum_duration_s: 0.0 };
            let motion = JerkLimitedMove::plan(&from, &to, &limits, &options)
                .unwrap_or_else(|error| panic!("{issue}, {synchronisation:?}: {error}"));
            if synchronisation != Synchronisation::None {
                let end = motion.at(motion.duration_s());
                let off = end.position.max_abs_difference(&to.position)
                    + end.velocity.max_abs_difference(&to.velocity);
                assert!(off < 1e-12, "{issue}, {synchronisation:?}: ends {off:e} off");
            }
        }
    }
}
