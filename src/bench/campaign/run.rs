//! Cases of a campaign, on every core. The number of threads does not change the verdicts.

use std::borrow::Cow;
use std::fmt::Display;
use std::num::NonZero;
use std::sync::Arc;

use crate::case::Case;
use crate::monitor::Monitor;
use crate::play;
use crate::situation::Situation;
use crate::stage::{self, Stage, StageError};
use crate::verdict::Verdict;
use crate::verification::{Recording, Verification};
use canopen::frame::Telegram;
use config::Config;
use inputs::InputSink;
use node::record::Record;
use sim::quirks::Quirk;
use testbench::bench::Bench;
use testbench::threads::each;
use units::numbering::Joint;
use units::time::Instant;

/// Cases of a seed on a list of hand controllers.
#[derive(Clone, Debug)]
pub struct Campaign {
    seed: u64,
    configs: Arc<[Config]>,
    cases: Vec<Case>,
}

/// Part of a case that is played from its own boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Steps into the situation of the case.
    Situation,
    /// Observation from the onset on.
    Case,
}

/// Function that is called after every cycle of a case played from its own boot.
pub type OnCycle<'a, S> = dyn FnMut(&mut Bench<Monitor, S>, &Record, Part) + 'a;

/// Verdict on a case, with every frame since the boot.
pub type Replay = (Verdict, Vec<(Instant, Telegram)>);

/// Benches in the situations that the cases of a campaign need, by hand controller and situation.
#[derive(Clone, Debug, Default)]
pub struct Stages(Vec<[Option<Bench<Monitor>>; Situation::ALL.len()]>);

impl Campaign {
    /// Creates a campaign of the first `faults` cases of a seed whose kind has a name that contains `only`.
    pub fn new(seed: u64, configs: Vec<Config>, faults: usize, only: Option<&str>) -> Self {
        let configs: Arc<[Config]> = configs.into();
        let whole = Batches::new(seed, configs.clone(), (faults, faults), only).next();
        whole.unwrap_or(Self { seed, configs, cases: Vec::new() })
    }

    /// Creates a campaign of case `number` of a seed alone.
    pub fn of_one(seed: u64, configs: impl Into<Arc<[Config]>>, number: u32) -> Option<Self> {
        let configs = configs.into();
        let case = Case::draw(seed, number, &configs)?;
        Some(Self { seed, configs, cases: vec![case] })
    }

    /// Returns the drawn cases, in ascending order of their numbers.
    pub fn cases(&self) -> &[Case] {
        &self.cases
    }

    /// Returns the hand controllers.
    pub const fn configs(&self) -> &Arc<[Config]> {
        &self.configs
    }

    /// Plays all cases with `threads` threads; `progress` is called after each.
    ///
    /// # Errors
    /// Returns an error if a network does not boot, or a situation is not reached.
    pub fn run(
        &self,
        threads: NonZero<usize>,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Vec<Verdict>, StageError> {
        self.run_on(&mut Stages::default(), threads, progress)
    }

    /// Plays all cases as [`run`](Self::run), on the benches of other batches of the campaign.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_on(
        &self,
        stages: &mut Stages,
        threads: NonZero<usize>,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Vec<Verdict>, StageError> {
        self.set(stages, threads)?;
        let stages = &*stages;
        let verdicts = each(threads, &self.cases, |case| {
            let verdict = self.play_on(stages, case);
            progress();
            verdict
        });
        verdicts.into_iter().collect()
    }

    /// Plays the first case again from its own boot, with all its frames since then. The inputs of its node go to `sink`.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn replay<S: InputSink + Clone>(
        &self,
        sink: S,
        on_cycle: &mut OnCycle<'_, S>,
    ) -> Result<Option<Replay>, StageError> {
        let Some(case) = self.cases.first() else { return Ok(None) };
        let config = self.config(case)?;
        let monitor = Monitor::new(&config).with_log();
        let (verdict, mut bench) = self.play_from_boot(case, &config, monitor, sink, on_cycle)?;
        Ok(Some((verdict, bench.tap_mut().frames().to_vec())))
    }

