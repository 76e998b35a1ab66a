//! Passivity observer and controller (PO/PC) at the reflection port, in six axes (Hannaford and Ryu 2002). The form here is
//! exact for torques held between cycles.
//!
//! The observer sums the work of the hand on the port: held torques times joint motion. The product of this cycle's
//! force and speed would attribute each sample to an earlier time, and miss the energy that a sampled wall generates.
//! A negative sum means that the port was active; the controller then dissipates the excess with the smallest damper
//! that suffices.
//!
//! Damping that the drives hold, but that no sample shows yet, counts as done. Otherwise each cycle of delay would
//! request the same energy again. The sum is capped, so that old credit does not hide new activity. The cap excludes
//! the energy in the spring of the contact ([`contact_stiffness`](crate::contact_stiffness)), which the hand stored and
//! gets back.

use thiserror::Error;

use crate::never_pulls;
use units::spatial::{Twist, Wrench};

/// Minimum speed at which a damper dissipates energy, in m/s.
const MIN_SPEED: f64 = 1e-6;

/// Minimum energy debt that is damped out of contact, in J: that of a bounce.
const BOUNCE: f64 = 5e-3;

/// Parameters of observer and controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassivitySettings {
    /// Maximum of the observed energy, in J, so that old credit does not hide new activity.
    pub max_energy: f64,
    /// Maximum damping, in N·s/m.
    pub max_damping: f64,
    /// Lever between translations and rotations, in m: rotational damping is its square times the translational one.
    pub lever: f64,
    /// Task force that counts as contact, in N.
    pub contact_threshold: f64,
    /// Maximum cycles without contact within one contact with bounces; more of them reset the observer.
    pub contact_release_cycles: u32,
    /// Contact is one-sided: the damper never reverses the task force.
    pub is_one_sided: bool,
}

/// Parameter of [`PassivitySettings`] out of range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("{quantity} of the passivity controller must be positive and at most 1e6, got {value}")]
pub struct InvalidPassivity {
    /// Name of the parameter.
    pub quantity: &'static str,
    /// Rejected value, in the unit of the parameter.
    pub value: f64,
}

/// Observer with its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passivity {
    settings: PassivitySettings,
    /// Net energy from the hand into the port, in J.
    energy: f64,
    cycles_without_contact: u32,
}

impl Passivity {
    /// Creates an observer at zero energy.
    ///
    /// # Errors
    /// Returns the first parameter that is not within 0 (excluded) and 1e6.
    pub fn new(settings: PassivitySettings) -> Result<Self, InvalidPassivity> {
        let PassivitySettings { max_energy, max_damping, lever, contact_threshold, .. } = settings;
        for (quantity, value) in [
            ("the largest energy", max_energy),
            ("the strongest damping", max_damping),
            ("the lever", lever),
            ("the contact threshold", contact_threshold),
        ] {
            if !(value > 0.0 && value <= 1e6) {
                return Err(InvalidPassivity { quantity, value });
            }
        }
        Ok(Self { settings, energy: 0.0, cycles_without_contact: 0 })
    }

    /// Maximum damping, in N·s/m.
    pub const fn max_damping(&self) -> f64 {
        self.settings.max_damping
    }

    /// Lever between translations and rotations, in m.
    pub const fn lever(&self) -> f64 {
        self.settings.lever
    }

    /// Net energy from the hand into the port, in J. Below zero the port was active.
    pub const fn energy(&self) -> f64 {
        self.energy
    }

    /// Maximum credit, in J, without the energy that the contact stores.
    pub const fn max_energy(&self) -> f64 {
        self.settings.max_energy
    }

    /// Adds a credit, in J.
    pub const fn grant(&mut self, credit: f64) {
        self.energy += credit;
    }

    /// Returns whether a contact, bounces included, is in progress.
    pub const fn is_in_contact(&self) -> bool {
        self.cycles_without_contact <= self.settings.contact_release_cycles
    }

