//! Profile generators: trajectories to a target within velocity and acceleration limits (6086h = 0, linear ramps).
//!
//! A trajectory is planned once and evaluated at any time: it does not depend on the sample time and ends exactly at its
//! target. Units: increments and s.

/// Motion demand at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Demand {
    /// Unwrapped position, in increments.
    pub(super) position: f64,
    /// Velocity, in increments/s.
    pub(super) velocity: f64,
    /// Acceleration, in increments/s².
    pub(super) acceleration: f64,
}

impl Demand {
    /// Returns a demand at rest.
    pub(super) const fn at(position: f64) -> Self {
        Self { position, velocity: 0.0, acceleration: 0.0 }
    }

    /// Returns the demand after `dt` s of constant acceleration.
    fn after(self, dt: f64, acceleration: f64) -> Self {
        Self {
            position: self.position + (self.velocity + acceleration * dt / 2.0) * dt,
            velocity: self.velocity + acceleration * dt,
            acceleration,
        }
    }

    /// Returns the demand after `dt` s on a ramp to `velocity`.
    pub(super) fn toward_velocity(self, dt: f64, velocity: f64, profile: &Profile) -> Self {
        Trajectory::to_velocity(self, velocity, profile).at(dt)
    }
}

/// Limits of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Profile {
    velocity: f64,
    acceleration: f64,
    deceleration: f64,
}

impl Profile {
    /// Creates a profile from increments/s and increments/s²; values that are not positive count as almost zero.
    pub(super) const fn new(velocity: f64, acceleration: f64, deceleration: f64) -> Self {
        Self {
            velocity: velocity.max(MIN_LIMIT),
            acceleration: acceleration.max(MIN_LIMIT),
            deceleration: deceleration.max(MIN_LIMIT),
        }
    }

    /// Returns the position at which immediate braking from `demand` ends.
    pub(super) fn rest_position(&self, demand: &Demand) -> f64 {
        demand.position + demand.velocity * demand.velocity.abs() / (2.0 * self.deceleration)
    }
}

/// Smallest limit: avoids a division by zero.
const MIN_LIMIT: f64 = 1e-9;

/// Phase of constant acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Phase {
    duration: f64,
    acceleration: f64,
}

impl Phase {
    /// Changes the velocity at `rate` increments/s².
    fn between(from: f64, to: f64, rate: f64) -> Self {
        let change = to - from;
        Self { duration: change.abs() / rate, acceleration: rate * change.signum() }
    }

    /// Keeps the velocity.
    const fn cruise(duration: f64) -> Self {
        Self { duration, acceleration: 0.0 }
    }
}

/// Piecewise trajectory from one demand to another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Trajectory {
    start: Demand,
    phases: [Phase; 4],
    end: Demand,
}

impl Trajectory {
    /// Plans the fastest trajectory to a standstill at `target` within `profile`, with at most one reversal.
    pub(super) fn to_position(start: Demand, target: f64, profile: &Profile) -> Self {
        let Profile { velocity: top, acceleration: up, deceleration: down } = *profile;
        let brake = profile.rest_position(&start) - start.position;
        let distance = target - start.position;
        // Moving away from the target, or too fast to stop before it: stop first.
        let must_turn = brake * distance < 0.0 || brake.abs() > distance.abs();
        let stop = Phase::between(start.velocity, 0.0, down);
        let (stop, distance, speed) = if must_turn {
            (stop, distance - brake, 0.0)
        } else {
            (Phase::default(), distance, start.velocity.abs())
        };
        let sign = distance.signum();
        let distance = distance.abs();
        // Peak speed: deceleration follows acceleration without a cruise phase.
        let peak = (down * (2.0 * up * distance + speed * speed) / (up + down)).sqrt();
        let fast = peak.max(speed).min(top);
        let rate = if fast < speed { down } else { up };
        let change = Phase::between(sign * speed, sign * fast, rate);
        let halt = Phase::between(sign * fast, 0.0, down);
        let ramps = (speed + fast) / 2.0 * change.duration + fast / 2.0 * halt.duration;
        let cruise = Phase::cruise((distance - ramps).max(0.0) / fast.max(MIN_LIMIT));
        Self { start, phases: [stop, change, cruise, halt], end: Demand::at(target) }
    }

