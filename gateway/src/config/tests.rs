use super::*;

const PATH: &str = "cells/test.yaml";

fn parse(text: &str) -> Result<CellConfig, CellConfigError> {
    CellConfig::parse(text, Path::new(PATH))
}

fn refusal(text: &str) -> String {
    parse(text).expect_err("the file is wrong").to_string()
}

fn with_robots(robots: &str) -> String {
    format!("cell: test\nrobots:\n{robots}")
}

const TWO: &str = "  torso: {file: ../robots/torso.yaml, endpoint: tcp/127.0.0.1:7451}
  arm:
    file: /etc/arm.yaml
    endpoint: tcp/127.0.0.1:7452
    emulate: true
    mount: {parent: torso/carriage, pose: {position_m: {x: 0.1, y: 0, z: 0.2}}}
";

#[test]
fn a_file_without_options_has_the_documented_defaults() {
    let config = parse(&with_robots(TWO)).expect("valid");
    assert_eq!(config.listen, ["tcp/127.0.0.1:7447"]);
    assert_eq!(config.namespace, None);
    assert_eq!(config.motion, MotionTimers::default());
    assert_eq!(config.clearance, ClearanceConfig { required_m: 0.01, check: true });
    assert!(!config.robots[0].emulate);
    assert_eq!(config.robots[0].mount, Mount { parent: "world".into(), pose: Default::default() });
}

#[test]
fn robots_stay_in_order_and_files_are_beside_the_cell_file() {
    let config = parse(&with_robots(TWO)).expect("valid");
    let names: Vec<_> = config.robots.iter().map(|robot| robot.name.as_str()).collect();
    assert_eq!(names, ["torso", "arm"]);
    assert_eq!(config.robots[0].file, Path::new("cells/../robots/torso.yaml"));
    assert_eq!(config.robots[1].file, Path::new("/etc/arm.yaml"));
    assert_eq!(config.robots[1].mount.pose.position().z, 0.2);
    assert_eq!(config.cell_robots().nth(1).expect("two").endpoint, "tcp/127.0.0.1:7452");
}

#[test]
fn every_section_is_read() {
    let text = format!(
        "namespace: site/cell-7\ngateway: {{listen: [unixsock-stream//run/a.sock]}}\n\
         motion: {{start_lead_ms: 300, silence_ms: 500, ending_ms: 2000, clock_budget_ms: 1.5}}\n\
         clearance: {{required_m: 0.05, check: false}}\n{}",
        with_robots(TWO)
    );
    let config = parse(&text).expect("valid");
    assert_eq!(config.namespace.as_deref(), Some("site/cell-7"));
    assert_eq!(config.listen, ["unixsock-stream//run/a.sock"]);
    assert_eq!(config.motion.start_lead, Duration::from_millis(300));
    assert_eq!(config.motion.silence, Duration::from_millis(500));
    assert_eq!(config.motion.ending, Duration::from_secs(2));
    assert_eq!(config.motion.clock_budget, Duration::from_micros(1_500));
    assert_eq!(config.clearance, ClearanceConfig { required_m: 0.05, check: false });
}

#[test]
fn a_problem_is_told_with_path_line_and_the_line_itself() {
    let text = with_robots(&TWO.replace("torso/carriage", "tors/carriage"));
    let error = refusal(&text);
    assert!(error.starts_with("cells/test.yaml:8:21: mount parent \"tors/carriage\""), "{error}");
    assert!(error.contains("no robot \"tors\", it has arm, torso"), "{error}");
    assert!(error.contains("    8 |     mount: {parent: tors/carriage"), "{error}");
}

#[test]
fn a_syntax_error_is_told_with_path_and_line() {
    for (text, expected) in [
        (TWO.replace("emulate: true", "emulate: yes"), "bool"),
        (TWO.replace("emulate:", "emulated:"), "emulated"),
        (TWO.replace("  arm:", "  torso:"), "duplicate"),
        (TWO.replace("z: 0.2", "z: .nan"), "not finite"),
    ] {
        let error = refusal(&with_robots(&text));
        assert!(error.contains(PATH) && error.contains(expected), "{expected}: {error}");
        assert!(error.contains(" --> "), "no snippet: {error}");
    }
}

#[test]
fn every_kind_of_senseless_value_is_refused() {
    let two = with_robots(TWO);
    for (text, expected) in [
        (two.replace("cell: test", "cell: Test cell"), "is not a name"),
        (two.replace("  arm:", "  Arm:"), "\"Arm\" is not a robot name"),
        (format!("namespace: a//b\n{two}"), "namespace \"a//b\" is not a key"),
        (format!("namespace: a/*\n{two}"), "namespace \"a/*\" is not a key"),
        (with_robots("  {}\n"), "0 robots, expected 1 to 64"),
        (format!("gateway: {{listen: []}}\n{two}"), "gateway.listen is empty"),
        (two.replace("tcp/127.0.0.1:7452", "127.0.0.1:7452"), "cannot be dialled"),
        (two.replace("tcp/127.0.0.1:7452", "tcp/127.0.0.1:0"), "cannot be dialled"),
        (two.replace("7452", "7451"), "is already used by torso"),
        (two.replace("7452", "7447"), "is already used by the gateway"),
        (two.replace("torso/carriage", "torso"), "is neither world nor ROBOT/LINK"),
        (two.replace("torso/carriage", "arm/tool0"), "mount of arm never reaches the world"),
        (format!("motion: {{start_lead_ms: 1}}\n{two}"), "start_lead_ms is 1 ms, expected 20 to"),
        (format!("motion: {{clock_budget_ms: 60}}\n{two}"), "is 60 ms, expected 0.1 to 50"),
        (format!("clearance: {{required_m: 0}}\n{two}"), "required_m is 0 m, expected 0.001 to 1"),
        (format!("motion: {{lead_ms: 1}}\n{two}"), "no timer \"lead_ms\", it has start_lead_ms,"),
    ] {
        let error = refusal(&text);
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn robots_that_carry_each_other_are_refused() {
    let text = with_robots(
        "  a: {file: a.yaml, endpoint: tcp/h:1, mount: {parent: b/x}}
  b: {file: b.yaml, endpoint: tcp/h:2, mount: {parent: c/x}}
  c: {file: c.yaml, endpoint: tcp/h:3, mount: {parent: b/y}}
",
    );
    let error = refusal(&text);
    assert!(error.contains(":3:56: mount of a never reaches the world"), "{error}");
}

#[test]
fn a_file_that_does_not_exist_is_told_by_its_path() {
    let error = CellConfig::load(Path::new("nowhere/cell.yaml")).expect_err("no file").to_string();
    assert!(error.starts_with("cannot read the cell file nowhere/cell.yaml"), "{error}");
}
