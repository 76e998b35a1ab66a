//! Quirks: deviations of real drives from the standards, for tests of masters.
//!
//! A [`Quirk`] is one deviation; a drive may have several ([`Quirks`]). `QuirkEffects` holds the effects: dictionary
//! values at power-up, [`Misbehaviour`](canopen_device::Misbehaviour) of the CANopen slave, delayed or dropped frames,
//! and motion before the first command. A quirk changes nothing else; a drive without quirks is a conforming one.

mod assignment;
mod effects;
mod quirk;
mod torque_filter;
mod transmit_path;
mod value;

pub use assignment::{QuirkAssignment, UnknownJoint};
pub(super) use effects::{AxisQuirks, EncoderQuirks, QuirkEffects, start_running};
pub use quirk::{Quirk, UnknownQuirk};
pub(super) use torque_filter::TorqueFilter;
pub(super) use transmit_path::{FrameQuirks, TransmitPath};

/// Quirks of one drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quirks(Vec<Quirk>);

impl Quirks {
    /// Returns the set of `quirks`. If two set the same value, the last one applies.
    pub fn new(quirks: impl IntoIterator<Item = Quirk>) -> Self {
        Self(quirks.into_iter().collect())
    }

    /// Iterates over the quirks, in their order of application.
    pub fn iter(&self) -> impl Iterator<Item = Quirk> + '_ {
        self.0.iter().copied()
    }
}

#[cfg(test)]
mod tests;
