//! Signals at torque: some stop the node in order, the others do nothing. Hazard 30.

use nix::sys::signal::Signal;

use crate::gateway::{Gateway, NODE};
use crate::rig::{NODES, Rig, Setup, cycles, millis};

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
fn hazard_30_signals_1_to_64_but_32_and_33_end_nothing_else() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("all-signals", &Setup::default());
    for number in 1..=64_u8 {
        let signal = Signal::try_from(i32::from(number)).ok();
        // The C library reserves 32 and 33: programs cannot block them. They end it, and the drives stop alone.
        let is_left_out = matches!(number, 32 | 33);
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
