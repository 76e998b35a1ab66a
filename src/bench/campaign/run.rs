//! All cases of a campaign, on every core. The number of threads does not change the verdicts.

use std::num::NonZero;

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
    configs: Vec<Config>,
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

/// Benches in the situations that the cases need, by hand controller and [`Situation::index`].
type Stages = Vec<[Option<Bench<Monitor>>; 4]>;

impl Campaign {
    /// Creates a campaign of the first `faults` cases of a seed whose kind has a name that contains `only`.
    pub fn new(seed: u64, configs: Vec<Config>, faults: usize, only: Option<&str>) -> Self {
        let is_wanted = |case: &Case| only.is_none_or(|only| case.kind.name.contains(only));
        let cases = (1..).map_while(|number| Case::draw(seed, number, &configs));
        let most = u32::try_from(faults).unwrap_or(u32::MAX).saturating_mul(MAX_KINDS);
        let cases = cases.take_while(|case| case.number <= most);
        let cases = cases.filter(is_wanted).take(faults).collect();
        Self { seed, configs, cases }
    }

    /// Creates a campaign of case `number` of a seed alone.
    pub fn of_one(seed: u64, configs: Vec<Config>, number: u32) -> Option<Self> {
        let case = Case::draw(seed, number, &configs)?;
        Some(Self { seed, configs, cases: vec![case] })
    }

    /// Returns the drawn cases, in ascending order of their numbers.
    pub fn cases(&self) -> &[Case] {
        &self.cases
    }

    /// Returns the hand controllers.
    pub fn configs(&self) -> &[Config] {
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
        let stages = self.stages(threads)?;
        let verdicts = each(threads, &self.cases, |case| {
            let verdict = self.play_on(&stages, case);
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
        let Some((case, config)) = self.cases.first().and_then(|case| self.with_config(case))
        else {
            return Ok(None);
        };
        let monitor = Monitor::new(config).keeping_frames();
        let (verdict, mut bench) = self.play_from_boot(case, config, monitor, sink, on_cycle)?;
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
            let (case, config) = self.with_config(case).ok_or_else(|| without_stage(case))?;
            let recording = Recording::new();
            let sink = recording.clone();
            let (again, _) = self.play_from_boot(
                case,
                config,
                Monitor::new(config),
                sink.clone(),
                &mut |_, record, _| sink.on_cycle(record),
            )?;
            progress();
            Ok(recording.verify(config, verdict, &again))
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

    fn with_config<'c>(&'c self, case: &'c Case) -> Option<(&'c Case, &'c Config)> {
        Some((case, self.configs.get(case.config)?))
    }

    fn play_on(&self, stages: &Stages, case: &Case) -> Result<Verdict, StageError> {
        let stage = stages.get(case.config).and_then(|stages| stages.get(case.situation.index()));
        match (stage, self.configs.get(case.config)) {
            // A quirk is present before the boot, so the case needs its own boot.
            (_, Some(config)) if case.injection.quirk.is_some() => {
                let monitor = Monitor::new(config);
                let played = self.play_from_boot(case, config, monitor, (), &mut |_, _, _| {})?;
                Ok(played.0)
            }
            (Some(Some(bench)), Some(config)) => {
                play::play(&mut bench.clone(), config, case, &mut |_, _| {})
            }
            // Unreachable: stages and hand controllers are derived from the cases.
            _ => Err(without_stage(case)),
        }
    }

    /// Brings one bench into each situation that the cases need.
    fn stages(&self, threads: NonZero<usize>) -> Result<Stages, StageError> {
        let of = |config| Situation::ALL.map(|situation| (config, situation));
        let mut wanted: Vec<(usize, Situation)> = (0..self.configs.len()).flat_map(of).collect();
        wanted.retain(|wanted| {
            self.cases.iter().any(|case| (case.config, case.situation) == *wanted)
        });
        let reached = each(threads, &wanted, |(config, situation)| {
            let config = self.configs.get(*config)?;
            let stage = self.stage(*situation, config, None);
            Some(stage::bring_to(stage, Monitor::new(config), (), &mut |_, _| {}))
        });
        let mut stages: Stages = self.configs.iter().map(|_| [const { None }; 4]).collect();
        for ((config, situation), bench) in wanted.into_iter().zip(reached) {
            let stage = stages.get_mut(config).and_then(|all| all.get_mut(situation.index()));
            if let (Some(stage), Some(bench)) = (stage, bench) {
                *stage = Some(bench?);
            }
        }
        Ok(stages)
    }
}

fn without_stage(case: &Case) -> StageError {
    StageError::Violated(format!("case {} has no stage", case.number))
}

/// Maximum number of cases that contains each kind at least once.
const MAX_KINDS: u32 = 200;
