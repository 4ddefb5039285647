//! The shortest path of a stop: from a client to every agent, gateway alive or not.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tracing::warn;
use zenoh::query::{ConsolidationMode, QueryTarget};

use super::{Client, ClientError, Subscription, now};
use crate::RobotName;
use crate::codec::{MAX_MESSAGE_BYTES, WireEncoding};
use crate::keys;
use crate::messages::{StopAck, StopReport, StopRequest, StopScope, StopStage, StopVerdict};
use crate::qos::Channel;

/// Pause between repetitions of a stop until every robot has it.
const REPEAT: Duration = Duration::from_millis(10);
/// How long it is repeated that often; who has not answered by then is hardly there.
const EAGER: Duration = Duration::from_secs(1);
/// Pause between repetitions after that.
const LATE_REPEAT: Duration = Duration::from_millis(100);
/// How long the gateway has to say which robots the cell has, while the stop is repeated.
const CONFIGURED: Duration = Duration::from_millis(500);
/// How often those that are not known to stand are asked to stop harder.
const HARDER: u32 = 5;

/// Who must stand still, and by when.
#[derive(Clone, Debug)]
pub struct StopOptions {
    /// Robots that must be measured to stand still, besides those on the bus now; if it is empty the
    /// gateway is asked which the cell has.
    pub expected: Vec<RobotName>,
    /// How long to wait for that.
    pub timeout: Duration,
}

impl Client {
    /// Stops robots without the gateway: publishes the stop again and again, asks every agent as
    /// well, and waits until each robot is measured to stand still.
    ///
    /// Robots in scope are those named by the scope, or for a whole cell every robot on the bus and
    /// `expected`, or if that is empty those that the gateway knows of. The stop goes out before
    /// anything else is looked at.
    ///
    /// # Errors
    /// [`ClientError::Zenoh`] if nothing can be sent at all.
    pub async fn stop(
        &self,
        mut request: StopRequest,
        options: StopOptions,
    ) -> Result<StopReport, ClientError> {
        let start = now();
        let deadline = start + options.timeout;
        let acks = self.subscribe::<StopAck>(&keys::ROBOT_STOP_ACK.any(), 256).await?;
        self.publish_stop(&request).await?;
        let asked = self.ask_to_stop(&keys::ROBOT_STOP.any(), &request, options.timeout).await?;
        let in_scope = self.in_scope_while_repeating(&mut request, options.expected).await?;
        let mut ladder = Ladder::new(request.stop_id, in_scope);
        let mut repeat = now();
        while !ladder.all_reached(StopStage::Standstill) && now() < deadline {
            // By the clock, never by what comes in: every repetition is acknowledged.
            if now() >= repeat && !ladder.all_reached(StopStage::Received) {
                request.seq += 1;
                self.publish_stop(&request).await?;
                repeat = now() + if start.elapsed() < EAGER { REPEAT } else { LATE_REPEAT };
            }
            let pause = REPEAT.min(deadline.saturating_duration_since(now()));
            if let Ok(ack) = tokio::time::timeout(pause, acks.next()).await {
                ladder.take(ack.map(|(_, ack)| ack));
            }
            while let Ok(Some(reply)) = asked.try_recv() {
                ladder.take(decode_ack(&reply));
            }
        }
        drain(&acks, &mut ladder);
        let report = ladder.report();
        self.stop_harder(request, &report).await;
        Ok(report)
    }

