//! Jacobians of chains against pinocchio's, in `tests/golden/jacobian.json`.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use std::collections::BTreeMap;

use armada_model::Chain;
use serde::Deserialize;

const TOLERANCE: f64 = 1e-9;

#[derive(Deserialize)]
struct Golden {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    urdf: String,
    tip: String,
    joint_positions: BTreeMap<String, f64>,
    columns: BTreeMap<String, [f64; 6]>,
}

#[test]
fn every_column_is_the_one_pinocchio_gives() {
    let Some(robots) = common::shared("robots") else { return };
    let golden: Golden =
        serde_json::from_str(include_str!("golden/jacobian.json")).expect("the answers decode");
    assert_eq!(golden.cases.len(), 42);
    for case in &golden.cases {
        let model = common::load(&robots.join(&case.urdf));
        let chain = Chain::from_root(&model, &case.tip).expect("a chain");
        let name = format!("{} {}", case.urdf, case.tip);
        let names: Vec<_> = chain.variables().iter().map(|v| v.name.clone()).collect();
        let mut sorted = names.clone();
        sorted.sort();
        assert_eq!(sorted, case.columns.keys().cloned().collect::<Vec<_>>(), "{name}");
        let positions: Vec<f64> = names.iter().map(|name| case.joint_positions[name]).collect();
        let (_, jacobian) = chain.forward_and_jacobian(&positions).expect("positions fit");
        for (index, joint) in names.iter().enumerate() {
            for (row, expected) in case.columns[joint].iter().enumerate() {
                let element = jacobian.element(row, index).expect("inside");
                let difference = (element - expected).abs();
                assert!(difference <= TOLERANCE, "{name} {joint} row {row}: {difference:e}");
            }
        }
    }
}
