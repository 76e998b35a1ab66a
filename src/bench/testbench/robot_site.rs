//! Robot at the commanded side: the control of the room `robot` on a simulated arm with masses, servos and a sensor.
//!
//! ```text
//!  command ─► robot::arm_control ─ joint rates ─► sim::manipulator ─► scene
//!                   ▲                                    │
//!                   └────── joints, wrist sensor ────────┘
//! ```
//!
//! Control and simulation know the arm from its file alone. The arm moves with the rates of the previous exchange.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::Duration;

use nalgebra::Isometry3;
use thiserror::Error;

use crate::simulated_joint;
use config::Config;
use remote::gripper::SimulatedGripper;
use remote::site::{Contact, GRAVITY, Virtual};
use remote::{Command, Gripper, Remote, RemoteSample, RobotJoints};
use robot::arm_control::ArmControl;
use robot::chain::Joints;
use robot::wrench_limit::WrenchLimit;
use robot::wrist_sensor::{Reports, WristSensor};
use sim::arm::Load;
use sim::contact::{Block, HALF_CUBE, Scene, Shape, Sphere, Surface, Wall};
use sim::manipulator::{InvalidManipulator, Manipulator, ManipulatorSettings, Tool};
use sim::wrist_sensor::WristSensorSettings;
use units::spatial::{Motion, Wrench};
use units::time::Instant;

/// Depth at which the damping of a surface reaches its full value, in m.
const DAMPING_DEPTH: f64 = 1e-3;

/// Reason why a robot cannot be simulated.
#[derive(Debug, Error)]
pub enum NoRobot {
    /// Configuration without an arm.
    #[error("the configuration has no remote.robot")]
    NoArm,
    /// Invalid arm, tool or scene.
    #[error(transparent)]
    Invalid(#[from] InvalidManipulator),
    /// Tool that would start in contact.
    #[error(
        "{}: joint.start_deg: the tool would start in a surface, at ({:.3}, {:.3}, {:.3}) m: change start_deg or \
         base_m, or move the surface",
        file.display(), at[0], at[1], at[2]
    )]
    StartsInContact {
        /// File of the arm.
        file: PathBuf,
        /// Position of {MRF} in {b}, in m.
        at: [f64; 3],
    },
    /// Invalid script of the operator.
    #[error(transparent)]
    Scenario(#[from] sim::scenario::Problem),
    /// Drives that did not reach Operation enabled (CiA 402).
    #[error(transparent)]
    BringUp(#[from] node::BringUpError),
}

/// Tool, scene, sensor and limit of a robot, in addition to its configuration.
#[derive(Clone, Debug)]
pub struct Equipment {
    /// Surface of the tool.
    pub shape: Shape,
    /// Solids around it.
    pub scene: Scene,
    /// Errors of the wrist sensor.
    pub sensor: WristSensorSettings,
    /// When the sensor reads.
    pub reading: ReadingTime,
    /// Wrench that stops the arm.
    pub limit: WrenchLimit,
}

/// Span and delay of the readings of a wrist sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadingTime {
    /// Duration at the end of each cycle over which a reading is averaged, in s; at most the cycle.
    pub span: f64,
    /// Delay of the reading, in cycles.
    pub late: usize,
}

impl ReadingTime {
    /// Mean over the cycle, available at its end.
    pub const MEAN: Self = Self { span: f64::INFINITY, late: 0 };
}

impl Equipment {
    /// Returns the tool and scene of the free object of a configuration, with an ideal sensor.
    pub fn from_remote(remote: &Virtual) -> Self {
        Self {
            shape: Shape::Cube { half_edge: HALF_CUBE },
            scene: scene(remote),
            sensor: WristSensorSettings::default(),
            reading: ReadingTime::MEAN,
            limit: WrenchLimit::NONE,
        }
    }
}

/// Measurements for the control of an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Joint positions, in rad.
    pub q: Joints,
    /// Reading of the wrist sensor, with payload and bias, in N and N·m.
    pub reading: Wrench,
    /// Number of the reading; that of the start is 0.
    pub reading_number: u64,
}

/// Simulated arm under control.
#[derive(Clone, Debug)]
pub struct RobotSite {
    arm: Manipulator,
    control: ArmControl,
    gripper: Option<SimulatedGripper>,
    qd: Joints,
    reading: ReadingTime,
    /// Readings that have not reached the control yet.
    under_way: VecDeque<Wrench>,
    measurement: Measurement,
    before: Option<Instant>,
    /// Time that the newest measurement was taken after the one before, in s.
    dt: f64,
    max_step: f64,
}

impl RobotSite {
    /// Creates the robot of `config` at rest at its start. `seed` is that of the sensor's noise.
    ///
    /// # Errors
    /// Returns an error if the configuration has no robot, or one that cannot be simulated.
    pub fn new(config: &Config, equipment: &Equipment, seed: u64) -> Result<Self, NoRobot> {
        let robot = config.robot.as_ref().ok_or(NoRobot::NoArm)?;
        let Virtual { interaction, servo, .. } = config.remote;
        let settings = ManipulatorSettings {
            joints: robot.joints.iter().map(simulated_joint::settings).collect(),
            x_b_0: robot.x_b_0,
            x_n_m: robot.x_n_m,
            gravity: GRAVITY.into(),
            servo_time_constant: servo.time_constant(),
            sensor: sensor(&equipment.sensor, &interaction.sensor),
            seed,
        };
        let tool =
            Tool { shape: equipment.shape, x_m_s: interaction.sensor.x_m_s, load: load(config) };
        let arm = Manipulator::new(&settings, tool, equipment.scene)?;
        let start = robot.start();
        let control = ArmControl::new(*robot.law(), servo, interaction, equipment.limit, &start);
        let max_step = 10.0 * config.period.as_secs_f64();
        let measurement = Measurement { q: start, reading: *arm.f_s_sensed(), reading_number: 0 };
        Ok(Self {
            arm,
            control,
            gripper: config.remote.gripper.map(SimulatedGripper::new),
            qd: Joints::zeros(),
            reading: equipment.reading,
            under_way: VecDeque::new(),
            measurement,
            before: None,
            dt: 0.0,
            max_step,
        })
    }

