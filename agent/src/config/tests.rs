//! Robot files that are taken, and errors that say what is wrong where.

use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::time::Duration;

use armada_model::{JointType, RobotModel};

use super::*;
use crate::drivers::VENDORS;

/// A smallest robot file; `{}` stands where a test adds to it.
const ARM: &str = "\
robot: arm
uuid: 0a0a0a0a-0000-4000-8000-000000000001
model: two-joint arm
urdf: arm.urdf
joints:
  turn: { acceleration_rad_s2: 5.0 }
  slide: { acceleration_m_s2: 0.5 }
driver:
  sim: { address: '127.0.0.1:47199' }
";

const URDF: &str = r#"<robot name="arm">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="tip"/><link name="side"/>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="3" effort="50"/>
    <safety_controller k_velocity="1" soft_lower_limit="-1.9" soft_upper_limit="1.9"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="fore"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.5" velocity="0.2" effort="100"/>
  </joint>
  <joint name="weld" type="fixed"><parent link="fore"/><child link="tip"/></joint>
  <joint name="follow" type="continuous">
    <parent link="base"/><child link="side"/><axis xyz="0 0 1"/><mimic joint="turn"/>
  </joint>
</robot>"#;

fn parse(text: &str) -> Result<RobotConfig, ConfigError> {
    RobotConfig::from_yaml(text, "arm.yaml", Path::new("robots"))
}

fn model() -> RobotModel {
    RobotModel::from_urdf(URDF, "arm.urdf").expect("a robot description")
}

/// The error of the smallest file with `from` replaced by `to`, found with or without the model.
fn error_of(from: &str, to: &str) -> String {
    assert_eq!(ARM.matches(from).count(), 1, "{from:?} must stand in the file once");
    let config = match parse(&ARM.replace(from, to)) {
        Err(error) => return error.to_string(),
        Ok(config) => config,
    };
    let checked = config.params(&model()).and_then(|_| config.chain_infos(&model()));
    checked.expect_err(to).to_string()
}

#[test]
fn a_file_that_says_nothing_else_has_the_documented_defaults() {
    let config = parse(ARM).expect("valid");
    assert_eq!(config.control, ControlConfig::default());
    assert_eq!(config.publish, PublishConfig::default());
    assert_eq!(config.zenoh, ZenohConfig::default());
    assert_eq!(config.serial, "");
    assert_eq!(config.urdf, Path::new("robots/arm.urdf"));
    assert_eq!(config.driver.vendor(), "sim");
}

#[test]
fn joints_keep_the_order_of_the_file() {
    let config = parse(ARM).expect("valid");
    let names: Vec<_> = config.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["turn", "slide"]);
    let list = "joints: [slide, turn]\n";
    let (before, after) = ARM.split_once("joints:").expect("joints");
    let (_, after) = after.split_once("0.5 }\n").expect("the last joint");
    let config = parse(&format!("{before}{list}{after}")).expect("valid");
    let names: Vec<_> = config.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["slide", "turn"]);
    let error = config.params(&model()).expect_err("URDF gives no acceleration").to_string();
    assert!(error.contains("joints.slide.acceleration_m_s2: is missing"), "{error}");
}

#[test]
fn limits_are_those_of_the_description_as_the_file_narrows_them() {
    let text = ARM.replace("rad_s2: 5.0", "rad_s2: 5.0, lower_rad: -1.0, velocity_rad_s: 1.5");
    let config = parse(&text).expect("valid");
    let joints = config.joint_infos(&model()).expect("fits");
    let turn = joints[0].limits;
    assert_eq!(joints[0].joint_type, JointType::Revolute);
    assert_eq!((turn.lower, turn.upper), (Some(-1.0), Some(1.9)), "soft limits narrow as well");
    assert_eq!((turn.velocity, turn.acceleration, turn.effort), (1.5, Some(5.0), Some(50.0)));
    assert_eq!(joints[1].joint_type, JointType::Prismatic);
    assert_eq!(joints[1].limits.acceleration, Some(0.5));
}

#[test]
fn reduced_limits_are_a_quarter_of_the_speed_and_all_of_the_acceleration_unless_given() {
    let params = parse(ARM).expect("valid").params(&model()).expect("fits");
    let [turn, slide] = [params.reduced[0], params.reduced[1]];
    assert_eq!((turn.velocity, turn.acceleration), (0.75, 5.0));
    assert_eq!((slide.velocity, slide.acceleration), (0.05, 0.5));
    let given = "rad_s2: 5.0, reduced_velocity_rad_s: 0.5, reduced_acceleration_rad_s2: 2";
    let params = parse(&ARM.replace("rad_s2: 5.0", given)).expect("valid");
    let reduced = params.params(&model()).expect("fits").reduced[0];
    assert_eq!((reduced.velocity, reduced.acceleration), (0.5, 2.0));
}