    /// Plays all cases from their own boots, and replays each from the recorded inputs of its node; `progress` is called
    /// after each. `verdicts` are those on clones of benches, in order.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn verify(
        &self,
        verdicts: &[Verdict],
        threads: NonZero<usize>,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Vec<Verification>, StageError> {
        let cases: Vec<_> = self.cases.iter().zip(verdicts).collect();
        let verified = each(threads, &cases, |(case, verdict)| {
            let config = self.config(case)?;
            let recording = Recording::new();
            let sink = recording.clone();
            let (again, _) = self.play_from_boot(
                case,
                &config,
                Monitor::new(&config),
                sink.clone(),
                &mut |_, record, _| sink.on_cycle(record),
            )?;
            progress();
            Ok(recording.verify(&config, verdict, &again))
        });
        verified.into_iter().collect()
    }

    /// Plays a case from its own boot. Returns its bench.
    fn play_from_boot<S: InputSink + Clone>(
        &self,
        case: &Case,
        config: &Config,
        monitor: Monitor,
        sink: S,
        on_cycle: &mut OnCycle<'_, S>,
    ) -> Result<(Verdict, Bench<Monitor, S>), StageError> {
        let stage = self.stage(case.situation, config, case.injection.quirk);
        let mut before = |bench: &mut _, record: &_| on_cycle(bench, record, Part::Situation);
        let mut bench = stage::bring_to(stage, monitor, sink, &mut before)?;
        let mut during = |bench: &mut _, record: &_| on_cycle(bench, record, Part::Case);
        let verdict = play::play(&mut bench, config, case, &mut during)?;
        Ok((verdict, bench))
    }

    const fn stage<'c>(
        &self,
        situation: Situation,
        config: &'c Config,
        quirk: Option<(Joint, Quirk)>,
    ) -> Stage<'c> {
        Stage { config, situation, seed: self.seed, quirk }
    }

    /// Returns the configuration of a case: that of its hand controller, or the same with other zeros.
    ///
    /// # Errors
    /// When a configuration with other zeros cannot be loaded.
    pub fn config(&self, case: &Case) -> Result<Cow<'_, Config>, StageError> {
        let config = self.configs.get(case.config).ok_or_else(|| without_stage(case))?;
        let Some(zeros) = case.injection.zeros else { return Ok(Cow::Borrowed(config)) };
        let refused = |error: &dyn Display| StageError::Configuration(error.to_string());
        let files = zeros.files(config).map_err(|error| refused(&error))?;
        let changed = Config::load_from(&files, &config.file);
        changed.map(Cow::Owned).map_err(|error| refused(&error))
    }

    fn play_on(&self, stages: &Stages, case: &Case) -> Result<Verdict, StageError> {
        let config = self.config(case)?;
        if case.injection.needs_own_boot() {
            let monitor = Monitor::new(&config);
            let played = self.play_from_boot(case, &config, monitor, (), &mut |_, _, _| {})?;
            return Ok(played.0);
        }
        // Never absent: stages are derived from the cases.
        let bench = stages.get(case.config, case.situation).ok_or_else(|| without_stage(case))?;
        play::play(&mut bench.clone(), &config, case, &mut |_, _| {})
    }

    /// Brings one bench into each situation that the cases need, and that none is in yet.
    fn set(&self, stages: &mut Stages, threads: NonZero<usize>) -> Result<(), StageError> {
        stages.0.resize_with(self.configs.len(), || [const { None }; Situation::ALL.len()]);
        let of = |config| Situation::ALL.map(|situation| (config, situation));
        let mut wanted: Vec<(usize, Situation)> = (0..self.configs.len()).flat_map(of).collect();
        wanted.retain(|wanted| {
            let on_stage = self.cases.iter().filter(|case| !case.injection.needs_own_boot());
            let is_needed =
                on_stage.map(|case| (case.config, case.situation)).any(|of| of == *wanted);
            is_needed && stages.get(wanted.0, wanted.1).is_none()
        });
        let reached = each(threads, &wanted, |(config, situation)| {
            let config = self.configs.get(*config)?;
            let stage = self.stage(*situation, config, None);
            Some(stage::bring_to(stage, Monitor::new(config), (), &mut |_, _| {}))
        });
        for ((config, situation), bench) in wanted.into_iter().zip(reached) {
            let stage = stages.0.get_mut(config).and_then(|all| all.get_mut(situation.index()));
            if let (Some(stage), Some(bench)) = (stage, bench) {
                *stage = Some(bench?);
            }
        }
        Ok(())
    }
}

