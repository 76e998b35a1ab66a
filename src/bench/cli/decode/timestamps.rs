//! Detection of timestamps that go back: a concatenated log, a clock that was set, or a file in the wrong order.

use derive_more::Display;

/// Maximum number of interfaces tracked separately; further ones share the last.
const MAX_INTERFACES: usize = 32;

/// Newest timestamp of each interface, in ns. Lines of different interfaces may be slightly out of order.
#[derive(Debug, Default)]
pub(super) struct Timestamps {
    newest: Vec<(String, u64)>,
}

/// Time in ns by which a timestamp is earlier than the previous one of the same interface.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
#[display("timestamp goes back {}.{:06} s", _0 / 1_000_000_000, _0 % 1_000_000_000 / 1_000)]
pub(super) struct GoesBack(u64);

impl Timestamps {
    /// Checks the next timestamp of an interface.
    pub(super) fn on_timestamp(&mut self, interface: &str, nanos: u64) -> Option<GoesBack> {
        let is_full = self.newest.len() >= MAX_INTERFACES;
        let known = self.newest.iter().position(|(name, _)| name == interface);
        let place = known.or(is_full.then(|| self.newest.len().saturating_sub(1)));
        let Some((_, before)) = place.and_then(|place| self.newest.get_mut(place)) else {
            self.newest.push((interface.to_owned(), nanos));
            return None;
        };
        let back = before.checked_sub(nanos).filter(|back| *back > 0);
        *before = nanos;
        back.map(GoesBack)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn earlier_timestamp_of_the_same_interface_goes_back() {
        let mut stamps = Timestamps::default();
        let stamped = [("can0", 5), ("can1", 3), ("can0", 5), ("can0", 2), ("can0", 4)];
        let back = stamped.map(|(interface, nanos)| stamps.on_timestamp(interface, nanos));
        assert_eq!(back, [None, None, None, Some(GoesBack(3)), None]);
    }

    #[test]
    fn interfaces_beyond_the_maximum_share_one_entry() {
        let mut stamps = Timestamps::default();
        for number in 0..1_000 {
            stamps.on_timestamp(&format!("can{number}"), number);
        }
        assert_eq!(stamps.newest.len(), MAX_INTERFACES);
    }
}
