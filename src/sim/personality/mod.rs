//! Dangerous personalities: what real drives do at their worst, one by one, for masters to be tried on.
//!
//! A [`Quirk`] says what is bad; a [`Personality`] is a set of them. What makes a bad drive of a good one
//! is in one table, `Makeup`: what its dictionary holds before it is switched on, its
//! [`Manners`](canopen::device::Manners) towards its SDO client and its master, what happens to
//! its frames on the way to its bus, and what it does before anybody has told it to. A quirk changes what
//! it names and nothing else; a drive without any is the good one, bit for bit.

mod cast;
mod makeup;
mod name;
mod quirk;
mod wire;

pub use cast::Cast;
pub use cast::UnknownJoint;
pub(super) use makeup::Makeup;
pub(super) use makeup::begin;
pub use name::UnknownQuirk;
pub use quirk::Quirk;
pub(super) use wire::Habits;
pub(super) use wire::Wire;

/// What is bad about one drive.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Personality(Vec<Quirk>);

impl Personality {
    /// With all of these. Where two of them choose the same thing, the last one counts.
    pub fn new(quirks: impl IntoIterator<Item = Quirk>) -> Self {
        Self(quirks.into_iter().collect())
    }

    /// Its quirks.
    pub fn quirks(&self) -> impl Iterator<Item = Quirk> + '_ {
        self.0.iter().copied()
    }
}

#[cfg(test)]
mod laws;
