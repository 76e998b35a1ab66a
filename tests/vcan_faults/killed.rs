//! A node that is gone from one instruction to the next: row 27. Its frames stop together, because all come
//! from the cycle; the rest is the drives' own.

use std::time::Duration;

use crate::gateway::Gateway;
use crate::gateway::NODE;
use crate::rig::Rig;
use crate::rig::Setup;
use crate::rig::millis;

/// Drives that watch the node's heartbeat alone, and a force that this is quick enough for.
const HEARTBEAT_ONLY: [(&str, &str); 2] = [
    ("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 0 "),
    ("max_force_n = 40.0 ", "max_force_n = 20.0 "),
];

fn killed(name: &str, phases: u32, changes: &[(&'static str, &'static str)], most: Duration) {
    let _gateway = Gateway::at(NODE);
    for phase in 0..phases {
        let setup = Setup { changes: changes.to_vec(), ..Setup::default() };
        // The phase within the cycle is drawn from the name.
        let mut rig = Rig::engaged(&format!("{name}-{phase}"), &setup);
        let onset = rig.onset();
        rig.kill_node();
        rig.seen_after(onset, most * 2).all_are_free_within(most);
    }
}

#[test]
fn hazard_27_killed_at_twenty_phases_of_its_cycle_it_leaves_the_drives_free_within_6_ms() {
    killed("killed", 20, &[], millis(6));
}

#[test]
fn hazard_27_without_rpdo_timers_the_heartbeat_leaves_the_drives_free_within_25_ms() {
    killed("heartbeat-only", 5, &HEARTBEAT_ONLY, millis(25));
}
