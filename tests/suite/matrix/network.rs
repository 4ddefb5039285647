//! The network of the tests itself: that a bad link is bad, and a good one good. And what a robot
//! does with a stream on a bad one.

use std::time::Duration;

use anyhow::Result;
use armada_protocol::messages::*;
use armada_protocol::method::robot::{Halt, SetMode};
use armada_tests::{NetCell, NetCellOptions, Quality, in_network, monotonic, wait_for};

use crate::clients::{Feeder, is_stream};
use crate::support::{Bed, Watch, count, is_commanded};

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
        let judged = |s: &RobotStatus| s.stream.is_some_and(|stream| stream.state_age_ms > 0.0);
        let good = bed.cell.status_when(&observer, robot, "the link is judged", judged).await?;
        let stream = good.stream.expect("looked at");
        assert_eq!((stream.loss, stream.allowed), (0.0, 1.0), "{stream:?}");

        bed.cell.network.set_link("client", "left_arm", Quality::losing(20))?;
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
