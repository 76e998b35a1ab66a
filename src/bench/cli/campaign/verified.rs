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

/// Result of all replayed cases.
#[derive(Debug, Serialize)]
pub(super) struct Verified {
    case_count: usize,
    cycle_count: u64,
    frame_count: u64,
    /// Cases that are not as recorded.
    differences: Vec<Differing>,
}

/// A case that is not as recorded.
#[derive(Debug, Serialize)]
struct Differing {
    case: u32,
    difference: String,
    /// Command that leaves its session.
    replay: String,
}

impl Verified {
    /// Plays all cases from their own boots, and replays them. `verdicts` are those on clones of warm benches; `command` gives
    /// the one that leaves the session of a case.
    pub(super) fn of(
        cases: &Cases,
        verdicts: &[Verdict],
        threads: NonZero<usize>,
        command: &dyn Fn(u32) -> String,
        quiet: bool,
    ) -> Result<Self, Failure> {
        let total = u64::try_from(verdicts.len()).unwrap_or(u64::MAX);
        let progress = Progress::start(total, "replays", quiet).or_fail(Kind::Bus)?;
        let on_case = || progress.advance(1);
        let verify = || cases.verify(verdicts, threads, &on_case);
        let verified = progress.abandonable(print::error, verify);
        let seconds = progress.elapsed().as_secs_f64();
        progress.finish();
        print::note(&format!("replayed in {seconds:.1} s"));
        let verified = verified.or_fail(Kind::Drive)?;
        let differing = |one: &Verification| {
            let difference = one.difference.clone()?;
            Some(Differing { case: one.case, difference, replay: command(one.case) })
        };
        Ok(Self {
            case_count: verified.len(),
            cycle_count: verified.iter().map(|one| one.cycles).sum(),
            frame_count: verified.iter().map(|one| one.frames).sum(),
            differences: verified.iter().filter_map(differing).collect(),
        })
    }

    /// # Errors
    /// A case that is not as recorded.
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

impl fmt::Display for Verified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { case_count, cycle_count, frame_count, differences } = self;
        for Differing { case, difference, replay } in differences {
            writeln!(f, "case {case}: {difference}\n  {replay}")?;
        }
        let equal = case_count - differences.len();
        write!(
            f,
            "{equal} of {case_count} cases replayed as recorded: {cycle_count} cycles, {frame_count} frames"
        )
    }
}
