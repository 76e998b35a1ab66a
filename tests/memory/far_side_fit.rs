//! Comparison of a far side's capability with the configuration: at arming, at a reset with the drives on, and at a change
//! of the command mode.

use std::cell::Cell;
use std::rc::Rc;

use contract::{Capability, Feedback, Reject};
use controller::switches::CommandMode;

use crate::common::linked::{LINK, linked};
use crate::common::prelude::*;
use crate::linked_node::{LinkedNode, Network, Peer, ask, booted, cycles, engage};

/// Time after which a node takes a restarted far side for the current one, and the one before for left.
const RESTART: usize = 300;

/// Restarts the far side with another capability.
fn restart(node: &mut LinkedNode, change: impl FnOnce(&mut Capability)) {
    change(&mut node.remote_mut().capability);
    node.remote_mut().handle.restarts.set(true);
    cycles(node, RESTART);
}

/// Boots a node with these keys of `[remote.link]`, and restarts its far side with another capability.
fn booted_beside(keys: &str, change: impl FnOnce(&mut Capability)) -> LinkedNode {
    let (mut node, _) = booted("kraft_like", &format!("{LINK}\n{keys}"), Network::default());
    restart(&mut node, change);
    node
}

/// Returns the answer to an arming of a node whose far side has another capability.
fn armed(keys: &str, change: impl FnOnce(&mut Capability)) -> Result<Mode, String> {
    ask(&mut booted_beside(keys, change), Request::Arm)
}

fn worse_hold(limit: &str, found: &str) -> Result<Mode, String> {
    Err(format!(
        "remote.link.hold_after_ms is {limit}, and the far side has {found}: correct the key, or the far side"
    ))
}

#[test]
fn hazard_34_only_a_hold_after_100_ms_at_most_is_armed() {
    let hold = |keys: &str, seconds: f64| armed(keys, |has| has.hold_after = seconds);
    for seconds in [0.0, 0.05, 0.1, f64::from(0.1_f32), 0.1 + 5e-9] {
        assert_eq!(hold("", seconds), Ok(Mode::Armed), "{seconds} s");
    }
    assert_eq!(hold("", 1.0), worse_hold("100", "1000"));
    assert_eq!(hold("", 0.101), worse_hold("100", "101"));
    assert_eq!(hold("hold_after_ms = 1000.0", 1.0), Ok(Mode::Armed));
    assert_eq!(hold("hold_after_ms = 50.0", 0.1), worse_hold("50", "100"));
}

#[test]
fn hazard_34_longer_hold_of_a_restarted_robot_is_not_reset() {
    let (mut node, handle) = booted("kraft_like", LINK, Network::default());
    engage(&mut node);
    handle.is_cut.set(true);
    cycles(&mut node, 100);
    assert_eq!((node.mode(), node.cause()), (Mode::ReflectionOff, Some(Cause::LinkLost)));
    handle.is_cut.set(false);
    restart(&mut node, |has| has.hold_after = 1.0);
    assert_eq!(ask(&mut node, Request::Reset), worse_hold("100", "1000"));
    restart(&mut node, |has| has.hold_after = 0.1);
    assert_eq!(ask(&mut node, Request::Reset), Ok(Mode::Armed));
}

/// Returns the position of {MRF}, in m.
fn position(node: &LinkedNode) -> [f64; 3] {
    node.remote().site.pose().translation.vector.into()
}

#[test]
fn robot_outside_its_workspace_is_not_armed() {
    let p = position(&booted_beside("", |_| {}));
    let beyond = |by: f64| [p.map(|one| one - 0.5), [p[0] + 0.5, p[1] - by, p[2] + 0.5]];
    for (workspace, is_inside) in [
        ([p, p], true),
        (beyond(0.9e-3), true),
        (beyond(1.1e-3), false),
        (beyond(0.1), false),
        ([[-1e9; 3], [1e9; 3]], true),
        ([[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]], true),
    ] {
        let answer = armed("", |has| has.workspace = workspace);
        assert_eq!(answer.is_ok(), is_inside, "{workspace:?} around {p:?}: {answer:?}");
    }
    let [x, _, z] = p;
    assert_eq!(
        armed("", |has| has.workspace = [[0.5, -1.0, 0.45], [1.0; 3]]).unwrap_err(),
        format!(
            "the far side is outside its own workspace: x of {{MRF}} is {x:.4} m, and must be within 0.5..=1: move the \
             robot, or correct the workspace; the far side is outside its own workspace: z of {{MRF}} is {z:.4} m, and \
             must be within 0.45..=1: move the robot, or correct the workspace"
        )
    );
}

