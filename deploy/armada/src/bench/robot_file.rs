//! The robot that is measured: the seven-axis arm of `config/robots`, on ports of its own.

use std::io;
use std::net::{TcpListener, UdpSocket};
use std::os::unix::fs::DirBuilderExt as _;
use std::path::PathBuf;
use std::time::Duration;

use armada_model::{JointVector, JointVectorError};
use armada_protocol::RobotName;
use uuid::Uuid;

/// Part of this program, so that it needs no file beside it.
const URDF: &str = include_str!("../../../../config/robots/seven_axis_arm.urdf");

/// Its joints.
pub(super) const JOINTS: [&str; 7] =
    ["joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6", "joint_7"];
/// Acceleration limit of each joint \[rad/s²\].
pub(super) const ACCELERATION: f64 = 10.0;
/// Where its joints are at the start \[rad\].
const READY: [f64; 7] = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785];
/// Time constant of the emulated joints \[ms\].
const TIME_CONSTANT_MS: f64 = 8.0;

/// How a robot is to run.
#[derive(Clone, Debug)]
pub(super) struct RobotSpec {
    /// Its name.
    pub(super) name: RobotName,
    /// Period of its control loop.
    pub(super) period: Duration,
    /// How often it publishes its state \[Hz\].
    pub(super) state_rate_hz: u32,
    /// Priority of its loop under SCHED_FIFO.
    pub(super) priority: Option<u8>,
}

/// A folder for the files of a measurement; removed with all that is in it when dropped.
#[derive(Debug)]
pub(super) struct Folder(PathBuf);

