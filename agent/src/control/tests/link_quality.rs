//! What is found of a stream's link, and what the robot does with it.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{CommandMode, StreamHeader};
use uuid::Uuid;

use super::rig::{PERIOD, Rig, params};
use super::stream::{LEASE, position, sample, streaming, velocity};
use crate::control::link_quality::{Arrival, LinkQuality};
use crate::control::{
    DroppedSamples, LinkReport, LoopEvent, Order, StreamChange, StreamReport, StreamValues,
};

use CommandMode::{PositionCommand, VelocityCommand};
use StreamChange::{Refused, Restored, Slowed};

/// Without word for so long a robot decelerates.
const TIMEOUT: Duration = Duration::from_millis(40);

/// A client, its link, and what the agent finds of it.
struct Link {
    quality: LinkQuality,
    now: MonoTime,
    header: StreamHeader,
    changes: Vec<StreamChange>,
}

impl Link {
    fn new() -> Self {
        let header = StreamHeader { lease: LEASE, epoch: 1, seq: 0, state_seqno: 0 };
        let quality = LinkQuality::new(Uuid::nil());
        Self { quality, now: MonoTime::from_nanos(1_000_000_000), header, changes: Vec::new() }
    }

    /// A sample comes so long after the one before, `lost` others having been lost on the way.
    fn brings(&mut self, gap_ms: f64, lost: u64, age_ms: Option<f64>) {
        self.now = self.now + Duration::from_secs_f64(gap_ms * 1e-3);
        self.header.seq += 1 + lost;
        let age = age_ms.map(|ms| Duration::from_secs_f64(ms * 1e-3));
        let arrival = Arrival { header: self.header, now: self.now, age };
        self.changes.extend(self.quality.take(arrival, TIMEOUT));
    }

    /// So many samples, `gap_ms` apart.
    fn even(&mut self, count: usize, gap_ms: f64) -> LinkReport {
        for _ in 0..count {
            self.brings(gap_ms, 0, Some(8.0));
        }
        self.quality.report()
    }

    /// Samples that are sent `spacing_ms` apart for ten seconds, of which each `nth` is lost.
    fn lossy(&mut self, spacing_ms: f64, nth: u64) -> LinkReport {
        for _ in 0..(10_000.0 / spacing_ms) as u64 / nth {
            for _ in 2..nth {
                self.brings(spacing_ms, 0, Some(8.0));
            }
            self.brings(2.0 * spacing_ms, 1, Some(8.0));
        }
        self.quality.report()
    }
}

#[test]
fn even_samples_are_followed_as_they_are() {
    for gap_ms in [2.0, 10.0, 20.0, 39.0] {
        let mut link = Link::new();
        let report = link.even(2000, gap_ms);
        assert!(report.jitter_s < 1e-6 && (report.state_age_s - 0.008).abs() < 1e-9, "{report:?}");
        assert_eq!((report.loss, report.allowed), (0.0, 1.0), "{gap_ms}");
        assert_eq!(link.changes, []);
    }
}

#[test]
fn loss_slows_a_stream_that_has_no_time_for_it_and_no_other() {
    let mut link = Link::new();
    let report = link.lossy(10.0, 5);
    assert!((report.loss - 0.2).abs() < 0.01 && report.allowed == 1.0, "{report:?}");
    let mut link = Link::new();
    let report = link.lossy(20.0, 5);
    // 25 ms in the mean, of 20, 20, 20 and 40.
    let need_s = 0.025 + 3.0 * 75e-6_f64.sqrt();
    assert!((report.loss - 0.2).abs() < 0.01, "{report:?}");
    assert!((report.jitter_s - 75e-6_f64.sqrt()).abs() < 3e-4, "{report:?}");
    assert!((report.allowed - 0.040 / need_s).abs() < 0.02, "{report:?}");
    assert_eq!(link.changes, [Slowed]);
    link.even(200, 20.0);
    assert_eq!(
        (link.changes.as_slice(), link.quality.report().allowed),
        (&[Slowed, Restored][..], 1.0)
    );
}

#[test]
fn a_stream_that_has_much_too_few_samples_is_refused_until_they_come_again() {
    let mut link = Link::new();
    let report = link.even(30, 125.0);
    assert_eq!((report.allowed, link.changes.as_slice()), (0.0, &[Refused][..]));
    assert!(link.quality.is_refused());
    link.even(99, 10.0);
    assert!(link.quality.is_refused(), "a second is not over yet");
    let report = link.even(300, 10.0);
    assert_eq!((report.allowed, link.quality.is_refused()), (1.0, false));
    assert_eq!(link.changes.last(), Some(&Restored));
}

#[test]
fn one_silence_slows_for_a_moment_and_a_pause_says_nothing() {
    let mut link = Link::new();
    link.even(300, 10.0);
    link.even(1, 600.0);
    link.even(80, 10.0);
    let report = link.quality.report();
    assert!(report.allowed < 1.0 && !link.quality.is_refused(), "{report:?}");
    link.even(300, 10.0);
    assert_eq!(link.changes, [Slowed, Restored]);
    link.even(1, 5000.0);
    link.even(300, 10.0);
    assert_eq!((link.changes.len(), link.quality.report().jitter_s < 1e-6), (2, true));
}

#[test]
fn a_pause_does_not_make_a_bad_link_good() {
    let mut link = Link::new();
    link.even(30, 125.0);
    for _ in 0..5 {
        link.even(1, 3000.0);
        link.even(50, 10.0);
        assert!(link.quality.is_refused(), "half a second is not enough");
    }
    assert_eq!(link.changes, [Refused]);
}

