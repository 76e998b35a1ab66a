//! Far side: the simulated robot behind the contract, without I/O and without a clock.
//!
//! ```text
//!  Command ──► contract::FarEnd ── motion ──► robot_site ── joints, wrist sensor ──► reasons to hold
//!                    ▲                                                                     │
//!  Feedback ◄────────┴──────────────────────────── hold: why ◄─────────────────────────────┘
//! ```
//!
//! One [`step`](FarRobot::step) per period. Measurements come first, so that a cycle with a reason to hold already holds.
//! docs/link.md has the rules.

use std::time::Duration;

use crate::robot_site::{Equipment, Measurement, NoRobot, RobotSite};
use config::Config;
use config::robots::RobotArm;
use contract::{Capability, FarEnd, Feedback, Measurements, Reason, Rejects};
use remote::delay::HOLD_AFTER;
use remote::site::Virtual;
use remote::stated::StatedCapability;
use remote::{Command, Remote, RemoteSample, messages};
use robot::wrench_limit::WrenchLimit;
use sim::wrist_sensor::WristSensorSettings;
use units::spatial::Wrench;
use units::time::Instant;

/// Reading of a sensor that reports itself invalid.
const INVALID: Wrench = Wrench::from_components([f64::NAN; 6]);

/// Bounds of a far side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotLimits {
    /// Age of the newest command after which the robot holds.
    pub hold_after: Duration,
    /// Range of the sensor: a component at it or beyond is saturated.
    pub sensor_range: SensorRange,
    /// Periods without a new reading after which the sensor is silent.
    pub max_missed_readings: u32,
    /// Maximum contact wrench, at {MRF}.
    pub wrench: WrenchLimit,
}

/// Range of a force/torque sensor, the same along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorRange {
    /// Force, in N.
    pub force: f64,
    /// Moment, in N·m.
    pub moment: f64,
}

impl Default for RobotLimits {
    fn default() -> Self {
        Self {
            hold_after: HOLD_AFTER,
            sensor_range: SensorRange { force: 200.0, moment: 20.0 },
            max_missed_readings: 3,
            wrench: WrenchLimit { force: 100.0, moment: 10.0 },
        }
    }
}

impl SensorRange {
    /// Returns the range of each component.
    const fn components(self) -> [f64; 6] {
        let Self { force, moment } = self;
        [force, force, force, moment, moment, moment]
    }

    /// Returns whether a component is at the range or beyond.
    fn is_reached_by(self, reading: &Wrench) -> bool {
        let components = reading.components();
        components.iter().zip(self.components()).any(|(part, range)| part.abs() >= range)
    }
}

/// Messages of one cycle to the node.
#[derive(Clone, Copy, Debug)]
pub struct Outgoing {
    /// Encoded measurements and state.
    pub feedback: [u8; Feedback::LENGTH],
    /// Capability, if requested by the node.
    pub capability: Option<[u8; Capability::LENGTH]>,
}

/// State of a far side.
#[derive(Clone, Debug)]
pub struct Status {
    /// Time of the newest cycle.
    pub at: Instant,
    /// Reason to hold; [`Reason::None`] while the robot follows.
    pub reason: Reason,
    /// Session and epoch of the leading node; session 0 for none.
    pub leader: (u64, u32),
    /// Measurements of the newest cycle.
    pub measured: Measurements,
    /// Joint positions of the newest cycle, in rad.
    pub q: Vec<f64>,
    /// Counts of messages that had no effect.
    pub rejects: Rejects,
}

/// Simulated robot of a configuration as a far side.
#[derive(Clone, Debug)]
pub struct FarRobot {
    end: FarEnd,
    site: RobotSite,
    figures: Capability,
    limits: RobotLimits,
    joint_count: usize,
    /// Session and epoch in which the control was reset last.
    leader: (u64, u32),
    sensor: SensorMonitor,
    is_ending: bool,
    at: Instant,
    measurement: Measurement,
    measured: Measurements,
}

