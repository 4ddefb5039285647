//! Evaluating a timed path allocates nothing.

#![expect(clippy::expect_used, reason = "a test fails by panicking, its helpers too")]

mod counting_allocator;
mod path_cases;

use std::hint::black_box;

use armada_model::{PathRows, RetimeOptions, StackedPath, retime};
use counting_allocator::allocations_of;
use path_cases::Case;

#[test]
fn sampling_a_timed_path_allocates_nothing() {
    let case = Case::new(6);
    let timed = retime(case.path(), &case.limits, &RetimeOptions::default()).expect("retimed");
    let count = allocations_of(|| {
        for tick in -10..6000 {
            let t = f64::from(tick) * 1e-3;
            black_box((timed.at(t), timed.fraction_at(t)));
        }
    });
    assert_eq!(count, 0);
}

#[test]
fn sampling_a_stack_of_three_arms_allocates_nothing() {
    let cases = [Case::new(1), Case::new(2), Case::new(3)];
    let stack = StackedPath::new(cases.iter().map(Case::path).collect()).expect("three paths");
    let limits = cases.each_ref().map(|case| case.limits.clone()).concat();
    let timed = retime(stack, &limits, &RetimeOptions::default()).expect("retimed");
    let mut rows = vec![0.0; 63];
    let count = allocations_of(|| {
        for tick in 0..3000 {
            timed.write_at(f64::from(tick) * 1e-3, &mut PathRows::split(black_box(&mut rows)));
        }
    });
    assert_eq!(count, 0);
}
