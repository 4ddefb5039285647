//! Questions to agents: one task each, with one answer in time.

use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{
    CancelParams, Denial, DenialCode, LeaseParams, MotionParams, SetModeParams, SpeedRatioParams,
};
use armada_protocol::method::robot;
use uuid::Uuid;
use zenoh::Session;

use super::clock::monotonic;
use crate::coordinator::{AgentAnswer, AgentCall, AskId, Control};

/// A question on its way.
pub(super) struct Ask {
    pub(super) ask: AskId,
    pub(super) robot: RobotName,
    pub(super) client: String,
    pub(super) lease: Option<Uuid>,
    pub(super) call: AgentCall,
    pub(super) timeout: Duration,
}

/// The answer to a question.
pub(super) type Answer = (AskId, Result<AgentAnswer, Denial>);

/// Asks, and gives up when the time is over.
pub(super) async fn ask(session: Session, question: Ask) -> Answer {
    let Ask { ask, robot, client, lease, call, timeout } = question;
    let client = Client::on_session(session, client).under(lease);
    let answer = tokio::time::timeout(timeout, answer(&client, &robot, call, timeout)).await;
    let result = match answer {
        Ok(result) => result.map_err(denial_of),
        Err(_) => {
            let message = format!("no answer within {} ms", timeout.as_millis());
            Err(Denial::new(DenialCode::Timeout, message))
        }
    };
    (ask, result)
}

async fn answer(
    client: &Client,
    robot: &RobotName,
    call: AgentCall,
    timeout: Duration,
) -> Result<AgentAnswer, ClientError> {
    let by_id = |motion_id: Uuid| CancelParams { motion_id };
    Ok(match call {
        AgentCall::Clock => {
            let sent = monotonic();
            let sample = client.robot_clock(robot).await?;
            AgentAnswer::Clock { sample, sent, received: monotonic() }
        }
        AgentCall::Info => AgentAnswer::Info(Box::new(client.robot_info(robot).await?)),
        AgentCall::Status => AgentAnswer::Status(Box::new(client.robot_status(robot).await?)),
        AgentCall::Motion(id) => AgentAnswer::Motion(Box::new(client.motion(robot, id).await?)),
        AgentCall::SetMode(mode) => {
            AgentAnswer::Mode(client.call::<robot::SetMode>(robot, SetModeParams { mode }).await?)
        }
        AgentCall::Prepare(params) => {
            AgentAnswer::Prepared(client.call::<robot::Prepare>(robot, *params).await?)
        }
        AgentCall::Commit(params) => {
            AgentAnswer::Committed(client.call::<robot::Commit>(robot, params).await?)
        }
        AgentCall::Abort(id) => {
            client.call::<robot::Abort>(robot, by_id(id)).await?;
            AgentAnswer::Aborted
        }
        AgentCall::Stop(request) => {
            AgentAnswer::Stop(client.stop_robot(robot, &request, timeout).await?)
        }
        AgentCall::Reset(params) => {
            AgentAnswer::Reset(client.call::<robot::Reset>(robot, *params).await?)
        }
        AgentCall::Control(motion_id, control) => {
            return control_of(client, robot, motion_id, control).await;
        }
        AgentCall::AcquireLease(params) => {
            AgentAnswer::Lease(client.call::<robot::AcquireLease>(robot, params).await?)
        }
        AgentCall::RenewLease(params) => {
            AgentAnswer::Lease(client.call::<robot::RenewLease>(robot, params).await?)
        }
        AgentCall::ReleaseLease(lease) => {
            client.call::<robot::ReleaseLease>(robot, LeaseParams { lease }).await?;
            AgentAnswer::LeaseReleased
        }
    })
}

async fn control_of(
    client: &Client,
    robot: &RobotName,
    motion_id: Uuid,
    control: Control,
) -> Result<AgentAnswer, ClientError> {
    let params = MotionParams { motion_id };
    Ok(match control {
        Control::Pause => {
            client.call::<robot::Pause>(robot, params).await?;
            AgentAnswer::Controlled
        }
        Control::Resume => {
            client.call::<robot::Resume>(robot, params).await?;
            AgentAnswer::Controlled
        }
        Control::SpeedRatio(ratio) => {
            let params = SpeedRatioParams { ratio };
            AgentAnswer::SpeedRatio(client.call::<robot::SetSpeedRatio>(robot, params).await?)
        }
    })
}

fn denial_of(error: ClientError) -> Denial {
    let code = match error {
        ClientError::Denied(denial) => return denial,
        ClientError::NoReply { .. } => DenialCode::Unreachable,
        ClientError::Timeout { .. } => DenialCode::Timeout,
        ClientError::Codec(_) => DenialCode::BadEncoding,
        _ => DenialCode::CommunicationLost,
    };
    Denial::new(code, error.to_string())
}
