//! Test fixture: a cycle of a session.

use node::record::Mode;
use signals::Cycle;
use units::spatial::Wrench;
use units::time::Instant;

/// Returns a cycle at time zero with every sample in time, a zero wrench, and no log or replay.
pub(crate) fn cycle(number: u64, mode: Mode) -> Cycle<'static> {
    Cycle {
        number,
        at: Instant::ZERO,
        mode,
        inputs: None,
        sampled: [true; 6],
        f_s: Wrench::default(),
        wire: None,
        record: None,
        sample_age: None,
    }
}
