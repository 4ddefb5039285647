//! Positions of joints as JSON: `{"NAME": POSITION, …}` for some, or `[POSITION, …]` for all.

use std::fmt;

use armada_model::{JointType, PositionSource, RobotModel, Variable};
use clap::Args;
use serde::de::{self, Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::input::{place_of, text_of};
use crate::exit::UsageError;

/// Most names that a message lists.
const MAX_NAMES: usize = 24;

/// Positions of the joints.
#[derive(Args, Clone, Debug)]
pub(super) struct JointsArgs {
    /// Positions as JSON, @FILE that holds it, or - for standard input: {"NAME": POSITION} in rad
    /// or m, joints left out at 0; or [POSITION, …] of all driven joints in the order of the file
    #[arg(long, value_name = "JSON")]
    pub(super) joints: Option<String>,
}

impl JointsArgs {
    /// A position for each variable of the robot \[rad or m\].
    ///
    /// # Errors
    /// If the file cannot be read; [`UsageError`] if the positions do not fit the robot.
    pub(super) fn positions(&self, model: &RobotModel) -> anyhow::Result<Vec<f64>> {
        let Some(joints) = &self.joints else { return Ok(vec![0.0; model.variable_count()]) };
        let text = text_of(joints)?;
        let positions = parse(model, &text);
        Ok(positions.map_err(|error| UsageError(format!("--joints: {error}")))?)
    }
}

/// Why JSON is not positions of a robot's joints.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum JointsError {
    #[error(
        "neither {{\"NAME\": POSITION}} nor [POSITION, …] with finite numbers: {reason} at {place}"
    )]
    NotJson { reason: String, place: String },
    #[error("joint {joint:?}: {value} is not a number; positions are in rad or m")]
    NotANumber { joint: String, value: String },
    #[error("joint {name:?} is given twice")]
    Repeated { name: String },
    #[error("there is no joint {name:?}; the driven joints are {names}")]
    Unknown { name: String, names: String },
    #[error("joint {name:?} is fixed and has no position")]
    Fixed { name: String },
    #[error("joint {name:?} follows joint {master:?}; give that one")]
    Mimic { name: String, master: String },
    #[error("{given} positions, but the robot has {expected} driven joints: {names}")]
    Count { given: usize, expected: usize, names: String },
}

/// Positions of all variables from JSON; those that are not named are 0.
pub(super) fn parse(model: &RobotModel, text: &str) -> Result<Vec<f64>, JointsError> {
    match serde_json::from_str(text) {
        Ok(Given::All(values)) => all(model, &values),
        Ok(Given::Named(values)) => named(model, &values),
        Err(error) => {
            let reason = error.to_string();
            let reason = reason.split(" at line").next().unwrap_or_default().to_owned();
            Err(JointsError::NotJson { reason, place: place_of(text, &error) })
        }
    }
}

/// What is wrong with positions that could be used, but lie outside the robot's limits.
pub(super) fn outside_limits(model: &RobotModel, positions: &[f64]) -> Vec<String> {
    let outside = |(variable, &position): (Variable<'_>, &f64)| {
        let limits = &variable.motion.limits;
        (!limits.contains(position)).then(|| {
            let bound = |limit: Option<f64>| {
                limit.map_or_else(|| "-".to_owned(), |limit| limit.to_string())
            };
            format!(
                "joint {:?}: {position} {unit} is outside its limits {} to {} {unit}",
                variable.name,
                bound(limits.lower),
                bound(limits.upper),
                unit = unit(variable.motion.joint_type),
            )
        })
    };
    model.variables().zip(positions).filter_map(outside).collect()
}

/// In the order of the robot, which a map would lose.
pub(super) fn as_map<S: Serializer, V: Serialize>(
    entries: &[(&str, V)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(entries.iter().map(|(name, value)| (name, value)))
}

/// Unit of a joint's position.
pub(super) const fn unit(joint_type: JointType) -> &'static str {
    match joint_type {
        JointType::Revolute | JointType::Continuous => "rad",
        JointType::Prismatic => "m",
    }
}

fn all(model: &RobotModel, values: &[Value]) -> Result<Vec<f64>, JointsError> {
    let (given, expected) = (values.len(), model.variable_count());
    if given != expected {
        return Err(JointsError::Count { given, expected, names: names(model) });
    }
    model.variables().zip(values).map(|(joint, value)| number(joint.name, value)).collect()
}

fn named(model: &RobotModel, values: &[(String, Value)]) -> Result<Vec<f64>, JointsError> {
    let mut positions: Vec<Option<f64>> = vec![None; model.variable_count()];
    for (name, value) in values {
        let variable = variable(model, name)?;
        let position = number(name, value)?;
        if let Some(slot) = positions.get_mut(variable)
            && slot.replace(position).is_some()
        {
            return Err(JointsError::Repeated { name: name.clone() });
        }
    }
    Ok(positions.into_iter().map(Option::unwrap_or_default).collect())
}

