//! Tools, payloads and values in the loop, and the mathematics of a tip.

use std::sync::Arc;

use armada_model::{JointLimits, JointVector, Pose, RobotModel};
use armada_protocol::messages::{CommandMode, LeaseLoss, MotionKind, Queue, StopLevel};

use super::rig::{JOINTS, Rig, joints, params};
use crate::control::{
    DelegateOrder, Equipment, EquipmentOrder, EquippedChain, LoopAbilities, Order, Params, Refusal,
    Retired, ValueSlot,
};
use crate::drivers::{
    DelegatedGoal, DelegatedMove, DriverRequest, LoadSetting, ReportedTip, TipFrame, Values,
};

const URDF: &str = r#"<robot name="arm"><link name="base"/><link name="l1"/><link name="l2"/>
  <link name="l3"/><link name="flange"/>
  <joint name="a" type="continuous"><parent link="base"/><child link="l1"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 0 1"/></joint>
  <joint name="b" type="continuous"><parent link="l1"/><child link="l2"/>
    <origin xyz="0.1 0 0.2"/><axis xyz="0 1 0"/></joint>
  <joint name="c" type="prismatic"><parent link="l2"/><child link="l3"/>
    <origin xyz="0.4 0 0" rpy="0.2 0.3 0.4"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
  <joint name="f" type="fixed"><parent link="l3"/><child link="flange"/>
    <origin xyz="0.1 0 0" rpy="0 0.5 0"/></joint></robot>"#;

/// Joints of the robot in another order than the chain meets them.
fn chain(tcp: Pose) -> EquippedChain {
    let model = RobotModel::from_urdf(URDF, "arm.urdf").expect("a robot");
    let limits = JointLimits { velocity: 1.0, ..JointLimits::default() };
    let joints = ["c", "a", "b"].map(|name| (name, limits));
    let chain = EquippedChain::new(&model, ("base", "flange"), &joints, Pose::default());
    EquippedChain { tcp, ..chain.expect("a chain") }
}

fn equipment(config_seqno: u64, mass: f64) -> Arc<Equipment> {
    let load = LoadSetting { mass, ..LoadSetting::default() };
    let chain = EquippedChain { load, ..chain(Pose::default()) };
    Arc::new(Equipment { config_seqno, chains: vec![chain] })
}

fn change(replaces: u64, mass: f64) -> Order {
    let equipment = equipment(replaces + 1, mass);
    let load = Some((0, equipment.chains[0].load));
    Order::SetEquipment(EquipmentOrder { equipment, replaces, load })
}

fn rig() -> Rig {
    let abilities = LoopAbilities { load: true, ..LoopAbilities::default() };
    let signals = vec![
        ValueSlot { first: 0, len: 1, tolerance: 0.0 },
        ValueSlot { first: 1, len: 2, tolerance: 0.01 },
    ];
    let mut rig =
        Rig::with(Params { abilities, signals, equipment: equipment(1, 0.0), ..params() });
    rig.plant.signals = Values::from_slice(&[0.0; 3]).expect("three values");
    rig.ticks(100);
    rig
}

fn told(rig: &Rig) -> Vec<f64> {
    let loads = rig.plant.asked.iter().filter_map(|asked| match asked {
        DriverRequest::SetLoad { chain: 0, load } => Some(load.mass),
        _ => None,
    });
    loads.collect()
}

#[test]
fn equipment_is_swapped_at_rest_and_the_controller_is_told_the_load() {
    let mut rig = rig();
    assert_eq!(told(&rig), [0.0], "told at the start");
    assert!(rig.ask(change(1, 2.5)).is_ok());
    let output = rig.last.clone().expect("a tick");
    assert_eq!(output.snapshot.config_seqno, 2);
    assert!(matches!(output.retired[0], Retired::Equipment(ref old) if old.config_seqno == 1));
    rig.ticks(3);
    assert_eq!(told(&rig), [0.0, 2.5]);
    rig.plant.silent = true;
    rig.ticks(30);
    rig.plant.silent = false;
    rig.ticks(10);
    assert_eq!(told(&rig), [0.0, 2.5, 2.5], "told again after silence");
}

#[test]
fn a_controller_that_says_it_is_another_run_is_told_the_load_again() {
    let mut rig = rig();
    assert!(rig.ask(change(1, 2.5)).is_ok());
    rig.ticks(3);
    assert_eq!(told(&rig), [0.0, 2.5]);
    rig.plant.session += 1;
    rig.ticks(30);
    assert_eq!(told(&rig), [0.0, 2.5, 2.5], "once, without a silence");
    assert!(rig.fault_codes().is_empty());
}