impl Stages {
    fn get(&self, config: usize, situation: Situation) -> Option<&Bench<Monitor>> {
        self.0.get(config)?.get(situation.index())?.as_ref()
    }
}

/// Cases of a campaign, a part at a time: a campaign of any length needs the memory of one part.
#[derive(Clone, Debug)]
pub struct Batches {
    seed: u64,
    configs: Arc<[Config]>,
    only: Option<String>,
    /// Number of the next case, and the highest.
    next: u32,
    most: u32,
    /// Maximum number of cases in a part, and of those in all further parts.
    size: usize,
    left: usize,
}

impl Batches {
    /// Creates the parts of a campaign as [`Campaign::new`]: `faults` cases, at most `size` in each part.
    pub fn new(
        seed: u64,
        configs: Arc<[Config]>,
        (faults, size): (usize, usize),
        only: Option<&str>,
    ) -> Self {
        let most = u32::try_from(faults).unwrap_or(u32::MAX).saturating_mul(MAX_KINDS);
        let only = only.map(str::to_owned);
        Self { seed, configs, only, next: 1, most, size, left: faults }
    }

    /// Draws the next case of a wanted kind.
    fn draw(&mut self) -> Option<Case> {
        while self.next < self.most {
            let case = Case::draw(self.seed, self.next, &self.configs)?;
            self.next += 1;
            if self.only.as_ref().is_none_or(|only| case.kind.name.contains(only)) {
                return Some(case);
            }
        }
        None
    }
}

impl Iterator for Batches {
    type Item = Campaign;

    fn next(&mut self) -> Option<Campaign> {
        let size = self.size.min(self.left);
        let cases: Vec<Case> = std::iter::from_fn(|| self.draw()).take(size).collect();
        self.left -= cases.len();
        let Self { seed, configs, .. } = self;
        (!cases.is_empty()).then(|| Campaign { seed: *seed, configs: configs.clone(), cases })
    }
}

fn without_stage(case: &Case) -> StageError {
    StageError::Violated(format!("case {} has no stage", case.number))
}

/// Maximum number of cases that contains each kind at least once.
const MAX_KINDS: u32 = 200;

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn campaign_in_parts_has_the_verdicts_of_the_whole() {
        let configs = vec![Config::load(Path::new("config/kraft_like.toml")).unwrap()];
        let whole = Campaign::new(3, configs, 9, Some("lost"));
        let parts = Batches::new(3, whole.configs().clone(), (9, 4), Some("lost"));
        let parts: Vec<_> = parts.collect();
        let sizes: Vec<_> = parts.iter().map(|part| part.cases().len()).collect();
        assert_eq!(sizes, [4, 4, 1]);
        let mut stages = Stages::default();
        let mut run = |part: &Campaign| part.run_on(&mut stages, NonZero::<usize>::MIN, &|| {});
        let verdicts: Vec<_> = parts.iter().flat_map(|part| run(part).unwrap()).collect();
        assert_eq!(verdicts, whole.run(NonZero::<usize>::MIN, &|| {}).unwrap());
    }
}
