//! `frhc campaign --verify-replay`: every case replayed from the recorded inputs of its node.

use std::fmt;
use std::num::NonZero;

use serde::Serialize;

use campaign::run::Campaign as Cases;
use campaign::verdict::Verdict;
use campaign::verification::Verification;
use progress::Progress;
use run::exit::{Failure, Kind, OrFail};
use run::print;
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

impl ReplayReport {
    /// Plays all cases from their own boots, and replays them. `verdicts` are those on clones of warm benches; `command`
    /// returns the command that records the session of a case.
    pub(super) fn replay_all(
        cases: &Cases,
        verdicts: &[Verdict],
        threads: NonZero<usize>,
        command: &dyn Fn(u32) -> String,
        quiet: bool,
    ) -> Result<Self, Failure> {
        let total = u64::try_from(verdicts.len()).unwrap_or(u64::MAX);
        let progress = Progress::start(total, "replays", quiet).or_fail(Kind::System)?;
        let on_case = || progress.advance(1);
        let verify = || cases.verify(verdicts, threads, &on_case);
        let verified = progress.abandonable(print::error, verify);
        let seconds = progress.elapsed().as_secs_f64();
        progress.finish();
        print::note(&format!("replayed in {seconds:.1} s"));
        let verified = verified.or_fail(Kind::Drive)?;
        let differing = |one: &Verification| {
            let difference = one.difference.clone()?;
            Some(Difference { case: one.case, difference, replay: command(one.case) })
        };
        Ok(Self {
            case_count: verified.len(),
            cycle_count: verified.iter().map(|one| one.cycles).sum(),
            frame_count: verified.iter().map(|one| one.frames).sum(),
            differences: verified.iter().filter_map(differing).collect(),
        })
    }

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
