//! `armada home`.

use armada_protocol::RobotName;
use armada_protocol::messages::{CommandMode, HomeMethod, HomeParams};
use armada_protocol::method::robot::Home;
use clap::Args;
use uuid::Uuid;

use crate::cell_address::CellArgs;
use crate::choice::one_of;
use crate::exit::Exit;
use crate::motion::enter_mode;
use crate::signals::Signals;
use crate::started::{OnSignal, Started, WaitArgs};

/// Arguments of `armada home`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada home left_arm                              the controller searches all references
  armada home left_arm --order lift --order j1,j2   first lift, then j1 and j2 together
  armada home left_arm --method move-to-home        they know where they are: only move there

The robot is brought into mode homing. To move to the home positions in mode trajectory, use
`armada move ROBOT --home`. Ctrl-C cancels with a ramp.")]
pub(crate) struct HomeArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Joints to home at the same time, after those of the options before; all at once if left out
    #[arg(long, value_name = "JOINT,…")]
    order: Vec<String>,
    /// How: the controller searches, or the joints move to the home positions of the robot file
    #[arg(long, value_name = "HOW", default_value = "controller",
        value_parser = one_of::<HomeMethod>(&["controller", "move-to-home"]))]
    method: HomeMethod,
    #[command(flatten)]
    wait: WaitArgs,
    #[command(flatten)]
    cell: CellArgs,
}

/// Homes the robot.
pub(crate) async fn run(args: HomeArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let mut signals = Signals::new()?;
    enter_mode(&client, &args.robot, CommandMode::Homing).await?;
    let id = Uuid::now_v7();
    let params = HomeParams {
        motion_id: Some(id),
        order: groups(&args.order),
        method: args.method,
        wait: false,
    };
    let started = Started::ask::<Home>(&client, &args.robot, id, params, OnSignal::Cancel).await?;
    started.conclude(&client, args.wait, &args.cell, &mut signals).await
}

fn groups(order: &[String]) -> Vec<Vec<String>> {
    let names = |group: &String| group.split(',').map(|name| name.trim().to_owned()).collect();
    order.iter().map(names).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_option_is_a_group_of_joints() {
        let order = ["lift".to_owned(), "j1, j2".to_owned()];
        assert_eq!(groups(&order), [vec!["lift"], vec!["j1", "j2"]]);
        assert!(groups(&[]).is_empty());
    }
}
