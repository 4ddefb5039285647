use armada_protocol::RobotName;

use super::*;

const SLIDER: &str = r#"<robot name="slider">
  <link name="foot"/><link name="top"/>
  <joint name="lift" type="prismatic">
    <parent link="foot"/><child link="top"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="2" velocity="1" effort="1"/>
  </joint>
</robot>"#;

const TURNER: &str = r#"<robot name="turner">
  <link name="root"/><link name="hand"/>
  <joint name="turn" type="continuous">
    <parent link="root"/><child link="hand"/><origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
    <limit velocity="1" effort="1"/>
  </joint>
</robot>"#;

fn name(robot: &str) -> RobotName {
    robot.parse().expect("a name")
}

fn info(robot: &str, urdf: &str, joint: &str) -> RobotInfo {
    let mut info: RobotInfo =
        serde_json::from_str(include_str!("../../../protocol/golden/robot_info.json"))
            .expect("golden sample");
    info.robot = name(robot);
    info.joints.truncate(1);
    joint.clone_into(&mut info.joints[0].name);
    urdf.clone_into(&mut info.urdf);
    info
}

fn cell() -> World {
    let robot = |robot: &str, parent: &str, x| CellRobot {
        robot: name(robot),
        mount: Mount { parent: parent.to_owned(), pose: Pose::from_translation(x, 0.0, 0.0) },
        endpoint: String::new(),
    };
    // The arm stands on the torso, though it comes first.
    World::new([robot("arm", "torso/top", 0.25), robot("torso", "world", 10.0)])
}

fn at(seconds: u64) -> MonoTime {
    MonoTime::ZERO + Duration::from_secs(seconds)
}

fn positions(value: f64) -> JointVector {
    JointVector::from_slice(&[value]).expect("finite")
}

fn described() -> World {
    let mut world = cell();
    assert!(world.set_model(&info("torso", SLIDER, "lift")).is_empty());
    assert!(world.set_model(&info("arm", TURNER, "turn")).is_empty());
    world.set_positions(&name("torso"), &positions(0.5));
    world.set_positions(&name("arm"), &positions(0.0));
    world
}

#[test]
fn a_robot_stands_on_the_link_that_carries_it() {
    let mut world = described();
    let frames = world.frames(at(0)).expect("all are new");
    assert!(frames.full);
    let hand = frames.frames["arm/hand"].position();
    assert!((hand - nalgebra::Vector3::new(10.75, 0.0, 1.5)).norm() < 1e-12, "{hand}");
    assert_eq!(frames.frames.len(), 4);
}

#[test]
fn only_links_that_moved_are_told() {
    let mut world = described();
    world.frames(at(0)).expect("all are new");
    assert_eq!(world.frames(at(0)), None);
    world.set_positions(&name("arm"), &positions(0.1));
    let frames = world.frames(at(0)).expect("the hand moved");
    assert!(!frames.full);
    assert_eq!(frames.frames.keys().collect::<Vec<_>>(), ["arm/hand"]);
    world.set_positions(&name("arm"), &positions(0.1 + 1e-9));
    assert_eq!(world.frames(at(0)), None, "less than the least motion");
    world.set_positions(&name("torso"), &positions(0.6));
    let frames = world.frames(at(0)).expect("it carries the arm");
    let moved: Vec<_> = frames.frames.keys().collect();
    assert_eq!(moved, ["arm/hand", "arm/root", "torso/top"]);
}

#[test]
fn slow_creep_is_told_as_soon_as_it_adds_up() {
    let mut world = described();
    world.frames(at(0)).expect("all are new");
    let mut told = 0;
    for step in 1..=20_u32 {
        world.set_positions(&name("arm"), &positions(f64::from(step) * 2e-7));
        told += usize::from(world.frames(at(0)).is_some());
    }
    assert_eq!(told, 3);
}

#[test]
fn every_link_is_told_once_a_second() {
    let mut world = described();
    world.frames(at(0)).expect("all are new");
    let frames = world.frames(at(1)).expect("a second is over");
    assert!(frames.full && frames.frames.len() == 4);
    assert_eq!(world.frames(at(1)), None);
}

#[test]
fn a_robot_whose_positions_are_not_known_is_left_out_with_what_stands_on_it() {
    let mut world = cell();
    world.set_model(&info("torso", SLIDER, "lift"));
    world.set_model(&info("arm", TURNER, "turn"));
    world.set_positions(&name("arm"), &positions(0.0));
    assert_eq!(world.frames(at(0)), None);
}

#[test]
fn a_broken_description_removes_its_robot_only() {
    let mut world = described();
    let errors = world.set_model(&info("arm", "<robot", "turn"));
    assert!(matches!(errors.as_slice(), [WorldError::Urdf { .. }]), "{errors:?}");
    let frames = world.frames(at(0)).expect("the torso");
    assert_eq!(frames.frames.keys().collect::<Vec<_>>(), ["torso/foot", "torso/top"]);
}

#[test]
fn a_description_that_does_not_fit_is_refused_by_joint_or_link() {
    let mut world = cell();
    let told = |errors: Vec<WorldError>| errors[0].to_string();
    assert_eq!(
        told(world.set_model(&info("torso", SLIDER, "raise"))),
        "torso: joint raise is no driven joint of its URDF"
    );
    let mut none = info("torso", SLIDER, "lift");
    none.joints.clear();
    assert_eq!(told(world.set_model(&none)), "torso: its URDF has 1 driven joints, but it tells 0");
    assert_eq!(
        told(world.set_model(&info("torso", TURNER, "turn"))),
        "arm: its mount parent \"torso/top\" is no link of that robot"
    );
    assert_eq!(
        told(world.set_model(&info("nobody", SLIDER, "lift"))),
        "the cell has no robot nobody"
    );
}

#[test]
fn positions_of_wrong_length_change_nothing() {
    let mut world = described();
    world.frames(at(0)).expect("all are new");
    world.set_positions(&name("arm"), &JointVector::from_slice(&[1.0, 2.0]).expect("finite"));
    world.set_positions(&name("arm"), &JointVector::EMPTY);
    assert_eq!(world.frames(at(0)), None);
}
