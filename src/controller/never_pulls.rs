//! Bound on the wrenches that resist a hand in contact: task, passivity damper and K_D together never pull it into the
//! surface.
//!
//! Along the direction of the task force:
//!
//! ```text
//!  F_T + F_P       ≥ 0                    the damper cancels the push at most
//!  F_T + F_P + F_D ≥ -slack               slack = 0 in contact, and rises by 450 N/s after it
//! ```
//!
//! For a hand that withdraws, the task wrench decays to zero and the damping of free motion returns without a step.
//! The bound on the damper remains after the contact. A hand that leaves is therefore not braked for the energy debt of a
//! bouncing contact. Beyond the range of a bounce the debt is cleared.

use nalgebra::Vector3;

use units::spatial::{Twist, Wrench};

/// Minimum task force that counts as contact, in N.
const CONTACT: f64 = 0.02;

/// Rise of the permitted damping after a contact, in N/s: the hand perceives drag and not a knock.
const RETURN: f64 = 450.0;

/// Maximum slack, in N, above any damping force.
const MAX_SLACK: f64 = 1e3;

/// Distance from the surface beyond which the hand has left it, in m; bounces on a stiff wall are shorter.
const LEFT: f64 = 0.01;

/// State of the bound.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct NeverPulls {
    contact: Option<LastContact>,
}

/// Present contact, or the most recent one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LastContact {
    /// Unit vector of the task force, in {G}: out of the surface.
    outwards: Vector3<f64>,
    /// Slack after its end, in N.
    slack: f64,
    /// Retreat from the surface after its end, in m.
    retreat: f64,
}

impl NeverPulls {
    /// Updates the contact with the task wrench and grip twist of a cycle of `dt` s.
    pub(crate) fn update(&mut self, dt: f64, f_g_task: &Wrench, v_g: &Twist) {
        let force = f_g_task.force.norm();
        self.contact = if force >= CONTACT {
            Some(LastContact { outwards: f_g_task.force / force, slack: 0.0, retreat: 0.0 })
        } else {
            self.contact.map(|LastContact { outwards, slack, retreat }| LastContact {
                outwards,
                slack: (slack + RETURN * dt).min(MAX_SLACK),
                retreat: retreat + v_g.linear.dot(&outwards) * dt,
            })
        };
    }

    /// Returns whether the hand has retreated farther than a bounce.
    pub(crate) fn has_left(&self) -> bool {
        self.contact.is_some_and(|contact| contact.retreat > LEFT)
    }

    /// Bounds the wrench of the passivity damper to the push of the task.
    pub(crate) fn bounded_damper(&self, f_g_damper: &Wrench, f_g_task: &Wrench) -> Wrench {
        self.contact.map_or(*f_g_damper, |LastContact { outwards, .. }| {
            bounded(f_g_damper, &outwards, f_g_task.force.dot(&outwards))
        })
    }

    /// Bounds the wrench of K_D to the push of `f_g_port`, the sum of task and passivity damper, plus the slack.
    pub(crate) fn bounded_damping(&self, f_g_damping: &Wrench, f_g_port: &Wrench) -> Wrench {
        self.contact.map_or(*f_g_damping, |LastContact { outwards, slack, .. }| {
            bounded(f_g_damping, &outwards, f_g_port.force.dot(&outwards) + slack)
        })
    }
}

/// Limits the force of `f_g` against the unit vector `outwards` to `push` N.
pub(crate) fn bounded(f_g: &Wrench, outwards: &Vector3<f64>, push: f64) -> Wrench {
    let too_much = (f_g.force.dot(outwards) + push.max(0.0)).min(0.0);
    Wrench { force: f_g.force - outwards * too_much, moment: f_g.moment }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn force(f: [f64; 3]) -> Wrench {
        Wrench { force: f.into(), ..Wrench::ZERO }
    }

    proptest! {
        #[test]
        fn nothing_pulls_into_the_surface(
            task in prop::array::uniform3(-5.0..5.0_f64), damper in prop::array::uniform3(-9.0..9.0_f64),
            damping in prop::array::uniform3(-9.0..9.0_f64)
        ) {
            let (task, damper, damping) = (force(task), force(damper), force(damping));
            let mut bound = NeverPulls::default();
            bound.update(1e-3, &task, &Twist::ZERO);
            let damper = bound.bounded_damper(&damper, &task);
            let damping = bound.bounded_damping(&damping, &(task + damper));
            let outwards = task.force.normalize();
            prop_assert!((task + damper).force.dot(&outwards) >= -1e-9);
            prop_assert!((task + damper + damping).force.dot(&outwards) >= -1e-9);
        }

        #[test]
        fn what_pushes_out_or_along_is_kept(along in -9.0..9.0_f64, out in 0.0..9.0_f64) {
            let mut bound = NeverPulls::default();
            bound.update(1e-3, &force([2.0, 0.0, 0.0]), &Twist::ZERO);
            let f_g = force([out, along, 0.0]);
            prop_assert_eq!(bound.bounded_damping(&f_g, &force([2.0, 0.0, 0.0])), f_g);
        }
    }

    #[test]
    fn damping_returns_after_the_contact_without_a_step() {
        let mut bound = NeverPulls::default();
        bound.update(1e-3, &force([1.0, 0.0, 0.0]), &Twist::ZERO);
        let drag = force([-3.0, 0.0, 0.0]);
        let mut before = 0.0;
        for _ in 0..10 {
            bound.update(1e-3, &Wrench::ZERO, &Twist::ZERO);
            let now = bound.bounded_damping(&drag, &Wrench::ZERO).force.x;
            assert!((now - before).abs() <= 0.45 + 1e-9, "{before} to {now} N");
            assert!(bound.bounded_damper(&drag, &Wrench::ZERO).force.x.abs() <= 0.0);
            before = now;
        }
        assert!((before + 3.0).abs() < 1e-9, "{before} N");
    }

    #[test]
    fn damper_of_a_bounce_does_not_pull_back() {
        let mut bound = NeverPulls::default();
        bound.update(1e-3, &force([1.0, 0.0, 0.0]), &Twist::ZERO);
        for _ in 0..10_000 {
            bound.update(1e-3, &Wrench::ZERO, &Twist::ZERO);
        }
        let [back, out] = [-3.0, 3.0].map(|f| force([f, 0.0, 0.0]));
        assert!(bound.bounded_damper(&back, &Wrench::ZERO).force.norm() <= 0.0);
        assert_eq!(bound.bounded_damper(&out, &Wrench::ZERO), out, "on the way to the surface");
        assert_eq!(bound.bounded_damping(&back, &Wrench::ZERO), back, "free motion is damped");
    }

    #[test]
    fn hand_beyond_a_bounce_has_left() {
        let at = |speed: f64| Twist { linear: Vector3::new(speed, 0.0, 0.0), ..Twist::ZERO };
        let mut bound = NeverPulls::default();
        bound.update(1e-3, &force([1.0, 0.0, 0.0]), &at(1.0));
        (0..9).for_each(|_| bound.update(1e-3, &Wrench::ZERO, &at(1.0)));
        assert!(!bound.has_left(), "9 mm");
        (0..2).for_each(|_| bound.update(1e-3, &Wrench::ZERO, &at(1.0)));
        assert!(bound.has_left(), "11 mm");
        bound.update(1e-3, &force([1.0, 0.0, 0.0]), &at(-1.0));
        assert!(!bound.has_left(), "in contact again");
    }
}
