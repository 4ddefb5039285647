//! A controller that restarts so quickly that nobody calls it silence, with the loop before it.

use std::sync::Arc;

use armada_model::Pose;
use arrayvec::ArrayVec;

use super::moves::{arm, config as arm_config};
use super::*;
use crate::control::{Equipment, EquippedChain, Input, LoopAbilities, LoopState, Params, step};
use crate::drivers::LoadSetting;

fn equipment() -> Arc<Equipment> {
    let chain = arm(1).chains.into_iter().flatten().next().expect("a chain");
    let load = LoadSetting { mass: 2.5, ..LoadSetting::default() };
    let (tcp, base_in_world) = (Pose::from_translation(0.0, 0.0, 0.1), Pose::default());
    let chain = EquippedChain { chain, tcp, base_in_world, joints: (0..6).collect(), load };
    Arc::new(Equipment { config_seqno: 1, chains: vec![chain] })
}

fn params() -> Params {
    let limits = arm(1).joints.iter().map(|joint| joint.limits).collect();
    let abilities = LoopAbilities { load: true, move_pose: true, ..LoopAbilities::default() };
    Params {
        equipment: equipment(),
        abilities,
        // Longer than the driver waits until it asks who is there.
        communication_timeout: HEARD_AGAIN_WITHIN,
        ..Params::for_joints(limits, PERIOD).expect("six joints")
    }
}

const HEARD_AGAIN_WITHIN: Duration = Duration::from_millis(300);

/// Runs loop, driver and emulator; what the loop asks of the controller.
fn run(pair: &mut Pair, params: &Params, state: &mut LoopState, ticks: u32) -> Vec<DriverRequest> {
    let mut asked = Vec::new();
    for _ in 0..ticks {
        pair.tick();
        let mut input = Input {
            now: pair.now,
            feedback: pair.driver.feedback().copied(),
            stop: None,
            resets: 0,
            loop_error: false,
            requests: ArrayVec::new(),
            stream: ArrayVec::new(),
            group: ArrayVec::new(),
        };
        let output = step(params, state, &mut input);
        let faults = output.events.iter().filter(|event| format!("{event:?}").contains("Fault"));
        assert_eq!(faults.count(), 0, "{:?}", output.events);
        if let Some(request) = output.driver_request {
            pair.request(request);
            asked.push(request);
        }
    }
    asked
}

/// How often the tool and the load were told, as they are.
fn told(asked: &[DriverRequest]) -> [usize; 2] {
    let (mut tools, mut loads) = (0, 0);
    for request in asked {
        match request {
            DriverRequest::SetTool { chain: 0, tool } => {
                assert_eq!(tool.position().z, 0.1);
                tools += 1;
            }
            DriverRequest::SetLoad { chain: 0, load } => {
                assert_eq!(load.mass, 2.5);
                loads += 1;
            }
            _ => {}
        }
    }
    [tools, loads]
}

#[test]
fn a_controller_that_restarts_within_the_timeout_is_told_tool_and_load_again() {
    let params = params();
    let mut state = LoopState::new(&params).expect("sensible");
    let mut pair = Pair::of(arm, arm_config(), Weather::default());
    let asked = run(&mut pair, &params, &mut state, 100);
    assert_eq!(told(&asked), [1, 1]);
    let first = pair.feedback().session;
    pair.emulator = config(arm_config()).emulator(&arm(33)).expect("emulator");
    let asked = run(&mut pair, &params, &mut state, 200);
    assert_ne!(pair.feedback().session, first);
    assert_eq!(told(&asked), [1, 1], "told again, once");
}