#[test]
fn robot_that_left_its_workspace_is_not_reset() {
    let (mut node, handle) = booted("kraft_like", LINK, Network::default());
    engage(&mut node);
    handle.hold.set(Some(contract::Reason::Robot));
    cycles(&mut node, 100);
    assert_eq!(node.mode(), Mode::ReflectionOff);
    restart(&mut node, |has| has.workspace = [[0.5, -1.0, -1.0], [1.0; 3]]);
    let refused = ask(&mut node, Request::Reset).unwrap_err();
    assert!(refused.starts_with("the far side is outside its own workspace: x "), "{refused}");
    restart(&mut node, |has| has.workspace = [[-1.0; 3], [1.0; 3]]);
    assert_eq!(ask(&mut node, Request::Reset), Ok(Mode::Armed));
}

#[test]
fn workspace_counts_only_for_a_robot_that_senses_its_pose() {
    let refused = armed("", |has| {
        has.senses_pose = false;
        has.workspace = [[5.0; 3], [6.0; 3]];
    });
    assert_eq!(refused, Err("the far side does not measure its pose".to_owned()));
}

/// Change of a capability, or of its message.
type Change<T> = fn(&mut T);

const NO_POSES: &str = "the far side does not follow poses";
const NO_RATES: &str = "the far side does not follow rates";

#[test]
fn far_side_must_follow_the_present_command_mode_alone() {
    use CommandMode::{Pose, Rate};
    for (rates, poses, mode, refused) in [
        (true, false, Rate, None),
        (true, false, Pose, Some(NO_POSES)),
        (false, true, Pose, None),
        (false, true, Rate, Some(NO_RATES)),
        (false, false, Rate, Some(NO_RATES)),
    ] {
        let mut node = booted_beside("", |has| {
            (has.follows_rates, has.follows_poses) = (rates, poses);
        });
        assert_eq!(ask(&mut node, Request::Command(mode)), Ok(Mode::Ready), "before arming");
        let answer = ask(&mut node, Request::Arm);
        assert_eq!(answer.err().as_deref(), refused, "rates {rates}, poses {poses}: {mode:?}");
    }
}

#[test]
fn armed_node_takes_no_mode_that_the_far_side_lacks() {
    let mut node = booted_beside("", |has| has.follows_poses = false);
    let pose = Request::Command(CommandMode::Pose);
    engage(&mut node);
    assert_eq!(ask(&mut node, pose), Err(NO_POSES.to_owned()), "engaged");
    assert_eq!(ask(&mut node, Request::Command(CommandMode::Rate)), Ok(Mode::Engaged));
    let rates = (0..100).all(|_| !matches!(node.cycle().output.command, Motion::Pose(_)));
    assert!(rates && node.cause().is_none(), "{:?}", node.cause());
    // Not armed, each mode is accepted, and the reset compares it.
    node.remote().handle.hold.set(Some(contract::Reason::Robot));
    cycles(&mut node, 100);
    assert_eq!(ask(&mut node, pose), Ok(Mode::ReflectionOff));
    assert_eq!(ask(&mut node, Request::Reset), Err(NO_POSES.to_owned()));
    assert_eq!(ask(&mut node, Request::Command(CommandMode::Rate)), Ok(Mode::ReflectionOff));
    assert_eq!(ask(&mut node, Request::Reset), Ok(Mode::Armed));
}

#[test]
fn armed_node_takes_each_mode_that_the_far_side_follows() {
    let mut node = booted_beside("", |_| {});
    engage(&mut node);
    for mode in [CommandMode::Pose, CommandMode::Rate] {
        assert_eq!(ask(&mut node, Request::Command(mode)), Ok(Mode::Engaged));
        cycles(&mut node, 50);
    }
    assert_eq!(node.cause(), None);
}

#[test]
fn rejected_capability_is_named_with_its_figure() {
    let refused = |change: fn(&mut Capability)| {
        armed("", change).unwrap_err().split_once("rejected: ").unwrap().1.to_owned()
    };
    let cases: [(Change<Capability>, &str); 5] = [
        (
            |has| has.hold_after = -0.1,
            "hold_after must be within 0..=1000000000, got -0.1: correct the far side by docs/link.md",
        ),
        (
            |has| has.servo_lag = f64::NAN,
            "servo_lag must be within 0..=1000000000, got NaN: correct the far side by docs/link.md",
        ),
        (
            |has| has.max_speed[1] = -2.0,
            "max_speed must be within 0..=1000000000, got -2: correct the far side by docs/link.md",
        ),
        (
            |has| has.workspace[0][2] = f64::NAN,
            "workspace_low must be within -1000000000..=1000000000, got NaN: correct the far side by docs/link.md",
        ),
        (
            |has| has.workspace = [[0.5, -1.0, -1.0], [0.25, 1.0, 1.0]],
            "workspace_high must be within 0.5..=1000000000, got 0.25: correct the far side by docs/link.md",
        ),
    ];
    for (change, reason) in cases {
        assert_eq!(refused(change), reason);
    }
}