impl FarRobot {
    /// Creates the robot of `config` at rest at its start, as the far side of `arm` with a session, which must be random.
    /// `seed` is that of the sensor's noise.
    ///
    /// # Errors
    /// Returns an error if the configuration has no robot, or one that cannot be simulated or starts in contact.
    pub fn new(
        config: &Config,
        limits: RobotLimits,
        arm: u16,
        session: u64,
        seed: u64,
    ) -> Result<Self, NoRobot> {
        let robot = config.robot.as_ref().ok_or(NoRobot::NoArm)?;
        let range = limits.sensor_range.components();
        let equipment = Equipment {
            sensor: WristSensorSettings { range, ..WristSensorSettings::default() },
            limit: limits.wrench,
            ..Equipment::from_remote(&config.remote)
        };
        let site = RobotSite::in_free_space(config, &equipment, seed)?;
        Ok(Self {
            end: FarEnd::new(arm, session, limits.hold_after),
            figures: figures(config, robot, &limits),
            limits,
            joint_count: robot.joints.len(),
            leader: (0, 0),
            sensor: SensorMonitor::default(),
            is_ending: false,
            at: Instant::ZERO,
            measurement: site.measurement(),
            measured: Measurements::default(),
            site,
        })
    }

    /// Takes a message of a node, received at `now`.
    pub fn on_message(&mut self, now: Instant, bytes: &[u8]) {
        self.end.on_message(now, bytes);
    }

    /// Performs a cycle; returns the messages to send.
    pub fn step(&mut self, now: Instant) -> Outgoing {
        self.step_with(now, |measurement| measurement)
    }

    /// Performs a cycle with measurements changed by `supply`, such as a silent sensor or a failed encoder.
    pub fn step_with(
        &mut self,
        now: Instant,
        supply: impl FnOnce(Measurement) -> Measurement,
    ) -> Outgoing {
        let leader = self.end.leader();
        if leader != self.leader {
            self.leader = leader;
            self.site.begin_epoch();
        }
        let measurement = supply(self.site.measure(now));
        let are_joints_valid = measurement.q.iter().all(|q| q.is_finite());
        let sensor = self.sensor.judge(&measurement, &self.limits);
        if self.is_ending {
            self.end.hold(Reason::Ending);
        }
        if !are_joints_valid {
            self.end.hold(Reason::Robot);
        }
        if let Some(reason) = sensor.reason {
            self.end.hold(reason);
        }
        let Command { motion, gripper } = messages::command(&mut self.end, now);
        // The control needs any valid reading to hold the present pose; the hold does not depend on its value.
        self.site.command(&motion, &Measurement { reading: self.sensor.valid, ..measurement });
        let control = self.site.control();
        if are_joints_valid && control.is_stopped() {
            self.end.hold(Reason::WrenchLimit);
        }
        let (f_s, x_b_m) = (*control.operator_wrench(), *control.pose());
        let sensed = RemoteSample { at: now, f_s, x_b_m, gripper: self.site.grip(gripper) };
        let Measurements { wrench, pose, gripper } = messages::measured(&sensed);
        // A repeated reading would get a newer echo, and appear new.
        let wrench = wrench.filter(|_| are_joints_valid && sensor.is_new_and_valid);
        let pose = pose.filter(|_| are_joints_valid);
        self.measured = Measurements { wrench, pose, gripper };
        (self.at, self.measurement) = (now, measurement);
        Outgoing {
            feedback: self.end.feedback(now, &self.measured),
            capability: self.end.capability(now, &self.figures),
        }
    }

    /// Performs a cycle with the reading of a real sensor: its number, 0 before the first, and its wrench, `None` if invalid. A
    /// reading with the number of the last one is not new.
    pub fn step_with_reading(
        &mut self,
        now: Instant,
        number: u64,
        wrench: Option<Wrench>,
    ) -> Outgoing {
        let without = if number == 0 { Wrench::ZERO } else { INVALID };
        let reading = wrench.unwrap_or(without);
        self.step_with(now, |measurement| Measurement {
            reading,
            reading_number: number,
            ..measurement
        })
    }

    /// Ends the robot: it holds from the next cycle on and ignores commands.
    pub const fn end(&mut self) {
        self.is_ending = true;
    }

