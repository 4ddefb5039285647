//! Sources of stops that have to check in, over real Zenoh.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::client::AnsweredStopSource;
use armada_protocol::messages::*;
use armada_protocol::method::robot::Reset;
use armada_protocol::signature::SigningKey;

use crate::common::{Bench, denial};

const DOOR: &str = "stop:\n  sources: [{name: door_1}]\n";

/// A button of the test, and what it says.
struct Button {
    pressed: Arc<AtomicBool>,
    answered: Option<AnsweredStopSource>,
}

impl Button {
    async fn released(bench: &Bench, key: Option<&str>) -> Self {
        let pressed = Arc::new(AtomicBool::new(false));
        let mut button = Self { pressed, answered: None };
        button.answer(bench, key).await;
        button
    }

    async fn answer(&mut self, bench: &Bench, key: Option<&str>) {
        let key = key.map(|key| SigningKey::from_bytes(key.as_bytes()).expect("a key"));
        let read = Arc::clone(&self.pressed);
        let read = move || read.load(Ordering::SeqCst);
        let answered = bench.client.answer_stop_source("door_1", key, read).await;
        self.answered = Some(answered.expect("answers"));
    }

    fn set(&self, pressed: bool) {
        self.pressed.store(pressed, Ordering::SeqCst);
    }
}

fn door(status: &RobotStatus) -> &StopSourceStatus {
    status.stop_sources.first().expect("one source")
}

async fn latched(bench: &Bench, stops: usize) -> StopLatch {
    let enough = |s: &RobotStatus| s.stop.as_ref().is_some_and(|stop| stop.stops.len() == stops);
    bench.status_when(enough).await.stop.expect("waited for")
}

/// Resets what is latched, once the door is known to be released and the robot to stand.
async fn reset(bench: &Bench) {
    let stands = |latch: &StopLatch| latch.stage >= StopStage::Standstill;
    let ready = |s: &RobotStatus| s.stop.as_ref().is_some_and(stands) && !door(s).pressed;
    let status = bench.status_when(ready).await;
    let params = status.stop.expect("latched").reset_params();
    bench.client.call::<Reset>(&bench.robot, params).await.expect("reset");
    bench.status_when(|s| s.stop.is_none()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invariant_08_a_source_that_is_not_heard_is_a_press_once_and_holds_the_reset() {
    let bench = Bench::keeping(DOOR).await;
    let latch = latched(&bench, 1).await;
    assert_eq!((latch.stops[0].source.as_str(), latch.level), ("door_1", StopLevel::L1));
    assert!(latch.stops[0].reason.contains("never heard"), "{latch:?}");
    let refused = denial(bench.client.call::<Reset>(&bench.robot, latch.reset_params()).await);
    assert_eq!(refused.code, DenialCode::NotReady);
    assert_eq!(refused.details["source"], "door_1", "{refused}");
    let mut button = Button::released(&bench, None).await;
    reset(&bench).await;
    let [(robot, ago)] =
        button.answered.as_ref().expect("answers").asking().try_into().expect("one");
    assert!(robot == bench.robot && ago < Duration::from_secs(5), "{robot} asked {ago:?} ago");
    button.answered = None;
    let latch = latched(&bench, 1).await;
    assert!(latch.stops[0].reason.contains("silent"), "{latch:?}");
    button.answer(&bench, None).await;
    reset(&bench).await;
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_press_stops_at_its_level_and_only_released_it_can_be_reset() {
    let bench = Bench::keeping("stop:\n  sources: [{name: door_1, level: L2}]\n").await;
    let button = Button::released(&bench, None).await;
    reset_if_latched(&bench).await;
    button.set(true);
    let latch = latched(&bench, 1).await;
    assert_eq!((latch.stops[0].source.as_str(), latch.level), ("door_1", StopLevel::L2));
    let refused = denial(bench.client.call::<Reset>(&bench.robot, latch.reset_params()).await);
    assert_eq!(
        (refused.code, &refused.details["source"]),
        (DenialCode::NotReady, &"door_1".into())
    );
    // Its check-ins come ten times a second; it is one press all the same.
    let told: MonoTime = bench.status_when(|s| s.stop.is_some()).await.stamp_ns;
    let later = told + Duration::from_millis(400);
    let status = bench.status_when(|s| s.stamp_ns > later).await;
    assert_eq!(status.stop.expect("latched").stops.len(), 1);
    button.set(false);
    reset(&bench).await;
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_source_with_a_key_is_not_released_by_who_does_not_have_it() {
    let text = "stop:\n  sources: [{name: door_1, key_file: door.key}]\n";
    let bench = Bench::prepared(text, |folder| {
        std::fs::write(folder.join("door.key"), "secret").expect("written");
    })
    .await;
    latched(&bench, 1).await;
    let mut button = Button::released(&bench, Some("guess")).await;
    let refused = |s: &RobotStatus| {
        s.dropped.iter().any(|(what, count)| what == "stop_source_check_in" && *count > 3)
    };
    let status = bench.status_when(refused).await;
    assert!(door(&status).pressed && door(&status).age_ms.is_none(), "{status:?}");
    button.answered = None;
    button.answer(&bench, Some("secret")).await;
    reset(&bench).await;
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_name_of_a_source_has_the_form_of_a_robots() {
    let bench = Bench::start().await;
    for name in ["", "Door", "a/b", "*"] {
        let refused = denial(bench.client.answer_stop_source(name, None, || true).await);
        assert_eq!(refused.code, DenialCode::InvalidArgument, "{name:?}");
    }
    bench.shut_down().await;
}

/// The source may have been heard in the first half second or not.
async fn reset_if_latched(bench: &Bench) {
    let status = bench.status_when(|s| !door(s).pressed).await;
    if status.stop.is_some() {
        reset(bench).await;
    }
}
