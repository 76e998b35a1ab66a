//! Model of an operator who puts pegs into holes by sight: the desired twist of the pegs.
//!
//! The operator sees the pegs and their misalignment with a delay, and with an error that is constant in a trial. Effort
//! rises where they do not move as wanted: `e' = g (v_wanted - v_seen)`. Wrenches are no input: they act on the
//! [hand](sim::hand) that executes the task.
//!
//! ```text
//!  approach   towards the holes, slower near the plate; aligns by sight, and waits above the plate until aligned
//!  insert     along the axis of the pegs, until the insertion depth is reached
//!  back off   after a stall: up again, and to a slightly different position
//! ```

use std::collections::VecDeque;
use std::f64::consts::TAU;

use nalgebra::Vector3;

use sim::contact::Misalignment;
use sim::random::SplitMix;
use units::spatial::Twist;

/// Speed below which the operator does not move the hand, in m/s or rad/s.
const STILL: f64 = 2e-4;

/// Time constant of the view of a speed, in s.
const SPEED_LAG: f64 = 0.1;

/// Maximum speed that is added by pressing harder, in m/s and rad/s.
const MAX_EFFORT: [f64; 2] = [0.01, 0.1];

/// Height in m below which pegs are at the plate, not above it.
const AT_PLATE: f64 = 2e-3;

/// Settings of task and sight of an operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PegOperatorSettings {
    /// Visual delay, in s.
    pub visual_delay: f64,
    /// Visual error across the axis of the holes, in m: its direction is random, and constant in a trial.
    pub visual_error: f64,
    /// Visual error of the orientation, in rad.
    pub visual_turn_error: f64,
    /// Position error that is not corrected, in m.
    pub tolerance: f64,
    /// Orientation error that is not corrected, in rad.
    pub turn_tolerance: f64,
    /// Speed far from the plate, in m/s.
    pub approach_speed: f64,
    /// Speed near the plate and in the holes, in m/s.
    pub insert_speed: f64,
    /// Height above the plate at which the operator slows down, in m.
    pub near: f64,
    /// Rate of correction per misalignment, in 1/s.
    pub correction: f64,
    /// Maximum speed of a correction, in m/s.
    pub max_correction: f64,
    /// Maximum rate of turn of a correction, in rad/s.
    pub max_turn: f64,
    /// Rate g at which effort rises, in 1/s.
    pub effort: f64,
    /// Minimum progress of pegs that are not stalled, in m.
    pub stall_distance: f64,
    /// Time without this progress until pegs count as stalled, in s.
    pub stall_time: f64,
    /// Distance of a retreat, in m.
    pub back_off: f64,
    /// Distance of a new attempt from the last, in m.
    pub search_step: f64,
    /// Insertion depth that completes the task, in m.
    pub insert_depth: f64,
}

/// Phase of the task.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Forward,
    /// Until the pegs are seen at this height above the plate, in m.
    BackOff(f64),
    Done,
}

/// State of one trial.
#[derive(Clone, Debug)]
pub struct PegOperator {
    settings: PegOperatorSettings,
    /// Constant visual error: in m across the axis, and in rad.
    error: [Vector3<f64>; 2],
    /// Offset of the present attempt from the seen position, in m.
    search: Vector3<f64>,
    random: SplitMix,
    /// Delay line of views, with their times.
    on_the_way: VecDeque<(f64, Misalignment)>,
    now: f64,
    phase: Phase,
    /// Last seen misalignment of the pegs.
    before: Option<Misalignment>,
    v_seen: Twist,
    /// Speed added by effort.
    pressed: Twist,
    /// Lowest height in this attempt, and its time.
    lowest: (f64, f64),
    attempts: u32,
}

impl PegOperator {
    /// Creates an operator; `seed` determines errors of sight and places of search.
    pub fn new(settings: PegOperatorSettings, seed: u64) -> Self {
        let mut random = SplitMix::new(seed);
        let across = direction(&mut random) * settings.visual_error;
        let tilt = direction(&mut random) * settings.visual_turn_error;
        let about = settings.visual_turn_error * (2.0 * random.unit() - 1.0);
        Self {
            settings,
            error: [across, tilt + Vector3::z() * about],
            search: Vector3::zeros(),
            random,
            on_the_way: VecDeque::with_capacity(1_024),
            now: 0.0,
            phase: Phase::Forward,
            before: None,
            v_seen: Twist::ZERO,
            pressed: Twist::ZERO,
            lowest: (f64::INFINITY, 0.0),
            attempts: 1,
        }
    }