#[test]
fn the_controller_knows_the_tool_before_it_moves_it_to_a_pose() {
    let abilities = LoopAbilities { move_pose: true, load: true, ..LoopAbilities::default() };
    let tool = |x: f64| {
        let chain = chain(Pose::from_translation(x, 0.0, 0.1));
        Arc::new(Equipment { config_seqno: if x > 0.0 { 2 } else { 1 }, chains: vec![chain] })
    };
    let mut rig = Rig::with(Params { abilities, equipment: tool(0.0), ..params() });
    rig.ticks(100);
    rig.plant.asked.clear();
    let goal = DelegatedGoal::Pose { chain: 0, pose: Pose::default() };
    let move_ = DelegatedMove { number: 0, goal, speed: 1.0, blend_radius_m: 0.0, connect: false };
    assert!(rig.ask(Order::SetMode(CommandMode::Trajectory)).is_ok());
    // Both in one tick, the tool not yet told.
    let load = Some((0, LoadSetting::default()));
    rig.order(Order::SetEquipment(EquipmentOrder { equipment: tool(0.2), replaces: 1, load }));
    rig.order(Order::Delegate(DelegateOrder {
        id: uuid::Uuid::from_u128(1),
        kind: MotionKind::MovePose,
        order: move_,
        queue: Queue::Refuse,
        on_lease_loss: LeaseLoss::StopOnPath,
    }));
    rig.ticks(5);
    let asked = &rig.plant.asked;
    let place = |of: fn(&DriverRequest) -> bool| asked.iter().position(of).expect("was asked");
    let told = place(|request| {
        *request == DriverRequest::SetTool { chain: 0, tool: Pose::from_translation(0.2, 0.0, 0.1) }
    });
    assert!(told < place(|request| matches!(request, DriverRequest::Move(_))), "{asked:?}");
}

#[test]
fn equipment_stays_while_the_robot_moves_and_if_it_was_changed_meanwhile() {
    let mut rig = rig();
    assert!(rig.ask(Order::SetMode(CommandMode::Jog)).is_ok());
    assert!(rig.jog(1, [0.3, 0.0, 0.0]).is_ok());
    let id = uuid::Uuid::from_u128(1);
    assert_eq!(rig.ask(change(1, 1.0)), Err(Refusal::Busy(id)));
    let output = rig.last.clone().expect("a tick");
    assert_eq!(output.snapshot.config_seqno, 1);
    assert!(matches!(output.retired[0], Retired::Equipment(ref new) if new.config_seqno == 2));
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.ask(change(1, 1.0)), Err(Refusal::StillMoving), "standstill is measured");
    rig.ticks(100);
    assert_eq!(rig.ask(change(7, 1.0)), Err(Refusal::EquipmentChanged { given: 7, current: 1 }));
    assert!(rig.ask(change(1, 1.0)).is_ok());
    rig.finish();
}

fn set_signal(signal: u8, values: &[f64], restricted: bool) -> Order {
    let values = Values::from_slice(values).expect("few values");
    Order::SetSignal { signal, values, restricted, while_stopped: false }
}

#[test]
fn a_stop_keeps_outputs_as_they_are_but_for_those_that_are_for_it() {
    let lamp = |rig: &mut Rig| {
        let values = Values::from_slice(&[1.0]).expect("one value");
        rig.order(Order::SetSignal { signal: 0, values, restricted: false, while_stopped: true })
    };
    let mut rig = rig();
    rig.plant.obeys_after = None;
    let on_the_way = rig.order(set_signal(1, &[0.5, 0.25], false));
    let lit = lamp(&mut rig);
    rig.ticks(2);
    rig.plant.obeys_after = Some(5);
    rig.stop = Some(StopLevel::L2);
    rig.tick();
    let stopped = Some(Err(Refusal::Stopped(StopLevel::L2)));
    assert_eq!(rig.answer(on_the_way), stopped);
    assert_eq!(rig.ask(set_signal(1, &[0.5, 0.25], false)).err(), stopped.and_then(Result::err));
    rig.until("the lamp", |rig| rig.answer(lit).is_some());
    assert!(rig.answer(lit).expect("waited for").is_ok());
    rig.ticks(100);
    let shown = rig.last.as_ref().expect("a tick").snapshot.signals;
    assert_eq!(shown.as_slice(), [1.0, 0.0, 0.0]);
}

