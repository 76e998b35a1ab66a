//! The torque that acts in each drive, read from the drives' side of the bus.
//!
//! A synchronous RPDO acts from the next SYNC on (CiA 301, 7.2.2.3), until its drive reports its power stage off: by a
//! statusword, an emergency or a boot-up message.

use std::time::Duration;

use crate::common::log::Entry;

/// One period.
pub(crate) const CYCLE: Duration = Duration::from_millis(1);

/// The torque of one drive over time: times of its changes in ns, and new values in per mille.
#[derive(Clone, Debug, Default)]
pub(crate) struct Torque(Vec<(u64, i16)>);

/// A drive by its frames.
#[derive(Clone, Debug, Default)]
struct Drive {
    /// Last target.
    target: i16,
    /// The power stage is on.
    is_on: bool,
    acts: Torque,
}

impl Drive {
    fn act(&mut self, nanos: u64) {
        let torque = if self.is_on { self.target } else { 0 };
        if self.acts.0.last().is_none_or(|(_, last)| *last != torque) {
            self.acts.0.push((nanos, torque));
        }
    }
}

/// Returns the torque of every drive in a log.
pub(crate) fn of_all(log: &[Entry]) -> [Torque; 6] {
    let mut drives: [Drive; 6] = Default::default();
    for Entry { nanos, id, data } in log {
        match (id & 0x780, id & 0x7F) {
            (0x080, 0) => drives.iter_mut().for_each(|drive| drive.act(*nanos)),
            (0x200, first @ (1 | 4)) => {
                let three = &mut drives[usize::from(first) - 1..][..3];
                for (drive, target) in three.iter_mut().zip(data.chunks_exact(2)) {
                    drive.target = i16::from_le_bytes([target[0], target[1]]);
                }
            }
            (base @ (0x280 | 0x680 | 0x700), node @ 1..=6) => {
                let drive = &mut drives[usize::from(node) - 1];
                let is_enabled = |status: Option<&u8>| status.is_some_and(|low| low & 0x6F == 0x27);
                drive.is_on = match base {
                    0x280 => is_enabled(data.first()),
                    // The low byte follows code, register and torque.
                    0x680 => drive.is_on && is_enabled(data.get(5)),
                    _ => drive.is_on && data != &[0],
                };
                if !drive.is_on {
                    drive.act(*nanos);
                }
            }
            _ => {}
        }
    }
    drives.map(|drive| drive.acts)
}

impl Torque {
    /// Returns the torque at `nanos`.
    pub(crate) fn at(&self, nanos: u64) -> i16 {
        let before = self.0.iter().rev().find(|(at, _)| *at <= nanos);
        before.map_or(0, |(_, torque)| *torque)
    }

    /// Returns the time after `onset` from which the torque is zero for good.
    pub(crate) fn ends_after(&self, onset: u64) -> Option<Duration> {
        let &(at, last) = self.0.last()?;
        (last == 0).then(|| Duration::from_nanos(at.saturating_sub(onset)))
    }

    /// Returns the largest magnitude.
    pub(crate) fn most(&self) -> u16 {
        self.0.iter().map(|(_, torque)| torque.unsigned_abs()).max().unwrap_or(0)
    }
}
