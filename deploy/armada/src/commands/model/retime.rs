//! `armada model retime`.

use anyhow::Context as _;
use armada_model::{
    CompiledTrajectory, Grid, Interpolation, JerkLimit, JointLimits, JointPath, JointTrajectory,
    JointType, MotionLimits, RetimeOptions, RobotModel, SplineEnds, TimedPath, TrajectoryOptions,
    Variable, retime, retime_jerk_limited,
};
use clap::Args;
use serde::Serialize;
use serde_json::Value;

use super::file::FileArgs;
use super::input::{STDIN, one_stdin, place_of, stdin, text_of};
use crate::exit::{Exit, UsageError};
use crate::output::{self, Output};
use crate::table::Table;

/// Share of a limit from which it counts as reached.
const SATURATED: f64 = 0.99;

/// Arguments of `armada model retime`.
#[derive(Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub(super) struct RetimeArgs {
    #[command(flatten)]
    file: FileArgs,
    /// Trajectory as JSON, or - for standard input
    #[arg(value_name = "TRAJECTORY.json")]
    trajectory: String,
    /// Points of the path at which limits are held; as many as it bends if left out
    #[arg(long, value_name = "N")]
    points: Option<usize>,
    /// Longest time between two waypoints of the result, in seconds
    #[arg(long, value_name = "S", default_value_t = 0.05)]
    spacing_s: f64,
    /// Keep limits of jerk too
    #[arg(long)]
    jerk_limited: bool,
    /// Accelerations as JSON {"NAME": VALUE}, @FILE or -, which replace those of the URDF; or one
    /// number for all joints for which it gives none, in rad/s² or m/s²
    #[arg(long, value_name = "JSON")]
    acceleration: Option<String>,
    /// Share of every velocity limit that may be used, above 0 and at most 1
    #[arg(long, value_name = "SHARE", default_value_t = 1.0)]
    velocity_scale: f64,
}

const AFTER_HELP: &str = "Examples:
  armada model retime arm.urdf pick.json --acceleration 5
  armada model retime arm.urdf pick.json --acceleration '{\"elbow\": 8}' --json | jq .trajectory
  armada model retime arm.urdf pick.json --jerk-limited --velocity-scale 0.5

Only joint_names, joint_units and joint_position are used: the path is the natural cubic spline
through the positions. Times, velocities, accelerations and tolerances are replaced or left out,
which is warned of. The result goes from rest to rest as fast as the limits of velocity and
acceleration allow, and `CompiledTrajectory::compile` accepts it.

With --json, one line: {\"robot\": NAME, \"trajectory\": {\"joint_names\", \"waypoints\", \"interpolation\"}
in rad and m, \"duration_s\", \"before_duration_s\": NUMBER, \"stretch\": factor by which waypoints
are slower than the path's own timing, \"saturations\": [{\"joint\", \"quantity\": NAME, \"time_s\",
\"share\": of the duration}], \"unsaturated_s\": NUMBER, \"warnings\": [TEXT]}.";

/// Why there is no retimed trajectory.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum RetimeInputError {
    #[error("{field}: {reason} at {place}")]
    NotJson { field: &'static str, reason: String, place: String },
    #[error("joint_names: there is no driven joint {name:?}; the driven joints are {names}")]
    UnknownJoint { name: String, names: String },
    #[error("joint_names: joint {name:?} stands twice")]
    RepeatedJoint { name: String },
    #[error("--acceleration: joint {name:?} is not one of the trajectory's: {names}")]
    UnknownAcceleration { name: String, names: String },
    #[error("--acceleration: {value} is not a finite number above 0")]
    NotAnAcceleration { value: String },
    #[error(
        "joint {name:?} has no acceleration limit in the URDF; give --acceleration VALUE or \
         --acceleration '{{{name:?}: VALUE}}'"
    )]
    NoAcceleration { name: String },
    #[error("--velocity-scale: {value}, expected above 0 and at most 1")]
    VelocityScale { value: f64 },
}

#[derive(Debug, Serialize)]
struct Answer<'m> {
    robot: &'m str,
    trajectory: JointTrajectory,
    duration_s: f64,
    before_duration_s: f64,
    stretch: f64,
    saturations: Vec<Share>,
    unsaturated_s: f64,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Share {
    joint: String,
    quantity: String,
    time_s: f64,
    share: f64,
}

