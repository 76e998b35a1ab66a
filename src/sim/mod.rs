//! What does not exist: drives and switches on the bus, the arm they move, the hand that holds it, and
//! what the commanded object can touch.
//!
//! Imports neither the controller nor the commanded side. Kinematics and dynamics are written here a
//! second time, another way, and both are held against the values of independent programs: a mistake
//! cannot cancel itself out.
//!
//! | file         | what                                                        |
//! |--------------|-------------------------------------------------------------|
//! | [`drive`]    | a CiA 402 drive: power states, modes, encoder               |
//! | [`motion`]   | its modes of operation                                      |
//! | [`drivetrain`] | its motor and gear, up to the joint                       |
//! | [`switches`] | a CiA 401 input module                                      |
//! | [`arm`]      | rigid-body kinematics and dynamics                          |
//! | [`plant`]    | the arm in motion: friction, end stops, integration         |
//! | [`hand`]     | the operator's hand, and its [`tremor`]                     |
//! | [`scenario`] | what the operator does, and when                            |
//! | [`scene`]    | a wall and a box                                            |
//! | [`world`]    | all of it, as a station on the buses                        |
//! | [`rig`]      | one joint against a load cell, to calibrate                 |

pub mod actuator;
pub mod arm;
pub mod drive;
pub mod drivetrain;
pub mod hand;
pub mod motion;
pub mod personality;
pub mod plant;
mod power;
mod random;
pub mod rig;
pub mod scenario;
pub mod scene;
pub mod switches;
pub mod transmission;
pub mod tremor;
pub mod world;
