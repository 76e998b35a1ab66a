//! One cycle of the hand controller's law: joint positions and the sensed wrench in, joint torques
//! and the Cartesian command out (Williams 1997, Fig. 3).
//!
//! Not when it runs, nor what becomes of its output. The paper is the index:
//!
//! | file            | paper         | what                                               |
//! |-----------------|---------------|----------------------------------------------------|
//! | [`calibration`] | 4.2, Fig. 6   | counts to positions, torques to per mille          |
//! | [`arm`]         | Eq. 1, 7, 3.3 | kinematics, Jacobian, weight                       |
//! | [`switches`]    | 4.1           | what the operator permits                          |
//! | [`mod@reference`] | Eq. 2, 3    | where zero is                                      |
//! | [`orientation`] | Eq. 4, 5      | orientation as three numbers                       |
//! | [`channels`]    | Fig. 4, Eq. 8 | one law for each axis                              |
//! | [`command`]     | Eq. 5, 3.5    | rate or pose of the object                         |
//! | [`reflection`]  | Eq. 6         | the wrench on the object, felt                     |
//! | [`assist`]      | Eq. 8, 9      | return to centre, damping                          |
//! | [`limits`]      | Eq. 10        | what every joint can exert                         |
//!
//! Where the paper leaves a choice, "decision n" names the one taken; each stands in one function,
//! so that another reading can stand beside it.

pub mod arm;
pub mod assist;
pub mod calibration;
pub mod channels;
pub mod command;
pub mod gains;
mod intake;
pub mod limits;
pub mod orientation;
pub mod reference;
pub mod reflection;
pub mod switches;

use nalgebra::Isometry3;
use nalgebra::SVector;
use thiserror::Error;

use crate::controller::arm::Arm;
use crate::controller::assist::Damping;
use crate::controller::calibration::Calibration;
use crate::controller::calibration::Counts;
use crate::controller::calibration::PerMille;
use crate::controller::channels::Channels;
use crate::controller::command::CommandLaw;
use crate::controller::command::Gate;
use crate::controller::intake::Trusted;
use crate::controller::limits::AssistFraction;
use crate::controller::limits::Limits;
use crate::controller::reference::Displacement;
use crate::controller::reference::Reference;
use crate::controller::reflection::Reflection;
use crate::controller::switches::Mode;
use crate::controller::switches::Panel;
use crate::controller::switches::Pressed;
use crate::controller::switches::Switches;
use crate::spatial::Jacobian;
use crate::spatial::Motion;
use crate::spatial::Wrench;

/// One number per joint, base first.
pub type JointVector = SVector<f64, 6>;

/// Everything the law is made of; each part cannot be wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The hand controller's links.
    pub arm: Arm<6>,
    /// Its encoders, gears and torque curves; their ends are the joints' capacities.
    pub calibration: Calibration<6>,
    /// Deadband and return to centre.
    pub channels: Channels,
    /// From displacement to command.
    pub command: CommandLaw,
    /// From the sensor to the grip.
    pub reflection: Reflection,
    /// Against the hand's motion, with the cycle period.
    pub damping: Damping,
    /// What the assist may take of each joint's capacity.
    pub assist_fraction: AssistFraction,
}

/// What one cycle starts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Where the drives are.
    pub counts: [Counts; 6],
    /// The wrench of the environment on the object, at the sensor {S}, payload removed.
    pub f_s: Wrench,
    /// Where the object is, in its base.
    pub x_b_m: Isometry3<f64>,
    /// Which switches are closed.
    pub switches: Switches,
    /// What a displacement means.
    pub mode: Mode,
    /// How much of the arm's weight is to be carried, 0 to 1: whether, and how far it is ramped up.
    pub gravity_share: f64,
    /// How much of task and assist is to be felt, 0 to 1, likewise.
    pub reflection_share: f64,
    /// Whether earlier cycles are to be forgotten: the first one, or one after an overrun.
    pub restart: bool,
}

