//! Things that are no messages come in on every key; nothing dies.

use anyhow::Result;
use armada_protocol::client::Client;
use armada_protocol::keys::{self, Kind};
use armada_protocol::messages::{Denial, DenialCode};
use armada_protocol::method;
use armada_tests::{Cell, CellOptions, DEADLINE, is_running, wait_for};
use zenoh::bytes::Encoding;
use zenoh::qos::CongestionControl;

/// Payloads that are no message of any kind, with the encodings they claim to be in.
fn garbage() -> Vec<(Vec<u8>, Encoding)> {
    let json = || Encoding::APPLICATION_JSON;
    let deep = "[".repeat(20_000).into_bytes();
    vec![
        (Vec::new(), json()),
        (b"{".to_vec(), json()),
        (b"null".to_vec(), json()),
        (b"[1,2,3]".to_vec(), json()),
        (b"{\"params\":7}".to_vec(), json()),
        (b"{\"params\":{\"joint_position_rad\":[1e999]}}".to_vec(), json()),
        (vec![0xff; 300], json()),
        (vec![0xc1; 40], Encoding::from("application/msgpack")),
        (b"{}".to_vec(), Encoding::IMAGE_PNG),
        (deep, json()),
        (vec![b' '; 2_000_000], json()),
    ]
}

/// Every key that agents and gateway listen on or answer at, made concrete.
fn concrete_keys() -> Vec<String> {
    let id = uuid::Uuid::nil().to_string();
    let mut found = Vec::new();
    for key in keys::ALL.iter().filter(|key| !key.kinds.contains(&Kind::Liveliness)) {
        let parts: &[&str] = match key.name {
            "CELL_MOTION" => &[&id],
            "CELL_RPC" => &["execute_trajectory"],
            "ROBOT_MOTION" => &["left_arm", &id],
            "ROBOT_RPC" => &["left_arm", "jog_freespace"],
            _ => &["left_arm"],
        };
        found.push(key.with(parts));
    }
    found
}

#[tokio::test(flavor = "multi_thread")]
async fn garbage_on_every_key_kills_nobody_and_is_denied_or_counted() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let processes = cell.processes()?;
    for key in concrete_keys() {
        for (payload, encoding) in garbage() {
            // Two megabytes on each key fill the link, and what may be dropped then would be.
            let put = client.session().put(&key, payload).encoding(encoding);
            put.congestion_control(CongestionControl::Block).await.expect("is sent");
        }
    }
    for pid in &processes {
        assert!(is_running(*pid), "process {pid} died:\n{}", cell.printed());
    }
    // Behind all that, and on a link that may have to be made anew.
    for robot in cell.robots()? {
        let answers = async || client.robot_status(&robot).await.ok();
        wait_for("each robot answers", DEADLINE, answers).await?;
    }
    let left = "left_arm".parse()?;
    let counted = async || {
        let status = client.robot_status(&left).await.ok()?;
        status.dropped.iter().any(|(what, _)| what == "unreadable_stop").then_some(())
    };
    wait_for("unreadable stops are counted", DEADLINE, counted).await?;
    wait_for("the gateway answers", DEADLINE, async || client.cell_status().await.ok()).await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn every_method_denies_every_kind_of_garbage() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let robot = method::robot::ALL.iter().map(|m| keys::ROBOT_RPC.with(&["left_arm", m.name]));
    let gateway = method::cell::ALL.iter().map(|m| keys::CELL_RPC.with(&[m.name]));
    for key in robot.chain(gateway) {
        for (payload, encoding) in garbage().into_iter().filter(|(bytes, _)| !bytes.is_empty()) {
            let denial = ask(&client, &key, payload, encoding).await;
            let fits = matches!(
                denial.code,
                DenialCode::InvalidArgument | DenialCode::BadEncoding | DenialCode::TooLarge
            );
            assert!(fits, "{key}: {denial}");
        }
    }
    let unknown = keys::ROBOT_RPC.with(&["left_arm", "fly"]);
    let denial = ask(&client, &unknown, b"{}".to_vec(), Encoding::APPLICATION_JSON).await;
    assert_eq!(denial.code, DenialCode::UnknownMethod, "{denial}");
    Ok(())
}

async fn ask(client: &Client, key: &str, payload: Vec<u8>, encoding: Encoding) -> Denial {
    let replies = client.session().get(key).payload(payload).encoding(encoding);
    let replies = replies.timeout(DEADLINE).await.expect("is asked");
    let reply = replies.recv_async().await.unwrap_or_else(|_| panic!("{key}: no reply"));
    let refused = match reply.result() {
        Ok(sample) => panic!("{key}: granted {:?}", sample.payload()),
        Err(refused) => refused.payload().to_bytes().into_owned(),
    };
    serde_json::from_slice(&refused)
        .or_else(|_| rmp_serde::from_slice(&refused))
        .unwrap_or_else(|_| panic!("{key}: {:?} is no denial", String::from_utf8_lossy(&refused)))
}