#[test]
fn a_value_is_answered_when_the_feedback_shows_it() {
    let mut rig = rig();
    let ticket = rig.order(set_signal(1, &[0.5, 0.25], false));
    rig.ticks(2);
    assert_eq!(rig.answer(ticket), None, "not before the controller shows it");
    rig.until("the answer", |rig| rig.answer(ticket).is_some());
    assert!(rig.answer(ticket).expect("waited for").is_ok());
    let shown = rig.last.as_ref().expect("a tick").snapshot.signals;
    assert_eq!(shown.as_slice(), [0.0, 0.5, 0.25]);
}

#[test]
fn a_value_that_is_never_shown_times_out_and_a_newer_one_takes_its_place() {
    let mut rig = rig();
    rig.plant.obeys_after = None;
    let (older, newer) =
        (rig.order(set_signal(0, &[1.0], false)), rig.order(set_signal(0, &[0.5], false)));
    rig.tick();
    assert_eq!(rig.answer(older), Some(Err(Refusal::Superseded)));
    rig.until("the answer", |rig| rig.answer(newer).is_some());
    assert_eq!(rig.answer(newer), Some(Err(Refusal::ControllerTimeout)));
    let wrong = rig.ask(set_signal(1, &[1.0], false));
    assert_eq!(wrong, Err(Refusal::WrongLength { given: 1, expected: 2 }));
    let unknown = rig.ask(set_signal(9, &[1.0], false));
    assert_eq!(unknown, Err(Refusal::NotSupported("such a signal or parameter")));
}

#[test]
fn a_restricted_value_is_not_set_while_the_robot_moves() {
    let mut rig = rig();
    assert!(rig.ask(Order::SetMode(CommandMode::Jog)).is_ok());
    assert!(rig.jog(1, [0.3, 0.0, 0.0]).is_ok());
    let refused = rig.ask(set_signal(0, &[1.0], true));
    assert_eq!(refused, Err(Refusal::Busy(uuid::Uuid::from_u128(1))));
    assert!(rig.ask_and_wait(set_signal(0, &[1.0], false)).is_ok());
    rig.finish();
}

#[test]
fn speeds_of_a_tip_are_the_differences_of_its_poses() {
    let tool = Pose::from_translation(0.05, -0.1, 0.2);
    let chain = chain(tool);
    let (position, velocity) = (joints([0.1, -0.4, 0.7]), joints([0.3, 0.8, -0.6]));
    let tip = chain.tip(&position, &velocity).expect("finite");
    let (tcp, flange) = (tip.tcp_twist.expect("known"), tip.flange_twist.expect("known"));
    let h = 1e-6;
    let later = position.map_indexed(|joint, x| x + h * velocity[joint]);
    let earlier = position.map_indexed(|joint, x| x - h * velocity[joint]);
    let (later, earlier) = (
        chain.tip(&later, &JointVector::EMPTY).expect("finite"),
        chain.tip(&earlier, &JointVector::EMPTY).expect("finite"),
    );
    for (twist, later, earlier) in
        [(tcp, later.tcp, earlier.tcp), (flange, later.flange, earlier.flange)]
    {
        let linear = (later.position() - earlier.position()) / (2.0 * h);
        assert!((linear - twist.linear).norm() < 1e-8, "{linear} {:?}", twist.linear);
        let turn = later.isometry().rotation * earlier.isometry().rotation.inverse();
        let angular = turn.scaled_axis() / (2.0 * h);
        assert!((angular - twist.angular).norm() < 1e-8, "{angular} {:?}", twist.angular);
    }
    // v_tcp = v_flange + w x r.
    let lever = tip.tcp.position() - tip.flange.position();
    assert!((tcp.linear - flange.linear - flange.angular.cross(&lever)).norm() < 1e-12);
    assert_eq!(tcp.angular, flange.angular);
    assert_eq!(later.tcp_twist, None, "speeds that are not known are not zero");
}

#[test]
fn a_flange_that_is_reported_gets_the_tool_and_a_tool_that_is_reported_is_taken() {
    let tool = Pose::from_translation(0.0, 0.0, 0.2);
    let chain = chain(tool);
    let tip = chain.tip(&joints([0.1; JOINTS]), &joints([0.2; JOINTS])).expect("finite");
    let pose = Pose::from_translation(0.4, 0.5, 0.6);
    let of = |frame| chain.reported(tip, &ReportedTip { chain: 0, frame, pose });
    let flange = of(TipFrame::Flange);
    assert_eq!((flange.flange, flange.tcp), (pose, pose * tool));
    let tcp = of(TipFrame::Tcp);
    assert_eq!(tcp.tcp, pose);
    assert!(tcp.flange.distance(&Pose::from_translation(0.4, 0.5, 0.4)).0 < 1e-12);
    assert_eq!(tcp.tcp_twist, tip.tcp_twist);
}