#[test]
fn samples_that_are_all_too_old_are_all_lost() {
    let mut link = Link::new();
    for _ in 0..150 {
        link.brings(10.0, 0, None);
    }
    let report = link.quality.report();
    assert_eq!((report.loss, report.allowed), (1.0, 0.0));
    let report = link.even(400, 10.0);
    assert_eq!((report.loss, report.allowed), (0.0, 1.0));
    assert_eq!(link.changes, [Refused, Restored]);
}

#[test]
fn a_new_epoch_is_no_loss_and_a_new_lease_begins_anew() {
    let mut link = Link::new();
    link.even(100, 10.0);
    (link.header.epoch, link.header.seq) = (2, 5000);
    link.even(200, 10.0);
    (link.header.epoch, link.header.seq) = (3, 0);
    assert_eq!(link.even(200, 10.0).loss, 0.0);
    link.even(30, 125.0);
    assert!(link.quality.is_refused());
    link.header.lease = Uuid::from_u128(5);
    assert_eq!(link.even(1, 10.0), LinkReport::default());
}

/// Streams `values` for `duration`, a sample all `every` ticks; returns the speeds that were sent.
fn stream(rig: &mut Rig, values: StreamValues, every: usize, duration: Duration) -> Vec<f64> {
    let ticks = (duration.as_nanos() / PERIOD.as_nanos()) as usize;
    let first = rig.commands.len();
    for tick in 0..ticks {
        if tick % every == 0 {
            let next = sample(rig, values);
            rig.samples.push(next);
        }
        rig.tick();
    }
    let position = |command: &crate::drivers::SetPoint| command.joint_position[2];
    let sent: Vec<f64> = rig.commands[first..].iter().map(position).collect();
    sent.windows(2).map(|pair| (pair[1] - pair[0]) / PERIOD.as_secs_f64()).collect()
}

fn report(rig: &Rig) -> Option<StreamReport> {
    rig.last.as_ref().expect("a tick").snapshot.stream
}

fn told(rig: &Rig, change: StreamChange) -> usize {
    rig.events.iter().filter(|event| **event == LoopEvent::Stream(change)).count()
}

#[test]
fn a_slowed_stream_moves_within_lowered_speeds_and_gets_there_gently() {
    let mut rig = streaming(VelocityCommand);
    let full = params().limits[2].velocity;
    let wanted = velocity([0.0, 0.0, full]);
    let speeds = stream(&mut rig, wanted, 2, Duration::from_secs(2));
    assert!((speeds.last().expect("sent") - full).abs() < 1e-6, "{speeds:?}");
    // A sample all 60 ms, for which the limit is 40.
    stream(&mut rig, wanted, 15, Duration::from_secs(4));
    assert!(told(&rig, Slowed) >= 1);
    let allowed = report(&rig).expect("a stream").link.allowed;
    assert!((allowed - 40.0 / 60.0).abs() < 0.05, "{allowed}");
    let speeds = stream(&mut rig, wanted, 15, Duration::from_secs(2));
    let fastest = speeds.iter().copied().fold(0.0, f64::max);
    assert!(fastest <= allowed * full + 1e-6, "{fastest}");
    let speeds = stream(&mut rig, wanted, 2, Duration::from_secs(4));
    assert!((speeds.last().expect("sent") - full).abs() < 1e-6);
    assert_eq!(told(&rig, Restored), 1);
    // The limiter had nothing to do: what is sent keeps acceleration all the way.
    assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
}

#[test]
fn a_refused_stream_rests_in_every_epoch_until_its_link_is_good() {
    let mut rig = streaming(PositionCommand);
    stream(&mut rig, position([0.1; 3]), 2, Duration::from_secs(1));
    stream(&mut rig, position([0.2; 3]), 50, Duration::from_secs(4));
    assert_eq!(told(&rig, Refused), 1);
    let before = rig.last.as_ref().expect("a tick").snapshot.dropped_samples.link;
    let speeds = stream(&mut rig, position([1.0; 3]), 50, Duration::from_secs(2));
    assert!(speeds.iter().all(|speed| *speed == 0.0), "nothing is followed");
    let dropped = rig.last.as_ref().expect("a tick").snapshot.dropped_samples;
    assert_eq!(dropped, DroppedSamples { link: before + 10, ..DroppedSamples::default() });
    assert!(report(&rig).is_some_and(|stream| stream.starved && stream.link.allowed == 0.0));
    rig.ask(Order::Halt).expect("granted");
    rig.ask_under(LEASE, Order::SetMode(PositionCommand)).expect("granted");
    assert_eq!(report(&rig), None);
    let speeds = stream(&mut rig, position([1.0; 3]), 50, Duration::from_secs(1));
    assert!(speeds.iter().all(|speed| *speed == 0.0), "a new epoch is no new link");
    let refused = report(&rig).expect("what is refused is told");
    assert_eq!((refused.taken, refused.dropped, refused.starved), (0, 5, true));
    stream(&mut rig, position([1.0; 3]), 2, Duration::from_secs(5));
    assert_eq!(told(&rig, Restored), 1);
    let there = rig.commands.last().expect("sent").joint_position;
    assert!(there.iter().all(|joint| (joint - 1.0).abs() < 1e-9), "{there:?}");
}