    /// Plans a ramp to `velocity` within `profile`. Speed rises with the acceleration and falls with the deceleration.
    pub(super) fn to_velocity(start: Demand, velocity: f64, profile: &Profile) -> Self {
        let velocity = velocity.clamp(-profile.velocity, profile.velocity);
        let turns_round = start.velocity * velocity < 0.0;
        let is_slower = velocity.abs() < start.velocity.abs();
        let between = match (turns_round, is_slower) {
            (true, _) => 0.0,
            (false, true) => velocity,
            (false, false) => start.velocity,
        };
        let slow = Phase::between(start.velocity, between, profile.deceleration);
        let speed = Phase::between(between, velocity, profile.acceleration);
        let phases = [slow, speed, Phase::default(), Phase::default()];
        let slowed = start.after(slow.duration, slow.acceleration);
        let reached = slowed.after(speed.duration, speed.acceleration);
        Self { start, phases, end: Demand { velocity, acceleration: 0.0, ..reached } }
    }

    /// Returns the duration, in s.
    pub(super) fn duration(&self) -> f64 {
        self.phases.iter().map(|phase| phase.duration).sum()
    }

    /// Returns the demand `time` s after the start; after the end it moves on at constant velocity.
    pub(super) fn at(&self, time: f64) -> Demand {
        let (mut demand, mut left) = (self.start, time);
        for phase in &self.phases {
            if left < phase.duration {
                return demand.after(left, phase.acceleration);
            }
            demand = demand.after(phase.duration, phase.acceleration);
            left -= phase.duration;
        }
        self.end.after(left, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const DT: f64 = 1e-3;

    fn run(trajectory: &Trajectory) -> Vec<Demand> {
        let mut time = 0.0;
        let mut seen = Vec::new();
        while time < trajectory.duration() + DT {
            seen.push(trajectory.at(time));
            time += trajectory.duration().max(DT) / 1_000.0;
        }
        seen
    }

    #[test]
    fn long_motion_is_trapezoidal_and_short_one_triangular() {
        let profile = Profile::new(10.0, 5.0, 10.0);
        let long = Trajectory::to_position(Demand::at(0.0), 100.0, &profile);
        // 2 s up (10), 1 s down (5), 85 at 10/s.
        assert!((long.duration() - 11.5).abs() < 1e-9, "{}", long.duration());
        assert!((long.at(2.0).velocity - 10.0).abs() < 1e-9);
        assert!((long.at(10.5).position - 95.0).abs() < 1e-9);
        let short = Trajectory::to_position(Demand::at(0.0), -3.75, &profile);
        // To 5/s in 1 s (2.5), and down in 0.5 s (1.25).
        assert!((short.duration() - 1.5).abs() < 1e-9, "{}", short.duration());
        assert!((short.at(1.0).velocity + 5.0).abs() < 1e-9);
    }

    #[test]
    fn motion_too_fast_for_its_target_overshoots_and_returns() {
        let start = Demand { position: 0.0, velocity: 10.0, acceleration: 0.0 };
        let trajectory = Trajectory::to_position(start, 1.0, &Profile::new(10.0, 10.0, 10.0));
        let maximum = run(&trajectory).iter().map(|demand| demand.position).fold(0.0, f64::max);
        assert!((maximum - 5.0).abs() < 1e-3, "{maximum}");
        assert_eq!(trajectory.at(trajectory.duration()), Demand::at(1.0));
    }

    #[test]
    fn velocity_reversal_decelerates_then_accelerates() {
        let start = Demand { position: 0.0, velocity: 10.0, acceleration: 0.0 };
        let trajectory = Trajectory::to_velocity(start, -4.0, &Profile::new(100.0, 2.0, 5.0));
        assert!((trajectory.duration() - 4.0).abs() < 1e-9);
        assert!((trajectory.at(2.0).velocity).abs() < 1e-9);
        assert!((trajectory.at(5.0).velocity + 4.0).abs() < 1e-9);
        assert!(
            (trajectory.at(5.0).position - (10.0 - 4.0 - 4.0)).abs() < 1e-9,
            "{:?}",
            trajectory.at(5.0)
        );
    }

    proptest! {
        #[test]
        fn trajectory_ends_at_rest_at_its_target_within_limits(
            position in -1e9_f64..1e9, velocity in -1e6_f64..1e6, target in -1e9_f64..1e9,
            top in 1.0_f64..1e6, up in 1.0_f64..1e8, down in 1.0_f64..1e8,
        ) {
            let start = Demand { position, velocity, acceleration: 0.0 };
            let trajectory = Trajectory::to_position(start, target, &Profile::new(top, up, down));
            prop_assert_eq!(trajectory.at(trajectory.duration() * (1.0 + 1e-9) + DT), Demand::at(target));
            let fastest = top.max(velocity.abs());
            for demand in run(&trajectory) {
                prop_assert!(demand.velocity.abs() <= fastest * (1.0 + 1e-9), "{demand:?}");
                prop_assert!(demand.acceleration.abs() <= up.max(down));
            }
            // The phases end at the target: no jump at the end.
            let before = trajectory.at(trajectory.duration() * (1.0 - 1e-12));
            let distance = (target - position).abs() + trajectory.duration() * fastest;
            prop_assert!((before.position - target).abs() <= 1e-9 * distance + 1e-3, "{before:?}");
            let rounding = 1e-6 * fastest + 2e-12 * trajectory.duration() * down;
            prop_assert!(before.velocity.abs() <= rounding, "{before:?}");
        }

        #[test]
        fn trajectory_from_rest_never_reverses(
            target in -1e9_f64..1e9, top in 1.0_f64..1e6, up in 1.0_f64..1e8, down in 1.0_f64..1e8,
        ) {
            let trajectory = Trajectory::to_position(Demand::at(0.0), target, &Profile::new(top, up, down));
            let mut before = 0.0;
            for demand in run(&trajectory) {
                let gone = demand.position * target.signum();
                prop_assert!(gone >= before - 1e-6 && gone <= target.abs() + 1e-6);
                before = gone;
            }
        }

        #[test]
        fn velocity_steps_add_up_to_one_step(
            velocity in -1e6_f64..1e6, target in -1e6_f64..1e6, top in 1.0_f64..1e6,
            up in 1e3_f64..1e7, down in 1e3_f64..1e7,
        ) {
            let profile = Profile::new(top, up, down);
            let start = Demand { position: 0.0, velocity, acceleration: 0.0 };
            let mut demand = start;
            for _ in 0..200 {
                let next = demand.toward_velocity(DT, target, &profile);
                let change = (next.velocity - demand.velocity).abs();
                prop_assert!(change <= up.max(down) * DT * (1.0 + 1e-9));
                demand = next;
            }
            let whole = start.toward_velocity(200.0 * DT, target, &profile);
            prop_assert!((whole.velocity - demand.velocity).abs() < 1e-6 * 1e6);
            prop_assert!((whole.position - demand.position).abs() < 1e-6 * 1e6);
        }

        #[test]
        fn any_limits_give_a_finite_demand(
            position: f64, velocity in -1e12_f64..1e12, target in -1e15_f64..1e15,
            top: f64, up: f64, down: f64, time in 0.0_f64..1e6,
        ) {
            let position = if position.is_finite() { position.clamp(-1e15, 1e15) } else { 0.0 };
            let start = Demand { position, velocity, acceleration: 0.0 };
            let [top, up, down] = [top, up, down].map(|bound| bound.min(1e18));
            let demand = Trajectory::to_position(start, target, &Profile::new(top, up, down)).at(time);
            prop_assert!(!demand.position.is_nan() && !demand.velocity.is_nan());
        }
    }
}
