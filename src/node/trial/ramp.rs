//! Torque of a drive that is tried: it rises by 5 % of the capacity a second or to its bound in four, whichever is slower, until the joint moves or the bound is reached; then
//! zero until the joint stands; then the same in the other direction.

use crate::trial::status::{Answer, End};
use config::Config;
use units::drive::{Counts, PerMille};
use units::numbering::Joint;

/// Rise of the torque, as a share of the capacity in one second.
const RISE: f64 = 0.05;

/// Least time in which the bound is reached, in s: a light joint that breaks away late would be pushed too far.
const LEAST_RISE: f64 = 4.0;

/// Motion that ends a push, in rad and m.
const MOVED: [f64; 2] = [0.3_f64.to_radians(), 0.5e-3];

/// Motion that ends the trial, in rad and m.
const TOO_FAR: [f64; 2] = [2.0_f64.to_radians(), 3.5e-3];

/// Speed that ends the trial, in rad/s and m/s.
const TOO_FAST: [f64; 2] = [0.6, 0.1];

/// Time at the bound before a joint counts as still, in s.
const AT_BOUND: f64 = 0.3;

/// Time without a motion of [`STANDING`] after which a joint stands, and the most that is waited for it, in s.
const STANDS: [f64; 2] = [0.3, 3.0];

/// Share of [`MOVED`] within which a joint stands.
const STANDING: f64 = 0.2;

/// Time constant of the speed's low pass, in s.
const SPEED_FILTER: f64 = 5e-3;

/// Settings of one joint, in counts and ‰ of rated torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    dt: f64,
    /// Capacity.
    pub(super) capacity: i16,
    moved: u32,
    too_far: u32,
    /// Counts in a second.
    too_fast: u32,
}

/// Returns the settings of each joint.
pub(super) fn settings(config: &Config) -> [Settings; 6] {
    config.joints.each_ref().map(|joint| {
        let of = |values| joint.calibration.span(joint.plant.link.kind.pick(values));
        let PerMille(capacity) = joint.calibration.max_target();
        Settings {
            dt: config.period.as_secs_f64(),
            capacity,
            // A coarse encoder: two counts are a motion, one may be noise.
            moved: of(MOVED).max(2),
            too_far: of(TOO_FAR).max(4),
            too_fast: of(TOO_FAST),
        }
    })
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// The torque rises, or is at its bound for this time, in s.
    Rising { at_bound: f64 },
    /// Zero torque for this time, of which the joint has stood for the other, in s.
    Resting { waited: f64, stood: f64, at: Counts },
}

/// Torque of a drive that is tried, cycle by cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ramp {
    joint: Joint,
    settings: [Settings; 6],
    /// Bound, in ‰ of rated torque.
    bound: i16,
    /// In ‰ of rated torque, without sign.
    torque: f64,
    phase: Phase,
    /// Positions at the start of the push.
    from: [Counts; 6],
    last: Counts,
    /// In counts a second, after the low pass.
    speed: f64,
    pub(super) answers: [Option<Answer>; 2],
}

impl Ramp {
    /// Begins at these positions, with a bound in ‰ of rated torque.
    pub(super) fn new(
        joint: Joint,
        settings: [Settings; 6],
        bound: i16,
        from: &[Counts; 6],
    ) -> Self {
        Self {
            joint,
            settings,
            bound,
            torque: 0.0,
            phase: Phase::Rising { at_bound: 0.0 },
            from: *from,
            last: *joint.entry(from),
            speed: 0.0,
            answers: [None; 2],
        }
    }

    /// Returns the same ramp from other positions.
    pub(super) fn from(mut self, from: &[Counts; 6]) -> Self {
        (self.from, self.last) = (*from, *self.joint.entry(from));
        self
    }

    /// Takes the positions of a cycle. Returns the target torque, or the end.
    pub(super) fn step(&mut self, counts: &[Counts; 6]) -> Result<PerMille, End> {
        let own = *self.joint.entry(&self.settings);
        let at = *self.joint.entry(counts);
        let by = moved(*self.joint.entry(&self.from), at);
        let rate = f64::from(moved(self.last, at)) / own.dt;
        self.speed += (rate - self.speed) * (own.dt / (SPEED_FILTER + own.dt));
        self.last = at;
        if by.unsigned_abs() > own.too_far {
            return Err(End::TooFar);
        }
        if self.speed.abs() > f64::from(own.too_fast) {
            return Err(End::TooFast);
        }
        if let Some(other) = self.other_moved(counts, by) {
            return Err(End::OtherMoved(other));
        }
        match self.phase {
            Phase::Rising { at_bound } => self.rise(at, by, at_bound),
            Phase::Resting { waited, stood, at: stood_at } => {
                return self.rest(counts, waited, stood, stood_at);
            }
        }
        Ok(self.target())
    }

    /// Returns a joint that has moved although another drive is pushed.
    fn other_moved(&self, counts: &[Counts; 6], by: i32) -> Option<Joint> {
        let own = *self.joint.entry(&self.settings);
        let has_moved =
            by.unsigned_abs() >= own.moved || !matches!(self.phase, Phase::Rising { .. });
        let others = Joint::ALL.into_iter().filter(|joint| *joint != self.joint);
        let mut moving = others.filter(|joint| {
            let settings = joint.entry(&self.settings);
            let limit = if has_moved { settings.too_far } else { settings.moved };
            moved(*joint.entry(&self.from), *joint.entry(counts)).unsigned_abs() >= limit
        });
        moving.next()
    }