#[test]
fn homes_and_the_operational_mode_reach_the_loop_and_default_to_none() {
    use armada_protocol::messages::OperationalMode::{Cobot, Undefined};
    let params = parse(ARM).expect("valid").params(&model()).expect("fits");
    assert_eq!((params.home, params.operational_mode), (vec![None, None], Undefined));
    assert_eq!(params.homing_timeout, Duration::from_secs(60));
    let control = "control: {operational_mode: cobot, homing_timeout_ms: 2000}\ndriver:\n";
    let text = ARM.replace("m_s2: 0.5", "m_s2: 0.5, home_m: 0.25").replace(DRIVER, control);
    let params = parse(&text).expect("valid").params(&model()).expect("fits");
    assert_eq!((params.home, params.operational_mode), (vec![None, Some(0.25)], Cobot));
    assert_eq!(params.homing_timeout, Duration::from_secs(2));
}

#[test]
fn tolerances_of_the_loop_are_in_the_unit_of_each_joint() {
    let params = parse(ARM).expect("valid").params(&model()).expect("fits");
    assert_eq!(&*params.start_tolerance, &[0.02, 0.005]);
    assert_eq!(&*params.tracking_tolerance, &[0.1, 0.02]);
    assert_eq!(&*params.standstill_velocity, &[0.01, 0.002]);
    assert_eq!(params.period, Duration::from_millis(2));
    assert_eq!(params.limits.len(), 2);
    assert!(!params.enable_on_start);
}

#[test]
fn an_error_names_file_line_field_value_and_limit() {
    let text = format!("{ARM}control:\n  enable_on_start: false\n  period_ms: 0.1\n");
    assert_eq!(
        parse(&text).expect_err("too fast").to_string(),
        "arm.yaml:12:14: control.period_ms: 0.1 is outside 0.5 to 100\n   12 |   period_ms: 0.1\n      |              ^"
    );
}

#[test]
fn what_the_description_does_not_allow_is_found_with_its_line() {
    assert_eq!(
        error_of("rad_s2: 5.0", "rad_s2: 5.0, upper_rad: 2.5"),
        "arm.yaml:6:48: joints.turn.upper_rad: 2.5 is above the robot description's limit 1.9; \
         limits can only be narrowed\n    6 |   turn: { acceleration_rad_s2: 5.0, upper_rad: 2.5 }\n      \
         |                                                ^"
    );
}

const SLIDE: &str = "slide: { acceleration_m_s2: 0.5 }";
const DRIVER: &str = "driver:\n";

