//! Torque curves (4.2, Fig. 6): the maker's straight line against a calibrated polynomial, at the joint and at the hand.
//!
//! A seed selects the curve of each joint's motor. It is measured on the simulated rig with a load cell, in both driving
//! directions, as for `frhc calib fit`.
//!
//! | file             | part                                                              |
//! |------------------|-------------------------------------------------------------------|
//! | [`calibration`]  | readings of a joint, both curves, and the error of their torques   |
//! | [`test_force`]   | test forces along one axis each, at the hand, with either curve   |

pub mod calibration;
pub mod test_force;
