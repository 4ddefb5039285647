//! The status packet.

use armada_protocol::messages::{OperationalMode, RobotFlags};

use super::codec::{Reader, Writer, joint_count};
use super::{Status, WireError};
use crate::drivers::{
    DelegatedReport, DelegatedStatus, Feedback, MAX_REPORTED_TIPS, ReportedTip, TipFrame,
};

pub(super) fn write_status(status: &Status, out: &mut Writer<'_>) -> Option<()> {
    out.u64(status.time_ns)?;
    out.u64(status.last_command)?;
    out.u32(status.last_power_id)?;
    out.u32(status.last_reset_id)?;
    out.u32(status.last_order_id)?;
    let flags = u8::from(status.enabled)
        | u8::from(status.ready) << 1
        | u8::from(status.emergency_stop) << 2
        | u8::from(status.guard_stop) << 3
        | u8::from(status.local_control) << 4;
    out.put(&[flags, mode_to_wire(status.operational_mode)])?;
    out.u32(u32::try_from(status.conditions.bits()).ok()?)?;
    out.u32(status.error)?;
    out.u8(joint_count(&status.position))?;
    out.u16(status.homed.bits())?;
    out.u16(status.homing.bits())?;
    out.joints(&status.position)?;
    out.joints(&status.velocity)?;
    out.joints(&status.effort)?;
    write_report(status.delegated.as_ref(), out)?;
    out.values(&status.signals)?;
    out.values(&status.parameters)?;
    write_tips(&status.tips, out)
}

pub(super) fn read_status(reader: &mut Reader<'_>) -> Result<Status, WireError> {
    let time_ns = reader.u64()?;
    let last_command = reader.u64()?;
    let last_power_id = reader.u32()?;
    let last_reset_id = reader.u32()?;
    let last_order_id = reader.u32()?;
    let flags = reader.flags(0b1_1111, "flags")?;
    let operational_mode = mode_from_wire(reader.u8()?)?;
    let conditions = conditions(reader.u32()?)?;
    let error = reader.u32()?;
    let joints = reader.joint_count()?;
    Ok(Status {
        time_ns,
        last_command,
        last_power_id,
        last_reset_id,
        last_order_id,
        enabled: flags & 1 != 0,
        ready: flags & 2 != 0,
        emergency_stop: flags & 4 != 0,
        guard_stop: flags & 8 != 0,
        local_control: flags & 16 != 0,
        conditions,
        operational_mode,
        error,
        homed: reader.joint_set(joints, "homed")?,
        homing: reader.joint_set(joints, "homing")?,
        position: reader.joints(joints, "positions")?,
        velocity: reader.joints(joints, "velocities")?,
        effort: reader.joints(joints, "efforts")?,
        delegated: read_report(reader)?,
        signals: reader.values("signals")?,
        parameters: reader.values("parameters")?,
        tips: read_tips(reader)?,
    })
}

/// The number of an operational mode on the wire.
pub(in super::super) const fn mode_to_wire(mode: OperationalMode) -> u8 {
    match mode {
        OperationalMode::Undefined => 0,
        OperationalMode::ManualReducedSpeed => 1,
        OperationalMode::ManualFullSpeed => 2,
        OperationalMode::Auto => 3,
        OperationalMode::Cobot => 4,
    }
}

const fn mode_from_wire(mode: u8) -> Result<OperationalMode, WireError> {
    Ok(match mode {
        0 => OperationalMode::Undefined,
        1 => OperationalMode::ManualReducedSpeed,
        2 => OperationalMode::ManualFullSpeed,
        3 => OperationalMode::Auto,
        4 => OperationalMode::Cobot,
        _ => return Err(WireError::Field { field: "operational mode" }),
    })
}

/// The flags with these bits; only what a controller may report.
fn conditions(bits: u32) -> Result<RobotFlags, WireError> {
    let bits = u64::from(bits);
    if bits & !Feedback::CONDITIONS.bits() != 0 {
        return Err(WireError::Field { field: "conditions" });
    }
    let flags = RobotFlags::NAMES.into_iter().map(|(_, flag)| flag);
    Ok(flags.fold(RobotFlags::NONE, |all, flag| all.with(flag, bits & flag.bits() != 0)))
}

fn write_report(report: Option<&DelegatedReport>, out: &mut Writer<'_>) -> Option<()> {
    let Some(DelegatedReport { number, status, progress }) = report else { return out.u8(0) };
    let (status, code) = match *status {
        DelegatedStatus::Waiting => (1, 0),
        DelegatedStatus::Running => (2, 0),
        DelegatedStatus::Paused => (3, 0),
        DelegatedStatus::Done => (4, 0),
        DelegatedStatus::Stopped => (5, 0),
        DelegatedStatus::Failed { code } => (6, code),
    };
    out.u8(status)?;
    out.u32(*number)?;
    out.u32(code)?;
    out.f64(*progress)
}

fn read_report(reader: &mut Reader<'_>) -> Result<Option<DelegatedReport>, WireError> {
    let status = reader.u8()?;
    if status == 0 {
        return Ok(None);
    }
    let (number, code) = (reader.u32()?, reader.u32()?);
    let status = match (status, code) {
        (1, 0) => DelegatedStatus::Waiting,
        (2, 0) => DelegatedStatus::Running,
        (3, 0) => DelegatedStatus::Paused,
        (4, 0) => DelegatedStatus::Done,
        (5, 0) => DelegatedStatus::Stopped,
        (6, code) => DelegatedStatus::Failed { code },
        _ => return Err(WireError::Field { field: "move" }),
    };
    let progress = reader.within([0.0, 1.0], "progress")?;
    Ok(Some(DelegatedReport { number, status, progress }))
}

fn write_tips(tips: &[Option<ReportedTip>; MAX_REPORTED_TIPS], out: &mut Writer<'_>) -> Option<()> {
    out.u8(tips.iter().flatten().count() as u8)?; // at most MAX_REPORTED_TIPS
    tips.iter().flatten().try_for_each(|tip| {
        let frame = match tip.frame {
            TipFrame::Flange => 1,
            TipFrame::Tcp => 2,
        };
        out.put(&[tip.chain, frame])?;
        out.pose(&tip.pose)
    })
}

fn read_tips(
    reader: &mut Reader<'_>,
) -> Result<[Option<ReportedTip>; MAX_REPORTED_TIPS], WireError> {
    let count = usize::from(reader.u8()?);
    let mut tips = [None; MAX_REPORTED_TIPS];
    let given = tips.get_mut(..count).ok_or(WireError::Field { field: "tips" })?;
    for tip in given {
        let chain = reader.u8()?;
        let frame = match reader.u8()? {
            1 => TipFrame::Flange,
            2 => TipFrame::Tcp,
            _ => return Err(WireError::Field { field: "tips" }),
        };
        *tip = Some(ReportedTip { chain, frame, pose: reader.pose("tips")? });
    }
    Ok(tips)
}
