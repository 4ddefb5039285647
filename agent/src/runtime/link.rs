//! The sockets that a driver or an emulator asked for.

use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use crate::drivers::{Endpoint, MAX_PACKET, Transmit};

/// Most packets taken from one socket at once, so that a flood cannot hold up a tick.
const MAX_BURST: usize = 64;

/// Why a connection could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {cause}")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The system's reason.
        cause: io::Error,
    },
    /// The address cannot be reached.
    #[error("cannot reach {address}: {cause}")]
    Connect {
        /// The address.
        address: SocketAddr,
        /// The system's reason.
        cause: io::Error,
    },
}

/// Non-blocking sockets in the order of the endpoints.
#[derive(Debug)]
pub(super) struct Link {
    sockets: Vec<UdpSocket>,
}

impl Link {
    pub(super) fn open(endpoints: &[Endpoint]) -> Result<Self, LinkError> {
        let sockets = endpoints.iter().map(open_socket).collect::<Result<_, _>>()?;
        Ok(Self { sockets })
    }

    /// Addresses the sockets are bound to.
    pub(super) fn local_addresses(&self) -> Vec<SocketAddr> {
        self.sockets.iter().filter_map(|socket| socket.local_addr().ok()).collect()
    }

    /// Hands every packet that has come to `take(endpoint, sender, bytes)`; does not wait.
    pub(super) fn receive(&self, mut take: impl FnMut(usize, SocketAddr, &[u8])) {
        let mut buffer = [0; MAX_PACKET];
        for (endpoint, socket) in self.sockets.iter().enumerate() {
            for _ in 0..MAX_BURST {
                match socket.recv_from(&mut buffer) {
                    Ok((len, sender)) => {
                        take(endpoint, sender, buffer.get(..len).unwrap_or_default());
                    }
                    // An earlier packet was refused by the other machine; that says nothing
                    // about those that wait.
                    Err(error) if error.kind() == ErrorKind::ConnectionRefused => {}
                    Err(_) => break,
                }
            }
        }
    }

    /// Sends every packet that `next(buffer)` writes; what cannot be sent is lost, as datagrams
    /// are, and shows as silence.
    pub(super) fn transmit(&self, mut next: impl FnMut(&mut [u8]) -> Option<Transmit>) {
        let mut buffer = [0; MAX_PACKET];
        while let Some(packet) = next(&mut buffer) {
            let (Some(socket), Some(bytes)) =
                (self.sockets.get(packet.endpoint), buffer.get(..packet.len))
            else {
                continue;
            };
            let _lost_is_silence = match packet.peer {
                Some(peer) => socket.send_to(bytes, peer),
                None => socket.send(bytes),
            };
        }
    }
}

fn open_socket(endpoint: &Endpoint) -> Result<UdpSocket, LinkError> {
    match *endpoint {
        Endpoint::UdpAt { local } => bind(local),
        Endpoint::UdpTo { remote } => {
            let any: SocketAddr = match remote {
                SocketAddr::V4(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
                SocketAddr::V6(_) => (Ipv6Addr::UNSPECIFIED, 0).into(),
            };
            let socket = bind(any)?;
            let connected = socket.connect(remote);
            connected.map_err(|cause| LinkError::Connect { address: remote, cause })?;
            Ok(socket)
        }
    }
}

fn bind(address: SocketAddr) -> Result<UdpSocket, LinkError> {
    let fail = |cause| LinkError::Bind { address, cause };
    let socket = UdpSocket::bind(address).map_err(fail)?;
    socket.set_nonblocking(true).map_err(fail)?;
    Ok(socket)
}
