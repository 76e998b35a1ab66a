//! Campaign of `frhc campaign`, played in parts: memory has one part, the figures, and the failed cases.

use std::num::NonZero;
use std::sync::Arc;
use std::time::Duration;

use crate::campaign::verified::Replays;
use campaign::run::{Batches, Stages};
use campaign::stage::StageError;
use campaign::tally::Tally;
use campaign::verdict::Verdict;
use config::Config;
use progress::Progress;
use run::exit::{Failure, Kind, OrFail};
use run::print;

/// Number of cases in a part: ten seconds of work, and a megabyte.
const PART: usize = 1_000;

/// Campaign to play.
pub(super) struct Task<'a> {
    pub(super) seed: u64,
    pub(super) configs: &'a Arc<[Config]>,
    pub(super) faults: NonZero<usize>,
    /// Part of the names of the kinds.
    pub(super) only: Option<&'a str>,
    pub(super) threads: NonZero<usize>,
    /// Set if each case is replayed, too.
    pub(super) is_replayed: bool,
}

/// Result of a campaign.
#[derive(Debug, Default)]
pub(super) struct CampaignResult {
    pub(super) tally: Tally,
    pub(super) count: usize,
    /// Verdicts on the failed cases.
    pub(super) bad: Vec<Verdict>,
    pub(super) replays: Option<Replays>,
    /// Time without the replays.
    pub(super) played_for: Duration,
    pub(super) replayed_for: Duration,
}

impl Task<'_> {
    /// Plays the campaign; `None` if no kind has such a name.
    pub(super) fn play(&self, quiet: bool) -> Result<Option<CampaignResult>, Failure> {
        let faults = self.faults.get();
        let batches = Batches::new(self.seed, self.configs.clone(), (faults, PART), self.only);
        let mut batches = batches.peekable();
        if batches.peek().is_none() {
            return Ok(None);
        }
        let total = u64::try_from(faults).unwrap_or(u64::MAX);
        let progress = Progress::start(total, "faults", quiet).or_fail(Kind::System)?;
        let result = progress.abandonable(print::error, || self.result(batches, &progress));
        progress.finish();
        result.map(Some).or_fail(Kind::Drive)
    }

    fn result(
        &self,
        batches: impl Iterator<Item = campaign::run::Campaign>,
        progress: &Progress,
    ) -> Result<CampaignResult, StageError> {
        let (mut stages, mut result) = (Stages::default(), CampaignResult::default());
        result.replays = self.is_replayed.then(Replays::default);
        let on_case = || progress.advance(1);
        for cases in batches {
            let begun = progress.elapsed();
            let verdicts = match self.is_replayed {
                false => cases.run_on(&mut stages, self.threads, &on_case)?,
                true => cases.run_on(&mut stages, self.threads, &|| {})?,
            };
            let played = progress.elapsed();
            if let Some(replays) = &mut result.replays {
                replays.add(cases.verify(&verdicts, self.threads, &on_case)?);
            }
            result.played_for += played.saturating_sub(begun);
            result.replayed_for += progress.elapsed().saturating_sub(played);
            result.count += verdicts.len();
            verdicts.iter().for_each(|verdict| result.tally.add(verdict));
            result.bad.extend(verdicts.into_iter().filter(|verdict| !verdict.is_good()));
        }
        Ok(result)
    }
}
