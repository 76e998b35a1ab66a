//! Interpretations of the paper where it can be read in several ways: one choice per decision of
//! `docs/paper.md`, and the two presets.
//!
//! | reading          | decision | `consistent`                    | `paper1997`, and what it does wrong        |
//! |------------------|----------|---------------------------------|--------------------------------------------|
//! | [`Orientation`]  | 4        | Euler angles, held beyond 80°   | the same; the rotation vector is the other choice, held beyond 170° |
//! | [`Displaced`]    | 2        | those of the reference {G0}     | those of the base: one six-vector has two frames, and the command turns with the base |
//! | [`Centring`]     | 2, 15    | conjugate to ΔX, turned to {G}  | components of ΔX taken for a wrench at {G}: a hand turned by half a turn is pushed away |
//! | [`Weight`]       | 12       | each link on its own joints     | all links as one wrench at the grip: every joint but the first also carries what lies before it |
//! | [`Scaling`]      | 13, 22   | gravity is never scaled         | gravity is part of the assist and scaled with it: the arm sags when the hand moves fast |
//! | [`Difference`]   | 19       | twist of the grip, in SI        | ΔX less the last ΔX: grows with the sample rate, and takes Euler angles for a rotation |
//! | `latches`        | 29       | closing the deadman latches     | the same; switched off, a pose command jumps to where the hand points |
//! | [`Felt`]         | 30       | those of the grip               | the same                                   |
//!
//! The odd reading of Eq. 8 (decision 14) is common to both: as printed, its first line pushes a hand
//! on the negative side away without bound, so it cannot be chosen.

use crate::orientation::Orientation;

/// Along which axes the translation of ΔX is written (Eq. 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Displaced {
    /// Those of the base {0}.
    InBase,
    /// Those of the reference {G0}.
    InReference,
}

/// Along which axes the task wrench is felt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Felt {
    /// Those of the grip {G}.
    InGrip,
    /// Those of the reference {G0}.
    InReference,
}

/// Conversion of the return to centre into a wrench (Eq. 8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Centring {
    /// The wrench that does the same work on the grip as the six forces do on the six numbers.
    Conjugate,
    /// The six forces themselves, taken for a wrench at {G}.
    Components,
}

/// Model of the gravity compensation (3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// `Σ J_ciᵀ (-m_i g)`.
    PerLink,
    /// The weight of all links as one wrench at the grip, through Eq. 7.
    AtGrip,
}

/// Torques that are scaled to fit the joints (3.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scaling {
    /// The assist to its fraction, then task and assist to what gravity leaves.
    GravityExempt,
    /// The assist to its fraction, then the total.
    Total,
    /// Assist and gravity together to the assist's fraction, then the total: Eq. 10 as printed.
    AssistWithGravity,
}

/// Quantity whose rate of change is damped (Eq. 9).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difference {
    /// The grip's pose: its twist.
    Twist,
    /// ΔX, number by number, since the last cycle.
    Components,
}

/// One reading of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interpretation {
    /// Parametrisation of an orientation.
    pub orientation: Orientation,
    /// Along which axes the translation of ΔX is written.
    pub displacement: Displaced,
    /// Conversion of the return to centre into a wrench.
    pub centring: Centring,
    /// Model of the gravity compensation.
    pub weight: Weight,
    /// Torques that are scaled.
    pub scaling: Scaling,
    /// Quantity whose rate of change is damped.
    pub damping: Difference,
    /// Closing the deadman in pose mode sets the reference.
    pub latches: bool,
    /// Along which axes the task wrench is felt.
    pub task: Felt,
}

impl Interpretation {
    /// Frames, work and weight agree with each other. The default.
    pub const CONSISTENT: Self = Self {
        orientation: Orientation::EulerZyx,
        displacement: Displaced::InReference,
        centring: Centring::Conjugate,
        weight: Weight::PerLink,
        scaling: Scaling::GravityExempt,
        damping: Difference::Twist,
        latches: true,
        task: Felt::InGrip,
    };

    /// The equations as they are printed, for comparison.
    pub const PAPER_1997: Self = Self {
        orientation: Orientation::EulerZyx,
        displacement: Displaced::InBase,
        centring: Centring::Components,
        weight: Weight::AtGrip,
        scaling: Scaling::AssistWithGravity,
        damping: Difference::Components,
        latches: true,
        task: Felt::InGrip,
    };
}
