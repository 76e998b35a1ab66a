//! Control law of the hand controller, one cycle at a time (Williams 1997, Fig. 3): from joint positions and the sensed
//! wrench to joint torques and the Cartesian command.
//!
//! Timing and the bus belong to the node. The paper is the index:
//!
//! | file                | paper         | what                                               |
//! |---------------------|---------------|----------------------------------------------------|
//! | [`mod@step`]        | Fig. 3        | one cycle, read from top to bottom                 |
//! | [`interpretation`]  |               | choices where the paper allows several             |
//! | [`calibration`]     | 4.2           | counts to positions, torques to per mille          |
//! | [`torque_curve`]    | Fig. 6        | odd polynomial, proven to rise                     |
//! | [`coupling`]        | 4.2           | joints and the actuators that move them            |
//! | [`arm`]             | Eq. 1, 7, 3.3 | kinematics, Jacobian, weight                       |
//! | [`switches`]        | 4.1           | permissions and requests of the operator           |
//! | [`mod@reference`]   | Eq. 2, 3      | grip pose of zero command                          |
//! | [`orientation`]     | Eq. 4, 5      | orientation as three numbers                       |
//! | [`channels`]        | Fig. 4, Eq. 8 | one law for each axis                              |
//! | [`command`]         | Eq. 5, 3.5    | rate or pose of the object                         |
//! | [`reflection`]      | Eq. 6         | wrench on the object, at the grip                  |
//! | [`assist`]          | Eq. 8, 9      | return to centre, damping                          |
//! | [`limits`]          | Eq. 10        | torque capacity of every joint                     |
//!
//! [`hold`] is a law beside Fig. 3: it moves the arm by itself, slowly.
//!
//! [`stability`] checks the gains before anything moves. While the arm runs, the operator sets scales, locks axes and
//! aligns the object: [`adjustment`], [`scaling`], `alignment`.
//!
//! Extensions that the paper does not have are off by default: [`velocity`] (a filter), [`virtual_coupling`],
//! [`engagement`], [`passivity`] and [`tank`] (at the [`port`]), [`friction`], [`soft_stops`]. [`torque_delay`]
//! relates each torque to the motion that it caused.
//!
//! "Decision n" refers to the list in `docs/paper.md`. One function implements each, so that an alternative can be
//! added beside it.
//!
//! ```
//! use controller::torque_curve::TorqueCurve;
//!
//! // Target in ‰ of rated torque for a joint torque of t N·m: 12 t + t³, up to 6 N·m. It is proven to rise.
//! let curve = TorqueCurve::new([12.0, 1.0, 0.0], 6.0).unwrap();
//! assert!(TorqueCurve::new([12.0, -40.0, 0.0], 6.0).is_err());
//! ```
#![forbid(unsafe_code)]

pub mod adjustment;
mod alignment;
pub mod arm;
pub mod assist;
mod booking;
pub mod breakaway;
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
pub mod hold;
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
mod valid_input;
pub mod velocity;
pub mod virtual_coupling;

pub use output::{DriveTargets, Input, InvalidValue, Ledger, Output};
pub use settings::{Extensions, Settings};
pub use step::Controller;

use nalgebra::SVector;

/// One number per joint, base first.
pub type JointVector = SVector<f64, 6>;
