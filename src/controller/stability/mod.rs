//! The gain checker: what can be said about stability before anything moves.
//!
//! Bounds are for one axis at a time and for small motions about one posture. A gain that is unstable
//! whoever holds the grip, or that contradicts itself, is **refused**: an object that cannot settle, a
//! hand and a device that Routh's condition makes swing, a loop that would need more damping than device
//! and hand have together, a return to centre too weak to move the device. What only the device *alone*
//! could not render passively is a **warning**: the hand that holds it damps it, and the passivity layer
//! takes back what contact gives off.

pub mod bounds;
mod findings;

pub use findings::Axis;
pub use findings::Finding;
pub use findings::Loop;
pub use findings::Topic;
pub use findings::Verdict;
