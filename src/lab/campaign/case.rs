//! One fault: what a number of a seed means.

use std::time::Duration;

use crate::campaign::catalogue;
use crate::campaign::draw::Draw;
use crate::campaign::injection::Injection;
use crate::campaign::injection::Place;
use crate::campaign::kind::Kind;
use crate::campaign::situation::Situation;
use config::Config;

/// A fault begins so long after its situation is reached at the latest, in s.
const SPREAD_S: f64 = 0.1;

/// A script is longer than what is watched of it, in s.
const MORE_S: f64 = 0.5;

/// What is done, to whom, when.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its number in the campaign, from 1.
    pub number: u32,
    /// Of all chance in it.
    pub seed: u64,
    /// What kind of fault.
    pub kind: &'static Kind,
    /// On which hand controller: a place in the campaign's list.
    pub config: usize,
    /// What the operator does then.
    pub situation: Situation,
    /// When, after the first SYNC: any microsecond.
    pub onset: Duration,
    /// What is done.
    pub injection: Injection,
}

impl Case {
    /// Case `number` of a campaign on these hand controllers.
    pub fn of(seed: u64, number: u32, configs: &[Config]) -> Option<Self> {
        let kind = catalogue::kind_of(number)?;
        let mut draw = Draw::of(seed, number);
        let count = u64::try_from(configs.len()).ok()?;
        let config = usize::try_from(draw.below(count)).ok()?;
        let situation = *draw.among(kind.situations)?;
        let onset_s = situation.warm_s() + draw.within(0.005, SPREAD_S);
        let onset =
            Duration::from_micros(Duration::from_secs_f64(onset_s).as_micros().try_into().ok()?);
        let at = Place { config: configs.get(config)?, situation, onset };
        let injection = (kind.injection)(&mut draw, &at);
        Some(Self { number, seed: draw.bits(), kind, config, situation, onset, injection })
    }

    /// The whole script, which `frhc demo --scenario` plays as well.
    pub fn script(&self) -> String {
        let seconds = (self.onset + self.injection.watch).as_secs_f64() + MORE_S;
        format!(
            "seconds = {seconds:.3}\n\n{}\n{}",
            self.situation.entries(),
            self.injection.entries
        )
    }
}
