//! Force on a hand that withdraws, from the start of the release until half a second after the contact.
//!
//! The simulated force between grip and hand along the task force is judged, without the arm's inertia and friction.
//! Return to centre, friction compensation and soft stops do not depend on the contact and are left out as well. Task,
//! passivity damper and damping K_D remain. Their sum must be within
//!
//! ```text
//!  0  ≤  force  ≤  task + K_D |v|      in contact: no force pulls the hand into the surface
//!  -K_D |v|  ≤  force                  after the contact
//! ```

use nalgebra::Vector3;
use serde::Serialize;

use telemetry::fidelity::Sample;
use units::spatial::Wrench;

/// Task force at the grip that counts as contact and defines its direction, in N.
const CONTACT: f64 = 0.06;

/// Time after the contact that is judged, in s.
const AFTER: f64 = 0.5;

/// Figures of a release; zero without contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Release {
    /// Largest force into the surface beyond the lower bound, in N.
    pub pull_n: f64,
    /// Largest force out of the surface beyond the upper bound, in N.
    pub excess_n: f64,
    /// Time during which the force was more than 0.3 N outside the bounds, in s.
    pub outside_s: f64,
    /// Largest change of the passivity damper's force in one cycle, in N.
    pub step_n: f64,
    /// Energy that the passivity damper took from the hand, in J.
    pub taken_j: f64,
    /// Duration of the judged part, in s.
    pub seconds: f64,
}

/// Evaluation of a release, sample by sample.
#[derive(Clone, Copy, Debug)]
pub struct ReleaseJudge {
    start: f64,
    damping: f64,
    figures: Release,
    before: Option<Before>,
    /// Direction of the last task force, in {G}: out of the surface.
    outwards: Option<Vector3<f64>>,
    free_since: Option<f64>,
}

/// Values of the cycle before.
#[derive(Clone, Copy, Debug)]
struct Before {
    t: f64,
    x_0: Vector3<f64>,
    damper: Wrench,
}

impl ReleaseJudge {
    /// Creates an evaluation from the time of the release in s, and the damping K_D in N·s/m.
    pub fn new(start: f64, damping: f64) -> Self {
        let figures = Release::default();
        Self { start, damping, figures, before: None, outwards: None, free_since: None }
    }

    /// Returns the figures so far.
    pub const fn figures(&self) -> Release {
        self.figures
    }

    /// Adds the sample of a cycle at `t` s; `None` interrupts the evaluation.
    pub fn add(&mut self, t: f64, sample: Option<&Sample>) {
        let Some(sample) = sample else {
            self.before = None;
            return;
        };
        let now = Before { t, x_0: sample.x_0, damper: sample.parts.passivity };
        let before = self.before.replace(now);
        let is_contact = sample.reference.force.norm() >= CONTACT;
        if is_contact {
            self.outwards = sample.reference.force.try_normalize(0.0);
            self.free_since = None;
        } else {
            self.free_since = self.free_since.or(Some(t));
        }
        let is_over = self.free_since.is_some_and(|since| t - since > AFTER);
        let (Some(before), Some(outwards)) = (before, self.outwards) else { return };
        if t < self.start || is_over {
            return;
        }
        self.judge(sample, &before, now, &outwards, is_contact);
    }

    fn judge(
        &mut self,
        sample: &Sample,
        before: &Before,
        now: Before,
        outwards: &Vector3<f64>,
        is_contact: bool,
    ) {
        let dt = now.t - before.t;
        let speed = (now.x_0 - before.x_0).norm() / dt;
        let damping = self.damping * speed;
        let force = answer(sample).force.dot(outwards);
        let task = sample.reference.force.dot(outwards);
        let least = if is_contact { 0.0 } else { -damping };
        let (pull, excess) = (least - force, force - task - damping);
        let damper = now.damper.force.dot(outwards).abs();
        let figures = &mut self.figures;
        figures.seconds += dt;
        figures.pull_n = figures.pull_n.max(pull);
        figures.excess_n = figures.excess_n.max(excess);
        figures.outside_s += if pull.max(excess) > 0.3 { dt } else { 0.0 };
        figures.step_n = figures.step_n.max((now.damper.force - before.damper.force).norm());
        figures.taken_j += damper * speed * dt;
    }
}

/// Returns the motors' reaction to the contact, at the hand: task, passivity damper and damping.
fn answer(sample: &Sample) -> Wrench {
    let parts = &sample.parts;
    let beside =
        parts.friction + parts.inertia + parts.compensation + parts.centring + parts.soft_stops;
    sample.felt + beside * -1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use telemetry::fidelity::WrenchParts;
    use units::time::Instant;

    fn along_x(force: f64) -> Wrench {
        Wrench { force: Vector3::new(force, 0.0, 0.0), ..Wrench::ZERO }
    }

    /// Returns the figures of a hand that withdraws at 0.1 m/s. A sample is the task force towards the hand, the force on
    /// the hand and that of the damper, in N.
    fn judged(samples: impl IntoIterator<Item = (f64, f64, f64)>) -> Release {
        let mut judge = ReleaseJudge::new(0.0, 8.0);
        for (cycle, (task, felt, damper)) in samples.into_iter().enumerate() {
            let t = 1e-3 * f64::from(u32::try_from(cycle).unwrap());
            let sample = Sample {
                at: Instant::ZERO,
                x_0: Vector3::new(-0.1 * t, 0.0, 0.0),
                contact_force: 0.0,
                is_saturated: false,
                reference: along_x(-task),
                felt: along_x(-felt),
                parts: WrenchParts { passivity: along_x(damper), ..WrenchParts::default() },
            };
            judge.add(t, Some(&sample));
        }
        judge.figures()
    }

    #[test]
    fn hand_that_is_pulled_into_the_wall_is_found() {
        let figures = judged([(2.0, 2.0, 0.0), (1.5, -3.2, 4.7), (1.0, 0.5, 0.5)]);
        assert!((figures.pull_n - 3.2).abs() < 1e-9, "{figures:?}");
        assert!((figures.step_n - 4.7).abs() < 1e-9);
        assert!((figures.outside_s - 1e-3).abs() < 1e-12);
        assert!((figures.taken_j - (4.7 + 0.5) * 0.1 * 1e-3).abs() < 1e-9);
    }

    #[test]
    fn task_and_damping_are_no_excess() {
        let figures = judged([(2.0, 2.0, 0.0), (2.0, 2.7, 0.0), (2.0, 3.1, 0.0)]);
        assert!((figures.excess_n - (3.1 - 2.8)).abs() < 1e-9, "{figures:?}");
    }

    #[test]
    fn drag_after_the_contact_is_no_pull_beyond_damping() {
        let figures = judged([(2.0, 2.0, 0.0), (0.0, -0.7, 0.0), (0.0, -1.0, 0.0)]);
        assert!((figures.pull_n - 0.2).abs() < 1e-9, "{figures:?}");
    }

    #[test]
    fn half_a_second_after_the_contact_nothing_is_judged() {
        let after = std::iter::repeat_n((0.0, 0.0, 0.0), 600);
        let figures = judged([(2.0, 2.0, 0.0)].into_iter().chain(after).chain([(0.0, -9.0, 9.0)]));
        assert!(figures.pull_n <= 0.0, "{figures:?}");
    }
}