    /// Returns the reason to hold; [`Reason::None`] while the robot follows.
    pub const fn reason(&self) -> Reason {
        self.end.reason()
    }

    /// Returns session and epoch of the leading node; session 0 for none.
    pub fn leader(&self) -> (u64, u32) {
        self.end.leader()
    }

    /// Returns the capability, which nodes may request.
    pub const fn figures(&self) -> &Capability {
        &self.figures
    }

    /// Returns the simulated arm with its servos and scene.
    pub const fn site(&self) -> &RobotSite {
        &self.site
    }

    /// Returns the state after the newest cycle.
    pub fn status(&self) -> Status {
        Status {
            at: self.at,
            reason: self.reason(),
            leader: self.leader(),
            measured: self.measured,
            q: self.measurement.q.iter().take(self.joint_count).copied().collect(),
            rejects: *self.end.rejects(),
        }
    }
}

/// Monitor of the readings of the force/torque sensor.
#[derive(Clone, Copy, Debug)]
struct SensorMonitor {
    /// Number of the newest reading; 0 before the first.
    newest: u64,
    missed: u32,
    /// Newest valid reading.
    valid: Wrench,
}

impl Default for SensorMonitor {
    fn default() -> Self {
        Self { newest: 0, missed: 0, valid: Wrench::ZERO }
    }
}

/// Judgement of one reading.
#[derive(Clone, Copy, Debug)]
struct Judgement {
    reason: Option<Reason>,
    is_new_and_valid: bool,
}

impl SensorMonitor {
    /// Takes the reading of a cycle; returns the reason to hold that it gives.
    fn judge(&mut self, measurement: &Measurement, limits: &RobotLimits) -> Judgement {
        let Measurement { reading, reading_number, .. } = measurement;
        let is_new = self.newest != *reading_number;
        self.missed = if is_new { 0 } else { self.missed.saturating_add(1) };
        self.newest = *reading_number;
        let is_finite = reading.is_finite();
        if is_finite {
            self.valid = *reading;
        }
        // Silence comes first: the last reading says nothing about the present.
        let reason = if self.missed >= limits.max_missed_readings {
            Some(Reason::SensorSilent)
        } else if !is_finite {
            Some(Reason::SensorInvalid)
        } else if limits.sensor_range.is_reached_by(reading) {
            Some(Reason::SensorSaturated)
        } else {
            None
        };
        Judgement { reason, is_new_and_valid: is_new && reason.is_none() }
    }
}

/// Returns the figures of the robot of a configuration.
fn figures(config: &Config, robot: &RobotArm, limits: &RobotLimits) -> Capability {
    let Virtual { interaction, servo, wall, block, sphere, .. } = &config.remote;
    let walls = wall.iter().map(|(.., contact)| contact);
    let blocks = block.iter().map(|(.., contact)| contact);
    let spheres = sphere.iter().map(|(.., contact)| contact);
    let contacts = walls.chain(blocks).chain(spheres);
    let stated = StatedCapability {
        stiffest_contact: contacts.map(|contact| contact.stiffness).fold(0.0, f64::max),
        sample_period: config.period.as_secs_f64(),
        hold_after: limits.hold_after.as_secs_f64(),
        sensor_range: [limits.sensor_range.force, limits.sensor_range.moment],
        ..StatedCapability::from_interaction(interaction, servo)
    };
    let has_gripper = config.remote.gripper.is_some();
    Capability { has_gripper, ..stated.capability(workspace(robot)) }
}

/// Returns the lowest and highest corner, in m, of a box in {b} that {MRF} cannot leave. It is around the base, with the
/// reach of all links together. Not every position in it can be reached.
fn workspace(robot: &RobotArm) -> [[f64; 3]; 2] {
    let lengths = robot.joints.iter().map(|joint| joint.link.a.hypot(joint.link.d));
    let reach = lengths.sum::<f64>() + robot.x_n_m.translation.vector.norm();
    let base = robot.x_b_0.translation.vector;
    [base.map(|part| part - reach).into(), base.map(|part| part + reach).into()]
}

#[cfg(test)]
mod tests;
