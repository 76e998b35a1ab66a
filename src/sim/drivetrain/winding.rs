//! The temperature of a motor's winding: the square of its current heats it, the room cools it.
//!
//! ```text
//!  T dϑ/dt = room + rise (p / 1000)² - ϑ        p: torque in ‰ of rated torque
//! ```
//!
//! The thermal model of the first order that drives use as I²t. At rated torque for ever it ends a little
//! below the limit.

/// Of the air around, in °C.
pub const ROOM: f64 = 25.0;

/// What a winding bears, in °C.
pub const LIMIT: f64 = 120.0;

/// What rated torque for ever leaves of the way from the room to the limit.
const MARGIN: f64 = 0.05;

/// By how much rated torque heats it in the end, in K.
const RATED_RISE: f64 = (1.0 - MARGIN) * (LIMIT - ROOM);

/// Whether a winding of `temperature` in °C must not go on as it does.
pub fn is_overheated(temperature: f64) -> bool {
    temperature > LIMIT
}

/// One motor's winding.
#[derive(Clone, Copy, Debug)]
pub(super) struct Winding {
    /// In s.
    time_constant: f64,
    temperature: f64,
}

impl Winding {
    /// As cold as the room.
    pub(super) const fn new(time_constant: f64) -> Self {
        Self { time_constant, temperature: ROOM }
    }

    /// In °C.
    pub(super) const fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Lets `h` s pass at `per_mille` of rated torque.
    pub(super) fn advance(&mut self, h: f64, per_mille: f64) {
        let load = per_mille / 1e3;
        let end = ROOM + RATED_RISE * load * load;
        let share = -(-h / self.time_constant).exp_m1();
        self.temperature += (end - self.temperature) * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIME_CONSTANT: f64 = 30.0;

    /// After so many seconds at this torque from cold.
    fn after(seconds: u32, per_mille: f64) -> f64 {
        let mut winding = Winding::new(TIME_CONSTANT);
        for _ in 0..seconds * 10 {
            winding.advance(0.1, per_mille);
        }
        winding.temperature
    }

    #[test]
    fn rated_torque_may_last_for_ever_and_a_tenth_more_may_not() {
        assert!(!is_overheated(after(3_600, 1_000.0)) && after(3_600, 1_000.0) > LIMIT - 10.0);
        assert!(is_overheated(after(3_600, -1_100.0)));
    }

    #[test]
    fn thrice_the_torque_is_borne_for_a_while() {
        // 9 rises wanted, (120 - 25) K allowed: T ln(1 / (1 - 1 / (9 * 0.95))) = 3.73 s.
        assert!(!is_overheated(after(3, 3_000.0)) && is_overheated(after(4, 3_000.0)));
    }

    #[test]
    fn it_heats_as_the_exponential_says_whatever_the_steps() {
        let expected = ROOM + RATED_RISE * (1.0 - (-1.0_f64).exp());
        assert!((after(30, 1_000.0) - expected).abs() < 1e-9);
    }

    #[test]
    fn without_torque_it_cools_to_the_room() {
        let mut winding = Winding { temperature: LIMIT, ..Winding::new(TIME_CONSTANT) };
        winding.advance(1e4, 0.0);
        assert!((winding.temperature - ROOM).abs() < 1e-9);
    }
}