/// Returns a peer that has each capability changed, and in place of a feedback sends one that was not requested.
fn changing(
    change: impl Fn(&mut Vec<u8>) + 'static,
    unasked: Rc<Cell<Option<Capability>>>,
) -> Peer {
    Box::new(move |_, _, mut messages| {
        for message in &mut messages {
            if message.len() == Capability::LENGTH {
                change(message);
            } else if let Some(capability) = unasked.take() {
                *message = capability.encode(&Feedback::decode(message).unwrap().head).to_vec();
            }
        }
        messages
    })
}

#[test]
fn rejected_capability_is_named_with_its_reason() {
    let refused = |change: fn(&mut Vec<u8>)| {
        let (mut node, handle) = booted("kraft_like", LINK, Network::default());
        *handle.peer.borrow_mut() = Some(changing(change, Rc::default()));
        restart(&mut node, |_| {});
        ask(&mut node, Request::Arm).unwrap_err()
    };
    let rejected = "the far side's capability is rejected: ";
    let cases: [(Change<Vec<u8>>, &str); 7] = [
        (|message| message[44] = 9, "senses must be within 0..=7, got 9"),
        (|message| message[45] = 4, "follows must be within 0..=3, got 4"),
        (|message| message[46] = 3, "payload_removal must be within 0..=2, got 3"),
        (|message| message.truncate(268), "length"),
        (|message| message[5] = 2, "version"),
        (|message| message[4 + 2] = 9, "arm"),
        // Its number is that of a message of long ago.
        (|message| message[20..28].copy_from_slice(&1_u64.to_le_bytes()), "replayed"),
    ];
    for (change, reason) in cases {
        let text = refused(change);
        assert!(text.starts_with(&format!("{rejected}{reason}: ")), "{reason}: {text}");
    }
    // Another session's message says nothing about the far side.
    let text = refused(|message| message[12..20].copy_from_slice(&0xbad_u64.to_le_bytes()));
    assert!(text.starts_with("the far side has not said yet"), "{text}");
}

#[test]
fn corrected_capability_is_accepted_without_a_restart() {
    let mut node = booted_beside("", |has| has.hold_after = f64::NAN);
    let refused = ask(&mut node, Request::Arm).unwrap_err();
    assert!(refused.contains("hold_after must be"), "{refused}");
    node.remote_mut().capability.hold_after = 0.1;
    cycles(&mut node, 10);
    assert_eq!(ask(&mut node, Request::Arm), Ok(Mode::Armed));
}

#[test]
fn rejected_capability_after_a_valid_one_has_no_effect() {
    let (mut node, handle) = booted("kraft_like", LINK, Network::default());
    let unasked = Rc::new(Cell::new(None));
    *handle.peer.borrow_mut() = Some(changing(|_| {}, Rc::clone(&unasked)));
    let has = node.remote().capability;
    unasked.set(Some(Capability { hold_after: -1.0, ..has }));
    // Before the node could have another one.
    node.cycle();
    assert_eq!(ask(&mut node, Request::Arm), Ok(Mode::Armed));
    cycles(&mut node, 10);
    let rejects = node.remote().thread.latest().get().rejects;
    assert_eq!(rejects, [(Reject::Impossible, 1)]);
}

#[test]
fn later_capability_counts_from_the_next_arming_on() {
    let (mut node, handle) = booted("kraft_like", LINK, Network::default());
    let unasked = Rc::new(Cell::new(None));
    *handle.peer.borrow_mut() = Some(changing(|_| {}, Rc::clone(&unasked)));
    engage(&mut node);
    let has = node.remote().capability;
    unasked.set(Some(Capability { hold_after: 1.0, follows_poses: false, ..has }));
    cycles(&mut node, 100);
    assert_eq!((node.mode(), node.cause()), (Mode::Engaged, None), "compared at the arming");
    let pose = Request::Command(CommandMode::Pose);
    assert_eq!(ask(&mut node, pose), Err(NO_POSES.to_owned()));
    ask(&mut node, Request::Disarm).unwrap();
    cycles(&mut node, 200);
    assert_eq!(node.mode(), Mode::Ready);
    assert_eq!(ask(&mut node, Request::Arm), worse_hold("100", "1000"));
}

#[test]
fn shipped_hands_with_a_link_ask_for_a_hold_after_100_ms() {
    for hand in ["kraft_like", "jpl_like", "sixr_spherical"] {
        let stated = parse(KRAFT, &linked(hand, LINK)).far_side.agreement.unwrap().stated;
        assert_eq!(stated.hold_after.to_bits(), 0.1_f64.to_bits(), "{hand}");
    }
}
