//! A robot file together with the robot description it names.

use std::num::NonZeroU64;
use std::sync::Arc;

use armada_model::{Chain, JointType, JointVector, PositionSource, RobotModel};
use armada_protocol::messages::{ChainInfo, JointInfo};

use super::{ChainConfig, ConfigError, Delegate, JointConfig, Problem, RobotConfig, millis};
use crate::control::Params;
use crate::drivers::DriverSetup;

impl RobotConfig {
    /// The joints in the order of every vector, with the limits of the description as the file
    /// narrows them; each has an acceleration limit.
    ///
    /// Soft limits of the description narrow its hard ones. A joint that turns without limits in
    /// the description and has both in the file becomes one that turns between them.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if a joint is not a driven joint of `model`, a limit is wider than
    /// the description's, in the unit of another type of joint, or missing in both.
    pub fn joint_infos(&self, model: &RobotModel) -> Result<Vec<JointInfo>, ConfigError> {
        let resolve = |joint| resolve(joint, model);
        let infos: Result<_, Problem> = self.joints.iter().map(resolve).collect();
        infos.map_err(|problem| self.error(problem))
    }

    /// The chains, each from a link of `model` to another further out.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if `model` has no link of that name, or the base of a chain does
    /// not carry its tip.
    pub fn chain_infos(&self, model: &RobotModel) -> Result<Vec<ChainInfo>, ConfigError> {
        for (index, chain) in self.chains.iter().enumerate() {
            check_chain(&chain.info(), model)
                .map_err(|problem| self.error(problem.under(&index.to_string()).under("chains")))?;
        }
        Ok(self.chains.iter().map(ChainConfig::info).collect())
    }

    /// What the control loop is told of the robot.
    ///
    /// # Errors
    /// As [`RobotConfig::joint_infos`].
    pub fn params(&self, model: &RobotModel) -> Result<Params, ConfigError> {
        let joints = self.joint_infos(model)?;
        let control = &self.control;
        let each = |rad: f64, m: f64| self.each_joint(&joints, rad, m);
        let limits = joints.iter().map(|joint| joint.limits).collect();
        let common = Params::for_joints(limits, control.period())
            .map_err(|error| self.error(Problem::new("joints", error.to_string())))?;
        Ok(Params {
            start_tolerance: each(control.start_tolerance_rad, control.start_tolerance_m)?,
            tracking_tolerance: each(control.tracking_tolerance_rad, control.tracking_tolerance_m)?,
            standstill_velocity: each(
                control.standstill_velocity_rad_s,
                control.standstill_velocity_m_s,
            )?,
            communication_timeout: millis(control.communication_timeout_ms),
            tracking_lag: millis(control.tracking_lag_ms),
            standstill_hold: millis(control.standstill_hold_ms),
            request_timeout: millis(control.request_timeout_ms),
            stream_timeout: millis(control.stream_timeout_ms),
            stream_max_age: millis(control.stream_max_age_ms),
            enable_on_start: control.enable_on_start,
            lease_required: control.lease_required,
            delegates: control.delegate == Delegate::Auto,
            homing_timeout: millis(control.homing_timeout_ms),
            operational_mode: control.operational_mode,
            reduced: joints.iter().map(|joint| joint.reduced).collect(),
            home: joints.iter().map(|joint| joint.home).collect(),
            equipment: Arc::new(self.equipment(model)?.for_loop()),
            stop_time: self.stop.time().unwrap_or(common.stop_time),
            ..common
        })
    }

    /// What a driver or emulator of this robot is told; `boot_nonce` is a number that no other run
    /// of any program has.
    ///
    /// # Errors
    /// As [`RobotConfig::joint_infos`] and [`RobotConfig::chain_infos`].
    pub fn driver_setup(
        &self,
        model: &RobotModel,
        boot_nonce: NonZeroU64,
    ) -> Result<DriverSetup, ConfigError> {
        let joints = self.joint_infos(model)?;
        let chain = |info: &ChainInfo| Chain::new(model, &info.base_link, &info.tip_link).ok();
        let chains = self.chain_infos(model)?.iter().map(chain).collect();
        Ok(DriverSetup { joints, chains, period: self.control.period(), boot_nonce })
    }

    /// One value for each joint, in its unit.
    fn each_joint(
        &self,
        joints: &[JointInfo],
        rad: f64,
        m: f64,
    ) -> Result<JointVector, ConfigError> {
        let values: Vec<f64> = joints
            .iter()
            .map(|joint| if joint.joint_type == JointType::Prismatic { m } else { rad })
            .collect();
        JointVector::from_slice(&values)
            .map_err(|error| self.error(Problem::new("joints", error.to_string())))
    }
}

fn resolve(joint: &JointConfig, model: &RobotModel) -> Result<JointInfo, Problem> {
    let refuse = |text: String| Problem::new(format!("joints.{}", joint.name), text);
    let Some(described) = model.joint_index(&joint.name).and_then(|i| model.joints().get(i)) else {
        let names: Vec<_> = model.variables().map(|variable| variable.name).collect();
        let names = names.join(", ");
        return Err(refuse(format!("the robot description has no such joint, it has {names}")));
    };
    match &described.motion {
        Some(motion) if matches!(motion.position, PositionSource::Variable(_)) => {
            joint.resolve(motion)
        }
        Some(_) => Err(refuse("mimics another joint, so it cannot be driven".to_owned())),
        None => Err(refuse("is a fixed joint, so it cannot be driven".to_owned())),
    }
}

fn check_chain(chain: &ChainInfo, model: &RobotModel) -> Result<(), Problem> {
    let index = |field: &str, name: &str| {
        model.link_index(name).ok_or_else(|| {
            Problem::new(field, format!("the robot description has no link {name:?}"))
        })
    };
    let base = index("base_link", &chain.base_link)?;
    let mut link = index("tip_link", &chain.tip_link)?;
    while link != base {
        let parent = model
            .links()
            .get(link)
            .and_then(|link| link.parent_joint)
            .and_then(|joint| model.joints().get(joint))
            .map(|joint| joint.parent);
        let Some(parent) = parent else {
            let text = format!("{:?} is not carried by {:?}", chain.tip_link, chain.base_link);
            return Err(Problem::new("tip_link", text));
        };
        link = parent;
    }
    Ok(())
}
