//! A client that dials several endpoints, of which some are dead: real sessions on loopback.
#![expect(clippy::expect_used, reason = "helpers of tests may panic as the tests do")]

use std::time::Duration;

use armada_protocol::client::{Client, ClientError, ClientOptions, StopOptions};
use armada_protocol::messages::{StopLevel, StopRequest, StopScope, StopVerdict};
use armada_protocol::session::{self, Role, SessionOptions};
use uuid::Uuid;
use zenoh::Session;

/// A gateway's session on a port that the system chose, and its endpoint.
async fn gateway() -> (Session, String) {
    let session = session::open(&SessionOptions {
        role: Role::Gateway,
        listen: vec!["tcp/127.0.0.1:0".to_owned()],
        connect: Vec::new(),
        namespace: None,
        insecure_lan: false,
    })
    .await
    .expect("a session");
    let endpoint = session.info().locators().await.first().expect("it listens").to_string();
    (session, endpoint)
}

/// An endpoint that nothing listens on: it was free a moment ago.
fn dead_endpoint() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    format!("tcp/{}", listener.local_addr().expect("bound"))
}

fn options(connect: Vec<String>) -> ClientOptions {
    ClientOptions { connect, ..ClientOptions::default() }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dead_endpoint_does_not_keep_a_client_from_the_live_one() {
    let (_gateway, endpoint) = gateway().await;
    let client = Client::connect(options(vec![dead_endpoint(), endpoint])).await;
    client.expect("one of two answers").close();
}

#[tokio::test(flavor = "multi_thread")]
async fn where_nobody_answers_the_endpoints_are_told() {
    // One endpoint and several are dialled in different ways.
    for dead in [vec![dead_endpoint()], vec![dead_endpoint(), dead_endpoint()]] {
        let error = Client::connect(options(dead.clone())).await.expect_err("nobody is there");
        assert!(
            matches!(&error, ClientError::NobodyThere { endpoints } if *endpoints == dead),
            "{error}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_goes_out_over_the_live_endpoint_while_the_other_is_dead() {
    let (gateway, endpoint) = gateway().await;
    let stops = gateway.declare_subscriber("cell/stop").await.expect("declared");
    let client = Client::connect_at_once(options(vec![dead_endpoint(), endpoint]))
        .await
        .expect("one of two answers");
    let request = StopRequest {
        stop_id: Uuid::from_u128(7),
        source: "test".to_owned(),
        level: StopLevel::L1,
        scope: StopScope::Cell,
        reason: String::new(),
        seq: 0,
    };
    let torso = "torso".parse().expect("a name");
    let wait = StopOptions { expected: vec![torso], timeout: Duration::from_millis(500) };
    let report = client.stop(request, wait).await.expect("it is sent");
    // No agent is there, so the stop is known not to be complete, and by whom.
    assert_eq!(report.verdict, StopVerdict::Incomplete);
    assert_eq!(report.missing.len(), 1);
    let sample = stops.try_recv().expect("the session is open").expect("the stop came");
    let text = sample.payload().try_to_string().expect("text").into_owned();
    let received: StopRequest = serde_json::from_str(&text).expect("a stop");
    assert_eq!(received.stop_id, Uuid::from_u128(7));
}
