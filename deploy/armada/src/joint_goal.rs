//! Goals of joints as they are typed: `0.1,-1.2,…` for all of them, or `elbow=1.2,wrist_1=0` for some.

use std::f64::consts::PI;
use std::str::FromStr;

use armada_model::{JointType, JointVector};
use armada_protocol::messages::JointInfo;

use crate::exit::UsageError;

/// Where joints shall go, in the unit that was typed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum JointGoal {
    /// Every joint, in the robot's order.
    All(Vec<f64>),
    /// These joints; the others stay where they are commanded.
    Named(Vec<(String, f64)>),
}

/// Unit of typed angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AngleUnit {
    /// Radians.
    Radians,
    /// Degrees; joints that slide stay in metres.
    Degrees,
}

impl FromStr for JointGoal {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let named = parts.iter().filter(|part| part.contains('=')).count();
        if named == 0 {
            let values: Result<_, _> = parts.iter().map(|part| number(part)).collect();
            return Ok(Self::All(values?));
        }
        if named < parts.len() {
            return Err("give either one value per joint or NAME=VALUE for each".to_owned());
        }
        let pair = |part: &&str| {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            Ok((name.trim().to_owned(), number(value.trim())?))
        };
        Ok(Self::Named(parts.iter().map(pair).collect::<Result<_, String>>()?))
    }
}

fn number(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("{text:?} is not a number")),
    }
}

impl JointGoal {
    /// The goal of every joint \[rad or m\]; `commanded` is where those stay that are not named.
    pub(crate) fn resolve(
        &self,
        joints: &[JointInfo],
        commanded: &JointVector,
        unit: AngleUnit,
    ) -> Result<JointVector, UsageError> {
        let values = match self {
            Self::All(values) => all(values, joints, unit)?,
            Self::Named(named) => some(named, joints, commanded, unit)?,
        };
        JointVector::from_slice(&values).map_err(|error| UsageError(error.to_string()))
    }
}

fn all(values: &[f64], joints: &[JointInfo], unit: AngleUnit) -> Result<Vec<f64>, UsageError> {
    if values.len() != joints.len() {
        return Err(UsageError(format!(
            "{} values, but the robot has {} joints: {}",
            values.len(),
            joints.len(),
            names(joints)
        )));
    }
    Ok(values.iter().zip(joints).map(|(&value, joint)| to_si(value, joint, unit)).collect())
}

fn some(
    named: &[(String, f64)],
    joints: &[JointInfo],
    commanded: &JointVector,
    unit: AngleUnit,
) -> Result<Vec<f64>, UsageError> {
    let mut goal = commanded.to_vec();
    if goal.len() != joints.len() {
        return Err(UsageError("the robot does not tell where its joints are".to_owned()));
    }
    for (index, (name, value)) in named.iter().enumerate() {
        if named.iter().take(index).any(|(earlier, _)| earlier == name) {
            return Err(UsageError(format!("joint {name} is named twice")));
        }
        let found = goal.iter_mut().zip(joints).find(|(_, joint)| &joint.name == name);
        let Some((place, joint)) = found else {
            let has = names(joints);
            return Err(UsageError(format!("there is no joint {name:?}; there are {has}")));
        };
        *place = to_si(*value, joint, unit);
    }
    Ok(goal)
}

fn to_si(value: f64, joint: &JointInfo, unit: AngleUnit) -> f64 {
    match (unit, joint.joint_type) {
        (AngleUnit::Degrees, JointType::Revolute | JointType::Continuous) => value * PI / 180.0,
        (AngleUnit::Degrees, JointType::Prismatic) | (AngleUnit::Radians, _) => value,
    }
}

fn names(joints: &[JointInfo]) -> String {
    joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use armada_model::JointLimits;
    use armada_protocol::messages::ReducedLimits;

    use super::*;

    fn joints() -> Vec<JointInfo> {
        let joint = |name: &str, joint_type| JointInfo {
            name: name.to_owned(),
            joint_type,
            limits: JointLimits { velocity: 1.0, ..JointLimits::default() },
            reduced: ReducedLimits::default(),
            home: None,
        };
        vec![joint("lift", JointType::Prismatic), joint("elbow", JointType::Revolute)]
    }

    fn resolve(text: &str, unit: AngleUnit) -> Result<Vec<f64>, String> {
        let commanded = JointVector::from_slice(&[0.25, 0.5]).expect("finite");
        let goal: JointGoal = text.parse()?;
        let goal = goal.resolve(&joints(), &commanded, unit).map_err(|error| error.to_string())?;
        Ok(goal.to_vec())
    }

    #[test]
    fn one_value_per_joint_is_taken_in_order() {
        assert_eq!(resolve("0.1, -1e-1", AngleUnit::Radians), Ok(vec![0.1, -0.1]));
    }

    #[test]
    fn joints_that_are_not_named_stay_where_they_are_commanded() {
        assert_eq!(resolve("elbow=1", AngleUnit::Radians), Ok(vec![0.25, 1.0]));
    }

    #[test]
    fn degrees_are_for_joints_that_turn() {
        assert_eq!(resolve("0.3,180", AngleUnit::Degrees), Ok(vec![0.3, PI]));
    }

    #[test]
    fn a_wrong_count_is_told_with_the_names_of_the_joints() {
        let error = resolve("1,2,3", AngleUnit::Radians).expect_err("two joints");
        assert_eq!(error, "3 values, but the robot has 2 joints: lift, elbow");
    }

    #[test]
    fn what_cannot_be_meant_is_refused_with_its_reason() {
        for (text, reason) in [
            ("1,two", "\"two\" is not a number"),
            ("1,NaN", "\"NaN\" is not a number"),
            ("", "\"\" is not a number"),
            ("1,elbow=2", "either one value per joint"),
            ("wrist=1", "there is no joint \"wrist\"; there are lift, elbow"),
            ("elbow=1,elbow=2", "named twice"),
            ("elbow=", "\"\" is not a number"),
        ] {
            let error = resolve(text, AngleUnit::Radians).expect_err(text);
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