    /// Asks the agent of one robot to stop; returns the first stage it reports.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn stop_robot(
        &self,
        robot: &RobotName,
        request: &StopRequest,
        timeout: Duration,
    ) -> Result<StopAck, ClientError> {
        let key = keys::ROBOT_STOP.of(robot);
        let replies = self.ask_to_stop(&key, request, timeout).await?;
        match replies.recv_async().await {
            Ok(reply) => decode_ack(&reply),
            Err(_) => Err(ClientError::NoReply { key }),
        }
    }

    /// Asks once more, one level harder, those that are not known to stand: whoever got the stop and
    /// does not come to rest raises it himself, and this may reach who has not got it.
    async fn stop_harder(&self, request: StopRequest, report: &StopReport) {
        let Some(level) = request.level.harder().filter(|_| !report.missing.is_empty()) else {
            return;
        };
        let scope = StopScope::Robots(report.missing.clone());
        let mut harder = StopRequest { level, scope, ..request };
        for _ in 0..HARDER {
            harder.seq += 1;
            let published = self.publish_stop(&harder).await;
            let asked = self.ask_to_stop(&keys::ROBOT_STOP.any(), &harder, REPEAT).await;
            if let Some(error) = published.err().or_else(|| asked.err()) {
                // Whoever asked has the report all the same, which says INCOMPLETE.
                warn!(%error, "the harder stop is not sent");
            }
            tokio::time::sleep(REPEAT).await;
        }
    }

    async fn publish_stop(&self, request: &StopRequest) -> Result<(), ClientError> {
        let payload = WireEncoding::Json.encode(request)?;
        self.session
            .put(keys::CELL_STOP.any(), payload)
            .encoding(WireEncoding::Json.to_zenoh())
            .priority(Channel::Stop.priority())
            .congestion_control(Channel::Stop.congestion_control())
            .express(Channel::Stop.express())
            .await
            .map_err(ClientError::zenoh)
    }

    async fn ask_to_stop(
        &self,
        key: &str,
        request: &StopRequest,
        timeout: Duration,
    ) -> Result<zenoh::handlers::FifoChannelHandler<zenoh::query::Reply>, ClientError> {
        let payload = WireEncoding::Json.encode(request)?;
        self.session
            .get(key)
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .payload(payload)
            .encoding(WireEncoding::Json.to_zenoh())
            .priority(Channel::Stop.priority())
            .congestion_control(Channel::Stop.congestion_control())
            .express(Channel::Stop.express())
            .timeout(timeout)
            .await
            .map_err(ClientError::zenoh)
    }

    /// The robots in scope; the stop is repeated until they are known, for the answer may have to
    /// wait for a gateway that hangs, and links may still come up.
    async fn in_scope_while_repeating(
        &self,
        request: &mut StopRequest,
        expected: Vec<RobotName>,
    ) -> Result<BTreeSet<RobotName>, ClientError> {
        let scope = request.scope.clone();
        let looking = async {
            self.wait_for_late_links().await;
            self.robots_in_scope(&scope, expected).await
        };
        tokio::pin!(looking);
        loop {
            tokio::select! {
                robots = &mut looking => return robots,
                () = tokio::time::sleep(REPEAT) => {
                    request.seq += 1;
                    self.publish_stop(request).await?;
                }
            }
        }
    }

    /// The robots of the cell's file, if the gateway tells them in time.
    async fn configured_robots(&self) -> Vec<RobotName> {
        let info = tokio::time::timeout(CONFIGURED, self.cell_info()).await;
        let info = info.ok().and_then(Result::ok);
        info.map_or_else(Vec::new, |info| info.robots.into_iter().map(|row| row.robot).collect())
    }

    async fn robots_in_scope(
        &self,
        scope: &StopScope,
        expected: Vec<RobotName>,
    ) -> Result<BTreeSet<RobotName>, ClientError> {
        match scope {
            StopScope::Robots(robots) => Ok(robots.iter().cloned().collect()),
            StopScope::Cell => {
                let configured = async {
                    match expected.is_empty() {
                        true => self.configured_robots().await,
                        false => expected,
                    }
                };
                let (alive, configured) = tokio::join!(self.robots_alive(), configured);
                Ok(alive?.into_iter().chain(configured).collect())
            }
        }
    }
}

fn decode_ack(reply: &zenoh::query::Reply) -> Result<StopAck, ClientError> {
    let sample =
        reply.result().map_err(|_| ClientError::NoReply { key: keys::ROBOT_STOP.any() })?;
    let encoding = WireEncoding::from_zenoh(sample.encoding())?;
    Ok(encoding.decode(&sample.payload().to_bytes(), MAX_MESSAGE_BYTES)?)
}