impl Folder {
    /// A new folder that only this user may enter.
    pub(super) fn make() -> io::Result<Self> {
        let path = std::env::temp_dir().join(format!("armada-bench-{}", Uuid::new_v4()));
        std::fs::DirBuilder::new().mode(0o700).create(&path)?;
        Ok(Self(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What cannot be removed from a temporary directory is of no use to anybody.
        drop(std::fs::remove_dir_all(&self.0));
    }
}

/// Where the joints are at the start.
pub(super) fn ready_position() -> Result<JointVector, JointVectorError> {
    JointVector::from_slice(&READY)
}

/// Writes the files of a robot into `folder`; returns the path of its robot file. Its drives are
/// off at the start.
pub(super) fn write(folder: &Folder, spec: &RobotSpec) -> io::Result<PathBuf> {
    let port = free_udp_socket()?.local_addr()?.port();
    write_at(folder, spec, port, Drives::Off)
}

/// Writes the files of `arms` robots `arm_0`, `arm_1` and so on, of which `spec` says all but the
/// name; returns the paths of their robot files. Their drives are switched on at the start.
pub(super) fn write_fleet(
    folder: &Folder,
    spec: &RobotSpec,
    arms: u32,
) -> anyhow::Result<Vec<PathBuf>> {
    // All are held until all are there, so that no two are the same.
    let sockets = (0..arms).map(|_| free_udp_socket()).collect::<io::Result<Vec<_>>>()?;
    let file = |(index, socket): (usize, &UdpSocket)| {
        let spec = RobotSpec { name: format!("arm_{index}").parse()?, ..spec.clone() };
        Ok(write_at(folder, &spec, socket.local_addr()?.port(), Drives::On)?)
    };
    sockets.iter().enumerate().map(file).collect()
}

/// Whether the drives are switched on at the start.
#[derive(Clone, Copy, Debug)]
enum Drives {
    On,
    Off,
}

fn write_at(folder: &Folder, spec: &RobotSpec, port: u16, drives: Drives) -> io::Result<PathBuf> {
    let Folder(folder) = folder;
    let urdf = folder.join("seven_axis_arm.urdf");
    std::fs::write(&urdf, URDF)?;
    let file = folder.join(format!("{}.yaml", spec.name));
    std::fs::write(&file, text(spec, port, drives))?;
    Ok(file)
}

fn text(spec: &RobotSpec, port: u16, drives: Drives) -> String {
    let table = |row: &dyn Fn(&str, f64) -> String| {
        let rows = JOINTS.iter().zip(READY).map(|(joint, ready)| row(joint, ready));
        rows.collect::<Vec<_>>().join(", ")
    };
    let joints = table(&|joint, _| format!("{joint}: {{ acceleration_rad_s2: {ACCELERATION} }}"));
    let initial = table(&|joint, ready| format!("{joint}: {ready:?}"));
    let period_ms = spec.period.as_secs_f64() * 1e3;
    let lag_ms = TIME_CONSTANT_MS + 2.0 * period_ms;
    let priority = spec.priority.map_or_else(|| "null".to_owned(), |value| value.to_string());
    format!(
        "robot: {name}
uuid: {uuid}
model: seven-axis arm
urdf: seven_axis_arm.urdf
joints: {{ {joints} }}
chains: [{{ name: arm, base_link: base_link, tip_link: tool0 }}]
control:
  period_ms: {period_ms:?}
  tracking_lag_ms: {lag_ms:?}
  enable_on_start: {enable_on_start}
  realtime: {{ priority: {priority}, lock_memory: true }}
publish: {{ state_rate_hz: {state_rate_hz} }}
driver:
  sim:
    address: 127.0.0.1:{port}
    emulator: {{ time_constant_ms: {TIME_CONSTANT_MS:?}, initial_rad: {{ {initial} }} }}
",
        name = spec.name,
        uuid = Uuid::new_v4(),
        enable_on_start = matches!(drives, Drives::On),
        state_rate_hz = spec.state_rate_hz,
    )
}

fn free_udp_socket() -> io::Result<UdpSocket> {
    UdpSocket::bind("127.0.0.1:0")
}

/// A Zenoh endpoint that nobody listens on.
pub(super) fn free_endpoint() -> io::Result<String> {
    let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
    Ok(format!("tcp/127.0.0.1:{port}"))
}

#[cfg(test)]
mod tests {
    use armada_agent::config::RobotConfig;

    use super::*;

    #[test]
    fn robots_of_a_fleet_differ_in_name_identity_and_address() {
        let folder = Folder::make().expect("a folder");
        let spec = RobotSpec {
            name: "arm".parse().expect("a name"),
            period: Duration::from_millis(10),
            state_rate_hz: 100,
            priority: None,
        };
        let files = write_fleet(&folder, &spec, 20).expect("written");
        let configs = files.iter().map(|file| {
            let config = RobotConfig::load(file).unwrap_or_else(|error| panic!("{error}"));
            assert!(config.control.enable_on_start);
            (config.robot, config.uuid, format!("{:?}", config.driver))
        });
        let configs: Vec<_> = configs.collect();
        for (index, one) in configs.iter().enumerate() {
            for other in configs.iter().skip(index + 1) {
                assert!(one.0 != other.0 && one.1 != other.1 && one.2 != other.2, "{one:?}");
            }
        }
        assert_eq!(configs.len(), 20);
    }

    #[test]
    fn the_robot_file_is_valid_at_every_rate() {
        let folder = Folder::make().expect("a folder");
        for (rate, priority) in [(50, None), (100, Some(80)), (1000, Some(1)), (2000, Some(99))] {
            let spec = RobotSpec {
                name: "arm".parse().expect("a name"),
                period: Duration::from_secs(1) / rate,
                state_rate_hz: rate.min(100),
                priority,
            };
            let file = write(&folder, &spec).expect("written");
            let config = RobotConfig::load(&file).unwrap_or_else(|error| panic!("{error}"));
            let (_, model) = config.read_urdf().unwrap_or_else(|error| panic!("{error}"));
            let params = config.params(&model).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(params.period, spec.period);
            assert_eq!(config.control.realtime.priority, priority);
            assert_eq!(params.limits.len(), JOINTS.len());
        }
    }
}
