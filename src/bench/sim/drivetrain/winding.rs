//! Winding temperature: heated by the square of the current, cooled by the room.
//!
//! ```text
//!  T dϑ/dt = room + rise (p / 1000)² - ϑ        p: torque in ‰ of rated torque
//! ```
//!
//! First-order thermal model, as drives use for I²t. Continuous rated torque ends a little below the limit.

/// Ambient temperature, in °C.
pub const AMBIENT: f64 = 25.0;

/// Temperature limit of the winding, in °C.
pub const LIMIT: f64 = 120.0;

/// Distance to the limit at continuous rated torque, relative to the distance from ambient.
const MARGIN: f64 = 0.05;

/// Final temperature rise at rated torque, in K.
const RATED_RISE: f64 = (1.0 - MARGIN) * (LIMIT - AMBIENT);

/// Returns whether `temperature`, in °C, exceeds the limit.
pub fn is_overheated(temperature: f64) -> bool {
    temperature > LIMIT
}

/// Winding of one motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Winding {
    /// Thermal time constant, in s.
    time_constant: f64,
    temperature: f64,
}

impl Winding {
    /// Creates a winding at ambient temperature.
    pub(super) const fn new(time_constant: f64) -> Self {
        Self { time_constant, temperature: AMBIENT }
    }

    /// Returns the temperature, in °C.
    pub(super) const fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Advances by `h` s at `per_mille` of rated torque.
    pub(super) fn advance(&mut self, h: f64, per_mille: f64) {
        let load = per_mille / 1e3;
        let end = AMBIENT + RATED_RISE * load * load;
        let share = -(-h / self.time_constant).exp_m1();
        self.temperature += (end - self.temperature) * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIME_CONSTANT: f64 = 30.0;

    /// Returns the temperature after `seconds` at this torque, from ambient.
    fn after(seconds: u32, per_mille: f64) -> f64 {
        let mut winding = Winding::new(TIME_CONSTANT);
        for _ in 0..seconds * 10 {
            winding.advance(0.1, per_mille);
        }
        winding.temperature
    }

    #[test]
    fn rated_torque_is_continuous_and_110_percent_is_not() {
        assert!(!is_overheated(after(3_600, 1_000.0)) && after(3_600, 1_000.0) > LIMIT - 10.0);
        assert!(is_overheated(after(3_600, -1_100.0)));
    }

    #[test]
    fn triple_torque_is_allowed_for_3_seconds() {
        // 9 rises wanted, (120 - 25) K allowed: T ln(1 / (1 - 1 / (9 * 0.95))) = 3.73 s.
        assert!(!is_overheated(after(3, 3_000.0)) && is_overheated(after(4, 3_000.0)));
    }

    #[test]
    fn heating_is_exponential_for_any_step() {
        let expected = AMBIENT + RATED_RISE * (1.0 - (-1.0_f64).exp());
        assert!((after(30, 1_000.0) - expected).abs() < 1e-9);
    }

    #[test]
    fn zero_torque_cools_to_ambient() {
        let mut winding = Winding { temperature: LIMIT, ..Winding::new(TIME_CONSTANT) };
        winding.advance(1e4, 0.0);
        assert!((winding.temperature - AMBIENT).abs() < 1e-9);
    }
}
