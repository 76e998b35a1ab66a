//! One fault: what a number of a seed means.

use std::time::Duration;

use crate::campaign::catalogue;
use crate::campaign::catalogue::Kind;
use crate::campaign::draw::Draw;
use crate::campaign::situation::Situation;
use crate::world;
use bus::Mishap;
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
    pub deed: Deed,
}

/// What is done, and what is demanded then.
#[derive(Clone, Debug)]
pub struct Deed {
    /// Entries of a script, all of them at or after the onset.
    pub entries: String,
    /// What befalls buses and process, and how long after the onset.
    pub mishaps: Vec<(Duration, Mishap)>,
    /// The commanded side senses this from the onset on, in N.
    pub senses: Option<f64>,
    /// The onset is when the grip is faster than this, in m/s.
    pub onset_speed: Option<f64>,
    /// What is demanded.
    pub demand: Demand,
    /// For how long it is watched.
    pub watch: Duration,
}

/// What the node, or the drives by themselves, must do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
    /// Every drive is told zero in time, and the node is latched.
    Stop(Duration),
    /// Every drive is told zero in time, and nothing needs to be latched.
    Zero(Duration),
    /// No drive exerts torque, in time, by its own timers if need be.
    Release(Duration),
    /// No drive exerts torque, in time, by its own timer if need be; the node gives up a bus it does not reach and
    /// switches the drives off, in time as well.
    Mute(Duration, Duration),
    /// What was felt has ended, in time, and the node is latched.
    LetGo(Duration),
    /// What was felt has ended, in time; whether it may stop altogether later.
    Disengage(Duration, MayStop),
    /// It goes on: this is no reason to stop.
    GoOn,
    /// It may stop or not; nothing may break on the way. Why.
    Either(&'static str),
}

/// Whether a node that has disengaged may stop as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MayStop {
    /// There is no reason to.
    No,
    /// What is wrong is more than a hand that lets go.
    Yes,
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
        let deed = (kind.deed)(&mut draw, &at);
        Some(Self { number, seed: draw.bits(), kind, config, situation, onset, deed })
    }

    /// The whole script, which `frhc demo --scenario` plays as well.
    pub fn script(&self) -> String {
        let seconds = (self.onset + self.deed.watch).as_secs_f64() + MORE_S;
        format!("seconds = {seconds:.3}\n\n{}\n{}", self.situation.entries(), self.deed.entries)
    }
}

/// Where and when a deed is done.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// On which hand controller.
    pub config: &'a Config,
    /// What the operator does.
    pub situation: Situation,
    /// When, after the first SYNC.
    pub onset: Duration,
}

impl Place<'_> {
    /// So many cycles.
    pub(super) fn cycles(&self, count: u32) -> Duration {
        self.config.period * count
    }

    /// What carries the arm's weight at a joint, from 1, where it starts: in ‰ of the most it may exert.
    pub(super) fn weight(&self, joint: usize) -> f64 {
        let calibration = &self.config.controller.calibration;
        let arm = world::arm(self.config);
        let gravity = arm.gravity(&arm.posture(&world::start(self.config)));
        let gravity = calibration.coupling().matrix().transpose() * gravity;
        let mut joints = gravity.iter().zip(&self.config.joints).skip(joint.saturating_sub(1));
        joints.next().map_or(0.0, |(weight, joint)| 1e3 * weight.abs() / joint.max_torque)
    }

    /// An entry `[[fault]]` at the onset: its keys, one a line.
    pub(super) fn fault(&self, keys: &str) -> String {
        self.fault_after(Duration::ZERO, keys)
    }

    /// The same, so long after the onset.
    pub(super) fn fault_after(&self, after: Duration, keys: &str) -> String {
        let at_s = (self.onset + after).as_secs_f64();
        format!("[[fault]]\nat_s = {at_s:.6}\n{}\n\n", keys.replace("; ", "\n"))
    }
}

impl Deed {
    /// Entries of a script.
    pub(super) fn scripted(entries: String, demand: Demand) -> Self {
        Self { entries, mishaps: Vec::new(), senses: None, onset_speed: None, demand, watch: WATCH }
    }

    /// Something that befalls buses or process.
    pub(super) fn befallen(mishaps: Vec<(Duration, Mishap)>, demand: Demand) -> Self {
        Self {
            entries: String::new(),
            mishaps,
            senses: None,
            onset_speed: None,
            demand,
            watch: WATCH,
        }
    }

    /// The same, watched for so long.
    pub(super) fn watched_for(self, watch: Duration) -> Self {
        Self { watch, ..self }
    }
}

/// Long enough to see the drives switched off 100 ms after a stop.
const WATCH: Duration = Duration::from_millis(150);
