//! The request packet.

use super::codec::{Reader, Writer, joint_count};
use super::{MAX_VALUE, Power, RequestBody, WireError};
use crate::drivers::{DelegatedGoal, DelegatedMove, DriverRequest, JointSet, LoadSetting};

pub(super) fn write_request(request: &RequestBody, out: &mut Writer<'_>) -> Option<()> {
    out.u32(request.power_id)?;
    out.u8(match request.power {
        None => 0,
        Some(Power::On) => 1,
        Some(Power::Off) => 2,
    })?;
    out.u32(request.reset_id)?;
    out.u32(request.order_id)?;
    match &request.order {
        Some(order) => write_order(order, out),
        None => out.u8(0),
    }
}

pub(super) fn read_request(reader: &mut Reader<'_>) -> Result<RequestBody, WireError> {
    let power_id = reader.u32()?;
    let power = match (reader.u8()?, power_id) {
        (0, 0) => None,
        (1, 1..) => Some(Power::On),
        (2, 1..) => Some(Power::Off),
        _ => return Err(WireError::Field { field: "power" }),
    };
    let reset_id = reader.u32()?;
    let order_id = reader.u32()?;
    let order = match (reader.u8()?, order_id) {
        (0, 0) => None,
        (kind @ 1.., 1..) => Some(read_order(kind, reader)?),
        _ => return Err(WireError::Field { field: "order" }),
    };
    Ok(RequestBody { power_id, power, reset_id, order_id, order })
}

fn write_order(order: &DriverRequest, out: &mut Writer<'_>) -> Option<()> {
    match order {
        // Those have places of their own.
        DriverRequest::Enable | DriverRequest::Disable | DriverRequest::ResetErrors => None,
        DriverRequest::Home(joints) => {
            out.u8(1)?;
            out.u16(joints.bits())
        }
        DriverRequest::Move(wanted) => {
            out.u8(2)?;
            write_move(wanted, out)
        }
        DriverRequest::StopMotion => out.u8(3),
        DriverRequest::PauseMotion => out.u8(4),
        DriverRequest::ResumeMotion => out.u8(5),
        DriverRequest::SetSpeedRatio(ratio) => {
            out.u8(6)?;
            out.f64(*ratio)
        }
        DriverRequest::SetSignal { signal, values } => {
            out.put(&[7, *signal])?;
            out.values(values)
        }
        DriverRequest::SetParameter { parameter, value } => {
            out.put(&[8, *parameter])?;
            out.f64(*value)
        }
        DriverRequest::SetLoad { chain, load } => {
            out.put(&[9, *chain])?;
            out.f64(load.mass)?;
            out.f64s(&load.com)?;
            out.f64s(&load.inertia)
        }
        DriverRequest::SetTool { chain, tool } => {
            out.put(&[10, *chain])?;
            out.pose(tool)
        }
    }
}

fn write_move(wanted: &DelegatedMove, out: &mut Writer<'_>) -> Option<()> {
    out.u32(wanted.number)?;
    out.f64s(&[wanted.speed, wanted.blend_radius_m])?;
    out.u8(u8::from(wanted.connect))?;
    let (kind, chain, pose) = match &wanted.goal {
        DelegatedGoal::Joint(positions) => {
            out.put(&[1, joint_count(positions)])?;
            return out.joints(positions);
        }
        DelegatedGoal::Pose { chain, pose } => (2, chain, pose),
        DelegatedGoal::Linear { chain, pose } => (3, chain, pose),
    };
    out.put(&[kind, *chain])?;
    out.pose(pose)
}

fn read_order(kind: u8, reader: &mut Reader<'_>) -> Result<DriverRequest, WireError> {
    Ok(match kind {
        1 => DriverRequest::Home(JointSet::from_bits(reader.u16()?)),
        2 => DriverRequest::Move(read_move(reader)?),
        3 => DriverRequest::StopMotion,
        4 => DriverRequest::PauseMotion,
        5 => DriverRequest::ResumeMotion,
        6 => DriverRequest::SetSpeedRatio(reader.within([0.01, 1.0], "speed ratio")?),
        7 => DriverRequest::SetSignal { signal: reader.u8()?, values: reader.values("values")? },
        8 => DriverRequest::SetParameter { parameter: reader.u8()?, value: reader.f64("value")? },
        9 => DriverRequest::SetLoad {
            chain: reader.u8()?,
            load: LoadSetting {
                mass: reader.within([0.0, MAX_VALUE], "mass")?,
                com: reader.f64s("centre of mass")?,
                inertia: reader.f64s("inertia")?,
            },
        },
        10 => DriverRequest::SetTool { chain: reader.u8()?, tool: reader.pose("tool")? },
        _ => return Err(WireError::Field { field: "order" }),
    })
}

fn read_move(reader: &mut Reader<'_>) -> Result<DelegatedMove, WireError> {
    let number = reader.u32()?;
    let speed = reader.within([f64::MIN_POSITIVE, 1.0], "speed")?;
    let blend_radius_m = reader.within([0.0, MAX_VALUE], "blend radius")?;
    let connect = reader.flags(1, "connect")? == 1;
    let goal = match reader.u8()? {
        1 => {
            let joints = reader.joint_count()?;
            DelegatedGoal::Joint(reader.joints(joints, "positions")?)
        }
        2 => DelegatedGoal::Pose { chain: reader.u8()?, pose: reader.pose("pose")? },
        3 => DelegatedGoal::Linear { chain: reader.u8()?, pose: reader.pose("pose")? },
        _ => return Err(WireError::Field { field: "goal" }),
    };
    Ok(DelegatedMove { number, goal, speed, blend_radius_m, connect })
}
