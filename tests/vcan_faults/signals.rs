//! Signals while drives exert torque: some stop the node in an orderly way, the others have no effect. Hazard 30.

use nix::sys::signal::Signal;

use crate::common::log::NODES;
use crate::gateway::{Gateway, NODE};
use crate::rig::{Rig, Setup, cycles, millis};

/// Signals that stop the node in order.
const STOPS: [Signal; 5] =
    [Signal::SIGINT, Signal::SIGTERM, Signal::SIGQUIT, Signal::SIGPWR, Signal::SIGXCPU];

/// Signals of a defect, and those that cannot be blocked.
const ENDS: [Signal; 9] = [
    Signal::SIGILL,
    Signal::SIGTRAP,
    Signal::SIGABRT,
    Signal::SIGBUS,
    Signal::SIGFPE,
    Signal::SIGSEGV,
    Signal::SIGSYS,
    Signal::SIGKILL,
    Signal::SIGSTOP,
];

#[test]
fn hazard_30_signals_1_to_64_but_32_end_nothing_else() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("all-signals", &Setup::default());
    for number in 1..=64_u8 {
        let signal = Signal::try_from(i32::from(number)).ok();
        // The C library reserves 32 and 33: programs cannot block them. glibc has a handler of 33 alone.
        let is_left_out = number == 32 || (number == 33 && !cfg!(target_env = "gnu"));
        if !is_left_out && !signal.is_some_and(|it| STOPS.contains(&it) || ENDS.contains(&it)) {
            rig.node.as_ref().unwrap().signal_number(number);
        }
    }
    rig.run_for(millis(20));
    let mode = rig.status()["mode"].clone();
    assert!(mode == "armed" || mode == "engaged", "{mode}");
    let onset = rig.onset();
    let (outcome, _) = rig.terminate_node();
    outcome.succeeds();
    for ignored in ["SIGHUP", "SIGUSR1", "SIGPIPE", "SIGTSTP", "SIGXFSZ", "signal 34", "signal 64"]
    {
        assert!(outcome.stderr.contains(&format!("{ignored}: ignored")), "{}", outcome.stderr);
    }
    assert!(rig.seen_after(onset, millis(5)).pushed(2), "there was torque to the end");
}

#[test]
fn hazard_27_signal_32_leaves_drives_torque_free_in_6_ms() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("signal-32", &Setup::default());
    let onset = rig.onset();
    let node = rig.node.take().unwrap();
    node.signal_number(32);
    let outcome = node.wait();
    assert_eq!(outcome.code, None, "ended by a signal: {}", outcome.stderr);
    rig.seen_after(onset, millis(12)).all_are_free_within(millis(6));
}

#[test]
fn hazard_27_no_address_space_leaves_drives_torque_free() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("address-space", &Setup::default());
    rig.node.as_ref().unwrap().limit_address_space();
    // Each client needs memory.
    let clients: Vec<_> = (0..16).map(|_| rig.client()).collect();
    let outcome = rig.until_node_ends();
    assert_eq!(outcome.code, None, "aborted: {}", outcome.stderr);
    assert!(outcome.stderr.contains("memory allocation of"), "{}", outcome.stderr);
    let now = rig.now();
    let seen = rig.seen_after(now, millis(12)).since_last_sync();
    seen.all_are_free_within(millis(6));
    println!(
        "aborted without memory: torque-free {:?} after its last SYNC",
        seen.last_is_free_after()
    );
    drop(clients);
}

#[test]
fn hazard_27_start_without_address_space_names_its_reason() {
    let _gateway = Gateway::at(NODE);
    let mut named = 0;
    // Around the size of the program with its libraries: what fails first is a library, a thread, or an allocation.
    for limit in (15_000..=19_000).step_by(250) {
        let shell = format!("ulimit -v {limit}").leak();
        let mut rig = Rig::started("no-start", &Setup { shell, ..Setup::default() });
        let outcome = rig.node.take().unwrap().wait();
        let reasons = match outcome.code {
            Some(4) => ["frhc: cannot "].as_slice(),
            Some(127) => &["error while loading shared libraries"],
            // The second is the standard library's, before `main`.
            _ => &["memory allocation of ", "failed to allocate an alternative stack"],
        };
        let is_named = reasons.iter().any(|reason| outcome.stderr.contains(reason));
        assert!(is_named, "{shell}: {:?} {}", outcome.code, outcome.stderr);
        named += u32::from(outcome.code == Some(4));
        let lines = rig.candump.finish();
        assert!(!lines.iter().any(|line| line.contains(" 080#")), "{shell}: a SYNC was sent");
    }
    assert!(named > 0, "no limit is that of a thread");
}

#[test]
fn hazard_30_signals_that_stop_the_node_stop_it_in_order() {
    let _gateway = Gateway::at(NODE);
    for signal in STOPS {
        let mut rig = Rig::engaged(signal.as_str(), &Setup::default());
        let onset = rig.onset();
        let node = rig.node.take().unwrap();
        node.signal(signal);
        let outcome = node.wait();
        outcome.succeeds();
        assert!(outcome.stderr.contains(&format!("signal=\"{signal}\"")), "{}", outcome.stderr);
        let seen = rig.seen_after(onset, millis(5));
        seen.all_are_free_within(millis(50) + cycles(2));
        seen.log().ends_with_every_drive_off(NODES);
    }
}
