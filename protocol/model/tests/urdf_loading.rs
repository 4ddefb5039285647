//! What real robot files do and a loader must take, and what the model then holds.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

use armada_model::{JointLimits, JointType, PositionSource, RobotModel, Shape};
use nalgebra::{UnitQuaternion, Vector3};

fn load(text: &str) -> RobotModel {
    RobotModel::from_urdf(text, "robot.urdf").unwrap_or_else(|error| panic!("{error}"))
}

/// Links `a` and `b` with one joint `j` between them.
fn with_joint(version: &str, joint_type: &str, content: &str) -> RobotModel {
    load(&format!(
        r#"<robot name="r" version="{version}"><link name="a"/><link name="b"/>
           <joint name="j" type="{joint_type}"><parent link="a"/><child link="b"/>{content}</joint>
           </robot>"#
    ))
}

fn limits(version: &str, joint_type: &str, limit: &str) -> JointLimits {
    let model = with_joint(version, joint_type, limit);
    model.variables().next().expect("one driven joint").motion.limits
}

/// A robot of the given links and joints `name parent child`, in this order.
fn tree(links: &[&str], joints: &[(&str, &str, &str)]) -> RobotModel {
    let links: String = links.iter().map(|name| format!(r#"<link name="{name}"/>"#)).collect();
    let joints: String = joints
        .iter()
        .map(|(name, parent, child)| {
            format!(
                r#"<joint name="{name}" type="continuous">
                   <parent link="{parent}"/><child link="{child}"/></joint>"#
            )
        })
        .collect();
    load(&format!(r#"<robot name="tree">{links}{joints}</robot>"#))
}

#[test]
fn links_are_sorted_from_the_root_and_joints_keep_their_order() {
    let model = tree(
        &["hand", "left", "finger", "base", "right"],
        &[
            ("f", "hand", "finger"),
            ("r", "base", "right"),
            ("h", "left", "hand"),
            ("l", "base", "left"),
        ],
    );
    let links: Vec<_> = model.links().iter().map(|link| link.name.as_str()).collect();
    assert_eq!(links, ["base", "right", "left", "hand", "finger"]);
    let joints: Vec<_> = model.variables().map(|variable| variable.name).collect();
    assert_eq!(joints, ["f", "r", "h", "l"]);
    for (index, link) in model.links().iter().enumerate() {
        assert_eq!(model.link_index(&link.name), Some(index));
        if let Some(joint) = link.parent_joint {
            let joint = &model.joints()[joint];
            assert_eq!(joint.child, index);
            assert!(joint.parent < index, "{} stands before its parent", link.name);
        }
    }
    assert_eq!(model.links()[0].parent_joint, None);
}

#[test]
fn names_lead_to_links_joints_and_variables() {
    let model = load(
        r#"<robot name="hand"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
        <joint name="fix" type="fixed"><parent link="a"/><child link="b"/></joint>
        <joint name="follower" type="continuous">
          <parent link="b"/><child link="c"/><mimic joint="leader"/></joint>
        <joint name="leader" type="continuous"><parent link="c"/><child link="d"/></joint></robot>"#,
    );
    assert_eq!((model.name(), model.variable_count()), ("hand", 1));
    assert_eq!(model.joint_index("leader"), Some(2));
    assert_eq!(model.variable_index("leader"), Some(0));
    assert_eq!(model.variable_index("follower"), None);
    assert_eq!(model.variable_index("fix"), None);
    assert_eq!((model.joint_index("x"), model.link_index("x")), (None, None));
    let position = model.joints()[1].motion.as_ref().expect("it moves").position;
    let expected = PositionSource::Mimic { variable: 0, multiplier: 1.0, offset: 0.0 };
    assert_eq!(position, expected);
}

#[test]
fn a_mimic_of_a_mimic_follows_the_driven_joint() {
    let model = load(
        r#"<robot name="m"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
        <joint name="x" type="continuous"><parent link="a"/><child link="b"/>
          <mimic joint="y" multiplier="-2" offset="0.5"/></joint>
        <joint name="y" type="continuous"><parent link="b"/><child link="c"/>
          <mimic joint="z" multiplier="3" offset="0.25"/></joint>
        <joint name="z" type="continuous"><parent link="c"/><child link="d"/></joint></robot>"#,
    );
    let position = model.joints()[0].motion.as_ref().expect("it moves").position;
    // -2 (3 z + 0.25) + 0.5
    let expected = PositionSource::Mimic { variable: 0, multiplier: -6.0, offset: 0.0 };
    assert_eq!(position, expected);
    assert!((position.evaluate(&[0.1]) + 0.6).abs() < 1e-15);
}

#[test]
fn the_axis_is_x_by_default_and_of_unit_length_always() {
    let axis = |content: &str| {
        let model = with_joint("1.0", "continuous", content);
        model.variables().next().expect("one").motion.axis.into_inner()
    };
    assert_eq!(axis(""), Vector3::x());
    assert_eq!(axis(r#"<axis xyz="0 0 -5"/>"#), -Vector3::z());
    assert_eq!(axis(r#"<axis xyz="0 1e300 0"/>"#), Vector3::y());
    let oblique = axis(r#"<axis xyz="0.3 0.4 1.2"/>"#);
    assert!((oblique - Vector3::new(3.0, 4.0, 12.0) / 13.0).amax() < 1e-15, "{oblique}");
}

#[test]
fn limits_are_as_the_file_gives_them() {
    assert_eq!(
        limits("1.0", "revolute", r#"<limit lower="-1" upper="2" velocity="3" effort="4"/>"#),
        JointLimits {
            lower: Some(-1.0),
            upper: Some(2.0),
            velocity: 3.0,
            acceleration: None,
            jerk: None,
            effort: Some(4.0)
        }
    );
    let equal = limits("1.0", "revolute", r#"<limit lower="1" upper="1" velocity="0"/>"#);
    assert_eq!((equal.lower, equal.upper, equal.velocity), (Some(1.0), Some(1.0), 0.0));
    assert_eq!(equal.effort, None);
}

#[test]
fn a_missing_position_limit_is_zero_before_version_1_2_and_open_from_then() {
    let limit = r#"<limit velocity="1" acceleration="5" deceleration="4"/>"#;
    let old = limits("1.0", "prismatic", limit);
    assert_eq!((old.lower, old.upper, old.acceleration), (Some(0.0), Some(0.0), None));
    let new = limits("1.2", "prismatic", limit);
    assert_eq!((new.lower, new.upper, new.acceleration), (None, None, Some(4.0)));
}

#[test]
fn a_continuous_joint_has_no_position_limits_whatever_the_file_says() {
    assert_eq!(limits("1.0", "continuous", ""), JointLimits::default());
    let partial = limits("1.0", "continuous", r#"<limit effort="30"/>"#);
    assert_eq!(partial, JointLimits { effort: Some(30.0), ..JointLimits::default() });
    let full = limits("1.0", "continuous", r#"<limit lower="-1" upper="1" velocity="2"/>"#);
    assert_eq!(full, JointLimits { velocity: 2.0, ..JointLimits::default() });
}

#[test]
fn soft_limits_stand_beside_the_hard_ones() {
    let soft_limits = |controller: &str| {
        let content = format!(r#"<limit lower="-1" upper="1" velocity="1"/>{controller}"#);
        let model = with_joint("1.0", "revolute", &content);
        model.variables().next().expect("one").motion.soft_limits
    };
    assert_eq!(soft_limits(""), None);
    let full = r#"<safety_controller soft_lower_limit="-0.9" soft_upper_limit="0.8"
                  k_position="100" k_velocity="40"/>"#;
    let soft = soft_limits(full).expect("given");
    assert_eq!((soft.lower, soft.upper), (Some(-0.9), Some(0.8)));
    assert_eq!((soft.k_position, soft.k_velocity), (100.0, 40.0));
    let velocity_only = soft_limits(r#"<safety_controller k_velocity="10"/>"#).expect("given");
    assert_eq!((velocity_only.lower, velocity_only.upper), (None, None));
}

#[test]
fn a_fixed_joint_keeps_only_its_origin() {
    let model = with_joint(
        "1.0",
        "fixed",
        r#"<origin xyz="1 2 3"/><axis xyz="0 0 0"/><limit lower="1" upper="0" velocity="-1"/>
           <mimic joint="nobody"/>"#,
    );
    assert_eq!(model.variable_count(), 0);
    assert_eq!(model.joints()[0].origin.position(), &Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(model.joints()[0].motion, None);
}

#[test]
fn foreign_elements_and_namespaces_are_passed_over() {
    let model = load(
        r#"<robot xmlns="http://drake.mit.edu" xmlns:g="urn:g" name="r">
        <g:link name="ghost"/><gazebo><link name="a"/></gazebo><frame name="f" link="a" xyz="x"/>
        <link name="a" g:name="b" type="x"><g:visual/><g:inertial/><verbose value="Gripper"/></link>
        <link name="b"/>
        <joint name="j" type="revolute" g:type="planar"><g:origin xyz="nonsense"/>
          <parent link="a" g:link="b"/><child link="b"/><calibration rising="0"/>
          <limit lower="-1" upper="1" velocity="1" g:velocity="-9" g:acceleration="many"/></joint>
        <transmission name="t" type="old"><actuator name="m"/><joint name="j"/></transmission>
        </robot>"#,
    );
    assert_eq!((model.links().len(), model.joints().len()), (2, 1));
    assert_eq!(model.variables().next().expect("j").motion.limits.velocity, 1.0);
}

#[test]
fn marks_in_names_survive() {
    let model =
        tree(&["a&amp;&lt;b", "ü \u{1F916}"], &[("&quot;j&apos;", "a&amp;&lt;b", "ü \u{1F916}")]);
    assert_eq!(model.link_index("a&<b"), Some(0));
    assert_eq!(model.link_index("ü \u{1F916}"), Some(1));
    assert_eq!(model.variable_index("\"j'"), Some(0));
}

#[test]
fn shapes_colours_and_masses_are_kept_as_data() {
    let model = load(
        r#"<robot name="r"><material name="red"><color rgba="1 0 0 1"/></material><link name="a">
        <collision><geometry><capsule radius="0.1" length="0.2"/></geometry></collision>
        <visual><origin xyz="1 2 3"/><geometry><box size="1 2 3"/></geometry><material name="red"/></visual>
        <visual><geometry><cylinder radius="0" length="2"/></geometry>
          <material name="own"><color rgba="0 1 0 0.5"/></material></visual>
        <visual><geometry><sphere radius="3"/></geometry><material name="own"/></visual>
        <visual><geometry><mesh filename="package://r/a.stl" scale="1 -1 1"/></geometry>
          <material name="unknown"/></visual>
        <inertial><origin xyz="0 0 0.5"/><mass value="2"/>
          <inertia ixx="1" ixy="0.1" ixz="0.2" iyy="2" iyz="0.3" izz="3"/></inertial>
        </link></robot>"#,
    );
    let link = &model.links()[0];
    let shapes: Vec<_> = link.visuals.iter().map(|visual| visual.shape.clone()).collect();
    assert_eq!(
        shapes,
        [
            Shape::Box { size: [1.0, 2.0, 3.0] },
            Shape::Cylinder { radius: 0.0, length: 2.0 },
            Shape::Sphere { radius: 3.0 },
            Shape::Mesh { file: "package://r/a.stl".into(), scale: [1.0, -1.0, 1.0] },
        ]
    );
    assert_eq!(link.visuals[0].origin.position(), &Vector3::new(1.0, 2.0, 3.0));
    let green = Some([0.0, 1.0, 0.0, 0.5]);
    let colours: Vec<_> = link.visuals.iter().map(|visual| visual.colour).collect();
    assert_eq!(colours, [Some([1.0, 0.0, 0.0, 1.0]), green, green, None]);
    assert_eq!(link.collisions[0].shape, Shape::Capsule { radius: 0.1, length: 0.2 });
    let inertial = link.inertial.as_ref().expect("given");
    assert_eq!((inertial.mass, inertial.origin.position().z), (2.0, 0.5));
    assert_eq!((inertial.inertia[(1, 2)], inertial.inertia[(2, 1)]), (0.3, 0.3));
}

#[test]
fn a_link_without_inertial_has_no_mass() {
    let model = with_joint("1.0", "continuous", "");
    assert_eq!(model.links()[0].inertial, None);
    assert_eq!(model.joints()[0].motion.as_ref().expect("moves").joint_type, JointType::Continuous);
}

#[test]
fn quaternions_are_read_exactly_near_the_vertical_as_well() {
    let nearly_vertical = std::f64::consts::FRAC_PI_2 - 1e-3;
    for (roll, pitch, yaw) in [
        (0.3, -0.4, 2.5),
        (1.0, nearly_vertical, -2.0),
        (-2.0, -std::f64::consts::FRAC_PI_2, 0.7),
        (3.0, std::f64::consts::FRAC_PI_2, 3.0),
    ] {
        let expected = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let q = expected.quaternion() * 2.0;
        let content = format!(r#"<origin quat_xyzw="{} {} {} {}"/>"#, q.i, q.j, q.k, q.w);
        let model = with_joint("1.1", "fixed", &content);
        let read = model.joints()[0].origin.isometry().rotation;
        let difference =
            (read.to_rotation_matrix().matrix() - expected.to_rotation_matrix().matrix()).amax();
        assert!(difference < 1e-14, "rpy {roll} {pitch} {yaw}: off by {difference:e}");
    }
}