    /// Raises the torque, or ends the push.
    fn rise(&mut self, at: Counts, by: i32, at_bound: f64) {
        let own = *self.joint.entry(&self.settings);
        let answer = if by.unsigned_abs() >= own.moved {
            let PerMille(torque) = self.target();
            Answer::Moved { torque, counts: by }
        } else if at_bound >= AT_BOUND {
            Answer::Still
        } else {
            let bound = f64::from(self.bound);
            let rise = (f64::from(own.capacity) * RISE).min(bound / LEAST_RISE);
            self.torque = (self.torque + rise * own.dt).min(bound);
            let at_bound = if self.torque >= bound { at_bound + own.dt } else { 0.0 };
            self.phase = Phase::Rising { at_bound };
            return;
        };
        let way = self.way();
        if let Some(entry) = self.answers.get_mut(way) {
            *entry = Some(answer);
        }
        self.torque = 0.0;
        self.phase = Phase::Resting { waited: 0.0, stood: 0.0, at };
    }

    /// Waits until the joint stands, then begins the other direction, or ends.
    fn rest(
        &mut self,
        counts: &[Counts; 6],
        waited: f64,
        stood: f64,
        stood_at: Counts,
    ) -> Result<PerMille, End> {
        let own = *self.joint.entry(&self.settings);
        let at = *self.joint.entry(counts);
        let [stands, most] = STANDS;
        let is_near = f64::from(moved(stood_at, at)).abs() <= STANDING * f64::from(own.moved);
        let stood = if is_near { stood + own.dt } else { 0.0 };
        let waited = waited + own.dt;
        if stood < stands && waited < most {
            let at = if is_near { stood_at } else { at };
            self.phase = Phase::Resting { waited, stood, at };
            return Ok(PerMille(0));
        }
        if self.answers.iter().all(Option::is_some) {
            return Err(End::Done);
        }
        self.from = *counts;
        self.phase = Phase::Rising { at_bound: 0.0 };
        Ok(PerMille(0))
    }

    /// Returns the direction that is pushed: 0 with positive torque, 1 with negative.
    fn way(&self) -> usize {
        self.answers.iter().filter(|answer| answer.is_some()).count()
    }

    fn target(&self) -> PerMille {
        let magnitude = whole(self.torque).min(self.bound);
        PerMille(if self.way() == 0 { magnitude } else { -magnitude })
    }
}

/// Motion from one position to another, modulo 2³² counts.
const fn moved(Counts(from): Counts, Counts(to): Counts) -> i32 {
    to.wrapping_sub(from)
}

#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "saturates; the torque is within 0 and its bound"
)]
fn whole(torque: f64) -> i16 {
    torque as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINT: Joint = Joint::of::<2>();

    /// A count is a hundredth of a degree, a cycle a millisecond, and the bound 100 of 1,000 ‰.
    fn ramp() -> Ramp {
        let settings =
            Settings { dt: 1e-3, capacity: 1_000, moved: 30, too_far: 200, too_fast: 3_400 };
        Ramp::new(JOINT, [settings; 6], 100, &[Counts(7); 6])
    }

    /// Runs to the end; `at` are the positions relative to the start, by the target before.
    fn run(ramp: &mut Ramp, mut at: impl FnMut(i16) -> [i32; 6]) -> (End, i16) {
        let (mut target, mut most) = (0, 0);
        for _ in 0..60_000 {
            match ramp.step(&at(target).map(|by| Counts(7 + by))) {
                Ok(PerMille(next)) => target = next,
                Err(end) => return (end, most),
            }
            most = most.max(target.abs());
        }
        panic!("no end within a minute")
    }

    /// Returns positions in which this joint is somewhere, and the others at the start.
    const fn only(by: i32) -> [i32; 6] {
        [0, by, 0, 0, 0, 0]
    }

    #[test]
    fn joint_that_stands_is_pushed_both_ways_up_to_the_bound() {
        let mut ramp = ramp();
        assert_eq!(run(&mut ramp, |_| only(0)), (End::Done, 100));
        assert_eq!(ramp.answers, [Some(Answer::Still); 2]);
    }

    #[test]
    fn torque_ends_with_the_motion_and_then_goes_the_other_way() {
        let (mut ramp, mut at) = (ramp(), 0.0_f64);
        let end = run(&mut ramp, |target| {
            let beyond = f64::from(target.abs()) - 60.0;
            if beyond > 0.0 {
                at += 0.1 * f64::from(target.signum());
            }
            only(whole(at).into())
        });
        assert_eq!(end.0, End::Done);
        assert!((61..75).contains(&end.1), "{end:?}");
        let [
            Some(Answer::Moved { torque, counts }),
            Some(Answer::Moved { torque: back, counts: by }),
        ] = ramp.answers
        else {
            panic!("{:?}", ramp.answers);
        };
        assert!(torque > 60 && back < -60, "{torque} {back}");
        assert_eq!((counts, by), (30, -30));
    }

    #[test]
    fn hazard_53_joint_that_runs_away_ends_the_trial() {
        let mut step = 0;
        let jumped = run(&mut ramp(), |target| only(if target.abs() < 20 { 0 } else { 250 }));
        assert_eq!(jumped.0, End::TooFar);
        let fast = run(&mut ramp(), |target| {
            step += i32::from(target.abs() >= 20);
            only(step * 6)
        });
        assert_eq!(fast.0, End::TooFast);
    }

    #[test]
    fn hazard_53_another_joint_that_moves_ends_the_trial() {
        let end = run(&mut ramp(), |target| {
            let mut by = only(0);
            by[4] = if target.abs() < 20 { 0 } else { 40 };
            by
        });
        assert_eq!(end, (End::OtherMoved(Joint::of::<5>()), 20));
    }
}
