//! What the operator does in every test: presses the deadman over and over, soon after each release, so
//! that a test need not know when the node is ready, and a latch is tried again and again; and moves to
//! and fro, so that no joint stands still.

use std::fmt::Write;

/// When the deadman is closed first, in s after the first SYNC.
const FIRST: f64 = 0.2;

/// From one press to the next, and how long each lasts, in s.
const EVERY: f64 = 0.36;
const PRESSED: f64 = 0.30;

/// For so many presses: longer than any test runs.
const PRESSES: u32 = 40;

/// The rhythm, as a scenario.
pub(crate) fn rhythm() -> String {
    scenario((0..PRESSES).map(|press| {
        let at = FIRST + EVERY * f64::from(press);
        (at, at + PRESSED)
    }))
}

/// One long press, for what takes longer to be seen.
pub(crate) fn long_press() -> String {
    scenario([(FIRST, FIRST + 5.0)].into_iter())
}

fn scenario(presses: impl Iterator<Item = (f64, f64)>) -> String {
    let mut text = String::from("seconds = 30.0\n");
    let mut switch = |at: f64, what: &str| {
        writeln!(text, "[[switch]]\nat_s = {at:.3}\n{what}").unwrap();
    };
    for (place, (closed, opened)) in presses.enumerate() {
        switch(closed, "deadman = true");
        if place == 0 {
            switch(closed + 0.02, "reflection = true");
            switch(closed + 0.06, "reflection = false");
        }
        switch(opened, "deadman = false");
    }
    for swing in 0..30 {
        let at = 0.2 + 0.5 * f64::from(swing);
        let y = if swing % 2 == 0 { 0.03 } else { -0.03 };
        let to = format!("duration_s = 0.5\nto_m = [0.0, {y}, 0.0]");
        writeln!(text, "[[move]]\nat_s = {at:.1}\n{to}").unwrap();
    }
    text
}
