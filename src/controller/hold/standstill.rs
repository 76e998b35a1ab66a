//! Joints whose positions stay the same to the last count although a hold pushes them on.
//!
//! Something rigid blocks such a joint, or its encoder is stopped, and the joint moves unseen. Neither must be pushed on, until
//! the position changes again. A hand yields by more than a count: what it holds is found by the [bound](super) of the hold.

use crate::JointVector;
use units::numbering::Joint;

/// Torque beside that share of the bound which a joint at rest may take before it moves, in described dry frictions: from one
/// direction into the other, 1.5 times as much as described, and 2.5 times that before it breaks away.
const FRICTIONS: f64 = 6.0;

/// Share of the bound of the hold, for a joint whose description has no dry friction.
const BOUND: f64 = 0.1;

/// What each joint had when its position changed last: position and set point, in rad or m, torque of the hold, in N·m or N.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standstill {
    q: JointVector,
    set_point: JointVector,
    torque: JointVector,
    /// Joints that are stopped since then.
    stopped: [bool; 6],
}

/// Joint torques in one cycle, in N·m or N.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pushed {
    /// Of the hold.
    pub torque: JointVector,
    /// Which it may have.
    pub bound: JointVector,
    /// Dry friction as described.
    pub friction: JointVector,
}

impl Standstill {
    /// Begins with these positions, set points and torques.
    pub(super) const fn new(
        q: &JointVector,
        set_point: &JointVector,
        torque: &JointVector,
    ) -> Self {
        Self { q: *q, set_point: *set_point, torque: *torque, stopped: [false; 6] }
    }

    /// Returns the torque of the hold when each joint moved last, in N·m or N.
    pub(super) const fn torque(&self) -> &JointVector {
        &self.torque
    }

    /// Returns the joints that are stopped.
    pub(super) const fn stopped(&self) -> [bool; 6] {
        self.stopped
    }

    /// Takes positions and set points of a cycle, in rad or m. A joint is stopped when, since it moved last, its set point has
    /// moved by more than `way`, or its torque has changed by more than friction takes.
    pub(super) fn update(
        &mut self,
        q: &JointVector,
        set_point: &JointVector,
        pushed: &Pushed,
        way: &JointVector,
    ) {
        let most = pushed.friction * FRICTIONS + pushed.bound * BOUND;
        for joint in Joint::ALL {
            let of = |all: &JointVector| all.get(joint.index()).copied().unwrap_or(f64::NAN);
            if (of(q) - of(&self.q)).abs() > 0.0 {
                *joint.entry_mut(&mut self.stopped) = false;
                for (last, now) in [
                    (&mut self.q, q),
                    (&mut self.set_point, set_point),
                    (&mut self.torque, &pushed.torque),
                ] {
                    last.get_mut(joint.index()).into_iter().for_each(|last| *last = of(now));
                }
            }
            let moved_on = (of(set_point) - of(&self.set_point)).abs();
            let more = (of(&pushed.torque) - of(&self.torque)).abs();
            *joint.entry_mut(&mut self.stopped) |= moved_on > of(way) || more > of(&most);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(value: f64) -> JointVector {
        JointVector::from_fn(|joint, _| if joint == 2 { value } else { 0.0 })
    }

    /// Returns the cycle in which joint 3 is stopped.
    fn stopped(
        q: impl Fn(f64) -> f64,
        set_point: impl Fn(f64) -> f64,
        torque: impl Fn(f64) -> f64,
    ) -> Option<f64> {
        let mut standstill = Standstill::new(&at(q(0.0)), &at(0.0), &at(0.0));
        let way = JointVector::repeat(0.02);
        (0..1_000).map(f64::from).find(|&cycle| {
            let pushed = Pushed {
                torque: at(torque(cycle)),
                bound: JointVector::repeat(1.0),
                friction: JointVector::repeat(0.1),
            };
            standstill.update(&at(q(cycle)), &at(set_point(cycle)), &pushed, &way);
            standstill.stopped()[2]
        })
    }

    #[test]
    fn joint_is_stopped_whose_set_point_or_torque_goes_on_alone() {
        assert_eq!(stopped(|_| 0.0, |cycle| cycle * 1e-4, |_| 0.0), Some(201.0));
        assert_eq!(stopped(|_| 0.0, |_| 0.0, |cycle| cycle * 1e-3), Some(701.0));
        assert_eq!(stopped(|_| 0.0, |_| 0.0, |cycle| cycle * -1e-3), Some(701.0));
        let once = |cycle: f64| if cycle < 100.0 { 0.0 } else { 1e-5 };
        assert_eq!(stopped(once, |_| 0.0, |cycle| cycle * 1e-3), Some(801.0), "since it moved");
        let creeps = |cycle: f64| (cycle / 100.0).floor() * 1e-5;
        assert_eq!(stopped(creeps, |cycle| cycle * 1e-4, |cycle| cycle * 1e-3), None);
        assert_eq!(stopped(|_| 0.0, |_| 0.019, |_| 0.69), None, "friction takes it");
    }
}
