//! Case of a campaign: a fault with its hand controller, situation and onset.

use std::time::Duration;

use crate::catalogue;
use crate::injection::{Conditions, Injection, seconds};
use crate::kind::CaseKind;
use crate::random::{Random, rounded};
use crate::situation::Situation;
use config::Config;
use sim::scenario::{Problem, Scenario};

/// Latest onset after the situation is reached, in s.
const SPREAD_S: f64 = 0.1;

/// Length of a scenario beyond its observed part, in s.
const MARGIN_S: f64 = 0.5;

/// Fault of one kind, with everything that its number and the seed determine.
#[derive(Clone, Debug)]
pub struct Case {
    /// Number of the case in the campaign, from 1.
    pub number: u32,
    /// Seed of the faults' own random sequences.
    pub seed: u64,
    /// Kind of fault.
    pub kind: &'static CaseKind,
    /// Hand controller, as an index into the campaign's list.
    pub config: usize,
    /// Situation at the onset.
    pub situation: Situation,
    /// Time from the first SYNC to the onset, in steps of 1 µs.
    pub onset: Duration,
    /// Faults and actions from the onset on.
    pub injection: Injection,
}

impl Case {
    /// Draws case `number` of a campaign on these hand controllers. Each round of all kinds uses the next of them.
    pub fn draw(seed: u64, number: u32, configs: &[Config]) -> Option<Self> {
        let kind = catalogue::kind_of(number)?;
        let mut random = Random::new(seed, number);
        let config = catalogue::round_of(number)?.checked_rem(configs.len())?;
        let situation = random.one_of(kind.situations)?.possible(configs.get(config)?);
        let onset_s = situation.reached_s() + random.within(0.005, SPREAD_S);
        let onset =
            Duration::from_micros(Duration::from_secs_f64(onset_s).as_micros().try_into().ok()?);
        let hazard = kind.hazard;
        let at = Conditions { config: configs.get(config)?, hazard, situation, onset };
        let injection = (kind.injection)(&mut random, &at);
        Some(Self { number, seed: random.bits(), kind, config, situation, onset, injection })
    }

    /// Returns the scenario of situation and fault, from the first SYNC on.
    ///
    /// # Errors
    /// Returns the first entry that is out of order or beyond the end.
    pub fn scenario(&self) -> Result<Scenario, Problem> {
        let end = seconds(self.onset + self.injection.observed_for) + MARGIN_S;
        let entries = self.situation.entries().into_iter();
        let entries = entries.chain(self.injection.entries.iter().cloned());
        let mut scenario = Scenario::new(rounded(end, 3), entries)?;
        if let Some((joint, quirk)) = self.injection.quirk {
            scenario.quirks_mut().add(joint, [quirk]);
        }
        Ok(scenario)
    }
}
