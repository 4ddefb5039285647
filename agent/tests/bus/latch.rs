//! The latched stop over restarts, and what its reset needs.

use std::path::Path;

use armada_agent::config::ConfigError;
use armada_agent::runtime::{Agent, AgentError, StateError};
use armada_protocol::messages::*;
use armada_protocol::method::robot::{Enable, Reset, ResetErrors, SetMode, SetSignal};
use armada_protocol::signature::SigningKey;
use uuid::Uuid;

use crate::common::{Bench, DEADLINE, denial, options, robot_file, stop_options};
use crate::running::stop;

/// The latched stop, once there is one and the robot was measured to stand.
async fn latched(bench: &Bench) -> StopLatch {
    let stands = |latch: &StopLatch| latch.stage >= StopStage::Standstill;
    let status = bench.status_when(|status| status.stop.as_ref().is_some_and(stands)).await;
    status.stop.expect("waited for")
}

async fn reset(bench: &Bench, params: ResetParams) -> Result<ResetAnswer, Denial> {
    match bench.client.call::<Reset>(&bench.robot, params).await {
        Ok(answer) => Ok(answer),
        refused => Err(denial(refused)),
    }
}

/// Stops, and waits for measured standstill.
async fn stop_now(bench: &Bench) -> Uuid {
    let request = stop(StopLevel::L1);
    let report = bench.client.stop(request.clone(), stop_options()).await.expect("sent");
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:?}");
    request.stop_id
}

