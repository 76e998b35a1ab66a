//! What a place on a disk takes of a run; the session and the fault records are two.

use canopen::frame::Telegram;
use node::record::Record;
use units::time::Instant;

/// A place on a disk that takes entries.
pub(super) trait Kept: Send + 'static {
    /// Takes a frame that passed by.
    fn frame(&mut self, at: Instant, telegram: &Telegram);
    /// Takes a cycle.
    fn cycle(&mut self, record: &Record);
    /// Returns the next line for people: where something is kept, or what is not kept and why.
    fn news(&mut self) -> Option<String>;
}