/// Prints the trajectory with new times.
pub(super) fn run(args: &RetimeArgs) -> anyhow::Result<Exit> {
    let acceleration = args.acceleration.as_deref();
    one_stdin(&[Some(&args.file.file), Some(&args.trajectory), acceleration])?;
    let model = args.file.model()?;
    let text = if args.trajectory == STDIN {
        stdin()?
    } else {
        std::fs::read_to_string(&args.trajectory).with_context(|| args.trajectory.clone())?
    };
    let given: JointTrajectory =
        serde_json::from_str(&text).map_err(|e| not_json("trajectory", &text, &e))?;
    let answer = retimed(args, &model, &given)?;
    for warning in &answer.warnings {
        output::note(format_args!("warning: {warning}"));
    }
    let out = Output::new(args.file.json);
    if out.is_json() {
        out.json_line(&answer)?;
        return Ok(Exit::Success);
    }
    print(&answer, &out)?;
    Ok(Exit::Success)
}

fn not_json(field: &'static str, text: &str, error: &serde_json::Error) -> RetimeInputError {
    let reason = error.to_string();
    let reason = reason.split(" at line").next().unwrap_or_default().to_owned();
    RetimeInputError::NotJson { field, reason, place: place_of(text, error) }
}

fn retimed<'m>(
    args: &RetimeArgs,
    model: &'m RobotModel,
    given: &JointTrajectory,
) -> anyhow::Result<Answer<'m>> {
    let joints = joints(model, &given.joint_names)?;
    let types: Vec<JointType> = joints.iter().map(|joint| joint.motion.joint_type).collect();
    let path = given.to_si(&types)?;
    let names = &path.joint_names;
    let limits = limits(args, &joints)?;
    let limits = MotionLimits::new(&limits).map_err(|e| by_name(&e, names))?;
    let (rows, mut warnings) = rows(&path);
    warnings.extend(replaced(&path));
    let curve = JointPath::through(&rows, SplineEnds::Natural)?;
    let options = RetimeOptions {
        grid: args.points.map_or(Grid::Adaptive, Grid::Uniform),
        ..RetimeOptions::default()
    };
    let (timed, made, jerk) = if args.jerk_limited {
        let timed =
            retime_jerk_limited(&curve, &limits, &options).map_err(|e| by_name(&e, names))?;
        let made = timed.to_smooth_trajectory(names, args.spacing_s);
        (timed, made, JerkLimit::Enforced)
    } else {
        let timed = retime(&curve, &limits, &options).map_err(|e| by_name(&e, names))?;
        let made = timed.to_trajectory(names, args.spacing_s);
        (timed, made, JerkLimit::Ignored)
    };
    let made = made.map_err(|e| by_name(&e, names))?;
    let options = TrajectoryOptions { jerk, ..TrajectoryOptions::default() };
    let compiled = CompiledTrajectory::compile(&made.trajectory, names, &limits, &options)
        .context("the retimed trajectory is not accepted")?;
    let (saturations, unsaturated_s) = shares(&timed, names, made.stretch);
    Ok(Answer {
        robot: model.name(),
        duration_s: compiled.duration_s(),
        before_duration_s: path.waypoints.last().map_or(0.0, |last| last.time_from_start_s),
        stretch: made.stretch,
        trajectory: made.trajectory,
        saturations,
        unsaturated_s,
        warnings,
    })
}

/// The trajectory's joints in its order.
fn joints<'m>(
    model: &'m RobotModel,
    names: &[String],
) -> Result<Vec<Variable<'m>>, RetimeInputError> {
    let mut joints: Vec<Variable<'m>> = Vec::new();
    for name in names {
        if joints.iter().any(|joint| joint.name == name) {
            return Err(RetimeInputError::RepeatedJoint { name: name.clone() });
        }
        let found = model.variables().find(|joint| joint.name == name);
        joints.push(found.ok_or_else(|| {
            let known: Vec<_> = model.variables().map(|joint| joint.name).collect();
            RetimeInputError::UnknownJoint { name: name.clone(), names: known.join(", ") }
        })?);
    }
    Ok(joints)
}

