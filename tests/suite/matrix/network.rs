//! The network of the tests itself: that a bad link is bad, and a good one good. And what a robot
//! does with a stream on a bad one.

use std::time::Duration;

use anyhow::Result;
use armada_protocol::messages::*;
use armada_protocol::method::robot::{Halt, SetMode};
use armada_tests::{NetCell, NetCellOptions, Quality, in_network, monotonic, wait_for};

use crate::clients::{Feeder, is_stream};
use crate::support::{Bed, RESERVE, Watch, count, is_commanded};

#[test]
fn a_cell_runs_on_hosts_and_its_links_can_be_cut_and_delayed() -> Result<()> {
    in_network("a cell on hosts", async |network| {
        let cell = NetCell::start(network, NetCellOptions::default()).await?;
        let client = cell.client().await?;
        let left = "left_arm".parse()?;
        let slow = Quality::slow(Duration::from_millis(40), Duration::ZERO);
        cell.network.set_link("client", "left_arm", slow)?;
        let begin = monotonic();
        client.robot_clock(&left).await?;
        let took = monotonic().saturating_since(begin);
        assert!(took >= Duration::from_millis(80), "there and back in {took:?}");
        cell.network.set_host("left_arm", Quality::CUT)?;
        assert!(client.robot_status(&left).await.is_err(), "nothing passes");
        cell.network.set_host("left_arm", Quality::losing(5))?;
        let answered = async || client.robot_status(&left).await.ok();
        wait_for("the robot answers again", Duration::from_secs(40), answered).await?;
        Ok(())
    })
}

#[test]
fn a_stream_is_slowed_on_a_bad_link_and_refused_if_it_has_too_few_samples() -> Result<()> {
    in_network("a stream on a bad link", async |network| {
        let bed = Bed::start(network, NetCellOptions::default()).await?;
        let robot = &bed.left;
        let driver = bed.cell.client_of("driver", &["left_arm"]).await?;
        // What happens is seen on another link.
        let observer = bed.cell.client_of("observer", &["gateway"]).await?;
        let keeper = driver.acquire_lease(robot, Duration::from_secs(60)).await?;
        let mode = SetModeParams { mode: CommandMode::VelocityCommand };
        let under = driver.under(keeper.lease());
        let epoch = under.call::<SetMode>(robot, mode).await?.epoch;
        let mut watch = Watch::of(&observer, robot).await?;
        let feeder = Feeder::start_with(&driver, &bed, (keeper.lease(), epoch), FAST).await?;
        let judged = |s: &RobotStatus| {
            let sound = |stream: StreamStatistics| stream.loss == 0.0 && stream.allowed == 1.0;
            s.stream.is_some_and(|stream| stream.state_age_ms > 0.0 && sound(stream))
        };
        let good = bed.cell.status_when(&observer, robot, "the link is judged", judged).await?;
        let stream = good.stream.expect("looked at");
        assert_eq!((stream.loss, stream.allowed), (0.0, 1.0), "{stream:?}");

        // Samples come in bunches. (Loss would be made good by TCP, after pauses of any length.)
        let uneven = Quality::slow(Duration::ZERO, Duration::from_millis(80));
        bed.cell.network.set_link("client", "left_arm", uneven)?;
        watch
            .event_when("it is slowed", |event| {
                is_stream(event, "slowed") || is_stream(event, "refused")
            })
            .await?;
        let told = |s: &RobotStatus| {
            s.stream.is_some_and(|stream| stream.allowed < 1.0 && stream.jitter_ms > 5.0)
                && s.why.iter().any(|why| why.code == WhyCode::DegradedLink)
        };
        bed.cell.status_when(&observer, robot, "it is told why", told).await?;
        bed.cell.network.set_link("client", "left_arm", Quality::default())?;
        watch.event_when("it is good again", |event| is_stream(event, "restored")).await?;

        drop(feeder);
        // It counts its samples anew.
        under.call::<Halt>(robot, Empty {}).await?;
        let epoch = bed.granted_under::<SetMode>(&under, robot, mode).await?.epoch;
        let feeder = Feeder::start_with(&driver, &bed, (keeper.lease(), epoch), SLOW).await?;
        watch.event_when("it is refused", |event| is_stream(event, "refused")).await?;
        let refused = |s: &RobotStatus| {
            s.stream.is_some_and(|stream| stream.allowed == 0.0) && count(s, "stream_link") > 0
        };
        let status = bed.cell.status_when(&observer, robot, "samples are dropped", refused).await?;
        watch.look()?;
        let seen = watch.seen.len();
        let more = |s: &RobotStatus| count(s, "stream_link") > count(&status, "stream_link") + 8;
        bed.cell.status_when(&observer, robot, "more are dropped", more).await?;
        watch.look()?;
        assert!(watch.seen[seen..].iter().all(|state| !is_commanded(state)), "it rests");
        watch.assert_ramped();
        drop(feeder);
        keeper.release().await?;
        bed.granted::<Halt>(robot, Empty {}).await?;
        observer.close();
        driver.close();
        Ok(())
    })
}

/// Between two samples of a good stream.
const FAST: Duration = Duration::from_millis(10);
/// Between two of one that cannot be followed: three times the timeout of 40 ms, and more.
const SLOW: Duration = Duration::from_millis(130);

/// Two arms that move together over a link that loses packets stay at one phase, or stop together.
#[test]
fn arms_in_a_common_motion_on_a_lossy_link_keep_level_or_stop_together() -> Result<()> {
    in_network("a common motion on a lossy link", async |network| {
        let bed = Bed::start(network, NetCellOptions::default()).await?;
        for percent in [1, 5, 20] {
            let trajectory = bed.both(0.2, 2.0).await?;
            bed.cell.network.set_link("left_arm", "right_arm", Quality::losing(percent))?;
            let params = CellExecuteTrajectory::new(None, trajectory);
            let id = bed.begin("a motion on a lossy link", params).await?;
            let left = bed.end_of(&bed.left, id).await?;
            let right = bed.end_of(&bed.right, id).await?;
            assert_kept_level(percent, [&left, &right]);
            bed.cell.network.set_link("left_arm", "right_arm", Quality::default())?;
            bed.make_ready().await?;
        }
        bed.work_again().await
    })
}

/// They completed, or one lost the other and both ended; what is said of how they kept together is
/// within what the group allows, and neither went on alone.
#[expect(clippy::print_stderr, reason = "figures of a test, for whoever looks")]
fn assert_kept_level(percent: u8, ends: [&MotionStatus; 2]) {
    for end in ends {
        let quality = end.group.expect("it had a partner");
        eprintln!(
            "{percent} % lost: {:?} after {:.2} s, divergence {:.1} ms, silence {:.1} ms",
            end.status, end.elapsed_s, quality.max_divergence_ms, quality.max_silence_ms
        );
        assert!(quality.max_divergence_ms <= 60.0, "{percent} %: {end:#?}");
    }
    let completed = ends.iter().filter(|end| end.status == ActionStatus::Complete).count();
    let lost = |end: &&MotionStatus| {
        let code = end.reason.as_ref().map(|why| why.code);
        matches!(code, Some(DenialCode::CommunicationLost | DenialCode::NotReady))
    };
    assert!(completed == 2 || ends.iter().any(lost), "{percent} %: {ends:#?}");
    // Loss time, allowed divergence, and what a busy machine adds.
    let apart_s = (ends[0].elapsed_s - ends[1].elapsed_s).abs();
    assert!(apart_s <= 0.06 + 0.05 + RESERVE.as_secs_f64(), "{percent} %: {apart_s} s apart");
}
