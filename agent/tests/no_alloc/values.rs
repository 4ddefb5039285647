//! Signals and parameters of the controller.

use armada_agent::control::{LoopEvent, Order, Output, Refusal};
use armada_agent::drivers::Values;
use armada_protocol::messages::CommandMode;

use crate::orders::{jog, set_mode};
use crate::rig::Rig;

fn set_signal(signal: u8, values: &[f64], restricted: bool) -> Order {
    let values = Values::from_slice(values).expect("few values");
    Order::SetSignal { signal, values, restricted, while_stopped: false }
}

const fn set_parameter(value: f64) -> Order {
    Order::SetParameter { parameter: 0, value, restricted: false }
}

fn results(output: &Output) -> Vec<Result<(), Refusal>> {
    let answers = output.events.iter().filter_map(|event| match event {
        LoopEvent::Answer { result, .. } => Some(result.map(drop)),
        _ => None,
    });
    answers.collect()
}

/// The first answers that come.
fn answers(rig: &mut Rig) -> Vec<Result<(), Refusal>> {
    let mut found = (0..1000).map(|_| results(&rig.tick([])));
    found.find(|answers| !answers.is_empty()).expect("an answer")
}

#[test]
fn signals_and_parameters_that_are_set_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(100);
    rig.tick([set_signal(0, &[1.0], true)]);
    assert_eq!(answers(&mut rig), [Ok(())]);
    rig.tick([set_signal(1, &[1.0, 2.0, 3.0], false), set_parameter(0.5)]);
    let answered = [answers(&mut rig), answers(&mut rig)].concat();
    assert_eq!(answered, [Ok(()), Ok(())]);
    let shown = rig.tick([]).snapshot;
    assert_eq!(shown.signals.as_slice(), [1.0, 1.0, 2.0, 3.0]);
    assert_eq!(shown.parameters.as_slice(), [0.5]);
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn values_that_are_refused_superseded_or_not_taken_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(100);
    let refused = rig.tick([set_signal(7, &[1.0], false), set_signal(1, &[1.0], false)]);
    assert!(results(&refused).iter().all(Result::is_err) && results(&refused).len() == 2);
    rig.deaf = true;
    rig.tick([set_parameter(1.0)]);
    assert_eq!(results(&rig.tick([set_parameter(2.0)])), [Err(Refusal::Superseded)]);
    assert_eq!(answers(&mut rig), [Err(Refusal::ControllerTimeout)]);
    rig.tick([set_parameter(3.0)]);
    let feedback = rig.feedback.take();
    assert_eq!(answers(&mut rig), [Err(Refusal::CommunicationLost)]);
    (rig.feedback, rig.deaf) = (feedback, false);
    rig.ticks(100);
    rig.tick([Order::ResetErrors, Order::Halt]);
    rig.ticks(100);
    rig.tick([set_mode(CommandMode::Jog), jog(1, 1.0)]);
    rig.ticks(100);
    let moving = rig.tick([set_signal(0, &[1.0], true)]);
    assert!(matches!(results(&moving)[..], [Err(Refusal::Busy(_))]), "{:?}", results(&moving));
    rig.expect_mode(CommandMode::Jog);
}