/// What one cycle came to, with every intermediate of Fig. 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// Joint positions, in rad or m.
    pub q: JointVector,
    /// The first joint outside its range, from 0.
    pub joint_out_of_range: Option<usize>,
    /// The grip's pose (Eq. 1).
    pub x_0_g: Isometry3<f64>,
    /// What the switches permit and ask for.
    pub pressed: Pressed,
    /// Where zero is, from this cycle on.
    pub reference: Reference,
    /// The grip's pose seen from the reference (Eq. 2, 3).
    pub x_h_g: Isometry3<f64>,
    /// The same as six numbers (Eq. 4).
    pub dx: Displacement,
    /// What of it commands: less the deadband.
    pub dx_db: Displacement,
    /// Whether the command is the operator's.
    pub gate: Gate,
    /// What is asked of the object (Eq. 5, 3.5).
    pub command: Motion,
    /// The wrench on the object at {MRF} (Eq. 6), whether or not it is felt.
    pub f_m_task: Wrench,
    /// What of it the hand is to feel, at {G}.
    pub f_g_task: Wrench,
    /// The return to centre, at {G} (Eq. 8).
    pub f_g_centring: Wrench,
    /// Damping, at {G} (Eq. 9).
    pub f_g_damping: Wrench,
    /// The Jacobian of {G} in {G}.
    pub j_g: Jacobian<6>,
    /// The joint torques of the task (Eq. 7), in N·m or N.
    pub tau_task: JointVector,
    /// Those of return to centre and damping, before their scaling.
    pub tau_assist: JointVector,
    /// Those that carry the arm, as far as it is to be carried.
    pub tau_gravity: JointVector,
    /// What is left of the assist.
    pub assist_scale: f64,
    /// What is left of task and assist.
    pub rest_scale: f64,
    /// The joint that left no more, from 0.
    pub limiting_joint: Option<usize>,
    /// The joint torques asked for (Eq. 10), in N·m or N.
    pub tau: JointVector,
    /// The same as the drives take it (Fig. 6).
    pub targets: [PerMille; 6],
    /// The worst that happened, if anything did. The torques are safe to send all the same.
    pub fault: Option<Fault>,
}

impl Output {
    /// Whether the hand feels less than it should because a joint can do no more.
    pub const fn is_saturated(&self) -> bool {
        self.limiting_joint.is_some()
    }
}

/// Something that cannot be, and was replaced. Worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Fault {
    /// All torques were replaced by zero.
    #[error("a torque is not a finite number")]
    TorqueNotFinite,
    /// Nothing is felt.
    #[error("the sensed wrench is not finite")]
    WrenchNotFinite,
    /// Nothing is felt.
    #[error("the sensed wrench is larger than any sensor reads")]
    WrenchTooLarge,
    /// The last good pose is used.
    #[error("the object's pose is not one")]
    ObjectPoseNotFinite,
    /// Nothing is carried, or nothing felt.
    #[error("a share is not within 0 and 1")]
    ShareOutOfRange,
    /// Nothing is commanded until the hand begins anew.
    #[error("the hand is turned too far from its reference to be commanded")]
    TurnedTooFar,
}

/// The law with what it remembers from cycle to cycle.
#[derive(Clone, Copy, Debug)]
pub struct Controller {
    arm: Arm<6>,
    calibration: Calibration<6>,
    channels: Channels,
    law: CommandLaw,
    reflection: Reflection,
    limits: Limits<6>,
    panel: Panel,
    reference: Reference,
    gate: Gate,
    damping: Damping,
    /// Where the object last was.
    x_b_m: Isometry3<f64>,
    /// Where the last command asked it to be, if it asked for a pose.
    x_b_asked: Option<Isometry3<f64>>,
}