    /// Ends the contact and clears its energy, because the hand has left the surface.
    pub const fn release(&mut self) {
        self.cycles_without_contact = u32::MAX;
        self.energy = 0.0;
    }

    /// Adds the work of the hand on the port since the last cycle, in J. `stored` is the energy in the spring of the
    /// contact, in J, by which the cap is raised.
    pub fn account(&mut self, work: f64, f_g_task: &Wrench, stored: f64) {
        let has_no_contact = f_g_task.force.norm() < self.settings.contact_threshold;
        self.cycles_without_contact =
            if has_no_contact { self.cycles_without_contact.saturating_add(1) } else { 0 };
        self.energy = if self.cycles_without_contact > self.settings.contact_release_cycles {
            0.0
        } else {
            (self.energy + work).min(self.settings.max_energy + stored.max(0.0))
        };
    }

    /// Returns the damping in N·s/m that dissipates the energy debt in the next `dt` s at the present velocity. It is
    /// `α = -(E + E_f) / (dt vᵀ W v)`; E_f = `in_flight` is the energy in J that damping in flight will dissipate.
    pub fn damping(&self, dt: f64, v_g: &Twist, in_flight: f64) -> f64 {
        let strength = self.weighted(v_g).power(v_g);
        let energy = self.energy + in_flight.max(0.0);
        if energy >= 0.0 || strength < MIN_SPEED * MIN_SPEED {
            return 0.0;
        }
        (-energy / (dt * strength)).min(self.settings.max_damping)
    }

    /// Returns the wrench of a damper of `damping` N·s/m on the hand, in {G}: `-α W v_g`. In one-sided contact its sum
    /// with the task wrench never pulls the hand into the surface.
    pub fn wrench(&self, damping: f64, v_g: &Twist, f_g_task: &Wrench) -> Wrench {
        let against = self.weighted(v_g) * -damping;
        if self.settings.is_one_sided { one_sided(&against, f_g_task) } else { against }
    }

    /// Returns whether the port is in contact, or owes more than 5 mJ after one. A hand that lets go leaves less.
    pub const fn is_engaged(&self) -> bool {
        self.cycles_without_contact == 0 || self.energy < -BOUNCE
    }

    /// Returns `W v`, with W = 1 on translations and the lever squared on rotations.
    fn weighted(&self, v_g: &Twist) -> Wrench {
        let turning = self.settings.lever * self.settings.lever;
        Wrench { force: v_g.linear, moment: v_g.angular * turning }
    }
}

