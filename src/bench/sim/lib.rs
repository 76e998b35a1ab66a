//! Simulation of drives and switch box on the bus, the arm they move, the operator's hand, and the contact of the
//! commanded object.
//!
//! It does not depend on the controller or the commanded side. Kinematics and dynamics are a second, different
//! implementation, compared with independent programs, so that an error in one cannot cancel in the other.
//!
//! Begin with [`world`]. Between a drive and the arm pass position, velocity, torque and temperature in one direction, and ‰ of
//! rated torque in the other. Faults act between the devices and the buses, so that they are the same in memory and on SocketCAN.
//!
//! | module                | content                                                     |
//! |-----------------------|-------------------------------------------------------------|
//! | [`drive`]             | a CiA 402 drive: power states, limits, faults               |
//! | [`motion`]            | its modes of operation                                      |
//! | [`drivetrain`]        | motor and gear: lag, torque curve, backlash, heat           |
//! | [`quirks`]            | deviations of real drives                                   |
//! | [`switches`]          | a CiA 401 input module                                      |
//! | [`arm`]               | rigid-body kinematics and dynamics                          |
//! | [`plant`]             | the arm in motion: friction, end stops, integration         |
//! | [`operator_model`]    | the operator: a [`hand`] and its [`tremor`]                 |
//! | [`operator_settings`] | presets of the operator model                               |
//! | [`scenario`]          | the operator's actions and the faults of a run              |
//! | [`fault`]             | faults of devices, applied between them and their buses     |
//! | [`world`]             | all of these as one station on the buses                    |
//! | [`drive_view`]        | drive values beside the ground truth                        |
//! | [`manipulator`]       | a slave arm of 6 to 9 joints: rate servo, friction, payload |
//! | [`wrist_sensor`]      | its force/torque sensor                                     |
//! | [`contact`]           | its tool against wall, box, sphere and a plate with holes   |
//! | [`rig`]               | one joint against a load cell, for calibration              |
//! | [`friction_rig`]      | one joint swept slowly, for its friction                    |
//!
//! ```
//! use sim::scenario::Scenario;
//!
//! let scenario = Scenario::parse("seconds = 2.0\n[[fault]]\nat_s = 1.0\nkind = \"unplug\"\njoint = 3").unwrap();
//! let error = Scenario::parse("seconds = 2.0\n[[fault]]\nat_s = 1.0\nkind = \"unplugged\"\njoint = 3").unwrap_err();
//! assert!(error.to_string().contains("unplugged"));
//! ```
#![forbid(unsafe_code)]

pub mod actuator;
pub mod arm;
pub mod contact;
pub mod cradle;
mod delay;
pub mod drive;
pub mod drive_view;
pub mod drivetrain;
pub mod extremes;
pub mod fault;
pub mod friction_rig;
mod guide;
pub mod hand;
pub mod manipulator;
pub mod motion;
mod motors;
pub mod operator_model;
pub mod operator_settings;
pub mod plant;
pub mod quirks;
pub mod random;
pub mod rig;
pub mod scenario;
mod scenario_start;
pub mod switches;
pub mod transmission;
pub mod tremor;
pub mod world;
pub mod wrist_sensor;
