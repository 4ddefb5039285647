//! Ports that nobody listens on.

use std::net::{TcpListener, UdpSocket};

use anyhow::Result;

/// Ports of one cell.
#[derive(Debug)]
pub struct Ports {
    /// The gateway's.
    pub gateway: u16,
    /// The agents', in the order of the cell file.
    pub agents: Vec<u16>,
    /// The emulators', in the same order.
    pub emulators: Vec<u16>,
}

impl Ports {
    /// Free ports for a cell of so many robots.
    ///
    /// # Errors
    /// If the system has none left.
    pub fn free(robots: usize) -> Result<Self> {
        // All sockets are held until every port is known, so that no two are the same.
        let tcp = (0..=robots)
            .map(|_| TcpListener::bind("127.0.0.1:0"))
            .collect::<std::io::Result<Vec<_>>>()?;
        let udp = (0..robots)
            .map(|_| UdpSocket::bind("127.0.0.1:0"))
            .collect::<std::io::Result<Vec<_>>>()?;
        let mut tcp = tcp
            .iter()
            .map(|socket| Ok(socket.local_addr()?.port()))
            .collect::<std::io::Result<Vec<_>>>()?;
        let emulators = udp
            .iter()
            .map(|socket| Ok(socket.local_addr()?.port()))
            .collect::<std::io::Result<Vec<_>>>()?;
        let gateway = tcp.remove(0);
        Ok(Self { gateway, agents: tcp, emulators })
    }
}

/// A TCP port of loopback that nobody listens on.
///
/// # Errors
/// If the system has none left.
pub fn free_tcp_port() -> Result<u16> {
    Ok(TcpListener::bind("127.0.0.1:0")?.local_addr()?.port())
}
