//! What is done to buses, drives and people in a case, and what the node must do then.

use std::time::Duration;

use crate::campaign::situation::Situation;
use crate::world;
use bus::HostFault;
use config::Config;
use units::numbering::Joint;

/// A fault to inject, and what is expected of the node then.
#[derive(Clone, Debug)]
pub struct Injection {
    /// Entries of a script, all of them at or after the onset.
    pub entries: String,
    /// Faults of buses and process, and their delays after the onset.
    pub host_faults: Vec<(Duration, HostFault)>,
    /// The commanded side senses this from the onset on, in N.
    pub senses: Option<f64>,
    /// The onset is when the grip is faster than this, in m/s.
    pub onset_speed: Option<f64>,
    /// What is expected of node or drives.
    pub expectation: Expectation,
    /// For how long it is watched.
    pub watch: Duration,
}

/// What the node, or the drives by themselves, must do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expectation {
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

/// Where and when a fault is injected.
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

    /// What carries the arm's weight at a joint where it starts: in ‰ of the most it may exert.
    pub(super) fn weight(&self, joint: Joint) -> f64 {
        let plant = self.config.plant();
        let arm = world::arm(&plant);
        let gravity = arm.gravity(&arm.posture(&world::start(&plant)));
        let gravity = plant.coupling.matrix().transpose() * gravity;
        let weight: f64 = *joint.entry(&gravity.into());
        1e3 * weight.abs() / joint.entry(&plant.joints).actuator.max_torque
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

impl Injection {
    /// Entries of a script.
    pub(super) fn scripted(entries: String, expectation: Expectation) -> Self {
        Self {
            entries,
            host_faults: Vec::new(),
            senses: None,
            onset_speed: None,
            expectation,
            watch: WATCH,
        }
    }

    /// Faults of buses or process.
    pub(super) fn host_faults(
        host_faults: Vec<(Duration, HostFault)>,
        expectation: Expectation,
    ) -> Self {
        Self {
            entries: String::new(),
            host_faults,
            senses: None,
            onset_speed: None,
            expectation,
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
