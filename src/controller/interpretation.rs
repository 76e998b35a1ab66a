//! Interpretations of the paper where it allows several: one choice per decision of `docs/paper.md`, and two presets.
//!
//! | choice                | decision | `consistent`                   | `paper1997`, with its defect               |
//! |-----------------------|----------|--------------------------------|--------------------------------------------|
//! | [`Orientation`]       | 4        | Euler angles, held beyond 80°  | the same; the rotation vector is the other choice, held beyond 170° |
//! | [`DisplacementFrame`] | 2        | those of the reference {G0}    | those of the base: one six-vector has two frames, and the command turns with the base |
//! | [`Centring`]          | 2, 15    | conjugate to ΔX, turned to {G} | components of ΔX taken as a wrench at {G}: a hand at half a turn is repelled |
//! | [`Weight`]            | 12       | each link on its own joints    | all links as one wrench at the grip: every joint except the first also carries the links before it |
//! | [`TorqueScaling`]     | 13, 22   | gravity is never scaled        | gravity is part of the assist and scaled with it: the arm sags in fast motion |
//! | [`Difference`]        | 19       | twist of the grip, in SI       | ΔX less the last ΔX: grows with the sample rate, and takes Euler angles as a rotation |
//! | `latches`             | 29       | closing the deadman sets the reference | the same; without it, a pose command jumps to the hand's displacement |
//! | [`ReflectionFrame`]   | 30       | those of the grip              | the same                                   |
//!
//! Both presets use Eq. 8 as an odd function (decision 14). As printed, its first line repels a hand on the negative
//! side without bound, so it is not available.

use crate::orientation::Orientation;

/// Frame in which the translation of ΔX is written (Eq. 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisplacementFrame {
    /// Base {0}.
    Base,
    /// Reference {G0}.
    Reference,
}

/// Frame whose axes the reflected task wrench keeps (decision 30).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReflectionFrame {
    /// Grip {G}.
    Grip,
    /// Reference {G0}.
    Reference,
}

/// Conversion of the return to centre into a wrench (Eq. 8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Centring {
    /// Wrench that does the same work on the grip as the six forces on the six components.
    Conjugate,
    /// Six forces, taken as a wrench at {G}.
    Components,
}

/// Model of the gravity compensation (3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// Weight of each link at its own joints, `Σ J_ciᵀ (-m_i g)`.
    PerLink,
    /// Weight of all links as one wrench at the grip, through Eq. 7.
    AtGrip,
}

/// Torques that are scaled to the joints' capacities (3.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TorqueScaling {
    /// Assist to its fraction, then task and assist to the capacity that gravity leaves.
    GravityExempt,
    /// Assist to its fraction, then the total to capacity.
    Total,
    /// Assist and gravity together to the assist's fraction, then the total to capacity: Eq. 10 as printed.
    AssistWithGravity,
}

/// Quantity whose rate of change is damped (Eq. 9).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difference {
    /// Pose of the grip: its twist.
    Twist,
    /// Each component of ΔX since the last cycle.
    Components,
}

/// One interpretation of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interpretation {
    /// Parametrisation of an orientation.
    pub orientation: Orientation,
    /// Frame in which the translation of ΔX is written.
    pub displacement: DisplacementFrame,
    /// Conversion of the return to centre into a wrench.
    pub centring: Centring,
    /// Model of the gravity compensation.
    pub weight: Weight,
    /// Torques that are scaled.
    pub scaling: TorqueScaling,
    /// Quantity whose rate of change is damped.
    pub damping: Difference,
    /// Closing the deadman in pose mode sets the reference.
    pub latches: bool,
    /// Frame whose axes the reflected task wrench keeps.
    pub task: ReflectionFrame,
}

impl Interpretation {
    /// Default: frames, work and weight are mutually consistent.
    pub const CONSISTENT: Self = Self {
        orientation: Orientation::EulerZyx,
        displacement: DisplacementFrame::Reference,
        centring: Centring::Conjugate,
        weight: Weight::PerLink,
        scaling: TorqueScaling::GravityExempt,
        damping: Difference::Twist,
        latches: true,
        task: ReflectionFrame::Grip,
    };

    /// Equations as printed, for comparison.
    pub const PAPER_1997: Self = Self {
        orientation: Orientation::EulerZyx,
        displacement: DisplacementFrame::Base,
        centring: Centring::Components,
        weight: Weight::AtGrip,
        scaling: TorqueScaling::AssistWithGravity,
        damping: Difference::Components,
        latches: true,
        task: ReflectionFrame::Grip,
    };
}
