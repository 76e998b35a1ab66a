//! The control socket: clients that hold it, and requests that outlive their client. Hazards 30 and 40.

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use crate::gateway::{Gateway, NODE};
use crate::rig::{Rig, Setup, cycles, millis};

const ARM: &[u8] = b"{\"ask\":\"arm\"}\n";

#[test]
fn hazard_30_disarm_acts_beside_clients_that_hold_the_console() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("held-console", &Setup::default());
    let idle = rig.client();
    let mut half = rig.client();
    half.write_all(b"{\"ask").unwrap();
    let mut unread = rig.client();
    unread.set_nonblocking(true).unwrap();
    while unread.write_all(b"{\"ask\":\"status\"}\n").is_ok() {}
    let mut arming = rig.client();
    arming.write_all(&ARM.repeat(50)).unwrap();
    let onset = rig.onset();
    rig.ctl("disarm").succeeds();
    rig.run_for(millis(60));
    rig.is("ready");
    let (outcome, _) = rig.terminate_node();
    for done in ["console: arm: armed uid=", "console: disarm: torque ramps to zero uid="] {
        assert!(outcome.stderr.contains(done), "{done}: {}", outcome.stderr);
    }
    let seen = rig.seen_after(onset, millis(70));
    // A ramp of 50 ms, and the drives' time to zero.
    seen.all_are_free_within(millis(50) + cycles(3));
    drop((idle, half, unread, arming));
}

/// New connections per burst, and the time between two bursts.
const FLOOD: (usize, Duration) = (25, Duration::from_millis(1));

#[test]
fn hazard_30_disarm_acts_beside_25_connections_a_millisecond() {
    let _gateway = Gateway::at(NODE);
    for (name, kept) in [("closed", 0), ("held", 500)] {
        let mut rig = Rig::engaged(&format!("flood-{name}"), &Setup::default());
        let socket = rig.socket();
        let (is_over, opened) = (AtomicBool::new(false), AtomicUsize::new(0));
        let onset = thread::scope(|threads| {
            threads.spawn(|| flood(&socket, kept, &is_over, &opened));
            rig.run_for(millis(20));
            let onset = rig.onset();
            let before = opened.load(Ordering::Relaxed);
            let disarmed = rig.ctl("disarm");
            let beside = opened.load(Ordering::Relaxed) - before;
            // The test is valid only during the flood.
            rig.run_for(millis(60));
            is_over.store(true, Ordering::Relaxed);
            assert_eq!(disarmed.code, Some(0), "{name}: {}", disarmed.stderr);
            println!(
                "{name}: {} connections in all, {beside} beside the request",
                opened.load(Ordering::Relaxed)
            );
            onset
        });
        assert!(opened.into_inner() > 1_000, "{name}");
        rig.is("ready");
        // A ramp of 50 ms, and the drives' time to zero.
        rig.seen_after(onset, millis(70)).all_are_free_within(millis(50) + cycles(3));
    }
}

/// Opens bursts of connections until `is_over`, for at most five seconds, and keeps this number of them open.
fn flood(socket: &str, kept: usize, is_over: &AtomicBool, opened: &AtomicUsize) {
    let mut open = std::collections::VecDeque::new();
    for _ in (0..5_000).take_while(|_| !is_over.load(Ordering::Relaxed)) {
        for _ in 0..FLOOD.0 {
            let Ok(client) = UnixStream::connect(socket) else { break };
            opened.fetch_add(1, Ordering::Relaxed);
            open.push_back(client);
        }
        while open.len() > kept {
            open.pop_front();
        }
        thread::sleep(FLOOD.1);
    }
}

#[test]
fn hazard_40_arm_requested_during_a_boot_never_acts() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::started("boot-arm", &Setup::default());
    // The first request to a drive: the boot has begun.
    rig.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x601));
    let status = rig.status();
    assert_eq!(status["mode"], "boot", "{status}");
    let refused = rig.ctl("arm");
    assert_eq!(refused.code, Some(1), "{}", refused.stderr);
    assert!(refused.stderr.contains("the node is booting"), "{}", refused.stderr);
    // One client does not wait for its answer, the other does.
    rig.client().write_all(ARM).unwrap();
    let mut stays = rig.client();
    stays.write_all(ARM).unwrap();
    rig.ctl("--wait status").succeeds();
    rig.run_for(millis(200));
    rig.is("ready");
}
