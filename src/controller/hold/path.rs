//! Path of a hold: a straight line in joint space, travelled slowly, and slower before its end.
//!
//! Its parameter is a time: the path lasts `seconds` at full rate. The rate, 0 to 1, rises and falls by [`ACCELERATION`], so that
//! every joint starts and ends smoothly and all arrive at once.

use nalgebra::SVector;

/// Change of the rate, in 1/s: the speed limits are reached in half a second.
const ACCELERATION: f64 = 2.0;

/// Rate on the last part of the path.
const FINAL_RATE: f64 = 1.0 / 3.0;

/// Straight line in joint space, and the place on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Path<const N: usize> {
    from: SVector<f64, N>,
    to: SVector<f64, N>,
    /// Duration at full rate, in s.
    seconds: f64,
    /// Length of the slow part before the end, in s at full rate.
    slow: f64,
    /// Place, 0 to `seconds`.
    at: f64,
    rate: f64,
}

impl<const N: usize> Path<N> {
    /// Creates a path at whose full rate no joint is faster than its speed, in rad/s (m/s). It is slow while each joint is
    /// within its distance `slow` of the end, in rad (m).
    pub(super) fn new(
        from: SVector<f64, N>,
        to: SVector<f64, N>,
        speeds: &SVector<f64, N>,
        slow: &SVector<f64, N>,
    ) -> Self {
        let way = (to - from).abs();
        let seconds = way.component_div(speeds).max();
        let parts = way.iter().zip(slow.iter()).filter(|(way, _)| **way > 0.0);
        let slow = seconds * parts.fold(1.0, |part, (way, slow)| (slow / way).min(part));
        Self { from, to, seconds, slow, at: 0.0, rate: 0.0 }
    }

    /// Advances by `dt` s, or slows down to a stop. Returns position and rate of every joint, in rad (m) and rad/s (m/s).
    pub(super) fn advance(
        &mut self,
        dt: f64,
        may_move: bool,
    ) -> (SVector<f64, N>, SVector<f64, N>) {
        let left = self.seconds - self.at;
        let to_stop = (2.0 * ACCELERATION * left).max(0.0).sqrt();
        let to_slow = FINAL_RATE.mul_add(FINAL_RATE, 2.0 * ACCELERATION * (left - self.slow));
        let limit = if left > self.slow { to_slow.max(0.0).sqrt().min(1.0) } else { FINAL_RATE };
        let wanted = if may_move { limit.min(to_stop) } else { 0.0 };
        let step = ACCELERATION * dt;
        self.rate = if wanted < self.rate {
            // Limits fall no faster than the rate may; only a pause does.
            if may_move { wanted } else { (self.rate - step).max(0.0) }
        } else {
            (self.rate + step).min(wanted)
        };
        self.at += self.rate * dt;
        if self.seconds - self.at <= self.rate * dt {
            (self.at, self.rate) = (self.seconds, 0.0);
        }
        let per_second = if self.seconds > 0.0 { 1.0 / self.seconds } else { 0.0 };
        (self.position(), (self.to - self.from) * (self.rate * per_second))
    }

    /// Returns the position of every joint at this place, in rad (m).
    pub(super) fn position(&self) -> SVector<f64, N> {
        self.from + (self.to - self.from) * self.done()
    }

    /// Returns the sign of each joint's rate; zero while the path stands.
    pub(super) fn direction(&self) -> SVector<f64, N> {
        let is_moving = self.rate > 0.0;
        (self.to - self.from).map(|way| if is_moving && way != 0.0 { way.signum() } else { 0.0 })
    }

    /// Returns whether the path has ended.
    pub(super) fn is_at_end(&self) -> bool {
        self.at >= self.seconds
    }

    /// Returns the share of the path that is travelled, 0 to 1.
    pub(super) fn done(&self) -> f64 {
        if self.is_at_end() { 1.0 } else { self.at / self.seconds }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const DT: f64 = 1e-3;

    fn path(to: [f64; 2]) -> Path<2> {
        let [speeds, slow] = [[0.2, 0.05], [0.087, 0.01]].map(SVector::from);
        Path::new(SVector::zeros(), SVector::from(to), &speeds, &slow)
    }

    proptest! {
        #[test]
        fn path_ends_at_its_goal_within_speed_and_acceleration(
            to in prop::array::uniform2(-2.0..2.0_f64), pause in 0..4_000_u32
        ) {
            let mut path = path(to);
            let (mut q, mut qd) = (SVector::<f64, 2>::zeros(), SVector::<f64, 2>::zeros());
            for cycle in 0.. {
                prop_assert!(cycle < 400_000, "{path:?}");
                let (next, rate) = path.advance(DT, cycle / 500 != pause);
                prop_assert!(rate[0].abs() <= 0.2 + 1e-9 && rate[1].abs() <= 0.05 + 1e-9);
                prop_assert!(((next - q) / DT).amax() <= 0.2 + 0.01, "{next} after {q}");
                let by = (rate - qd) / DT;
                prop_assert!(path.is_at_end() || by[0].abs() <= 0.5, "{by} at {path:?}");
                (q, qd) = (next, rate);
                if path.is_at_end() {
                    break;
                }
            }
            prop_assert_eq!(q, SVector::from(to));
        }
    }

    #[test]
    fn last_part_is_travelled_at_a_third_of_the_speed() {
        let mut path = path([1.0, 0.0]);
        let mut fastest = 0.0_f64;
        while !path.is_at_end() {
            let (q, qd) = path.advance(DT, true);
            if 1.0 - q[0] < 0.087 - 1e-3 {
                fastest = fastest.max(qd[0]);
            }
        }
        assert!((fastest - 0.2 / 3.0).abs() < 1e-3, "{fastest}");
    }

    #[test]
    fn path_without_a_way_has_ended() {
        let path = path([0.0, 0.0]);
        assert!(path.is_at_end() && path.done() >= 1.0);
        assert_eq!(path.direction(), SVector::<f64, 2>::zeros());
        let mut path = self::path([0.5, -0.1]);
        path.advance(DT, true);
        assert_eq!(path.direction(), SVector::from([1.0, -1.0]));
        let mut path = self::path([0.0, 0.0]);
        assert_eq!(path.advance(DT, true), (SVector::zeros(), SVector::zeros()));
    }
}