    /// Returns the robot of `config` as [`new`](Self::new) does, unless it starts in contact.
    ///
    /// # Errors
    /// As [`new`](Self::new), and a start in contact.
    pub fn in_free_space(
        config: &Config,
        equipment: &Equipment,
        seed: u64,
    ) -> Result<Self, NoRobot> {
        let site = Self::new(config, equipment, seed)?;
        if !site.arm.contact().is_touching_at(site.pose()) {
            return Ok(site);
        }
        let file = config.robot.as_ref().map(|robot| robot.file.clone()).unwrap_or_default();
        Err(NoRobot::StartsInContact { file, at: site.pose().translation.vector.into() })
    }

    /// Returns the simulated arm, with its ground truth.
    pub const fn arm(&self) -> &Manipulator {
        &self.arm
    }

    /// Returns the control law of the arm, with its state.
    pub const fn control(&self) -> &ArmControl {
        &self.control
    }

    /// Returns the true pose of {MRF} in {b}.
    pub const fn pose(&self) -> &Isometry3<f64> {
        self.arm.x_b_m()
    }

    /// Returns the newest measurements; before the first [`measure`](Self::measure), those of the start.
    pub const fn measurement(&self) -> Measurement {
        self.measurement
    }

    /// Moves the arm with its joint rates until `now`; returns the measurements. After a pause it moves for at most ten
    /// periods.
    pub fn measure(&mut self, now: Instant) -> Measurement {
        let elapsed = self.before.map_or(Duration::ZERO, |before| now.since(before));
        self.before = Some(now);
        self.dt = elapsed.as_secs_f64().min(self.max_step);
        if self.dt > 0.0 {
            let unread = (self.dt - self.reading.span).max(0.0);
            self.arm.step(unread, &self.qd.into());
            self.arm.step(self.dt - unread, &self.qd.into());
            self.measurement = Measurement {
                q: Joints::from(self.arm.q()),
                reading: self.read(),
                reading_number: self.measurement.reading_number + 1,
            };
        }
        self.measurement
    }

    /// Steps the control with a command and the measurements of the last [`measure`](Self::measure), which a test or a fault
    /// may have changed.
    pub fn command(&mut self, command: &Motion, measurement: &Measurement) {
        if self.dt > 0.0 {
            let Measurement { q, reading, .. } = measurement;
            self.qd = self.control.step(self.dt, command, q, reading);
        }
    }

    /// Moves the gripper over the time of the last [`measure`](Self::measure), with a command or else the last one. Returns
    /// opening and force; `None` without a gripper.
    pub fn grip(&mut self, command: Option<Gripper>) -> Option<Gripper> {
        let dt = self.dt;
        self.gripper.as_mut().map(|gripper| gripper.step(dt, command))
    }

    /// Returns the reading that reaches the control; initially that of the start.
    fn read(&mut self) -> Wrench {
        let reading = *self.arm.f_s_sensed();
        self.under_way.push_back(reading);
        while self.under_way.len() <= self.reading.late {
            self.under_way.push_back(reading);
        }
        self.under_way.pop_front().unwrap_or(reading)
    }
}

impl Remote for RobotSite {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        let measurement = self.measure(now);
        self.command(&command.motion, &measurement);
        let gripper = self.grip(command.gripper);
        Some(RemoteSample {
            at: now,
            f_s: *self.control.operator_wrench(),
            x_b_m: *self.control.pose(),
            gripper,
        })
    }

    /// Resets a stop of the arm's control.
    fn begin_epoch(&mut self) {
        self.control.reset();
    }

    fn joints(&self) -> Option<RobotJoints> {
        Some(RobotJoints(self.measurement.q.into()))
    }
}

/// Returns a sensor with the sign and bias of the configuration, and additional errors.
fn sensor(errors: &WristSensorSettings, configured: &WristSensor) -> WristSensorSettings {
    let sign = match configured.reports {
        Reports::OnTool => 1.0,
        Reports::OnArm => -1.0,
    };
    let mut bias = errors.bias;
    bias.iter_mut().zip(configured.bias.components()).for_each(|(all, known)| *all += known);
    let cross_talk = errors.cross_talk.map(|row| row.map(|share| sign * share));
    WristSensorSettings { cross_talk, bias, ..*errors }
}

/// Returns the payload of the configuration, in {S}.
fn load(config: &Config) -> Load {
    let payload = &config.remote.interaction.payload;
    Load {
        mass: payload.mass(),
        centre_of_mass: *payload.centre_of_mass(),
        inertia: *payload.inertia(),
    }
}

/// Returns the surfaces of a configuration, as the simulation computes them.
fn scene(remote: &Virtual) -> Scene {
    let surface = |Contact { stiffness, damping, friction }| Surface {
        stiffness,
        damping,
        damping_depth: DAMPING_DEPTH,
        friction,
    };
    Scene {
        wall: remote.wall.map(|(point, normal, contact)| Wall {
            point,
            normal,
            surface: surface(contact),
        }),
        block: remote.block.map(|(centre, half_size, contact)| Block {
            centre,
            half_size,
            surface: surface(contact),
        }),
        sphere: remote.sphere.map(|(centre, radius, contact)| Sphere {
            centre,
            radius,
            surface: surface(contact),
        }),
        plate: None,
    }
}