fn sources(latch: &StopLatch) -> Vec<&str> {
    latch.stops.iter().map(|stop| stop.source.as_str()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_stays_latched_over_an_orderly_restart_and_its_reset_does_too() {
    let mut bench = Bench::keeping("").await;
    let id = stop_now(&bench).await;
    bench.restart().await;
    let latch = latched(&bench).await;
    assert_eq!((latch.level, latch.stops.len()), (StopLevel::L1, 1), "{latch:?}");
    assert_eq!(latch.stops[0].stop_id, id);
    let jog = SetModeParams { mode: CommandMode::Jog };
    let refused = denial(bench.client.call::<SetMode>(&bench.robot, jog).await);
    assert_eq!(refused.code, DenialCode::Stopped, "{refused}");
    // The drives were on from the start in this robot's file; a latched stop keeps them off.
    let refused = denial(bench.client.call::<Enable>(&bench.robot, Empty {}).await);
    assert_eq!(refused.code, DenialCode::Stopped, "{refused}");
    let answer = reset(&bench, latch.reset_params()).await.expect("reset");
    assert_eq!(answer.cleared, [id]);
    bench.restart().await;
    bench.status_when(|s| s.stop.is_none() && s.command_mode == CommandMode::Halt).await;
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_that_died_is_followed_by_one_that_is_stopped() {
    let mut bench = Bench::keeping("").await;
    bench.restart_as_after_a_crash().await;
    let latch = latched(&bench).await;
    assert_eq!(sources(&latch), ["agent_lost"]);
    assert_eq!(latch.level, StopLevel::L2);
    reset(&bench, latch.reset_params()).await.expect("reset");
    bench.status_when(|s| s.stop.is_none() && s.command_mode == CommandMode::Halt).await;
    bench.restart().await;
    bench.ready().await;
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_latch_file_that_is_not_understood_is_a_stop() {
    let mut bench = Bench::keeping("").await;
    bench
        .restart_after(|folder| {
            std::fs::write(folder.join("left_arm.latch.json"), "{\"version\": 1, ")
                .expect("written");
        })
        .await;
    let latch = latched(&bench).await;
    assert_eq!(sources(&latch), ["latch file unreadable"]);
    assert!(latch.stops[0].reason.contains("EOF"), "{latch:?}");
    reset(&bench, latch.reset_params()).await.expect("reset");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn two_agents_never_keep_the_stops_of_one_robot() {
    let bench = Bench::keeping("").await;
    let mut second = bench.options();
    second.state_dir = Some(bench.state_dir());
    match Agent::start(second).await {
        Err(AgentError::Robot { cause, .. }) => {
            assert!(matches!(*cause, AgentError::State(StateError::Taken(_))), "{cause}");
        }
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("two agents keep one file"),
    }
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reset_that_cannot_be_kept_is_refused_with_the_reason_and_the_gate_stays_closed() {
    let bench = Bench::keeping("").await;
    stop_now(&bench).await;
    let file = bench.state_dir().join("left_arm.latch.json");
    // A stop does not wait for the disk.
    let kept = async {
        while !std::fs::read_to_string(&file).expect("a file").contains("\"L1\"") {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(DEADLINE, kept).await.expect("kept without any reset");
    // A folder in the way fails for every user, as a full disk does.
    std::fs::remove_file(&file).and_then(|()| std::fs::create_dir(&file)).expect("in the way");
    let refused = reset(&bench, latched(&bench).await.reset_params()).await.expect_err("not kept");
    assert_eq!(refused.code, DenialCode::NotReady, "{refused}");
    assert!(refused.message.contains("left_arm.latch.json"), "{refused}");
    let jog = SetModeParams { mode: CommandMode::Jog };
    let still = denial(bench.client.call::<SetMode>(&bench.robot, jog).await);
    assert_eq!(still.code, DenialCode::Stopped);
    std::fs::remove_dir(&file).expect("out of the way");
    reset(&bench, latched(&bench).await.reset_params()).await.expect("kept now");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_nonce_of_a_reset_is_good_for_one_attempt_after_the_last_stop() {
    let bench = Bench::start().await;
    stop_now(&bench).await;
    let first = latched(&bench).await.reset_params();
    let wrong = ResetParams { nonce: Uuid::nil(), ..first.clone() };
    let refused = reset(&bench, wrong).await.expect_err("wrong");
    assert_eq!(refused.code, DenialCode::StaleSequence, "{refused}");
    let refused = reset(&bench, first).await.expect_err("used up by the attempt before");
    assert_eq!(refused.code, DenialCode::StaleSequence, "{refused}");
    let second = latched(&bench).await.reset_params();
    let id = stop_now(&bench).await;
    let listed = ResetParams { stop_ids: [second.stop_ids, vec![id]].concat(), ..second };
    let refused = reset(&bench, listed).await.expect_err("of before the second stop");
    assert_eq!(refused.code, DenialCode::StaleSequence, "{refused}");
    let mut more = latched(&bench).await.reset_params();
    more.stop_ids.push(Uuid::nil());
    let refused = reset(&bench, more).await.expect_err("lists what is not latched");
    assert_eq!(refused.code, DenialCode::InvalidArgument, "{refused}");
    let cleared = reset(&bench, latched(&bench).await.reset_params()).await.expect("reset");
    assert_eq!(cleared.cleared.len(), 2);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reset_that_has_to_be_signed_needs_the_key() {
    let bench = Bench::prepared("stop:\n  reset: {key_file: reset.key}\n", |folder| {
        std::fs::write(folder.join("reset.key"), "secret\n").expect("written");
    })
    .await;
    stop_now(&bench).await;
    let latch = latched(&bench).await;
    assert!(latch.reset.signed);
    let refused = reset(&bench, latch.reset_params()).await.expect_err("not signed");
    assert_eq!(refused.code, DenialCode::InvalidArgument);
    assert_eq!(refused.details["field"], "signature");
    let boot_id = bench.status_when(|_| true).await.boot_id;
    let sign = |key: &str, latch: &StopLatch| {
        let key = SigningKey::from_bytes(key.as_bytes()).expect("a key");
        key.sign_reset(&bench.robot, boot_id, latch.reset_params())
    };
    let forged = sign("guess", &latched(&bench).await);
    let refused = reset(&bench, forged).await.expect_err("another key");
    assert_eq!(refused.details["field"], "signature");
    let signed = sign("secret", &latched(&bench).await);
    reset(&bench, signed).await.expect("signed");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn in_zone_manual_somebody_has_to_acknowledge_at_the_arm_after_the_stop() {
    let bench = Bench::keeping("stop:\n  reset: {zone: manual, acknowledge_signal: DI1}\n").await;
    bench.inject("input=DI1:0");
    bench.signal_is("DI1", false).await;
    bench.inject("input=DI1:1");
    bench.signal_is("DI1", true).await;
    stop_now(&bench).await;
    let latch = latched(&bench).await;
    assert_eq!((latch.reset.zone, latch.reset.acknowledged), (ResetZone::Manual, false));
    let refused = reset(&bench, latch.reset_params()).await.expect_err("of before the stop");
    assert_eq!(refused.code, DenialCode::NotReady, "{refused}");
    assert!(refused.message.contains("acknowledge at the arm"), "{refused}");
    bench.inject("input=DI1:0");
    // The agent has to see it off before it can see it rise.
    bench.signal_is("DI1", false).await;
    bench.inject("input=DI1:1");
    let acknowledged =
        |s: &RobotStatus| s.stop.as_ref().is_some_and(|stop| stop.reset.acknowledged);
    let status = bench.status_when(acknowledged).await;
    let params = status.stop.expect("latched").reset_params();
    reset(&bench, params).await.expect("acknowledged");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_emergency_stop_of_the_controller_is_a_latched_stop_for_each_press() {
    let mut bench = Bench::keeping("").await;
    bench.inject("estop");
    let latch = latched(&bench).await;
    assert_eq!((sources(&latch), latch.level), (vec!["controller"], StopLevel::L1));
    bench.status_when(|s| s.faults.iter().any(|f| f.code == FaultCode::EmergencyStop)).await;
    let refused = reset(&bench, latch.reset_params()).await.expect_err("pressed");
    assert_eq!(refused.code, DenialCode::NotReady, "{refused}");
    assert_eq!(refused.details["source"], "controller");
    bench.restart().await;
    assert_eq!(latched(&bench).await.stops.len(), 1, "held over a restart it is the same press");
    bench.inject("estop_release");
    bench.status_when(|s| s.controller_state == ControllerState::EmergencyStopReset).await;
    let latch = latched(&bench).await;
    assert_eq!(sources(&latch), ["controller"], "its release alone changes nothing");
    bench.inject("estop");
    let twice = bench.status_when(|s| s.stop.as_ref().is_some_and(|s| s.stops.len() == 2)).await;
    bench.inject("estop_release");
    bench.status_when(|s| s.controller_state == ControllerState::EmergencyStopReset).await;
    let params = twice.stop.expect("latched").reset_params();
    let answer = reset(&bench, params).await.expect("released");
    assert_eq!(answer.cleared.len(), 2);
    bench.client.call::<ResetErrors>(&bench.robot, Empty {}).await.expect("the fault is its own");
    bench.status_when(|s| s.stop.is_none() && s.faults.is_empty()).await;
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invariant_03_a_stop_repeated_with_one_id_is_acknowledged_each_time_and_logged_once() {
    let bench = Bench::start().await;
    let events = bench.client.subscribe::<Event>("robots/left_arm/events", 256).await;
    let events = events.expect("subscribed");
    let request = stop(StopLevel::L2);
    for _ in 0..5 {
        let timeout = std::time::Duration::from_secs(5);
        let ack = bench.client.stop_robot(&bench.robot, &request, timeout).await.expect("an ack");
        assert_eq!(ack.stop_id, request.stop_id);
    }
    let latch = latched(&bench).await;
    assert_eq!(latch.stops.len(), 1);
    let id = request.stop_id.to_string();
    reset(&bench, latch.reset_params()).await.expect("a repetition is no new stop");
    bench.status_when(|s| s.stop.is_none()).await;
    let mut logged = 0;
    loop {
        let (_, event) = events.next().await.expect("an event");
        logged += usize::from(event.details.get("stop_id").is_some_and(|stop| *stop == *id));
        if event.kind == EventKind::Reset {
            assert_eq!(event.details["client"], "test", "{event:?}");
            assert_eq!(event.details["stop_ids"], serde_json::json!([id]), "{event:?}");
            assert!(event.message.starts_with("stop reset by test"), "{event:?}");
            break;
        }
    }
    assert_eq!(logged, 1);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invariant_04_a_stop_goes_on_when_whoever_asked_for_it_is_gone() {
    let bench = Bench::start().await;
    let payload = serde_json::to_vec(&stop(StopLevel::L1)).expect("encodes");
    let gone = bench.another_client().await;
    gone.session().put("cell/stop", payload).await.expect("sent");
    gone.session().close().await.expect("closed at once");
    let off = |latch: &StopLatch| latch.stage == StopStage::DrivesOff;
    bench.status_when(|s| s.stop.as_ref().is_some_and(off)).await;
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invariant_11_a_robot_whose_stop_could_never_be_reset_does_not_start() {
    let refused = [
        ("{zone: manual}", "acknowledge_signal: is missing"),
        ("{zone: manual, acknowledge_signal: DI99}", "no signal \"DI99\""),
        ("{zone: manual, acknowledge_signal: AI1}", "not a signal that is on or off"),
        ("{acknowledge_signal: DI1}", "in zone remote nobody acknowledges"),
        ("{key_file: nowhere.key}", "nowhere.key"),
        ("{key_file: empty.key}", "the key is empty"),
    ];
    for (table, problem) in refused {
        let text = format!("stop:\n  reset: {table}\n");
        let error = start_with(&text).await;
        assert!(error.contains(problem) && error.contains("stop.reset"), "{table}: {error}");
    }
    let error = start_with("stop:\n  sources: [{name: door_1, key_file: empty.key}]\n").await;
    assert!(error.contains("stop.sources.0.key_file"), "{error}");
}

/// Why an agent does not start with more lines in its robot file.
async fn start_with(text: &str) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let file = robot_file(folder.path(), "left_arm");
    append(&file, text);
    std::fs::write(folder.path().join("empty.key"), "\n").expect("written");
    match Agent::start(options(&file, "tcp/127.0.0.1:0")).await {
        Err(AgentError::Config(error @ ConfigError::Invalid { .. })) => error.to_string(),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("it starts with {text}"),
    }
}

fn append(file: &Path, text: &str) {
    let before = std::fs::read_to_string(file).expect("the file is there");
    std::fs::write(file, format!("{before}\n{text}")).expect("written");
}

#[tokio::test(flavor = "multi_thread")]
async fn outputs_stay_as_they_are_while_it_is_stopped_but_for_the_lamp() {
    let bench = Bench::start().await;
    let set = async |name: &str| {
        let value = SignalValue::Bool(true);
        let params = SetValueParams { name: name.to_owned(), value };
        bench.client.call::<SetSignal>(&bench.robot, params).await
    };
    bench.client.stop(stop(StopLevel::L2), stop_options()).await.expect("stopped");
    assert_eq!(denial(set("DO1").await).code, DenialCode::Stopped, "it closes the gripper");
    set("DO2").await.expect("the file says that it is for that");
    reset(&bench, latched(&bench).await.reset_params()).await.expect("it stands");
    set("DO1").await.expect("nothing is latched");
    bench.shut_down().await;
}
