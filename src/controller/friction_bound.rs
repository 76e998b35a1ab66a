//! Bound on the compensated share of friction: the compensation must not move an arm that no hand holds.
//!
//! Not in the paper. Friction may be far less than identified: a warm gear, new grease, a wrong file. A share of `s` drives
//! every joint with less friction than `s f_c`. The full share therefore acts in contact or against damping only (ADR 34):
//!
//! ```text
//!  s = s_free + max(contact (s_full - s_free), part P_D / P_c)      at most s_full;  s_free = min(s_full, FREE_SHARE)
//! ```
//!
//! `contact` rises from 0 to 1 with the reflected wrench, which pushes a grip without a hand off the surface. `P_D` is the
//! power that K_D dissipates, and `P_c` the power of a share of 1. The compensation returns only a part of `P_D`, and
//! friction of `s_free f_c` dissipates the power of the free share. An arm without a hand therefore comes to rest.

use units::spatial::{Twist, Wrench};

/// Maximum compensated share in free motion, without damping. Real friction is assumed to be at least 0.3 of the
/// identified one; this share keeps a margin of a third.
pub const FREE_SHARE: f64 = 0.2;

/// Maximum part of the power of damping that the compensation returns.
const DAMPING_PART: f64 = 0.4;

/// Reflected forces at which the share starts to rise, and at which it is full, in N.
const CONTACT_N: [f64; 2] = [0.3, 1.0];

/// Minimum power of damping, as a share of the power of the compensation, at which the source of a motion is
/// observable.
const MIN_DAMPING_PART: f64 = 0.05;

/// Size of the grip, in m; converts a moment to a force.
const GRIP_SIZE: f64 = 0.1;

/// Wrench and power at the grip that bound the compensation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GripLoad {
    /// Share of contact, 0 to 1.
    contact: f64,
    /// Power that damping dissipates, in W.
    damping: f64,
    /// Power of the other wrenches on the hand, in W; positive if they drive the motion.
    driving: f64,
}

impl GripLoad {
    /// Computes the load at grip twist `v_g`, from the task wrench, the return to centre and the damping.
    pub fn new(
        v_g: &Twist,
        f_g_task: &Wrench,
        f_g_centring: &Wrench,
        f_g_damping: &Wrench,
    ) -> Self {
        let [low, high] = CONTACT_N;
        let force = f_g_task.force.norm() + f_g_task.moment.norm() / GRIP_SIZE;
        Self {
            contact: finite((force - low) / (high - low)).clamp(0.0, 1.0),
            damping: finite(-f_g_damping.power(v_g)).max(0.0),
            driving: finite(f_g_task.power(v_g) + f_g_centring.power(v_g)),
        }
    }

    /// Returns the share of contact, 0 to 1.
    pub const fn contact(&self) -> f64 {
        self.contact
    }

    /// Adds the power of other torques that drive the motion, in W.
    #[must_use]
    pub fn driven_by(self, power: f64) -> Self {
        Self { driving: self.driving + finite(power), ..self }
    }

    /// Returns the share of friction to compensate, at most `full`. `power` is the power of a share of 1, in W.
    pub fn share(&self, full: f64, power: f64) -> f64 {
        let free = full.min(FREE_SHARE);
        let returned = if power > 0.0 { DAMPING_PART * self.damping / power } else { 0.0 };
        (free + returned.max(self.contact * (full - free))).min(full)
    }

    /// Returns whether a joint's compensation of `power` W is the source of its motion, with `all` W of all joints. It then
    /// exceeds the dissipation, and other wrenches give less than half of it. Always false without damping, since a hand may
    /// move an undamped arm.
    pub fn is_driven_by_friction(&self, power: f64, all: f64) -> bool {
        let is_known = self.damping > MIN_DAMPING_PART * power.max(all);
        // A resisting task counts twice: friction dissipates at least as much. Only a hand or oscillation exceeds both.
        let taken = self.damping + 2.0 * (-self.driving).max(0.0);
        is_known && power > taken && self.driving < 0.5 * power
    }
}

/// Returns the value, or zero in place of one that is not finite.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn along_x(value: f64) -> [f64; 6] {
        [value, 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    /// Returns the load of a motion at `v` m/s, with damping `k_d` in N·s/m and task force `task` in N.
    fn load(v: f64, k_d: f64, task: f64) -> GripLoad {
        GripLoad::new(
            &Twist::from_components(along_x(v)),
            &Wrench::from_components(along_x(task)),
            &Wrench::ZERO,
            &Wrench::from_components(along_x(-k_d * v)),
        )
    }

    #[test]
    fn share_at_rest_in_contact_is_full_and_free_elsewhere() {
        for (task, share) in [(0.0, 0.2), (0.3, 0.2), (0.65, 0.425), (1.0, 0.65), (9.0, 0.65)] {
            assert!((load(0.0, 8.0, task).share(0.65, 0.0) - share).abs() < 1e-12, "{task} N");
        }
        assert!((load(0.0, 8.0, 0.0).share(0.1, 0.0) - 0.1).abs() < 1e-12, "less is asked for");
    }

    #[test]
    fn moment_counts_as_contact() {
        let f_g = Wrench::from_components([0.0, 0.0, 0.0, 0.0, 0.1, 0.0]);
        let load = GripLoad::new(&Twist::ZERO, &f_g, &Wrench::ZERO, &Wrench::ZERO);
        assert!((load.share(0.65, 0.0) - 0.65).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn arm_without_contact_loses_energy_to_little_friction(
            v in 1e-3..2.0_f64, k_d in 0.0..40.0_f64, f_c in 0.01..5.0_f64, full in 0.0..0.7_f64
        ) {
            // Friction at the grip is 0.3 of the identified one.
            let given = load(v, k_d, 0.0).share(full, f_c * v) * f_c * v;
            // A resisting task counts twice: friction dissipates at least as much. Only a hand or oscillation exceeds both.
        let taken = 0.3 * f_c * v + k_d * v * v;
            prop_assert!(given <= taken - 0.1 * f_c * v - 0.59 * k_d * v * v);
        }

        #[test]
        fn share_is_bounded_for_any_number(
            v in any::<f64>(), k_d in any::<f64>(), task in any::<f64>(), power in any::<f64>(), full in 0.0..0.7_f64
        ) {
            let share = load(v, k_d, task).share(full, power);
            prop_assert!((full.min(FREE_SHARE)..=full).contains(&share), "{share}");
        }
    }

    #[test]
    fn compensation_is_the_source_only_beyond_all_others() {
        assert!(load(0.1, 1.0, 0.0).is_driven_by_friction(0.02, 0.02));
        assert!(!load(0.1, 0.0, 0.0).is_driven_by_friction(0.02, 0.02), "nothing shows a hand");
        assert!(!load(0.1, 3.0, 0.0).is_driven_by_friction(0.02, 0.02), "damping takes more");
        assert!(!load(0.1, 1.0, 0.2).is_driven_by_friction(0.02, 0.02), "the task gives as much");
        assert!(!load(0.1, 1.0, -0.2).is_driven_by_friction(0.02, 0.02), "the task takes more");
        assert!(
            !load(0.1, 1.0, 0.0).driven_by(0.02).is_driven_by_friction(0.02, 0.02),
            "a soft stop"
        );
    }
}
