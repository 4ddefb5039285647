//! The book against a simple model, and what it makes for the loop.

use armada_model::{JointLimits, Pose, RobotModel};
use armada_protocol::messages::{
    AttachPayloadParams, AttachToolParams, DetachParams, Inertia, PayloadInfo, ToolInfo, ToolType,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;

const URDF: &str = r#"<robot name="twins"><link name="world"/>
  <link name="left"/><link name="left_hand"/><link name="right"/><link name="right_hand"/>
  <joint name="l" type="revolute"><parent link="world"/><child link="left"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
  <joint name="lh" type="fixed"><parent link="left"/><child link="left_hand"/>
    <origin xyz="0.5 0 0"/></joint>
  <joint name="r" type="revolute"><parent link="world"/><child link="right"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
  <joint name="rh" type="fixed"><parent link="right"/><child link="right_hand"/>
    <origin xyz="0 0.5 0"/></joint></robot>"#;

fn tool(name: &str) -> ToolInfo {
    ToolInfo {
        name: name.to_owned(),
        uuid: None,
        tool_type: ToolType::Other,
        tcp: Pose::from_translation(0.0, 0.0, 0.2),
        inertia: Inertia { mass_kg: 1.0, com_m: [0.0, 0.0, 0.1], inertia_kg_m2: [0.0; 6] },
        description: String::new(),
    }
}

fn payload(name: &str) -> PayloadInfo {
    let inertia = Inertia { mass_kg: 3.0, com_m: [0.0; 3], inertia_kg_m2: [0.0; 6] };
    PayloadInfo { name: name.to_owned(), uuid: None, inertia, description: String::new() }
}

fn chains() -> Vec<(String, EquippedChain)> {
    let model = RobotModel::from_urdf(URDF, "twins.urdf").expect("a robot");
    let limits = JointLimits { velocity: 1.0, ..JointLimits::default() };
    let joints = [("l", limits), ("r", limits)];
    let chain = |tip: &str| {
        let chain = EquippedChain::new(&model, ("world", tip), &joints, Pose::default());
        (tip.to_owned(), chain.expect("a chain"))
    };
    vec![chain("left_hand"), chain("right_hand")]
}

fn book() -> EquipmentBook {
    EquipmentBook::new(chains(), vec![tool("gripper"), tool("torch")])
}

fn attach(chain: Option<&str>, name: &str) -> AttachToolParams {
    let (chain, name) = (chain.map(str::to_owned), Some(name.to_owned()));
    AttachToolParams { chain, tool: None, name }
}

fn detach(chain: &str, name: Option<&str>) -> DetachParams {
    DetachParams { chain: Some(chain.to_owned()), name: name.map(str::to_owned) }
}

fn hold(chain: &str, name: &str) -> AttachPayloadParams {
    AttachPayloadParams {
        chain: Some(chain.to_owned()),
        payload: payload(name),
        pose: Pose::from_translation(0.0, 0.0, 0.1),
    }
}

#[test]
fn tool_and_payload_weigh_together_at_the_flange() {
    let mut book = book();
    let change = book.attach_tool(&attach(Some("right_hand"), "gripper")).expect("free");
    book.enter(change);
    let change = book.attach_payload(&hold("right_hand", "box")).expect("free");
    let (chain, load) = change.order.load.expect("a load");
    assert_eq!((chain, load.mass), (1, 4.0));
    // 1 kg at 0.1 m and 3 kg at 0.3 m.
    assert!((load.com[2] - 0.25).abs() < 1e-12, "{load:?}");
    assert!((load.inertia[0] - 0.03).abs() < 1e-12, "{load:?}");
    let chains = &change.order.equipment.chains;
    assert_eq!(chains[1].tcp, Pose::from_translation(0.0, 0.0, 0.2));
    assert_eq!(chains[0].tcp, Pose::default());
}

#[test]
fn the_only_chain_needs_no_name_and_one_of_two_does() {
    let mut one = chains();
    one.truncate(1);
    let book = EquipmentBook::new(one, vec![tool("gripper")]);
    assert!(book.attach_tool(&attach(None, "gripper")).is_ok());
    let error = self::book().attach_tool(&attach(None, "gripper")).expect_err("two chains");
    assert_eq!(error.field(), Some("chain"));
    assert_eq!(error.to_string(), "chain is missing: it is one of left_hand, right_hand");
    let none = EquipmentBook::default().attach_tool(&attach(None, "gripper"));
    assert_eq!(none.expect_err("no chain"), EquipmentError::NoChains);
}

#[test]
fn tools_that_make_no_sense_are_refused_by_field() {
    let book = book();
    let with = |tool: ToolInfo| {
        let chain = Some("left_hand".to_owned());
        let params = AttachToolParams { chain, tool: Some(tool), name: None };
        book.attach_tool(&params).expect_err("no tool")
    };
    assert_eq!(with(tool("")).field(), Some("tool.name"));
    assert_eq!(with(tool(&"x".repeat(65))).field(), Some("tool.name"));
    let mut light = tool("light");
    light.inertia.mass_kg = -1.0;
    assert_eq!(with(light).to_string(), "tool.inertia: mass is -1 kg, below 0");
    let mut odd = tool("odd");
    odd.inertia.inertia_kg_m2 = [1.0, 0.0, 0.0, 1.0, 0.0, 5.0];
    assert_eq!(with(odd).field(), Some("tool.inertia"));
    let unknown = book.attach_tool(&attach(Some("left_hand"), "drill")).expect_err("no drill");
    assert!(unknown.to_string().ends_with("it has gripper, torch"), "{unknown}");
    let both = AttachToolParams { tool: Some(tool("x")), ..attach(Some("left_hand"), "torch") };
    assert_eq!(book.attach_tool(&both).expect_err("both"), EquipmentError::ToolOrName);
}

#[test]
fn a_change_that_the_loop_did_not_grant_leaves_no_trace() {
    let mut book = book();
    let refused = book.attach_tool(&attach(Some("left_hand"), "gripper")).expect("free");
    drop(refused);
    assert_eq!(book.config_seqno(), 1);
    let doubtful = book.attach_tool(&attach(Some("left_hand"), "gripper")).expect("free");
    book.hand_over(&doubtful);
    let change = book.attach_tool(&attach(Some("left_hand"), "torch")).expect("free");
    assert_eq!((doubtful.config_seqno(), change.config_seqno()), (2, 3), "never given twice");
    assert_eq!(change.order.replaces, 1);
    book.enter(change);
    assert_eq!(book.config_seqno(), 3);
}

/// One request of a random story; the numbers choose chain and name.
#[derive(Clone, Copy, Debug)]
enum Step {
    AttachTool(usize, usize),
    DetachTool(usize, Option<usize>),
    AttachPayload(usize, usize),
    DetachPayload(usize, Option<usize>),
}

const CHAINS: [&str; 2] = ["left_hand", "right_hand"];
const NAMES: [&str; 2] = ["gripper", "torch"];

fn steps() -> impl Strategy<Value = Step> {
    let named = || proptest::option::of(0..2_usize);
    prop_oneof![
        (0..2_usize, 0..2_usize).prop_map(|(chain, name)| Step::AttachTool(chain, name)),
        (0..2_usize, named()).prop_map(|(chain, name)| Step::DetachTool(chain, name)),
        (0..2_usize, 0..2_usize).prop_map(|(chain, name)| Step::AttachPayload(chain, name)),
        (0..2_usize, named()).prop_map(|(chain, name)| Step::DetachPayload(chain, name)),
    ]
}

/// What a chain carries, by number; the second is a payload.
type Carried = (Option<usize>, Option<usize>);

/// The rules in four lines: what a step leads to, if it is allowed.
fn expected((tool, payload): Carried, step: Step) -> Option<Carried> {
    let fits = |asked: Option<usize>, is: usize| asked.is_none_or(|asked| asked == is);
    match step {
        Step::AttachTool(_, name) => tool.is_none().then_some((Some(name), None)),
        Step::DetachTool(_, name) => {
            tool.filter(|&is| payload.is_none() && fits(name, is)).map(|_| (None, None))
        }
        Step::AttachPayload(_, name) => {
            tool.filter(|_| payload.is_none()).map(|_| (tool, Some(name)))
        }
        Step::DetachPayload(_, name) => payload.filter(|&is| fits(name, is)).map(|_| (tool, None)),
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 256, rng_seed: RngSeed::Fixed(18), ..ProptestConfig::default()
    })]

    #[test]
    fn tools_and_payloads_keep_their_order_whatever_is_asked(
        story in prop::collection::vec(steps(), 1..40),
    ) {
        let mut book = book();
        let mut model: [Carried; 2] = Default::default();
        for step in story {
            let before = book.config_seqno();
            let (chain, change) = match step {
                Step::AttachTool(chain, name) => {
                    (chain, book.attach_tool(&attach(Some(CHAINS[chain]), NAMES[name])))
                }
                Step::DetachTool(chain, name) => {
                    let params = detach(CHAINS[chain], name.map(|name| NAMES[name]));
                    (chain, book.detach_tool(&params))
                }
                Step::AttachPayload(chain, name) => {
                    (chain, book.attach_payload(&hold(CHAINS[chain], NAMES[name])))
                }
                Step::DetachPayload(chain, name) => {
                    let params = detach(CHAINS[chain], name.map(|name| NAMES[name]));
                    (chain, book.detach_payload(&params))
                }
            };
            let allowed = expected(model[chain], step);
            prop_assert_eq!(change.is_ok(), allowed.is_some(), "{:?} {:?}", step, change);
            let (Ok(change), Some(after)) = (change, allowed) else { continue };
            book.enter(change);
            model[chain] = after;
            prop_assert_eq!(book.config_seqno(), before + 1);
            for (entry, (tool, payload)) in book.equipment().iter().zip(model) {
                let name = entry.tool.as_ref().map(|tool| tool.name.as_str());
                prop_assert_eq!(name, tool.map(|tool| NAMES[tool]));
                let held = entry.payload.as_ref().map(|held| held.payload.name.as_str());
                prop_assert_eq!(held, payload.map(|payload| NAMES[payload]));
            }
        }
    }
}