impl Controller {
    /// Ready for its first cycle: no reference, reflection off.
    pub fn new(settings: &Settings) -> Self {
        let Settings { arm, calibration, channels, command, reflection, damping, assist_fraction } =
            *settings;
        Self {
            arm,
            calibration,
            channels,
            law: command,
            reflection,
            limits: Limits::new(calibration.max_torques(), assist_fraction),
            panel: Panel::new(Mode::Rate),
            reference: Reference::none(),
            gate: Gate::Released,
            damping,
            x_b_m: Isometry3::identity(),
            x_b_asked: None,
        }
    }

    /// One cycle (Fig. 3).
    pub fn step(&mut self, input: &Input) -> Output {
        let given = Trusted::of(input, &self.x_b_m);
        let pressed = self.panel.read(input.switches, input.mode); // 4.1

        let q = self.calibration.positions(&input.counts);
        let posture = self.arm.posture(&q);
        let x_0_g = posture.x_0_g; // Eq. 1

        let x_b_last = self.x_b_asked.unwrap_or(given.x_b_m);
        let is_new = self.reference.update(&pressed, &x_0_g, &x_b_last);
        let reference = self.reference;
        let x_h_g = reference.displacement(&x_0_g); // Eq. 2, 3
        let dx = Displacement::between(&x_h_g, self.law.orientation); // Eq. 4

        let dx_db = self.law.effective(input.mode, &self.channels, &dx);
        let is_within = self.law.orientation.is_within(&dx.orientation);
        let gate = self.gate.next(&pressed, input.mode, is_new, dx_db.is_zero(), is_within);
        let command = self.law.motion(input.mode, gate, &reference, &dx_db); // Eq. 5, 3.5

        let f_m_task = self.reflection.at_object(&given.f_s); // Eq. 6
        let f_g_task = permitted(pressed.task, self.reflection.at_grip(&f_m_task)); // K_T
        let centring = assist::centring(&self.channels, self.law.orientation, &x_h_g, &dx);
        let f_g_centring = permitted(pressed.centring, centring); // Eq. 8
        let damping = self.damping.wrench(&x_0_g, &reference.x_0_h, input.restart);
        let f_g_damping = permitted(pressed.damping, damping); // Eq. 9

        let j_g = self.arm.jacobian(&posture);
        let tau_task = j_g.torques(&f_g_task); // Eq. 7
        let tau_assist = j_g.torques(&(f_g_centring + f_g_damping));
        let tau_gravity = self.arm.gravity(&posture) * given.gravity_share; // 3.3
        let share = given.reflection_share;
        let limited = self.limits.combine(&tau_gravity, &tau_task, &tau_assist, share); // Eq. 10
        let targets = self.calibration.targets(&limited.tau); // Fig. 6

        self.gate = gate;
        self.x_b_m = given.x_b_m;
        self.x_b_asked = asked_pose(&command);
        let broken = limited.is_broken.then_some(Fault::TorqueNotFinite);
        let turned = (gate == Gate::TurnedTooFar).then_some(Fault::TurnedTooFar);
        Output {
            q,
            joint_out_of_range: self.arm.out_of_range(&q),
            x_0_g,
            pressed,
            reference,
            x_h_g,
            dx,
            dx_db,
            gate,
            command,
            f_m_task,
            f_g_task,
            f_g_centring,
            f_g_damping,
            j_g,
            tau_task,
            tau_assist,
            tau_gravity,
            assist_scale: limited.assist_scale,
            rest_scale: limited.rest_scale,
            limiting_joint: limited.limiting_joint,
            tau: limited.tau,
            targets,
            fault: broken.or(given.fault).or(turned),
        }
    }
}

/// The wrench where it is permitted, none elsewhere.
fn permitted(is_permitted: bool, f_g: Wrench) -> Wrench {
    if is_permitted { f_g } else { Wrench::ZERO }
}

/// Where a command asks the object to be, if it does.
fn asked_pose(command: &Motion) -> Option<Isometry3<f64>> {
    match command {
        Motion::Pose(x_b_d) => Some(*x_b_d),
        Motion::Hold | Motion::Rate(_) => None,
    }
}
