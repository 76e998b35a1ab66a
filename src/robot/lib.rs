//! Commanded side: motion of a robot or a virtual object under commands (Williams 1997, 3.2 and 4.3).
//!
//! Contact wrenches are inputs. The crate does not depend on the hand controller.
//!
//! ```
//! use nalgebra::Isometry3;
//! use robot::object::{Object, Servo};
//! use units::spatial::{Motion, Twist, Wrench};
//!
//! let servo = Servo::new(0.05, 0.5, 2.0).unwrap(); // a lag of 50 ms, at most 0.5 m/s and 2 rad/s
//! let mut object = Object::new(servo, Isometry3::identity());
//! object.step(0.001, &Motion::Hold, &Wrench::ZERO);
//! assert_eq!(object.pose().translation.x, 0.0);
//! ```
#![forbid(unsafe_code)]

pub mod accommodation;
pub mod arm_control;
pub mod chain;
pub mod damped_inverse;
pub mod following_arm;
pub mod god_object;
pub mod interaction;
pub mod joint_limits;
pub mod object;
pub mod payload;
pub mod resolved_rate;
pub mod shared_control;
#[cfg(test)]
mod testing;
pub mod wrench_limit;
pub mod wrist_sensor;
