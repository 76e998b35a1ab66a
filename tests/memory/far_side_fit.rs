//! Comparison of a far side's capability with the configuration: at arming, and at a reset with the drives on.

use contract::Capability;

use crate::common::linked::{LINK, linked};
use crate::common::prelude::*;
use crate::linked_node::{LinkedNode, Network, ask, booted, cycles, engage};

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

#[test]
fn shipped_hands_with_a_link_ask_for_a_hold_after_100_ms() {
    for hand in ["kraft_like", "jpl_like", "sixr_spherical"] {
        let stated = parse(KRAFT, &linked(hand, LINK)).far_side.agreement.unwrap().stated;
        assert_eq!(stated.hold_after.to_bits(), 0.1_f64.to_bits(), "{hand}");
    }
}
