//! Stamps that go back: a log that was cut together, a clock that was set, a file in the wrong order.

use std::fmt;

/// Interfaces with a stamp of their own; further ones share the last.
const MAX_INTERFACES: usize = 32;

/// The newest stamp of each interface, in ns. Interfaces of one log may overtake each other a little.
#[derive(Debug, Default)]
pub(super) struct Stamps {
    newest: Vec<(String, u64)>,
}

/// Time in ns by which a stamp is earlier than the one before it on the same interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GoesBack(u64);

impl Stamps {
    /// Takes the next stamp of an interface.
    pub(super) fn on_stamp(&mut self, interface: &str, nanos: u64) -> Option<GoesBack> {
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

/// `stamp goes back 1.500000 s`.
impl fmt::Display for GoesBack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(nanos) = self;
        write!(
            f,
            "stamp goes back {}.{:06} s",
            nanos / 1_000_000_000,
            nanos % 1_000_000_000 / 1_000
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_earlier_stamp_of_the_same_interface_goes_back() {
        let mut stamps = Stamps::default();
        let stamped = [("can0", 5), ("can1", 3), ("can0", 5), ("can0", 2), ("can0", 4)];
        let back = stamped.map(|(interface, nanos)| stamps.on_stamp(interface, nanos));
        assert_eq!(back, [None, None, None, Some(GoesBack(3)), None]);
    }

    #[test]
    fn any_number_of_interfaces_fits() {
        let mut stamps = Stamps::default();
        for number in 0..1_000 {
            stamps.on_stamp(&format!("can{number}"), number);
        }
        assert_eq!(stamps.newest.len(), MAX_INTERFACES);
    }
}