/// Limits of the trajectory's joints, with accelerations and speeds as they are asked for.
fn limits(args: &RetimeArgs, joints: &[Variable<'_>]) -> anyhow::Result<Vec<JointLimits>> {
    let scale = args.velocity_scale;
    if !(scale > 0.0 && scale <= 1.0) {
        let error = RetimeInputError::VelocityScale { value: scale };
        return Err(UsageError(error.to_string()).into());
    }
    let mut limits: Vec<JointLimits> = joints.iter().map(|joint| joint.motion.limits).collect();
    if let Some(argument) = &args.acceleration {
        let text = text_of(argument)?;
        accelerate(&mut limits, joints, &text).map_err(|error| UsageError(error.to_string()))?;
    }
    for (limits, joint) in limits.iter_mut().zip(joints) {
        limits.velocity *= scale;
        if limits.acceleration.is_none() {
            let error = RetimeInputError::NoAcceleration { name: joint.name.to_owned() };
            return Err(UsageError(error.to_string()).into());
        }
    }
    Ok(limits)
}

/// Takes over accelerations: one for joints that have none, or those of joints by name.
fn accelerate(
    limits: &mut [JointLimits],
    joints: &[Variable<'_>],
    text: &str,
) -> Result<(), RetimeInputError> {
    let value: Value =
        serde_json::from_str(text).map_err(|error| not_json("--acceleration", text, &error))?;
    let above_zero = |value: &Value| {
        let number = value.as_f64().filter(|number| number.is_finite() && *number > 0.0);
        let not = || RetimeInputError::NotAnAcceleration { value: value.to_string() };
        number.ok_or_else(not)
    };
    let Value::Object(map) = &value else {
        let number = above_zero(&value)?;
        for limits in limits {
            limits.acceleration = limits.acceleration.or(Some(number));
        }
        return Ok(());
    };
    for (name, value) in map {
        let joint = joints.iter().position(|joint| joint.name == name);
        let Some(limits) = joint.and_then(|joint| limits.get_mut(joint)) else {
            let names: Vec<_> = joints.iter().map(|joint| joint.name).collect();
            let (name, names) = (name.clone(), names.join(", "));
            return Err(RetimeInputError::UnknownAcceleration { name, names });
        };
        limits.acceleration = Some(above_zero(value)?);
    }
    Ok(())
}

/// Positions without those that are equal to the one before, at which a path has no direction.
fn rows(path: &JointTrajectory) -> (Vec<Vec<f64>>, Vec<String>) {
    let mut rows: Vec<Vec<f64>> =
        path.waypoints.iter().map(|waypoint| waypoint.joint_position.clone()).collect();
    let before = rows.len();
    rows.dedup();
    let dropped = before - rows.len();
    let warning =
        || format!("{dropped} waypoints are where the one before is: pauses are left out");
    (rows, (dropped > 0).then(warning).into_iter().collect())
}

/// What the new trajectory does not have of the old one.
fn replaced(path: &JointTrajectory) -> Vec<String> {
    let any = |row: fn(&armada_model::Waypoint) -> &Vec<f64>| {
        path.waypoints.iter().any(|waypoint| !row(waypoint).is_empty())
    };
    let mut warnings = Vec::new();
    if any(|waypoint| &waypoint.joint_velocity) || any(|waypoint| &waypoint.joint_acceleration) {
        warnings.push("velocities and accelerations of the waypoints are replaced".to_owned());
    }
    if any(|waypoint| &waypoint.position_tolerance) || any(|waypoint| &waypoint.velocity_tolerance)
    {
        warnings.push("tolerances of the waypoints are left out".to_owned());
    }
    if path.interpolation == Interpolation::JointLinear {
        warnings
            .push("joint_linear: the path is a spline, not lines, between waypoints".to_owned());
    }
    warnings
}

/// An error that counts joints, with their names.
fn by_name(error: &dyn std::error::Error, names: &[String]) -> anyhow::Error {
    let text = error.to_string();
    let mut told = String::new();
    for (index, part) in text.split("joint ").enumerate() {
        if index > 0 {
            told.push_str("joint ");
        }
        let end = part.find(|c: char| !c.is_ascii_digit()).unwrap_or(part.len());
        let (number, rest) = part.split_at(end);
        match number.parse().ok().and_then(|joint: usize| names.get(joint)) {
            Some(name) if index > 0 => told.push_str(&format!("{name:?}{rest}")),
            _ => told.push_str(part),
        }
    }
    anyhow::anyhow!(told)
}

/// How long each joint is at a limit, the longest first, and how long none is.
fn shares<P: armada_model::GeometricPath>(
    timed: &TimedPath<P>,
    names: &[String],
    stretch: f64,
) -> (Vec<Share>, f64) {
    let mut shares: Vec<Share> = Vec::new();
    let (duration_s, mut rest_s) = (timed.duration_s(), 0.0);
    for (saturation, ends) in timed.saturations().iter().zip(timed.knots().windows(2)) {
        let [from, to] = ends else { continue };
        let time_s = to.time_s - from.time_s;
        if saturation.share < SATURATED {
            rest_s += time_s;
            continue;
        }
        let joint = names.get(saturation.joint).map_or("", String::as_str);
        let quantity = saturation.quantity.to_string();
        match shares.iter_mut().find(|s| s.joint == joint && s.quantity == quantity) {
            Some(share) => share.time_s += time_s,
            None => shares.push(Share { joint: joint.to_owned(), quantity, time_s, share: 0.0 }),
        }
    }
    for share in &mut shares {
        share.share = share.time_s / duration_s;
        share.time_s *= stretch;
    }
    shares.sort_by(|a, b| b.time_s.total_cmp(&a.time_s));
    (shares, rest_s * stretch)
}

fn print(answer: &Answer<'_>, out: &Output) -> anyhow::Result<()> {
    let count = answer.trajectory.waypoints.len();
    let Answer { duration_s, before_duration_s, stretch, .. } = answer;
    out.line(format_args!("before   {before_duration_s:.3} s"))?;
    out.line(format_args!("now      {duration_s:.3} s in {count} waypoints"))?;
    out.line(format_args!("stretch  {stretch:.6}"))?;
    let mut table = Table::new(&["at its limit", "of", "time [s]", "share"]);
    for Share { joint, quantity, time_s, share } in &answer.saturations {
        let share = format!("{:.1} %", 100.0 * share);
        table.row(vec![joint.clone(), quantity.clone(), format!("{time_s:.3}"), share]);
    }
    if !answer.saturations.is_empty() {
        out.line(format_args!("\n{table}"))?;
    }
    out.line("\n--json prints the trajectory")
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    fn args(acceleration: Option<&str>) -> RetimeArgs {
        RetimeArgs {
            file: FileArgs { file: String::new(), json: true },
            trajectory: String::new(),
            points: None,
            spacing_s: 0.05,
            jerk_limited: false,
            acceleration: acceleration.map(str::to_owned),
            velocity_scale: 1.0,
        }
    }

    fn trajectory() -> JointTrajectory {
        let text = r#"{"joint_names": ["elbow_joint", "shoulder_pan_joint"],
            "joint_units": ["degree", "implicit"], "waypoints": [
            {"time_from_start_s": 0, "joint_position": [0, 0]},
            {"time_from_start_s": 9, "joint_position": [30, 0.4]},
            {"time_from_start_s": 12, "joint_position": [30, 0.4]},
            {"time_from_start_s": 20, "joint_position": [60, -0.3]}]}"#;
        serde_json::from_str(text).expect("a trajectory")
    }

    #[test]
    fn units_are_honoured_and_pauses_left_out() {
        let model = own_robot("six_axis_arm.urdf");
        let answer = retimed(&args(Some("2")), &model, &trajectory()).expect("retimed");
        let last = answer.trajectory.waypoints.last().expect("a waypoint");
        assert!((last.joint_position[0] - 60.0_f64.to_radians()).abs() < 1e-9);
        assert!(answer.duration_s < 5.0 && answer.before_duration_s == 20.0);
        assert!(answer.warnings[0].starts_with("1 waypoints"), "{:?}", answer.warnings);
        let total: f64 = answer.saturations.iter().map(|share| share.time_s).sum();
        assert!((total + answer.unsaturated_s - answer.duration_s).abs() < 1e-6);
    }

    #[test]
    fn a_joint_without_acceleration_is_told_with_the_option() {
        let model = own_robot("six_axis_arm.urdf");
        let given = trajectory();
        let refused = |text| retimed(&args(text), &model, &given).expect_err("refused").to_string();
        assert!(refused(None).starts_with("joint \"elbow_joint\" has no acceleration limit"));
        assert!(refused(None).contains("--acceleration"));
        let missing = refused(Some(r#"{"elbow_joint": 3}"#));
        assert!(missing.starts_with("joint \"shoulder_pan_joint\" has no"), "{missing}");
        assert!(refused(Some("-1")).contains("-1 is not a finite number above 0"));
        assert!(refused(Some(r#"{"wrist_1_joint": 1}"#)).contains("not one of the trajectory's"));
    }

    #[test]
    fn joints_are_told_by_name_where_they_are_counted() {
        let names = ["a".to_owned(), "b".to_owned()];
        let error = armada_model::MotionLimitsError::AccelerationMissing { joint: 1 };
        assert_eq!(
            by_name(&error, &names).to_string(),
            "joint \"b\": acceleration limit is missing"
        );
    }
}
