//! Opening of a script: the mode, arming, and the switches that precede the motion.

use sim::scenario::operator::{Console, Switch};
use sim::scenario::{ConsoleRequest, Entry};

/// Times at which the deadman switches on, and reflection is pressed and let go, in s.
pub(crate) const SWITCHES_S: [f64; 3] = [1.5, 1.6, 1.7];

/// Times at which the reference is pressed and let go, in s.
const REFERENCE_S: [f64; 2] = [2.0, 2.1];

/// Returns the requests of `mode` and to arm, and the deadman and reflection at these times in s.
pub(crate) fn engaged(mode: ConsoleRequest, [deadman, pressed, let_go]: [f64; 3]) -> [Entry; 5] {
    [
        Entry::Console(Console::new(0.1, mode)),
        Entry::Console(Console::new(0.2, ConsoleRequest::Arm)),
        Entry::Switch(Switch::deadman(deadman, true)),
        Entry::Switch(Switch::reflection(pressed, true)),
        Entry::Switch(Switch::reflection(let_go, false)),
    ]
}

/// Returns the entries of [`engaged`] at [`SWITCHES_S`], then those that press the reference.
pub(crate) fn referenced(mode: ConsoleRequest) -> impl Iterator<Item = Entry> {
    let [pressed, let_go] = REFERENCE_S;
    let reference = [(pressed, true), (let_go, false)];
    let reference = reference.map(|(at_s, is_on)| Entry::Switch(Switch::reference(at_s, is_on)));
    engaged(mode, SWITCHES_S).into_iter().chain(reference)
}
