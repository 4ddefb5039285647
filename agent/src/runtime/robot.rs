//! The robot as its files describe it.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};

use armada_model::{JointType, MotionLimits, RobotModel};
use armada_protocol::messages::{ChainInfo, JointInfo, RobotFlags, RobotInfo};
use uuid::Uuid;

use super::agent::AgentError;
use super::capabilities::{capabilities, loop_abilities, methods, parameter_slots, signal_slots};
use super::stop_latch::ResetRules;
use crate::config::RobotConfig;
use crate::control::Params;
use crate::drivers::{Abilities, Driver};
use crate::equipment::EquipmentBook;
use crate::stop_sources::StopSourceSetting;

/// The robot as its files describe it.
pub(super) struct Robot {
    pub(super) config: RobotConfig,
    pub(super) urdf: String,
    pub(super) model: RobotModel,
    pub(super) joints: Vec<JointInfo>,
    pub(super) chains: Vec<ChainInfo>,
    pub(super) params: Params,
    pub(super) limits: MotionLimits,
    pub(super) abilities: Abilities,
    pub(super) book: EquipmentBook,
    pub(super) reset_rules: ResetRules,
    pub(super) stop_sources: Vec<StopSourceSetting>,
}

/// The robots of an agent, each of another name.
///
/// # Errors
/// What [`AgentError`] says of files and robots that cannot be used, alone or together.
pub(super) fn load_all(files: &[PathBuf]) -> Result<Vec<Robot>, AgentError> {
    if files.is_empty() {
        return Err(AgentError::NoRobot);
    }
    let (mut paths, mut names) = (BTreeSet::new(), BTreeMap::new());
    let mut robots = Vec::new();
    for file in files {
        // A file that is not there is refused by the one that reads it, with the reason.
        if !paths.insert(file.canonicalize().unwrap_or_else(|_| file.clone())) {
            return Err(AgentError::SameFile(file.clone()));
        }
        let robot = Robot::load(file)?;
        if let Some(other) = names.insert(robot.config.robot.clone(), file.clone()) {
            let files = [other, file.clone()];
            return Err(AgentError::SameName { robot: robot.config.robot, files });
        }
        robots.push(robot);
    }
    Ok(robots)
}

impl Robot {
    fn load(file: &Path) -> Result<Self, AgentError> {
        let config = RobotConfig::load(file)?;
        let (urdf, model) = config.read_urdf()?;
        let joints = config.joint_infos(&model)?;
        let chains = config.chain_infos(&model)?;
        let book = config.equipment(&model)?;
        let setup = config.driver_setup(&model, NonZeroU64::MIN)?;
        // Made only to be asked what its controller can do: it opens no connection by itself.
        let abilities = config.driver.driver(&setup)?.abilities();
        let signals = signal_slots(&abilities.signals);
        let acknowledges = config.acknowledge_signal(&abilities.signals)?;
        let slot = acknowledges.and_then(|index| signals.get(index));
        let params = Params {
            abilities: loop_abilities(&abilities),
            acknowledge: slot.map(|slot| slot.first),
            signals,
            parameters: parameter_slots(&abilities.parameters),
            ..config.params(&model)?
        };
        let limits = MotionLimits::new(&params.limits)?;
        let reset_rules = ResetRules { zone: config.stop.reset.zone, key: config.reset_key()? };
        let stop_sources = config.stop_sources()?;
        Ok(Self {
            config,
            urdf,
            model,
            joints,
            chains,
            params,
            limits,
            abilities,
            book,
            reset_rules,
            stop_sources,
        })
    }

    pub(super) fn joint_names(&self) -> Vec<String> {
        self.joints.iter().map(|joint| joint.name.clone()).collect()
    }

    pub(super) fn joint_types(&self) -> Vec<JointType> {
        self.joints.iter().map(|joint| joint.joint_type).collect()
    }

    pub(super) fn chain_names(&self) -> Vec<String> {
        self.chains.iter().map(|chain| chain.name.clone()).collect()
    }

    pub(super) fn driver(&self, boot_id: Uuid) -> Result<Box<dyn Driver>, AgentError> {
        let (high, low) = boot_id.as_u64_pair();
        let nonce = NonZeroU64::new(high ^ low).unwrap_or(NonZeroU64::MIN);
        let setup = self.config.driver_setup(&self.model, nonce)?;
        Ok(self.config.driver.driver(&setup)?)
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the ratio of two checked rates is a small positive number"
    )]
    fn ticks_between(&self, rate_hz: f64) -> u64 {
        (self.loop_rate_hz() / rate_hz).round().max(1.0) as u64
    }

    pub(super) fn ticks_per_sample(&self) -> u64 {
        self.ticks_between(self.config.publish.state_rate_hz)
    }

    /// The rates at which the state is published besides \[Hz\], and how many ticks lie between two.
    pub(super) fn state_classes(&self) -> Vec<(u32, u64)> {
        let rates = self.config.publish.state_classes(self.loop_rate_hz());
        rates.into_iter().map(|rate| (rate, self.ticks_between(f64::from(rate)))).collect()
    }

    fn loop_rate_hz(&self) -> f64 {
        1000.0 / self.config.control.period_ms
    }

    pub(super) fn info(&self, boot_id: Uuid) -> RobotInfo {
        RobotInfo {
            robot: self.config.robot.clone(),
            uuid: self.config.uuid,
            boot_id,
            seqno: 1,
            vendor: self.config.driver.vendor().to_owned(),
            model: self.config.model.clone(),
            serial: self.config.serial.clone(),
            software_version: env!("CARGO_PKG_VERSION").to_owned(),
            model_rev: self.book.config_seqno(),
            joints: self.joints.clone(),
            chains: self.chains.clone(),
            equipment: self.book.equipment(),
            tools: self.book.catalogue().to_vec(),
            signals: self.abilities.signals.clone(),
            parameters: self.abilities.parameters.clone(),
            capabilities: capabilities(&self.abilities),
            methods: methods(&self.abilities, &self.params, self.chains.len()),
            flags: RobotFlags::NAMES.map(|(name, bit)| (name.to_owned(), bit.bits())).to_vec(),
            period_ms: self.config.control.period_ms,
            stop_time_s: self.params.stop_time.as_secs_f64(),
            lease_required: self.params.lease_required,
            state_rate_hz: self.config.publish.state_rate_hz,
            state_classes_hz: self.state_classes().into_iter().map(|(rate, _)| rate).collect(),
            urdf: self.urdf.clone(),
        }
    }
}