    /// Returns the number of attempts, the present one included.
    pub const fn attempts(&self) -> u32 {
        self.attempts
    }

    /// Returns whether the operator has seen the pegs at the insertion depth.
    pub fn is_done(&self) -> bool {
        self.phase == Phase::Done
    }

    /// Takes the present misalignment, `dt` s after the last call; returns the desired twist of {E}, along the axes of {P}.
    pub fn step(&mut self, dt: f64, pegs: &Misalignment) -> Twist {
        self.now += dt;
        let Some(seen) = self.seen(pegs) else { return Twist::ZERO };
        let height = seen.offset.z;
        self.decide(height);
        if self.phase == Phase::Done {
            return Twist::ZERO;
        }
        let [across, turned] = self.error;
        let offset = Vector3::new(seen.offset.x, seen.offset.y, 0.0) + across + self.search;
        let rotation = seen.rotation + turned;
        let PegOperatorSettings { tolerance, turn_tolerance, correction, .. } = self.settings;
        let lateral = beyond(&offset, tolerance) * -correction;
        let turn = beyond(&rotation, turn_tolerance) * -correction;
        let is_aligned = lateral.norm() < STILL && turn.norm() < STILL;
        let linear = lateral.cap_magnitude(self.settings.max_correction)
            - Vector3::z() * self.speed(height, is_aligned);
        let wanted = Twist { linear, angular: turn.cap_magnitude(self.settings.max_turn) };
        self.press(dt, &seen, &wanted);
        wanted + self.pressed
    }

    /// Raises effort on axes that do not move as wanted, and removes it from axes at rest.
    fn press(&mut self, dt: f64, seen: &Misalignment, wanted: &Twist) {
        let before = self.before.replace(*seen).unwrap_or(*seen);
        let v = Twist {
            linear: (seen.offset - before.offset) / dt,
            angular: (seen.rotation - before.rotation) / dt,
        };
        let part = -(-dt / SPEED_LAG).exp_m1();
        self.v_seen = self.v_seen * (1.0 - part) + v * part;
        let missing = *wanted + self.v_seen * -1.0;
        let [linear, angular] = MAX_EFFORT;
        let limits = [linear, linear, linear, angular, angular, angular];
        let mut pressed = self.pressed.components();
        let axes = pressed.iter_mut().zip(missing.components()).zip(wanted.components());
        for (((pressed, missing), wanted), limit) in axes.zip(limits) {
            let more = *pressed + self.settings.effort * missing * dt;
            // Effort stays in the wanted direction.
            let most = if wanted > STILL { limit } else { 0.0 };
            let least = if wanted < -STILL { -limit } else { 0.0 };
            *pressed = more.clamp(least, most);
        }
        self.pressed = Twist::from_components(pressed);
    }

    /// Returns the view of the present time, which the visual delay has passed.
    fn seen(&mut self, pegs: &Misalignment) -> Option<Misalignment> {
        let oldest = self.now - self.settings.visual_delay;
        if self.on_the_way.len() < self.on_the_way.capacity() {
            self.on_the_way.push_back((self.now, *pegs));
        }
        while self.on_the_way.get(1).is_some_and(|(at, _)| *at <= oldest) {
            self.on_the_way.pop_front();
        }
        let (at, seen) = self.on_the_way.front()?;
        (*at <= oldest).then_some(*seen)
    }

    fn decide(&mut self, height: f64) {
        let PegOperatorSettings { insert_depth, stall_distance, stall_time, back_off, .. } =
            self.settings;
        match self.phase {
            Phase::Done => {}
            Phase::Forward if height <= -insert_depth => self.phase = Phase::Done,
            Phase::Forward => {
                let (lowest, at) = self.lowest;
                if height < lowest - stall_distance || height > AT_PLATE {
                    self.lowest = (height, self.now);
                } else if self.now - at > stall_time {
                    self.phase = Phase::BackOff(height + back_off);
                }
            }
            Phase::BackOff(until) if height >= until => {
                let step = self.settings.search_step * self.random.unit();
                self.search = (self.search + direction(&mut self.random) * step)
                    .cap_magnitude(self.settings.search_step);
                self.phase = Phase::Forward;
                self.lowest = (height, self.now);
                self.attempts = self.attempts.saturating_add(1);
            }
            Phase::BackOff(_) => {}
        }
    }

