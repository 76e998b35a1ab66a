//! One cycle of the hand controller's law: joint positions and the sensed wrench in, joint torques
//! and the Cartesian command out (Williams 1997, Fig. 3).
//!
//! Not when it runs, nor what becomes of its output. The paper is the index:
//!
//! | file                | paper         | what                                               |
//! |---------------------|---------------|----------------------------------------------------|
//! | [`mod@step`]        | Fig. 3        | one cycle, read from top to bottom                 |
//! | [`interpretation`]        |               | how the paper is read where it can be read in several ways |
//! | [`calibration`]     | 4.2           | counts to positions, torques to per mille          |
//! | [`torque_curve`]    | Fig. 6        | an odd polynomial that is proven to rise           |
//! | [`coupling`]        | 4.2           | joints and the actuators that move them            |
//! | [`arm`]             | Eq. 1, 7, 3.3 | kinematics, Jacobian, weight                       |
//! | [`switches`]        | 4.1           | what the operator permits                          |
//! | [`mod@reference`]   | Eq. 2, 3      | where zero is                                      |
//! | [`orientation`]     | Eq. 4, 5      | orientation as three numbers                       |
//! | [`channels`]        | Fig. 4, Eq. 8 | one law for each axis                              |
//! | [`command`]         | Eq. 5, 3.5    | rate or pose of the object                         |
//! | [`reflection`]      | Eq. 6         | the wrench on the object, felt                     |
//! | [`assist`]          | Eq. 8, 9      | return to centre, damping                          |
//! | [`limits`]          | Eq. 10        | what every joint can exert                         |
//!
//! [`stability`] says which gains are fit to be felt.
//! While it runs the operator sets scales, locks axes and aligns the object: [`adjustment`], [`scaling`], `alignment`.
//! Beside the paper, each off unless asked for: [`velocity`] (a filter), [`virtual_coupling`],
//! [`engagement`], [`passivity`] and [`tank`] (at the [`port`]), [`soft_stops`]. [`torque_delay`] says
//! which torque caused which motion.
//!
//! Where the paper leaves a choice, "decision n" names the one taken; each stands in one function,
//! so that another reading can stand beside it.
//!
//! ```
//! use controller::torque_curve::TorqueCurve;
//!
//! // Torque of a drive over ‰ of its rated torque: 12 x + x³ N·m, up to 6 N·m. It is proven to rise.
//! let curve = TorqueCurve::new([12.0, 1.0, 0.0], 6.0).unwrap();
//! assert!(TorqueCurve::new([12.0, -40.0, 0.0], 6.0).is_err());
//! ```
#![forbid(unsafe_code)]

pub mod adjustment;
mod alignment;
pub mod arm;
pub mod assist;
mod booking;
pub mod calibration;
pub mod channels;
pub mod command;
pub mod contact_posture;
pub mod contact_stiffness;
pub mod coupling;
mod damper;
pub mod engagement;
pub mod friction;
pub mod friction_bound;
pub mod gains;
mod intake;
pub mod interpretation;
pub mod limits;
mod never_pulls;
pub mod orientation;
mod output;
pub mod passivity;
pub mod period;
pub mod port;
pub mod reference;
pub mod reflection;
pub mod scaling;
pub mod self_drive;
mod settings;
pub mod soft_stops;
pub mod stability;
pub mod step;
pub mod switches;
pub mod tank;
pub mod torque_curve;
pub mod torque_delay;
mod unloading;
pub mod velocity;
pub mod virtual_coupling;

pub use output::{DriveTargets, Fault, Input, Ledger, Output};
pub use settings::{Extensions, Settings};
pub use step::Controller;

use nalgebra::SVector;

/// One number per joint, base first.
pub type JointVector = SVector<f64, 6>;