/// Limits `f_g` so that it does not reverse the task force; zero without a task force.
fn one_sided(f_g: &Wrench, f_g_task: &Wrench) -> Wrench {
    let push = f_g_task.force.norm();
    if push <= 0.0 {
        return Wrench::ZERO;
    }
    never_pulls::bounded(f_g, &(f_g_task.force / push), push)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SETTINGS: PassivitySettings = PassivitySettings {
        max_energy: 0.1,
        max_damping: 1e3,
        lever: 0.1,
        contact_threshold: 0.01,
        contact_release_cycles: 3,
        is_one_sided: true,
    };

    /// Returns an observer at `energy` J.
    fn seen(energy: f64) -> Passivity {
        let mut passivity = Passivity::new(SETTINGS).unwrap();
        passivity.account(energy, &push(1.0), 0.0);
        passivity
    }

    /// Returns the wrench of the exact damper.
    fn exact(passivity: &Passivity, v_g: &Twist, f_g_task: &Wrench, in_flight: f64) -> Wrench {
        passivity.wrench(passivity.damping(1e-3, v_g, in_flight), v_g, f_g_task)
    }

    fn push(force: f64) -> Wrench {
        Wrench::from_components([force, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    fn twist() -> impl Strategy<Value = Twist> {
        prop::array::uniform6(-1.0..1.0_f64).prop_map(Twist::from_components)
    }

    proptest! {
        #[test]
        fn excess_energy_is_dissipated(energy in -1e-3..0.0_f64, v_g in twist()) {
            let both_sided = PassivitySettings { is_one_sided: false, ..SETTINGS };
            let mut passivity = Passivity::new(both_sided).unwrap();
            passivity.account(energy, &push(1.0), 0.0);
            let f_g = exact(&passivity, &v_g, &push(1.0), 0.0);
            let taken = -f_g.power(&v_g) * 1e-3;
            // Dissipates all of it, or what the maximum damping does in a cycle of 1 ms; the lever is 0.1 m.
            let strength = v_g.linear.norm_squared() + 0.01 * v_g.angular.norm_squared();
            let expected = (-energy).min(1e3 * strength * 1e-3);
            prop_assert!((taken - expected).abs() <= 1e-9 * expected, "{taken} J for {expected} J");
        }

        #[test]
        fn a_passive_port_is_left_alone(energy in 0.0..1.0_f64, v_g in twist()) {
            prop_assert!(seen(energy).damping(1e-3, &v_g, 0.0) <= 0.0);
        }

        #[test]
        fn a_contact_never_pulls(
            energy in -1.0..0.0_f64, v_g in twist(), f in prop::array::uniform6(-5.0..5.0_f64)
        ) {
            let f_g_task = Wrench::from_components(f);
            let f_g = exact(&seen(energy), &v_g, &f_g_task, 0.0) + f_g_task;
            prop_assert!(f_g.force.dot(&f_g_task.force) >= -1e-9);
        }
    }

    #[test]
    fn damping_under_way_is_not_asked_for_again() {
        let v_g = Twist::from_components([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let passivity = seen(-1e-3);
        let asked = |in_flight| {
            let f_g = exact(&passivity, &v_g, &push(1e3), in_flight);
            -f_g.power(&v_g) * 1e-3
        };
        assert!((asked(0.0) - 1e-3).abs() < 1e-12);
        assert!((asked(0.6e-3) - 0.4e-3).abs() < 1e-12);
        assert_eq!((asked(1e-3), asked(5e-3)), (0.0, 0.0));
        assert!((asked(-5e-3) - 1e-3).abs() < 1e-12, "damping never adds energy");
    }

    #[test]
    fn what_the_contact_stores_comes_back_without_a_brake() {
        let mut passivity = Passivity::new(SETTINGS).unwrap();
        // Pressing stores 0.5 J; letting go returns it, and the cap falls along.
        for _ in 0..50 {
            passivity.account(0.01, &push(10.0), 0.5);
        }
        assert!((passivity.energy() - 0.5).abs() < 1e-9);
        for step in (0..50).rev() {
            passivity.account(-0.01, &push(10.0), 0.01 * f64::from(step));
            assert!(passivity.energy() >= -1e-9, "{} J", passivity.energy());
        }
    }

    #[test]
    fn credit_is_bounded_and_ends_with_the_contact() {
        let mut passivity = seen(5.0);
        assert!((passivity.energy() - 0.1).abs() < 1e-15);
        passivity.account(-0.3, &push(1.0), 0.0);
        assert!(passivity.energy() < -0.19);
        for _ in 0..3 {
            passivity.account(0.0, &Wrench::ZERO, 0.0);
        }
        assert!(passivity.energy() < -0.19, "a bounce");
        passivity.account(0.0, &Wrench::ZERO, 0.0);
        assert!(passivity.energy() == 0.0);
    }

    #[test]
    fn invalid_parameter_is_named() {
        let wrong = PassivitySettings { lever: 0.0, ..SETTINGS };
        let error = Passivity::new(wrong).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the lever of the passivity controller must be positive and at most 1e6, got 0"
        );
        for wrong in [f64::NAN, -1.0, f64::INFINITY] {
            assert!(Passivity::new(PassivitySettings { max_energy: wrong, ..SETTINGS }).is_err());
        }
    }
}
