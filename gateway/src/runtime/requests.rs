//! Requests of clients on their way to the executor.

use armada_model::JointTrajectory;
use armada_protocol::messages::{
    Accepted, CellResetAnswer, Denial, DenialCode, Empty, Request, StopReport,
};
use armada_protocol::method::{Method, cell};
use armada_protocol::serve::{Call, Handler};
use serde_json::Value;
use tokio::sync::{mpsc, oneshot};
use uuid::Uuid;

use crate::coordinator::{CellAnswer, CellRequest};

/// Requests that wait for the executor.
const QUEUE: usize = 64;

/// One request and where its answer goes.
pub(super) struct Order {
    pub(super) client: String,
    pub(super) request: CellRequest,
    pub(super) answer: oneshot::Sender<Result<CellAnswer, Denial>>,
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

    async fn submit<P>(
        &self,
        request: Request<P>,
        ask: impl FnOnce(P) -> CellRequest,
    ) -> Result<CellAnswer, Denial> {
        let (answer, answered) = oneshot::channel();
        let order = Order { client: request.client, request: ask(request.params), answer };
        let queue =
            if matches!(order.request, CellRequest::Stop(_)) { &self.stops } else { &self.others };
        let ending = || Denial::new(DenialCode::CommunicationLost, "the gateway ends");
        queue.send(order).await.map_err(|_| ending())?;
        answered.await.map_err(|_| ending())?
    }
}

impl Handler for CellRequests {
    async fn handle(&self, call: Call) -> Result<Value, Denial> {
        match call.method() {
            cell::Stop::NAME => {
                call.run::<cell::Stop, _, _>(async |request| {
                    report(self.submit(request, CellRequest::Stop).await?)
                })
                .await
            }
            cell::Reset::NAME => {
                call.run::<cell::Reset, _, _>(async |request| {
                    reset(self.submit(request, CellRequest::Reset).await?)
                })
                .await
            }
            cell::ExecuteTrajectory::NAME => {
                call.run::<cell::ExecuteTrajectory, _, _>(async |request| {
                    refuse_lease(request.lease)?;
                    let ask = |params: armada_protocol::messages::CellExecuteTrajectory| {
                        execute(params.motion_id, params.trajectory)
                    };
                    accepted(self.submit(request, ask).await?)
                })
                .await
            }
            cell::Cancel::NAME => {
                call.run::<cell::Cancel, _, _>(async |request| {
                    let ask = |params: armada_protocol::messages::CancelParams| {
                        CellRequest::Cancel { motion_id: params.motion_id }
                    };
                    cancelled(self.submit(request, ask).await?)
                })
                .await
            }
            _ => {
                let known: Vec<_> = cell::ALL.iter().map(|row| row.name).collect();
                Err(call.unknown_method(&known))
            }
        }
    }

    fn is_urgent(&self, method: &str) -> bool {
        method == cell::Stop::NAME
    }
}

/// A lease is of one robot: what drives several would need one of each.
fn refuse_lease(lease: Option<Uuid>) -> Result<(), Denial> {
    lease.map_or(Ok(()), |_| {
        Err(Denial::new(
            DenialCode::NotSupported,
            "a lease is of one robot and cannot drive a cell: release it and leave it out",
        )
        .with("field", "lease"))
    })
}

fn execute(motion_id: Option<Uuid>, trajectory: JointTrajectory) -> CellRequest {
    let motion_id = motion_id.unwrap_or_else(Uuid::now_v7);
    CellRequest::ExecuteTrajectory { motion_id, trajectory }
}

fn report(answer: CellAnswer) -> Result<StopReport, Denial> {
    if let CellAnswer::Stopped(report) = answer { Ok(report) } else { Err(confused()) }
}

fn reset(answer: CellAnswer) -> Result<CellResetAnswer, Denial> {
    if let CellAnswer::Reset(answer) = answer { Ok(answer) } else { Err(confused()) }
}

fn accepted(answer: CellAnswer) -> Result<Accepted, Denial> {
    if let CellAnswer::Accepted(accepted) = answer { Ok(accepted) } else { Err(confused()) }
}

fn cancelled(answer: CellAnswer) -> Result<Empty, Denial> {
    if answer == CellAnswer::Cancelled { Ok(Empty {}) } else { Err(confused()) }
}

fn confused() -> Denial {
    Denial::new(DenialCode::Internal, "the answer is to another request")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lease_does_not_drive_a_cell() {
        assert_eq!(refuse_lease(None), Ok(()));
        let denial = refuse_lease(Some(Uuid::nil())).expect_err("refused");
        assert_eq!(denial.code, DenialCode::NotSupported);
        assert_eq!(denial.details["field"], "lease");
    }
}
