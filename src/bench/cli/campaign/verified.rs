//! `frhc campaign --verify-replay`: every case replayed from the recorded inputs of its node.

use std::fmt;

use serde::Serialize;

use campaign::verification::Verification;
use run::exit::{Failure, Kind};
use units::wording::counted;

/// Numbers of replayed cases, cycles and frames, and the differences.
#[derive(Debug, Serialize)]
pub(super) struct ReplayReport {
    case_count: usize,
    cycle_count: u64,
    frame_count: u64,
    /// Cases whose replay differs from the recording.
    differences: Vec<Difference>,
}

/// Case whose replay differs from the recording.
#[derive(Debug, Serialize)]
struct Difference {
    case: u32,
    difference: String,
    /// Command that records the session of the case.
    replay: String,
}

/// Replays in progress: their numbers, and the cases that differ.
#[derive(Debug, Default)]
pub(super) struct Replays {
    cases: usize,
    cycles: u64,
    frames: u64,
    /// Case and difference.
    differing: Vec<(u32, String)>,
}

impl Replays {
    /// Adds the results of some cases.
    pub(super) fn add(&mut self, verified: Vec<Verification>) {
        for Verification { case, cycles, frames, difference } in verified {
            self.cases += 1;
            self.cycles += cycles;
            self.frames += frames;
            self.differing.extend(difference.map(|difference| (case, difference)));
        }
    }

    /// Returns the report; `command` returns the command that records the session of a case.
    pub(super) fn report(self, command: &dyn Fn(u32) -> String) -> ReplayReport {
        let Self { cases, cycles, frames, differing } = self;
        let difference =
            |(case, difference)| Difference { case, difference, replay: command(case) };
        ReplayReport {
            case_count: cases,
            cycle_count: cycles,
            frame_count: frames,
            differences: differing.into_iter().map(difference).collect(),
        }
    }
}

impl ReplayReport {
    /// # Errors
    /// Returns an error if the replay of a case differs from the recording.
    pub(super) fn ensure_equal(&self) -> Result<(), Failure> {
        match &*self.differences {
            [] => Ok(()),
            differing => {
                let numbers: Vec<_> = differing.iter().map(|one| one.case.to_string()).collect();
                let reason = format!("not replayed as recorded: cases {}", numbers.join(", "));
                Err(Failure::new(Kind::Negative, reason))
            }
        }
    }
}

impl fmt::Display for ReplayReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { case_count, cycle_count, frame_count, differences } = self;
        for Difference { case, difference, replay } in differences {
            writeln!(f, "case {case}: {difference}\n  {replay}")?;
        }
        let equal = case_count - differences.len();
        write!(
            f,
            "{equal} of {} replayed as recorded: {}, {}",
            counted(case_count, "case"),
            counted(cycle_count, "cycle"),
            counted(frame_count, "frame")
        )
    }
}
