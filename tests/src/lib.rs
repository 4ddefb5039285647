//! Whole cells as real processes, for the tests in `suite`.
//!
//! A [`Cell`] is started by `armada up` on ports of its own, in a folder of its own, and is ended
//! with every process it started when it is dropped.

mod cell;
mod clock;
mod net;
mod net_cell;
mod ports;
mod process;
mod python;
mod wait;

pub use cell::{Cell, CellOptions};
pub use clock::monotonic;
pub use net::{Host, HostProcess, Network, Quality, can_make_hosts, in_network};
pub use net_cell::{NetCell, NetCellOptions};
pub use ports::{Ports, free_tcp_port};
pub use process::{armada, children_of, is_running, kill, signal, terminate};
pub use python::python;
pub use wait::{DEADLINE, wait_for};
