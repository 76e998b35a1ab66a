//! Wrenches, twists, Jacobians and rotations, with named parts.
//!
//! A pose `x_a_b` is an [`Isometry3`](nalgebra::Isometry3), the pose of frame `b` in frame `a`.
//! Twists and wrenches are written in their own frame unless the name says otherwise. Six-vectors
//! appear only as [`components`](Wrench::components), linear part first, as in the paper.

mod jacobian;
mod motion;
pub mod rotation;
mod twist;
mod wrench;

pub use jacobian::Jacobian;
pub use motion::{CommandMode, Motion};
pub use twist::Twist;
pub use wrench::Wrench;
