//! Time windows of CiA 402, such as 6068h: a condition must hold for a given time.

/// Time that a condition has held without a break, in s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ConditionTimer(f64);

impl ConditionTimer {
    /// Advances by `dt` s with the condition `is_met`; returns whether it has held for `millis` ms.
    pub(super) fn has_lasted(&mut self, dt: f64, is_met: bool, millis: u32) -> bool {
        self.0 = if is_met { self.0 + dt } else { 0.0 };
        is_met && self.0 * MILLIS >= f64::from(millis) - ROUNDING
    }
}

const MILLIS: f64 = 1e3;
/// Rounding error allowed in the sum of periods, in ms.
const ROUNDING: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interruption_restarts_the_time() {
        let mut timer = ConditionTimer::default();
        let is_met = [true, true, false, true, true, true];
        let has_lasted = is_met.map(|is_met| timer.has_lasted(1e-3, is_met, 3));
        assert_eq!(has_lasted, [false, false, false, false, false, true]);
    }

    #[test]
    fn zero_time_is_met_at_once() {
        assert!(ConditionTimer::default().has_lasted(0.0, true, 0));
        assert!(!ConditionTimer::default().has_lasted(0.0, false, 0));
    }
}