fn drain(acks: &Subscription<StopAck>, ladder: &mut Ladder) {
    while let Ok(Some((_, ack))) = acks.try_next() {
        ladder.take(Ok(ack));
    }
}

/// How far each robot in scope has come.
struct Ladder {
    stop_id: uuid::Uuid,
    in_scope: BTreeSet<RobotName>,
    reached: BTreeMap<RobotName, StopAck>,
}

impl Ladder {
    const fn new(stop_id: uuid::Uuid, in_scope: BTreeSet<RobotName>) -> Self {
        Self { stop_id, in_scope, reached: BTreeMap::new() }
    }

    /// Takes an acknowledgement; one that cannot be read proves nothing and is passed over.
    fn take(&mut self, ack: Result<StopAck, ClientError>) {
        let Ok(ack) = ack else { return };
        if ack.stop_id != self.stop_id {
            return;
        }
        let known = self.reached.get(&ack.robot);
        if known.is_none_or(|known| known.stage < ack.stage) {
            self.reached.insert(ack.robot.clone(), ack);
        }
    }

    fn has_reached(&self, robot: &RobotName, stage: StopStage) -> bool {
        self.reached.get(robot).is_some_and(|ack| ack.stage >= stage)
    }

    fn all_reached(&self, stage: StopStage) -> bool {
        !self.in_scope.is_empty()
            && self.in_scope.iter().all(|robot| self.has_reached(robot, stage))
    }

    fn report(self) -> StopReport {
        let complete = self.all_reached(StopStage::Standstill);
        let missing = self
            .in_scope
            .iter()
            .filter(|robot| !self.has_reached(robot, StopStage::Standstill))
            .cloned()
            .collect();
        StopReport {
            stop_id: self.stop_id,
            verdict: if complete { StopVerdict::Complete } else { StopVerdict::Incomplete },
            acks: self.reached.into_values().collect(),
            missing,
        }
    }
}

#[cfg(test)]
mod tests {
    use armada_model::MonoTime;
    use uuid::Uuid;

    use super::*;

    fn ack(robot: &str, stage: StopStage) -> StopAck {
        StopAck {
            stop_id: Uuid::nil(),
            robot: robot.parse().expect("a name"),
            boot_id: Uuid::nil(),
            stage,
            stamp_ns: MonoTime::ZERO,
            since_received_ms: 0.0,
        }
    }

    fn ladder(robots: &[&str]) -> Ladder {
        let names = robots.iter().map(|name| name.parse().expect("a name")).collect();
        Ladder::new(Uuid::nil(), names)
    }

    #[test]
    fn a_robot_that_never_answers_makes_the_verdict_incomplete_by_name() {
        let mut ladder = ladder(&["left_arm", "right_arm"]);
        ladder.take(Ok(ack("left_arm", StopStage::Standstill)));
        let report = ladder.report();
        assert_eq!(report.verdict, StopVerdict::Incomplete);
        assert_eq!(report.missing, ["right_arm".parse().expect("a name")]);
    }

    #[test]
    fn a_late_lower_stage_takes_nothing_back() {
        let mut ladder = ladder(&["left_arm"]);
        ladder.take(Ok(ack("left_arm", StopStage::Standstill)));
        ladder.take(Ok(ack("left_arm", StopStage::Received)));
        assert_eq!(ladder.report().verdict, StopVerdict::Complete);
    }

    #[test]
    fn a_stop_that_nobody_was_asked_to_follow_is_not_complete() {
        assert_eq!(ladder(&[]).report().verdict, StopVerdict::Incomplete);
    }

    #[test]
    fn an_answer_to_another_stop_proves_nothing() {
        let mut ladder = ladder(&["left_arm"]);
        let other = StopAck { stop_id: Uuid::max(), ..ack("left_arm", StopStage::Standstill) };
        ladder.take(Ok(other));
        assert_eq!(ladder.report().verdict, StopVerdict::Incomplete);
    }
}
