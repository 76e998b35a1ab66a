//! What does not exist: drives and switches on the bus, the arm they move, the hand that holds it, and
//! what the commanded object can touch.
//!
//! Imports neither the controller nor the commanded side. Kinematics and dynamics are written here a
//! second time, another way, and both are held against the values of independent programs: a mistake
//! cannot cancel itself out.
//!
//! | file         | what                                                        |
//! |--------------|-------------------------------------------------------------|
//! | [`drive`]    | a CiA 402 drive: power states, limits, faults               |
//! | [`motion`]   | its modes of operation                                      |
//! | [`drivetrain`] | its motor and gear, up to the joint: lag, curve, play, heat |
//! | [`personality`] | what real drives do at their worst                      |
//! | [`switches`] | a CiA 401 input module                                      |
//! | [`arm`]      | rigid-body kinematics and dynamics                          |
//! | [`plant`]    | the arm in motion: friction, end stops, integration         |
//! | [`person`]   | the operator: a [`hand`], its [`tremor`], its [`temperament`] |
//! | [`scenario`] | what the operator does and what breaks, and when            |
//! | [`fault`]    | what breaks, between devices and buses                      |
//! | [`world`]    | all of it, as a station on the buses                        |
//! | [`belief`]   | what each drive believes, and what is so                    |
//! | [`rig`]      | one joint against a load cell, to calibrate                 |
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
mod beginning;
pub mod belief;
mod delay;
pub mod drive;
pub mod drivetrain;
pub mod fault;
pub mod hand;
pub mod motion;
mod motors;
pub mod person;
pub mod personality;
pub mod plant;
pub mod random;
pub mod rig;
pub mod scenario;
pub mod switches;
pub mod temperament;
pub mod transmission;
pub mod tremor;
pub mod world;
