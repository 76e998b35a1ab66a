//! What goes into one cycle and what comes out, with every intermediate of Fig. 3.

use nalgebra::Isometry3;
use thiserror::Error;

use crate::JointVector;
use crate::command::Gate;
use crate::port::Passed;
use crate::reference::Displacement;
use crate::reference::Reference;
use crate::switches::Mode;
use crate::switches::Pressed;
use crate::switches::Switches;
use crate::velocity::Moving;
use units::drive::Counts;
use units::drive::PerMille;
use units::numbering::Joint;
use units::spatial::Jacobian;
use units::spatial::Motion;
use units::spatial::Wrench;

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
    /// How the grip moves, in {G}.
    pub moving: Moving,
    /// The wrench on the object at {MRF} (Eq. 6), or that of the virtual coupling, felt or not.
    pub f_m_task: Wrench,
    /// What of it the hand is to feel, at {G}.
    pub f_g_task: Wrench,
    /// What keeps that exchange passive, at {G}, and the energies it is kept by.
    pub port: Passed,
    /// The return to centre, at {G} (Eq. 8).
    pub f_g_centring: Wrench,
    /// Damping, at {G} (Eq. 9).
    pub f_g_damping: Wrench,
    /// The Jacobian of {G} in {G}.
    pub j_g: Jacobian<6>,
    /// What every joint's torque is made of.
    pub ledger: Ledger,
    /// The joint torques asked for (Eq. 10), in N·m or N.
    pub tau: JointVector,
    /// The same as the drives take it (Fig. 6).
    pub targets: [PerMille; 6],
    /// The worst that happened, if anything did. The torques are safe to send all the same.
    pub fault: Option<Fault>,
}

/// The torque budget of one cycle: who asked for what, and what was left of it. In N·m or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ledger {
    /// The task (Eq. 7).
    pub task: JointVector,
    /// Carrying the arm, as far as it is to be carried.
    pub gravity: JointVector,
    /// The return to centre, before its scaling.
    pub centring: JointVector,
    /// Damping, before its scaling.
    pub damping: JointVector,
    /// Keeping the port passive.
    pub passivity: JointVector,
    /// The soft stops.
    pub soft_stops: JointVector,
    /// What is left of return to centre and damping, 0 to 1.
    pub assist_scale: f64,
    /// What is left of task and assist together, 0 to 1.
    pub rest_scale: f64,
    /// How much of task and assist is let through at all, 0 to 1.
    pub share: f64,
    /// The joint that left no more.
    pub limiting_joint: Option<Joint>,
    /// The first joint whose torque could not change as fast as asked.
    pub slewing_joint: Option<Joint>,
}

impl Ledger {
    /// Nobody asks for anything.
    pub(crate) fn nothing() -> Self {
        let none = JointVector::zeros();
        Self {
            task: none,
            gravity: none,
            centring: none,
            damping: none,
            passivity: none,
            soft_stops: none,
            assist_scale: 1.0,
            rest_scale: 1.0,
            share: 1.0,
            limiting_joint: None,
            slewing_joint: None,
        }
    }
}

impl Output {
    /// Whether the hand feels less than it should because a joint can do no more.
    pub const fn is_saturated(&self) -> bool {
        self.ledger.limiting_joint.is_some()
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