/// Part of the smallest file, what stands in its place, and what the error must hold.
type Case = (&'static str, &'static str, &'static str);

fn check_cases(cases: &[Case]) {
    for (from, to, expected) in cases {
        let message = error_of(from, to);
        assert!(message.contains(expected), "{to:?} gave {message:?}, not {expected:?}");
        assert!(message.starts_with("arm.yaml:"), "{to:?} gave no place: {message}");
        assert!(!message.starts_with("arm.yaml:0"), "{to:?} gave no line: {message}");
    }
}

#[test]
fn identity_and_paths_that_say_nothing_are_refused() {
    check_cases(&[
        ("robot: arm", "robot: Left Arm", "is not a robot name"),
        ("robot: arm", "robots: arm", "robots"),
        ("model: two-joint arm", "model: ''", "model: is empty"),
        ("model: two-joint arm", "model: 5\nmodel: 6", "model"),
        ("0a0a0a0a-0000-4000-8000-000000000001", "17", "arm.yaml:2:"),
        ("0a0a0a0a-0000-4000-8000-000000000001", "00000000-0000-0000-0000-000000000000", "is nil"),
        ("urdf: arm.urdf", "urdf: ''", "urdf: is empty"),
    ]);
}

#[test]
fn limits_that_no_joint_or_not_this_joint_may_have_are_refused() {
    check_cases(&[
        (SLIDE, "turn: {}", "turn"),
        (SLIDE, "slide: {}", "joints.slide.acceleration_m_s2: is missing"),
        (SLIDE, "slide:", "joints.slide.acceleration_m_s2: is missing"),
        (SLIDE, "slide: { acceleration_m_s2: .nan }", "acceleration_m_s2: NaN is outside 0"),
        (SLIDE, "slide: { acceleration_m_s2: .inf }", "acceleration_m_s2: inf is outside 0"),
        (SLIDE, "slide: { acceleration_m_s2: 0 }", "0 is outside 0 (exclusive) to 10000"),
        (SLIDE, "slide: { acceleration_m_s2: fast }", "arm.yaml:7:"),
        (SLIDE, "slide: { accel: 1 }", "accel"),
        (SLIDE, "slide: { acceleration_rad_s2: 1 }", "the joint slides, give acceleration_m_s2"),
        (SLIDE, "slide: { acceleration_m_s2: 1, velocity_m_s: 0.3 }", "limit 0.2"),
        (SLIDE, "slide: { acceleration_m_s2: 1, lower_m: -0.1 }", "-0.1 is below"),
        (SLIDE, "slide: { acceleration_m_s2: 1, lower_m: .nan }", "lower_m: NaN is outside -10000"),
        (SLIDE, "slide: { acceleration_m_s2: 1, lower_m: 0.5 }", "lower 0.5 and upper 0.5"),
        (SLIDE, "slide: { acceleration_m_s2: 1, home_m: 0.6 }", "0.6 is outside the joint's"),
        (SLIDE, "slide: { acceleration_m_s2: 1, home_m: .nan }", "home_m: NaN is outside -10000"),
        (SLIDE, "slide: { acceleration_m_s2: 1, home_rad: 0.1 }", "slides, give home_m"),
        (
            SLIDE,
            "slide: { acceleration_m_s2: 1, reduced_velocity_m_s: 0.3 }",
            "reduced_velocity_m_s: 0.3 is above the joint's limit 0.2",
        ),
        (
            SLIDE,
            "slide: { acceleration_m_s2: 1, reduced_acceleration_m_s2: 2 }",
            "reduced_acceleration_m_s2: 2 is above the joint's limit 1",
        ),
        (SLIDE, "slide: { acceleration_m_s2: 1, reduced_velocity_m_s: 0 }", "0 is outside 0"),
        (SLIDE, "glide: { acceleration_m_s2: 1 }", "no such joint, it has turn, slide"),
        (SLIDE, "weld: { acceleration_m_s2: 1 }", "joints.weld: is a fixed joint"),
        (SLIDE, "follow: { acceleration_rad_s2: 1 }", "joints.follow: mimics another joint"),
    ]);
}

#[test]
fn chains_that_the_description_does_not_have_are_refused() {
    check_cases(&[
        (DRIVER, "chains: [{name: a, base_link: base}]\ndriver:\n", "tip_link"),
        (
            DRIVER,
            "chains: [{name: a, base_link: base, tip_link: nose}]\ndriver:\n",
            "chains.0.tip_link: the robot description has no link \"nose\"",
        ),
        (
            DRIVER,
            "chains: [{name: a, base_link: side, tip_link: tip}]\ndriver:\n",
            "chains.0.tip_link: \"tip\" is not carried by \"side\"",
        ),
        (
            DRIVER,
            "chains: [{name: a, base_link: base, tip_link: tip}, \
             {name: a, base_link: base, tip_link: tip}]\ndriver:\n",
            "chains.1.name: \"a\" is given twice",
        ),
    ]);
}

#[test]
fn values_that_no_loop_may_have_are_refused() {
    check_cases(&[
        (DRIVER, "control: {period_ms: .nan}\ndriver:\n", "control.period_ms: NaN is outside"),
        (DRIVER, "control: {operational_mode: fast}\ndriver:\n", "fast"),
        (
            DRIVER,
            "control: {homing_timeout_ms: 50}\ndriver:\n",
            "control.homing_timeout_ms: 50 is outside 100 to 600000",
        ),
        (DRIVER, "control: {period: 2}\ndriver:\n", "period"),
        (
            DRIVER,
            "control: {period_ms: 10, communication_timeout_ms: 15}\ndriver:\n",
            "control.communication_timeout_ms: 15 is outside 20 to 5000",
        ),
        (DRIVER, "control: {enable_on_start: yes}\ndriver:\n", "arm.yaml:8:"),
        (
            DRIVER,
            "control: {start_tolerance_rad: 0}\ndriver:\n",
            "start_tolerance_rad: 0 is outside",
        ),
        (
            DRIVER,
            "control: {realtime: {priority: 100}}\ndriver:\n",
            "control.realtime.priority: 100 is outside 1 to 99",
        ),
        (
            DRIVER,
            "publish: {state_rate_hz: 501}\ndriver:\n",
            "publish.state_rate_hz: 501 is outside 1 to 500",
        ),
        (
            DRIVER,
            "publish: {state_rate_hz: 19}\ndriver:\n",
            "publish.state_rate_hz: 19 is below 20: a stream needs a state that is younger than \
             control.stream_max_age_ms, which is 100",
        ),
        (
            DRIVER,
            "publish: {state_classes_hz: [10, 501]}\ndriver:\n",
            "publish.state_classes_hz: 501 is outside 1 to 500",
        ),
        (
            DRIVER,
            "publish: {state_classes_hz: [10, 1, 10]}\ndriver:\n",
            "publish.state_classes_hz: 10 is given twice",
        ),
        (
            DRIVER,
            "publish: {state_classes_hz: [1, 2, 3, 4, 5, 6, 7, 8, 9]}\ndriver:\n",
            "publish.state_classes_hz: 9 rates, above the limit 8",
        ),
        (
            DRIVER,
            "control: {stream_timeout_ms: 201}\ndriver:\n",
            "control.stream_timeout_ms: 201 is outside 8 to 200",
        ),
        (
            DRIVER,
            "control: {stream_max_age_ms: 10}\ndriver:\n",
            "control.stream_max_age_ms: 10 is outside 20 to 1000",
        ),
        (DRIVER, "publish: {encoding: xml}\ndriver:\n", "json"),
        (DRIVER, "zenoh: {listen: [localhost]}\ndriver:\n", "zenoh.listen.0: \"localhost\" is not"),
    ]);
}

#[test]
fn driver_tables_that_are_not_one_vendors_are_refused() {
    check_cases(&[
        ("  sim: {", "  abb: {", "abb"),
        ("  sim: { address: '127.0.0.1:47199' }", "  {}", "arm.yaml:"),
        ("'127.0.0.1:47199'", "localhost", "arm.yaml:9:"),
        ("47199'", "47199', port: 3", "port"),
        (
            "47199'",
            "47199', emulator: {time_constant_ms: 0}",
            "driver.sim.emulator.time_constant_ms: 0 is outside 1 to 1000",
        ),
        (
            "47199'",
            "47199', emulator: {initial_rad: {turn: .inf}}",
            "driver.sim.emulator.initial_rad.turn: inf is outside -1000 to 1000",
        ),
    ]);
}

#[test]
fn two_vendors_in_one_file_are_refused() {
    let message = error_of(
        "  sim: { address: '127.0.0.1:47199' }",
        "  sim: { address: '127.0.0.1:47199' }\n  abb: {}",
    );
    assert!(message.starts_with("arm.yaml:10:"), "{message}");
}

#[test]
fn a_file_of_unreasonable_size_or_depth_is_refused() {
    let large = format!("{ARM}#{}", " ".repeat(2 << 20));
    let message = parse(&large).expect_err("too large").to_string();
    assert!(message.contains("above the limit of 1048576 bytes"), "{message}");
    let deep = format!("{ARM}x: {}{}", "[".repeat(100), "]".repeat(100));
    assert!(matches!(parse(&deep), Err(ConfigError::Syntax { .. })));
}

#[test]
fn a_file_that_is_missing_is_named() {
    let error = RobotConfig::load(Path::new("no/such/robot.yaml")).expect_err("missing");
    assert!(error.to_string().starts_with("no/such/robot.yaml: "), "{error}");
}

#[test]
fn every_robot_file_of_the_project_loads_with_its_description() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots");
    let entries = std::fs::read_dir(&folder).expect("config/robots");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let files: Vec<PathBuf> =
        paths.filter(|path| path.extension() == Some("yaml".as_ref())).collect();
    assert!(files.len() >= 3, "found only {files:?}");
    let mut uuids = Vec::new();
    for file in &files {
        let config = RobotConfig::load(file).unwrap_or_else(|error| panic!("{error}"));
        let (_, model) = config.read_urdf().unwrap_or_else(|error| panic!("{error}"));
        config.params(&model).unwrap_or_else(|error| panic!("{error}"));
        config.chain_infos(&model).unwrap_or_else(|error| panic!("{error}"));
        let setup = config.driver_setup(&model, NonZeroU64::MIN).expect("params were made");
        config.driver.driver(&setup).unwrap_or_else(|error| panic!("{error}"));
        config.driver.emulator(&setup).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(Some(config.robot.as_str()), file.file_stem().and_then(|stem| stem.to_str()));
        assert!(!uuids.contains(&config.uuid), "{} has the uuid of another", file.display());
        uuids.push(config.uuid);
    }
}

#[test]
fn what_is_not_known_is_answered_with_what_is() {
    assert_eq!(
        error_of("robot: arm", "robots: arm"),
        "arm.yaml:1:1: unknown field `robots`, expected one of robot, uuid, model, serial, urdf, \
         joints, chains, tools, mount, control, stop, publish, recorder, zenoh, driver\n    1 | robots: arm\n      | ^"
    );
    let message = error_of("  sim: {", "  abb: {");
    let vendors = VENDORS.join(", ");
    let expected = format!("arm.yaml:9:3: unknown variant `abb`, expected one of {vendors}\n");
    assert!(message.starts_with(&expected), "{message}");
}

#[test]
fn a_slow_loop_has_those_default_rates_of_the_state_that_it_can_keep() {
    let classes = |rate_hz: f64| PublishConfig::default().state_classes(rate_hz);
    assert_eq!((classes(500.0), classes(10.0)), (vec![1, 10, 30], vec![1, 10]));
}
