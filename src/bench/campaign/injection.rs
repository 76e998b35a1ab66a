//! Faults and actions of a case, and its criterion.

use std::time::Duration;

use crate::criterion::Criterion;
use crate::expectation;
use crate::lost_zeros::LostZeros;
use crate::situation::Situation;
use canopen::watchdog::LifeSign;
use config::Config;
use faults::{Fault, FaultKind, Target};
use sim::quirks::Quirk;
use sim::scenario::Entry;
use sim::scenario::operator::Switch;
use testbench::world;
use units::numbering::Joint;

/// Faults and operator actions of a case, with the required reaction.
#[derive(Clone, Debug)]
pub struct Injection {
    /// Faults and actions of the operator, all of them at or after the onset.
    pub entries: Vec<Entry>,
    /// Speed of the grip, in m/s, that two cycles in a row exceed: the first of them is the onset. `None` for a fixed
    /// onset.
    pub onset_speed: Option<f64>,
    /// Joint whose targets differ from the one that its drive holds: the first difference is the onset.
    pub cut_off: Option<Joint>,
    /// Set if a drive does not receive its controlwords.
    pub loses_commands: bool,
    /// Quirk of a drive, present before its boot.
    pub quirk: Option<(Joint, Quirk)>,
    /// Zeros of the drives in place of those of the file.
    pub zeros: Option<LostZeros>,
    /// Required reaction of node or drives.
    pub criterion: Criterion,
    /// Duration of the observation after the onset.
    pub observed_for: Duration,
}

/// Hand controller, situation and time of an injection.
#[derive(Clone, Copy, Debug)]
pub struct Conditions<'a> {
    /// Configuration of the hand controller.
    pub config: &'a Config,
    /// Number of the hazard in docs/safety.md.
    pub hazard: u8,
    /// Situation of the operator.
    pub situation: Situation,
    /// Time of the onset after the first SYNC.
    pub onset: Duration,
}

impl Conditions<'_> {
    /// Returns the duration of this many cycles.
    pub(super) fn cycles(&self, count: u32) -> Duration {
        self.config.period * count
    }

    /// Returns the limit of the hazard.
    pub(super) fn limit(&self) -> Duration {
        self.limit_of(self.hazard)
    }

    /// Returns the limit of the hazard for a joint's drive, which depends on its RPDO timer.
    pub(super) fn limit_for(&self, joint: Joint) -> Duration {
        let row = expectation::of_hazard(self.hazard);
        let without = row.and_then(|row| row.without_timer).filter(|_| !self.has_rpdo_timer(joint));
        without.map_or_else(|| self.limit(), |limit| limit.time(self.config))
    }

    /// Returns whether a joint's drive has an RPDO timer.
    pub(super) fn has_rpdo_timer(&self, joint: Joint) -> bool {
        let plans = self.config.node_plans();
        let plan = plans.get(joint.index()).map(|(_, plan)| plan);
        plan.is_some_and(|plan| plan.watchdog(LifeSign::Rpdo).is_some())
    }

    /// Returns the limit of another hazard; zero if not stated.
    pub(super) fn limit_of(&self, hazard: u8) -> Duration {
        let row = expectation::of_hazard(hazard);
        row.map(|row| row.limit.time(self.config)).unwrap_or_default()
    }

    /// Returns the gravity torque of a joint in the start posture, in ‰ of the joint's largest torque.
    pub(super) fn weight(&self, joint: Joint) -> f64 {
        let plant = self.config.plant();
        let arm = world::arm(&plant);
        let gravity = arm.gravity(&arm.posture(&world::start(&plant)));
        let gravity = plant.coupling.matrix().transpose() * gravity;
        let weight: f64 = *joint.entry(&gravity.into());
        1e3 * weight.abs() / joint.entry(&plant.joints).actuator.max_torque
    }

    /// Returns the time of the onset after the first SYNC, in s.
    pub(super) fn onset_s(&self) -> f64 {
        seconds(self.onset)
    }

    /// Returns a fault at the onset.
    pub(super) fn fault(&self, target: Target, kind: FaultKind) -> Entry {
        Entry::Fault(self.fault_after(Duration::ZERO, target, kind))
    }

    /// Returns a fault this long after the onset.
    pub(super) const fn fault_after(
        &self,
        after: Duration,
        target: Target,
        kind: FaultKind,
    ) -> Fault {
        Fault::new(self.onset.saturating_add(after), target, kind)
    }

    /// Returns a switch pressed or released this long after the onset.
    pub(super) fn switch(
        &self,
        after: Duration,
        switch: fn(f64, bool) -> Switch,
        is_pressed: bool,
    ) -> Entry {
        Entry::Switch(switch(seconds(self.onset + after), is_pressed))
    }
}

impl Injection {
    /// Creates an injection of these entries, observed for 150 ms.
    pub(super) fn new(entries: impl Into<Vec<Entry>>, criterion: Criterion) -> Self {
        Self {
            entries: entries.into(),
            onset_speed: None,
            cut_off: None,
            loses_commands: false,
            quirk: None,
            zeros: None,
            criterion,
            observed_for: OBSERVED,
        }
    }

    /// Returns the injection observed for this long.
    pub(super) fn observed_for(self, observed_for: Duration) -> Self {
        Self { observed_for, ..self }
    }

    /// Returns whether the case needs a boot of its own: quirks and zeros are those of the drives from the start.
    pub(super) const fn needs_own_boot(&self) -> bool {
        self.quirk.is_some() || self.zeros.is_some()
    }

    /// Returns the faults among the entries.
    pub fn faults(&self) -> impl Iterator<Item = &Fault> + '_ {
        self.entries.iter().filter_map(|entry| match entry {
            Entry::Fault(fault) => Some(fault),
            Entry::Move(_) | Entry::Switch(_) | Entry::Console(_) | Entry::Hold(_) => None,
        })
    }
}

/// Converts a time to s, rounded to 1 µs.
pub(super) fn seconds(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e6).round() / 1e6
}

/// Default duration of an observation: it includes the power-off, 100 ms after a stop.
const OBSERVED: Duration = Duration::from_millis(150);