    /// Returns the wanted speed into the holes, in m/s.
    fn speed(&self, height: f64, is_aligned: bool) -> f64 {
        let PegOperatorSettings { approach_speed, insert_speed, near, .. } = self.settings;
        match self.phase {
            Phase::BackOff(_) => -insert_speed,
            Phase::Done => 0.0,
            Phase::Forward if height > near => approach_speed,
            Phase::Forward if height > AT_PLATE && !is_aligned => 0.0,
            Phase::Forward => insert_speed,
        }
    }
}

/// Returns the part of a vector beyond a magnitude.
fn beyond(vector: &Vector3<f64>, tolerance: f64) -> Vector3<f64> {
    let size = vector.norm();
    if size > tolerance { vector * (1.0 - tolerance / size) } else { Vector3::zeros() }
}

/// Returns a random direction across z.
fn direction(random: &mut SplitMix) -> Vector3<f64> {
    let (sin, cos) = (TAU * random.unit()).sin_cos();
    Vector3::new(cos, sin, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 2e-3;

    const SETTINGS: PegOperatorSettings = PegOperatorSettings {
        visual_delay: 0.2,
        visual_error: 0.0,
        visual_turn_error: 0.0,
        tolerance: 0.3e-3,
        turn_tolerance: 5e-3,
        approach_speed: 0.015,
        insert_speed: 0.005,
        near: 0.01,
        correction: 1.0,
        max_correction: 0.01,
        max_turn: 0.1,
        effort: 0.0,
        stall_distance: 0.5e-3,
        stall_time: 0.6,
        back_off: 5e-3,
        search_step: 1e-3,
        insert_depth: 0.02,
    };

    fn at(x: f64, z: f64) -> Misalignment {
        Misalignment { offset: Vector3::new(x, 0.0, z), rotation: Vector3::zeros() }
    }

    /// Moves ideal pegs for `seconds`; `floor` is the height at which they stop.
    fn played(operator: &mut PegOperator, pegs: &mut Misalignment, seconds: f64, floor: f64) {
        let mut left = seconds;
        while left > 0.0 {
            let v = operator.step(DT, pegs);
            pegs.offset += v.linear * DT;
            pegs.rotation += v.angular * DT;
            pegs.offset.z = pegs.offset.z.max(floor);
            left -= DT;
        }
    }

    #[test]
    fn free_pegs_are_aligned_and_inserted() {
        let mut operator = PegOperator::new(SETTINGS, 1);
        let mut pegs = at(0.003, 0.03);
        pegs.rotation = Vector3::new(0.02, 0.0, -0.03);
        played(&mut operator, &mut pegs, 15.0, -1.0);
        assert!(operator.is_done() && operator.attempts() == 1);
        assert!(pegs.offset.xy().norm() < 0.5e-3 && pegs.rotation.norm() < 0.01, "{pegs:?}");
    }

    #[test]
    fn sight_is_late() {
        let mut operator = PegOperator::new(SETTINGS, 1);
        let pegs = at(0.0, 0.03);
        let first = (0..1_000).position(|_| operator.step(DT, &pegs) != Twist::ZERO);
        assert!((99..=102).contains(&first.unwrap()), "{first:?}");
    }

    #[test]
    fn blocked_pegs_are_withdrawn_and_tried_beside() {
        let mut operator = PegOperator::new(SETTINGS, 3);
        let mut pegs = at(0.0, 0.005);
        played(&mut operator, &mut pegs, 8.0, 0.0);
        assert!(operator.attempts() > 1 && !operator.is_done());
        assert!(operator.search.norm() > 0.0 && operator.search.norm() <= 1e-3);
    }

    #[test]
    fn pegs_that_do_not_move_are_pressed_harder() {
        let mut operator = PegOperator::new(PegOperatorSettings { effort: 1.0, ..SETTINGS }, 3);
        let pegs = at(0.0, 0.03);
        let first = (0..150).map(|_| operator.step(DT, &pegs)).last().unwrap();
        let later = (0..250).map(|_| operator.step(DT, &pegs)).last().unwrap();
        assert!(later.linear.z < first.linear.z - 0.005 && later.linear.z > -0.0251);
    }

    #[test]
    fn error_of_sight_misplaces_by_its_size() {
        let settings = PegOperatorSettings { visual_error: 2e-3, tolerance: 0.0, ..SETTINGS };
        let mut operator = PegOperator::new(settings, 5);
        let mut pegs = at(0.0, 0.05);
        played(&mut operator, &mut pegs, 12.0, 0.004);
        assert!((pegs.offset.xy().norm() - 2e-3).abs() < 1e-4, "{pegs:?}");
    }
}
