//! Operator of every test. It presses the deadman again soon after each release, so a test need not know when the node is
//! ready, and a latched mode is tried repeatedly. It moves back and forth, so no joint is at rest.

use sim::scenario::operator::{Move, Switch};
use sim::scenario::{Entry, Scenario};

/// Time of the first press, in s after the first SYNC.
const FIRST_S: f64 = 0.2;

/// Time from one press to the next, in s.
const PERIOD_S: f64 = 0.36;

/// Duration of a press, in s.
const PRESSED_S: f64 = 0.30;

/// Number of presses: longer than any test runs.
const PRESSES: u32 = 40;

/// Positions between which the hand moves, in m from the start, that leave the arm's weight as it is.
const ASIDE: [f64; 3] = [0.0, 0.03, 0.0];

/// The same, for a motion that changes the weight at the elevation joint by more than a tenth of its torque.
const LIFT: [f64; 3] = [0.05, 0.0, 0.03];

/// Returns repeated presses.
pub(crate) fn rhythm() -> Vec<Entry> {
    let presses = (0..PRESSES).map(|press| {
        let at = FIRST_S + PERIOD_S * f64::from(press);
        (at, at + PRESSED_S)
    });
    entries(presses, ASIDE)
}

/// Returns one long press in which the arm is lifted and lowered, for faults that are detected slowly.
pub(crate) fn long_press() -> Vec<Entry> {
    entries([(FIRST_S, FIRST_S + 5.0)].into_iter(), LIFT)
}

/// Returns the scenario of these entries as a file.
pub(crate) fn scenario(entries: Vec<Entry>) -> String {
    Scenario::new(30.0, entries).unwrap().to_toml()
}

fn entries(presses: impl Iterator<Item = (f64, f64)>, to: [f64; 3]) -> Vec<Entry> {
    let mut entries = Vec::new();
    for (place, (closed, opened)) in presses.enumerate() {
        entries.push(Entry::Switch(Switch::deadman(closed, true)));
        if place == 0 {
            entries.push(Entry::Switch(Switch::reflection(closed + 0.02, true)));
            entries.push(Entry::Switch(Switch::reflection(closed + 0.06, false)));
        }
        entries.push(Entry::Switch(Switch::deadman(opened, false)));
    }
    for swing in 0..30 {
        let at = 0.2 + 0.5 * f64::from(swing);
        let side = if swing % 2 == 0 { 1.0 } else { -1.0 };
        entries.push(Entry::Move(Move::new(at, 0.5, to.map(|position| side * position))));
    }
    entries
}
