//! Inputs, outputs, settings and the load.

use armada_model::MAX_JOINTS;

use super::*;
use crate::drivers::{LoadSetting, Values};

/// Places in the default signals.
const DI1: usize = 0;
const DO2: u8 = 5;
const AI1: usize = 8;
const AO1: u8 = 9;

fn values(values: &[f64]) -> Values<MAX_JOINTS> {
    Values::from_slice(values).expect("few")
}

fn set_signal(pair: &mut Pair, signal: u8, to: &[f64]) {
    pair.request(DriverRequest::SetSignal { signal, values: values(to) });
    pair.run(0.05);
}

#[test]
fn an_output_is_read_back_as_it_was_set() {
    let mut pair = Pair::new(quiet());
    pair.run(0.1);
    set_signal(&mut pair, DO2, &[1.0]);
    set_signal(&mut pair, AO1, &[7.5]);
    let signals = pair.feedback().signals;
    assert_eq!(signals.as_slice(), &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 7.5]);
    let infos = pair.driver.abilities().signals;
    assert_eq!(infos.iter().map(|info| usize::from(info.size)).sum::<usize>(), 10);
    assert_eq!(infos[usize::from(AO1)].name, "AO1");
}

#[test]
fn an_input_outside_its_range_or_a_value_it_cannot_have_changes_nothing() {
    let mut pair = Pair::new(quiet());
    pair.run(0.1);
    set_signal(&mut pair, DI1 as u8, &[1.0]); // an input
    set_signal(&mut pair, DO2, &[0.5]);
    set_signal(&mut pair, DO2, &[1.0, 1.0]);
    set_signal(&mut pair, AO1, &[10.5]);
    assert!(pair.feedback().signals.as_slice().iter().all(|value| *value == 0.0));
}

#[test]
fn inputs_are_injected_by_name() {
    let mut pair = Pair::new(quiet());
    pair.run(0.1);
    assert!(pair.inject("input=DI1:1"));
    assert!(pair.inject("input=AI1:2.5"));
    for refused in ["input=DI9:1", "input=DI1[1]:1", "input=DI1:2", "input=AI1:11", "input=DO1:1"] {
        assert!(!pair.inject(refused), "{refused}");
    }
    pair.run(0.05);
    let signals = pair.feedback().signals;
    assert_eq!((signals.as_slice()[DI1], signals.as_slice()[AI1]), (1.0, 2.5));
}

#[test]
fn parameters_begin_at_their_defaults_and_take_what_they_may_have() {
    let mut pair = Pair::new(quiet());
    pair.run(0.1);
    assert_eq!(pair.feedback().parameters.as_slice(), &[1.0, 0.5, 0.0, 1.0]);
    let wanted = [(0, 0.0), (1, 0.25), (2, 2.0), (3, 8.0)];
    let refused = [(0, 0.5), (1, 1.5), (2, 3.0), (3, 2.5), (3, 9.0)];
    for (parameter, value) in wanted.into_iter().chain(refused) {
        pair.request(DriverRequest::SetParameter { parameter, value });
        pair.run(0.05);
    }
    assert_eq!(pair.feedback().parameters.as_slice(), &[0.0, 0.25, 2.0, 8.0]);
}

#[test]
fn a_restricted_parameter_is_not_changed_in_motion() {
    let mut pair = Pair::enabled(quiet());
    pair.accelerate_to(0.5);
    pair.request(DriverRequest::SetParameter { parameter: 2, value: 1.0 });
    pair.request(DriverRequest::SetParameter { parameter: 1, value: 0.75 });
    pair.command(0.05, |t| [(0.075 + 0.5 * t, 0.5), (0.0, 0.0)]);
    assert_eq!(pair.feedback().parameters.as_slice()[1..3], [0.75, 0.0]);
}

#[test]
fn many_values_at_once_all_arrive_through_a_bad_network_and_the_newest_of_each_wins() {
    let weather = Weather { loss: 0.3, hold_up: 3, twice: 0.2 };
    let mut pair = Pair::in_weather(quiet(), weather);
    pair.run(0.5);
    for round in 0..40 {
        for signal in 4..8 {
            let on = f64::from((round + signal) % 2);
            pair.request(DriverRequest::SetSignal { signal: signal as u8, values: values(&[on]) });
        }
        pair.tick();
    }
    pair.run(2.0);
    assert_eq!(pair.feedback().signals.as_slice()[4..8], [1.0, 0.0, 1.0, 0.0]);
}

#[test]
fn a_value_asked_of_a_controller_that_restarted_is_dropped() {
    let mut pair = Pair::new(quiet());
    pair.run(0.1);
    pair.request(DriverRequest::SetSignal { signal: DO2, values: values(&[1.0]) });
    pair.emulator = config(quiet()).emulator(&setup(33)).expect("emulator");
    pair.run(0.5);
    assert_eq!(pair.feedback().signals.as_slice()[usize::from(DO2)], 0.0);
    set_signal(&mut pair, DO2, &[1.0]);
    assert_eq!(pair.feedback().signals.as_slice()[usize::from(DO2)], 1.0);
}

#[test]
fn a_load_shows_in_the_effort() {
    let mut pair = Pair::of(moves::arm, moves::config(), Weather::default());
    pair.enable();
    let before = pair.feedback().joint_effort;
    let load = LoadSetting { mass: 5.0, ..LoadSetting::default() };
    pair.request(DriverRequest::SetLoad { chain: 0, load });
    pair.run(0.1);
    let after = pair.feedback().joint_effort;
    // The upper arm points up and the forearm ahead: the elbow carries the weight at that distance.
    assert!((after[2] - before[2]).abs() > 0.5 * 5.0 * 9.81 * 0.5, "{before:?} {after:?}");
    assert!((after[0] - before[0]).abs() < 1e-9, "a vertical axis carries no weight");
}
