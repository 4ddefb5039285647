//! The joints of a robot file: a list of names, or a table with limits.

use std::fmt;

use armada_model::{JointLimits, JointType, Motion};
use armada_protocol::messages::{JointInfo, ReducedLimits};
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};

use super::Problem;
use crate::control::REDUCED_SHARE;

/// One joint of a robot file.
#[derive(Clone, Debug, PartialEq)]
pub struct JointConfig {
    /// Name as in the robot description.
    pub name: String,
    /// Limits given in the file.
    pub limits: JointOverrides,
}

/// Limits of a joint given in the robot file: those the description lacks, and narrower ones.
///
/// Of each pair only the unit of the joint may be given: \[rad\] if it turns, \[m\] if it slides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointOverrides {
    /// Highest acceleration and deceleration \[rad/s²\]; needed unless the description gives it.
    pub acceleration_rad_s2: Option<f64>,
    /// Highest acceleration and deceleration \[m/s²\]; needed unless the description gives it.
    pub acceleration_m_s2: Option<f64>,
    /// Highest jerk \[rad/s³\]; by default the acceleration is reached in 50 ms.
    pub jerk_rad_s3: Option<f64>,
    /// Highest jerk \[m/s³\]; by default the acceleration is reached in 50 ms.
    pub jerk_m_s3: Option<f64>,
    /// Highest speed \[rad/s\]; needed if the description gives none.
    pub velocity_rad_s: Option<f64>,
    /// Highest speed \[m/s\]; needed if the description gives none.
    pub velocity_m_s: Option<f64>,
    /// Lowest position \[rad\].
    pub lower_rad: Option<f64>,
    /// Lowest position \[m\].
    pub lower_m: Option<f64>,
    /// Highest position \[rad\].
    pub upper_rad: Option<f64>,
    /// Highest position \[m\].
    pub upper_m: Option<f64>,
    /// Home position \[rad\]; none by default.
    pub home_rad: Option<f64>,
    /// Home position \[m\]; none by default.
    pub home_m: Option<f64>,
    /// Highest speed at reduced speed \[rad/s\]; by default a quarter of the highest.
    pub reduced_velocity_rad_s: Option<f64>,
    /// Highest speed at reduced speed \[m/s\]; by default a quarter of the highest.
    pub reduced_velocity_m_s: Option<f64>,
    /// Highest acceleration at reduced speed \[rad/s²\]; by default the highest.
    pub reduced_acceleration_rad_s2: Option<f64>,
    /// Highest acceleration at reduced speed \[m/s²\]; by default the highest.
    pub reduced_acceleration_m_s2: Option<f64>,
}

