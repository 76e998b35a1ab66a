//! Which way the joints turn, and which way the grip goes: a person makes a motion that is asked for in words of the world, and
//! the positions tell whether the configuration says the same. Nothing exerts a torque.
//!
//! Each answer that contradicts the configuration is asked for once more, since a person may have taken the wrong way.

mod answer;
mod axis;
mod motion;
mod rest;

use controller::JointVector;
use controller::arm::Arm;

pub use self::answer::Answer;
pub use self::axis::Axis;
pub use self::motion::Motion;
use self::rest::Rest;

/// What follows from the positions of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The arm is at rest: the motion can be asked for.
    Ask(Motion),
    /// A motion has been made.
    Answered(Motion, Answer),
    /// The same contradiction twice: the configuration is wrong.
    Wrong(Motion, Answer),
    /// No motion is left.
    Done,
}

/// Motions that are left, and the one under way.
#[derive(Debug)]
pub struct Direction<'a> {
    arm: &'a Arm<6>,
    /// Motions that are left, the last one first.
    left: Vec<Motion>,
    rest: Rest,
    /// Positions from which the motion begins, once it has been asked for.
    from: Option<JointVector>,
    /// Contradiction of the last answer.
    doubt: Option<Answer>,
}

impl<'a> Direction<'a> {
    /// Begins with the first of these motions.
    pub fn new(arm: &'a Arm<6>, motions: impl IntoIterator<Item = Motion>) -> Self {
        let mut left: Vec<_> = motions.into_iter().collect();
        left.reverse();
        Self { arm, left, rest: Rest::new(&arm.kinds()), from: None, doubt: None }
    }

    /// Takes positions in rad or m, at a time in s.
    pub fn take(&mut self, at: f64, q: &JointVector) -> Option<Event> {
        let Some(&motion) = self.left.last() else { return Some(Event::Done) };
        if !q.iter().all(|position| position.is_finite()) {
            (self.from, self.doubt) = (None, None);
            self.rest.restart();
            return None;
        }
        let is_at_rest = self.rest.take(at, q);
        let Some(from) = self.from else {
            if !is_at_rest {
                return None;
            }
            self.from = Some(*q);
            return Some(Event::Ask(motion));
        };
        let answer = answer::of(self.arm, motion, &from, q)?;
        self.from = None;
        self.rest.restart();
        let before = self.doubt.take();
        if answer == Answer::Right {
            self.left.pop();
        } else if answer.is_contradiction() {
            if before == Some(answer) {
                return Some(Event::Wrong(motion, answer));
            }
            self.doubt = Some(answer);
        }
        Some(Event::Answered(motion, answer))
    }

    /// Returns the motions that are left, the next one first.
    pub fn left(&self) -> impl Iterator<Item = Motion> {
        self.left.iter().rev().copied()
    }
}

#[cfg(test)]
mod tests;
