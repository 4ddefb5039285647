//! Requests of clients on their way to the executor.

use armada_protocol::messages::{CellExecuteTrajectory, Denial, DenialCode, Request};
use armada_protocol::method::{Method, cell};
use armada_protocol::serve::{Call, Handler};
use serde_json::Value;
use tokio::sync::{mpsc, oneshot};
use uuid::Uuid;

use super::answers::{FromAnswer, confused};
use crate::coordinator::{CellRequest, Control};

/// Requests that wait for the executor.
const QUEUE: usize = 64;

/// One request and where its answer goes.
pub(super) struct Order {
    pub(super) client: String,
    pub(super) request: CellRequest,
    pub(super) answer: oneshot::Sender<Result<crate::coordinator::CellAnswer, Denial>>,
}

/// The executor's end: stops never wait behind other requests.
pub(super) struct Orders {
    pub(super) stops: mpsc::Receiver<Order>,
    pub(super) others: mpsc::Receiver<Order>,
}

/// Answers the methods of the cell.
#[derive(Debug)]
pub(super) struct CellRequests {
    stops: mpsc::Sender<Order>,
    others: mpsc::Sender<Order>,
}

impl CellRequests {
    pub(super) fn new() -> (Self, Orders) {
        let (stops, stop_orders) = mpsc::channel(QUEUE);
        let (others, other_orders) = mpsc::channel(QUEUE);
        (Self { stops, others }, Orders { stops: stop_orders, others: other_orders })
    }

    /// Answers a method: `ask` makes the request from its parameters and lease.
    async fn run<M>(
        &self,
        call: Call,
        ask: impl FnOnce(M::Params, Option<Uuid>) -> Result<CellRequest, Denial> + Send,
    ) -> Result<Value, Denial>
    where
        M: Method<Answer: FromAnswer>,
    {
        call.run::<M, _, _>(async |request: Request<M::Params>| {
            let Request { client, lease, params, .. } = request;
            let (answer, answered) = oneshot::channel();
            let order = Order { client, request: ask(params, lease)?, answer };
            let is_stop = matches!(order.request, CellRequest::Stop(_));
            let queue = if is_stop { &self.stops } else { &self.others };
            let ending = || Denial::new(DenialCode::CommunicationLost, "the gateway ends");
            queue.send(order).await.map_err(|_| ending())?;
            let answer = answered.await.map_err(|_| ending())??;
            M::Answer::from_answer(answer).ok_or_else(confused)
        })
        .await
    }
}

impl Handler for CellRequests {
    async fn handle(&self, call: Call) -> Result<Value, Denial> {
        use CellRequest as Ask;
        match call.method() {
            // Never refused, whatever comes with it.
            cell::Stop::NAME => {
                self.run::<cell::Stop>(call, |params, _| Ok(Ask::Stop(params))).await
            }
            cell::Reset::NAME => {
                // Needs no lease: a stop has taken it.
                self.run::<cell::Reset>(call, |params, _| Ok(Ask::Reset(params))).await
            }
            cell::ExecuteTrajectory::NAME => {
                self.run::<cell::ExecuteTrajectory>(call, |params, lease| {
                    no_single_lease(lease)?;
                    Ok(execute(params))
                })
                .await
            }
            cell::Cancel::NAME => {
                // Anybody may end a motion, at an agent too.
                self.run::<cell::Cancel>(call, |params, _| {
                    Ok(Ask::Cancel { motion_id: params.motion_id })
                })
                .await
            }
            cell::Pause::NAME => {
                self.run::<cell::Pause>(call, |params, lease| {
                    Ok(control(params.motion_id, lease, Control::Pause))
                })
                .await
            }
            cell::Resume::NAME => {
                self.run::<cell::Resume>(call, |params, lease| {
                    Ok(control(params.motion_id, lease, Control::Resume))
                })
                .await
            }
            cell::SetSpeedRatio::NAME => {
                self.run::<cell::SetSpeedRatio>(call, |params, lease| {
                    Ok(control(params.motion_id, lease, Control::SpeedRatio(params.ratio)))
                })
                .await
            }
            _ => self.handle_leases(call).await,
        }
    }

    fn is_urgent(&self, method: &str) -> bool {
        method == cell::Stop::NAME
    }
}

impl CellRequests {
    /// The methods about leases, and those that need none.
    async fn handle_leases(&self, call: Call) -> Result<Value, Denial> {
        use CellRequest as Ask;
        match call.method() {
            cell::AcquireLease::NAME => {
                self.run::<cell::AcquireLease>(call, |params, lease| {
                    no_single_lease(lease).map(|()| Ask::AcquireLease(params))
                })
                .await
            }
            cell::RenewLease::NAME => {
                self.run::<cell::RenewLease>(call, |params, lease| {
                    no_single_lease(lease).map(|()| Ask::RenewLease(params))
                })
                .await
            }
            cell::ReleaseLease::NAME => {
                self.run::<cell::ReleaseLease>(call, |params, lease| {
                    no_single_lease(lease).map(|()| Ask::ReleaseLease(params))
                })
                .await
            }
            cell::CheckClearance::NAME => {
                // Nothing moves, so any lease will do.
                self.run::<cell::CheckClearance>(call, |params, _| {
                    Ok(Ask::CheckClearance(Box::new(params)))
                })
                .await
            }
            _ => {
                let known: Vec<_> = cell::ALL.iter().map(|row| row.name).collect();
                Err(call.unknown_method(&known))
            }
        }
    }
}

/// A lease is of one robot: what concerns several takes one of each.
fn no_single_lease(lease: Option<Uuid>) -> Result<(), Denial> {
    lease.map_or(Ok(()), |_| {
        Err(Denial::new(
            DenialCode::InvalidArgument,
            "lease is of one robot, this is asked of several: leave it out and name the lease of \
             each robot in leases",
        )
        .with("field", "lease"))
    })
}

fn execute(params: CellExecuteTrajectory) -> CellRequest {
    let motion_id = params.motion_id.unwrap_or_else(Uuid::now_v7);
    CellRequest::ExecuteTrajectory { motion_id, params: Box::new(params) }
}

const fn control(motion_id: Uuid, lease: Option<Uuid>, control: Control) -> CellRequest {
    CellRequest::Control { motion_id, lease, control }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_lease_does_not_drive_a_cell() {
        assert_eq!(no_single_lease(None), Ok(()));
        let denial = no_single_lease(Some(Uuid::nil())).expect_err("refused");
        assert_eq!(denial.code, DenialCode::InvalidArgument);
        assert_eq!(denial.details["field"], "lease");
    }
}