/// Names of the fields in one unit, and their values.
struct InUnit {
    acceleration: (&'static str, Option<f64>),
    jerk: (&'static str, Option<f64>),
    velocity: (&'static str, Option<f64>),
    lower: (&'static str, Option<f64>),
    upper: (&'static str, Option<f64>),
    home: (&'static str, Option<f64>),
    reduced_velocity: (&'static str, Option<f64>),
    reduced_acceleration: (&'static str, Option<f64>),
}

impl JointConfig {
    /// The joint with the limits of `motion`, its entry in the description, narrowed by the file.
    pub(super) fn resolve(&self, motion: &Motion) -> Result<JointInfo, Problem> {
        self.resolve_limits(motion).map_err(|problem| self.at(problem))
    }

    /// Finds values that no joint may have.
    pub(super) fn check(&self) -> Result<(), Problem> {
        for fields in [self.limits.turning(), self.limits.sliding()] {
            let rates = [
                (fields.acceleration, MAX_RATE),
                (fields.velocity, MAX_RATE),
                (fields.reduced_acceleration, MAX_RATE),
                (fields.reduced_velocity, MAX_RATE),
            ];
            for ((field, value), most) in rates.into_iter().chain([(fields.jerk, MAX_JERK)]) {
                // Written so that not a number is refused as well.
                if let Some(value) = value
                    && !(value > 0.0 && value <= most)
                {
                    let text = format!("{value} is outside 0 (exclusive) to {most}");
                    return Err(self.at(Problem::new(field, text)));
                }
            }
            for (field, value) in [fields.lower, fields.upper, fields.home] {
                if let Some(value) = value {
                    super::check_range(field, value, -MAX_POSITION..=MAX_POSITION)
                        .map_err(|problem| self.at(problem))?;
                }
            }
        }
        Ok(())
    }

    fn resolve_limits(&self, motion: &Motion) -> Result<JointInfo, Problem> {
        let slides = motion.joint_type == JointType::Prismatic;
        let (fields, other) = if slides {
            (self.limits.sliding(), self.limits.turning())
        } else {
            (self.limits.turning(), self.limits.sliding())
        };
        other.refuse_all(if slides { "slides" } else { "turns" }, &fields)?;
        let described = &motion.limits;
        let (lower, upper) = fields.position(motion)?;
        let limits = JointLimits {
            lower,
            upper,
            velocity: required(fields.velocity, Some(described.velocity).filter(|v| *v > 0.0))?,
            acceleration: Some(required(fields.acceleration, described.acceleration)?),
            jerk: narrowed(fields.jerk, described.jerk)?,
            effort: described.effort,
        };
        let bounded = limits.lower.is_some() && limits.upper.is_some();
        let joint_type = match motion.joint_type {
            JointType::Continuous if bounded => JointType::Revolute,
            other => other,
        };
        let (reduced, home) = (fields.reduced(&limits)?, fields.home(&limits)?);
        Ok(JointInfo { name: self.name.clone(), joint_type, limits, reduced, home })
    }

    fn at(&self, problem: Problem) -> Problem {
        problem.under(&self.name).under("joints")
    }
}

/// Highest speed and acceleration that can be given \[SI\].
const MAX_RATE: f64 = 10_000.0;
/// Highest jerk that can be given \[SI\].
const MAX_JERK: f64 = 1_000_000.0;
/// Highest position that can be given \[rad or m\].
const MAX_POSITION: f64 = 10_000.0;

impl JointOverrides {
    const fn turning(&self) -> InUnit {
        InUnit {
            acceleration: ("acceleration_rad_s2", self.acceleration_rad_s2),
            jerk: ("jerk_rad_s3", self.jerk_rad_s3),
            velocity: ("velocity_rad_s", self.velocity_rad_s),
            lower: ("lower_rad", self.lower_rad),
            upper: ("upper_rad", self.upper_rad),
            home: ("home_rad", self.home_rad),
            reduced_velocity: ("reduced_velocity_rad_s", self.reduced_velocity_rad_s),
            reduced_acceleration: ("reduced_acceleration_rad_s2", self.reduced_acceleration_rad_s2),
        }
    }

    const fn sliding(&self) -> InUnit {
        InUnit {
            acceleration: ("acceleration_m_s2", self.acceleration_m_s2),
            jerk: ("jerk_m_s3", self.jerk_m_s3),
            velocity: ("velocity_m_s", self.velocity_m_s),
            lower: ("lower_m", self.lower_m),
            upper: ("upper_m", self.upper_m),
            home: ("home_m", self.home_m),
            reduced_velocity: ("reduced_velocity_m_s", self.reduced_velocity_m_s),
            reduced_acceleration: ("reduced_acceleration_m_s2", self.reduced_acceleration_m_s2),
        }
    }
}

impl InUnit {
    const fn all(&self) -> [(&'static str, Option<f64>); 8] {
        [
            self.acceleration,
            self.jerk,
            self.velocity,
            self.lower,
            self.upper,
            self.home,
            self.reduced_velocity,
            self.reduced_acceleration,
        ]
    }

    /// What the joint may do at reduced speed, at most what it may do at all.
    fn reduced(&self, limits: &JointLimits) -> Result<ReducedLimits, Problem> {
        let at_most = |(field, given): (&'static str, Option<f64>), limit: f64| match given {
            Some(value) if value > limit => {
                Err(Problem::new(field, format!("{value} is above the joint's limit {limit}")))
            }
            given => Ok(given),
        };
        let acceleration = limits.acceleration.unwrap_or_default();
        Ok(ReducedLimits {
            velocity: at_most(self.reduced_velocity, limits.velocity)?
                .unwrap_or(REDUCED_SHARE * limits.velocity),
            acceleration: at_most(self.reduced_acceleration, acceleration)?.unwrap_or(acceleration),
        })
    }

    /// The home position, inside the position limits.
    fn home(&self, limits: &JointLimits) -> Result<Option<f64>, Problem> {
        let (field, home) = self.home;
        if let Some(value) = home.filter(|&value| !limits.contains(value)) {
            let bound = |limit: Option<f64>| limit.map_or("none".to_owned(), |l| l.to_string());
            let (lower, upper) = (bound(limits.lower), bound(limits.upper));
            let text = format!("{value} is outside the joint's limits, {lower} to {upper}");
            return Err(Problem::new(field, text));
        }
        Ok(home)
    }

    /// Refuses fields in the unit of another type of joint, naming the right one.
    fn refuse_all(&self, moves: &str, right: &Self) -> Result<(), Problem> {
        for ((field, value), (right, _)) in self.all().into_iter().zip(right.all()) {
            if value.is_some() {
                return Err(Problem::new(field, format!("the joint {moves}, give {right}")));
            }
        }
        Ok(())
    }

    /// Position limits: those of the description, its soft limits, and the file's.
    fn position(&self, motion: &Motion) -> Result<(Option<f64>, Option<f64>), Problem> {
        let hard = &motion.limits;
        let soft = motion.soft_limits;
        let lower = narrowest(hard.lower, soft.and_then(|soft| soft.lower), f64::max);
        let upper = narrowest(hard.upper, soft.and_then(|soft| soft.upper), f64::min);
        if let ((field, Some(value)), Some(limit)) = (self.lower, lower)
            && value < limit
        {
            return Err(widened(field, value, "below", limit));
        }
        if let ((field, Some(value)), Some(limit)) = (self.upper, upper)
            && value > limit
        {
            return Err(widened(field, value, "above", limit));
        }
        let (lower, upper) = (self.lower.1.or(lower), self.upper.1.or(upper));
        if let (Some(low), Some(high)) = (lower, upper)
            && low >= high
        {
            let field = if self.upper.1.is_some() { self.upper.0 } else { self.lower.0 };
            let text = format!("no position is left between lower {low} and upper {high}");
            return Err(Problem::new(field, text));
        }
        Ok((lower, upper))
    }
}

fn narrowest(hard: Option<f64>, soft: Option<f64>, pick: fn(f64, f64) -> f64) -> Option<f64> {
    match (hard, soft) {
        (Some(hard), Some(soft)) => Some(pick(hard, soft)),
        (hard, soft) => hard.or(soft),
    }
}

/// The file's value, at most the description's; one of the two must be there.
fn required(
    (field, given): (&'static str, Option<f64>),
    described: Option<f64>,
) -> Result<f64, Problem> {
    narrowed((field, given), described)?.ok_or_else(|| {
        Problem::new(field, "is missing, and the robot description does not give it")
    })
}

/// The file's value, at most the description's, if there is any.
fn narrowed(
    (field, given): (&'static str, Option<f64>),
    described: Option<f64>,
) -> Result<Option<f64>, Problem> {
    match (given, described) {
        (Some(given), Some(limit)) if given > limit => Err(widened(field, given, "above", limit)),
        (given, described) => Ok(given.or(described)),
    }
}

fn widened(field: &str, value: f64, side: &str, limit: f64) -> Problem {
    let text = format!(
        "{value} is {side} the robot description's limit {limit}; limits can only be narrowed"
    );
    Problem::new(field, text)
}

/// Reads joints in the order of the file: `[a, b]`, or `{a: {limits…}, b: {…}}`.
pub(super) fn names_or_table<'de, D>(deserializer: D) -> Result<Vec<JointConfig>, D::Error>
where
    D: Deserializer<'de>,
{
    deserializer.deserialize_any(JointsVisitor)
}

struct JointsVisitor;

impl<'de> Visitor<'de> for JointsVisitor {
    type Value = Vec<JointConfig>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of joint names, or a table of joints with their limits")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut names: A) -> Result<Self::Value, A::Error> {
        let mut joints = Vec::new();
        while let Some(name) = names.next_element()? {
            joints.push(JointConfig { name, limits: JointOverrides::default() });
        }
        Ok(joints)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Self::Value, A::Error> {
        let mut joints = Vec::new();
        while let Some((name, limits)) = entries.next_entry::<String, Option<JointOverrides>>()? {
            joints.push(JointConfig { name, limits: limits.unwrap_or_default() });
        }
        Ok(joints)
    }
}