fn variable(model: &RobotModel, name: &str) -> Result<usize, JointsError> {
    let joint = model.joint_index(name).and_then(|index| model.joints().get(index));
    let name = name.to_owned();
    match joint.map(|joint| joint.motion.as_ref().map(|motion| motion.position)) {
        None => Err(JointsError::Unknown { name, names: names(model) }),
        Some(None) => Err(JointsError::Fixed { name }),
        Some(Some(PositionSource::Mimic { variable, .. })) => {
            let master = model.variables().nth(variable).map_or("", |master| master.name);
            Err(JointsError::Mimic { name, master: master.to_owned() })
        }
        Some(Some(PositionSource::Variable(variable))) => Ok(variable),
    }
}

fn number(joint: &str, value: &Value) -> Result<f64, JointsError> {
    value.as_f64().filter(|value| value.is_finite()).ok_or_else(|| JointsError::NotANumber {
        joint: joint.to_owned(),
        value: value.to_string(),
    })
}

fn names(model: &RobotModel) -> String {
    let mut names: Vec<_> = model.variables().map(|joint| joint.name).take(MAX_NAMES).collect();
    if model.variable_count() > MAX_NAMES {
        names.push("…");
    }
    names.join(", ")
}

/// Positions as they are given; names may stand twice.
enum Given {
    Named(Vec<(String, Value)>),
    All(Vec<Value>),
}

impl<'de> Deserialize<'de> for Given {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(GivenVisitor)
    }
}

struct GivenVisitor;

impl<'de> Visitor<'de> for GivenVisitor {
    type Value = Given;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object or an array")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Given, A::Error> {
        let mut named = Vec::new();
        while let Some(entry) = map.next_entry()? {
            named.push(entry);
        }
        Ok(Given::Named(named))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Given, A::Error> {
        let mut all = Vec::new();
        while let Some(value) = seq.next_element()? {
            all.push(value);
        }
        if all.is_empty() {
            return Err(de::Error::invalid_length(0, &"one position per driven joint"));
        }
        Ok(Given::All(all))
    }
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    fn hand() -> RobotModel {
        let text = r#"<robot name="hand"><link name="a"/><link name="b"/><link name="c"/>
            <link name="d"/>
            <joint name="lift" type="prismatic"><parent link="a"/><child link="b"/>
              <limit lower="0.1" upper="1" velocity="1"/></joint>
            <joint name="follower" type="continuous"><parent link="b"/><child link="c"/>
              <mimic joint="lift"/></joint>
            <joint name="weld" type="fixed"><parent link="c"/><child link="d"/></joint></robot>"#;
        RobotModel::from_urdf(text, "hand.urdf").expect("sound")
    }

    #[test]
    fn joints_that_are_left_out_are_at_zero() {
        let arm = own_robot("six_axis_arm.urdf");
        let positions = parse(&arm, r#"{"elbow_joint": 1.5, "wrist_3_joint": -2}"#);
        assert_eq!(positions, Ok(vec![0.0, 0.0, 1.5, 0.0, 0.0, -2.0]));
        assert_eq!(parse(&arm, "{}"), Ok(vec![0.0; 6]));
        assert_eq!(parse(&arm, "[1,2,3,4,5,6]"), Ok(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    }

    #[test]
    fn what_does_not_fit_the_robot_is_refused_by_name() {
        for (text, reason) in [
            (r#"{"lif": 1}"#, r#"there is no joint "lif"; the driven joints are lift"#),
            (r#"{"follower": 1}"#, r#"joint "follower" follows joint "lift"; give that one"#),
            (r#"{"weld": 1}"#, r#"joint "weld" is fixed and has no position"#),
            (r#"{"lift": 1, "lift": 1}"#, r#"joint "lift" is given twice"#),
            (
                r#"{"lift": "90deg"}"#,
                r#"joint "lift": "90deg" is not a number; positions are in rad or m"#,
            ),
            (r#"[null]"#, r#"joint "lift": null is not a number; positions are in rad or m"#),
            ("[1, 2]", "2 positions, but the robot has 1 driven joints: lift"),
        ] {
            assert_eq!(parse(&hand(), text).expect_err(text).to_string(), reason);
        }
    }

    #[test]
    fn numbers_that_json_does_not_have_are_refused_with_the_joint_before_them() {
        for text in [r#"{"lift": NaN}"#, r#"{"lift": 1e999}"#, r#"{"lift": -Infinity}"#] {
            let error = parse(&hand(), text).expect_err(text);
            let JointsError::NotJson { place, .. } = &error else { panic!("{text}: {error}") };
            assert!(place.ends_with(r#"after "lift""#), "{error}");
        }
        for text in ["", "1", "[]", "{lift: 1}", "{\"lift\": 1} x"] {
            let error = parse(&hand(), text).expect_err(text);
            assert!(matches!(error, JointsError::NotJson { .. }), "{text}: {error}");
        }
    }

    #[test]
    fn positions_outside_the_limits_are_told() {
        assert_eq!(
            outside_limits(&hand(), &[0.0]),
            [r#"joint "lift": 0 m is outside its limits 0.1 to 1 m"#]
        );
        assert!(outside_limits(&hand(), &[0.1]).is_empty());
    }
}
