//! How long something has been so: the windows in time of CiA 402.

/// How long a condition has held without a break, in s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lasting(f64);

impl Lasting {
    /// `dt` s have passed, and now it `is_so`: whether it has been for `millis` ms.
    pub(super) fn has_lasted(&mut self, dt: f64, is_so: bool, millis: u32) -> bool {
        self.0 = if is_so { self.0 + dt } else { 0.0 };
        is_so && self.0 * MILLIS >= f64::from(millis) - ROUNDING
    }
}

const MILLIS: f64 = 1e3;
/// So many ms may be lost in adding up periods.
const ROUNDING: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_interrupted_begins_anew() {
        let mut lasting = Lasting::default();
        let so = [true, true, false, true, true, true];
        let lasted = so.map(|is_so| lasting.has_lasted(1e-3, is_so, 3));
        assert_eq!(lasted, [false, false, false, false, false, true]);
    }

    #[test]
    fn no_time_to_last_is_at_once() {
        assert!(Lasting::default().has_lasted(0.0, true, 0));
        assert!(!Lasting::default().has_lasted(0.0, false, 0));
    }
}
