//! The network of the tests itself: that a bad link is bad, and a good one good.

use std::time::Duration;

use anyhow::Result;
use armada_tests::{NetCell, NetCellOptions, Quality, in_network, monotonic, wait_for};

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
