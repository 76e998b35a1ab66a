//! Estimate of the environment's stiffness k_e, and the energy that its spring stores.
//!
//! In pose mode the reflected stiffness along one axis is `K_T K_P k_e`. A hand that presses stores energy in it, and gets
//! it back on release. That energy does not count as credit or debt of the port. In rate mode the depth does not depend on the
//! hand's displacement, and no energy is stored.
//!
//! The estimate is the slope of contact force over depth, by least squares over all samples of one contact (the running
//! form of Welford 1962). Force and pose belong to the same sample of the remote side, so delay has no effect. Motion
//! along the surface does not count.

use nalgebra::Vector3;

use crate::gains::Gains;
use units::spatial::Wrench;

/// Minimum force on the object that counts as contact, in N.
const MIN_FORCE: f64 = 0.5;

/// Minimum standard deviation of the depths for an estimate, in m.
const MIN_SPREAD: f64 = 50e-6;

/// Minimum number of samples for an estimate.
const MIN_SAMPLES: f64 = 5.0;

/// Plausible stiffnesses, in N/m.
const STIFFNESSES: std::ops::RangeInclusive<f64> = 100.0..=1e7;

/// Maximum stored energy of a contact, in J.
pub const MAX_STORED: f64 = 0.5;

/// Estimator of the present contact's stiffness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ContactStiffness {
    contact: Option<Regression>,
}

/// Linear regression of force over depth, from the start of the contact at `x_b_first`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Regression {
    x_b_first: Vector3<f64>,
    count: f64,
    mean: [f64; 2],
    /// Sum of squared deviations of the depth, in m².
    spread: f64,
    /// Sum of products of the deviations of depth and force, in N·m.
    product: f64,
}

impl ContactStiffness {
    /// Adds a sample: force on the object in N and its position in m, both written in its base. A small force ends the
    /// contact.
    pub(crate) fn update(&mut self, f_b: &Vector3<f64>, x_b: &Vector3<f64>) {
        let force = f_b.norm();
        if force.is_nan() || force < MIN_FORCE {
            self.contact = None;
            return;
        }
        let contact = self.contact.get_or_insert(Regression::starting_at(*x_b));
        contact.add((contact.x_b_first - x_b).dot(f_b) / force, force);
    }

    /// Returns the stiffness of the contact in N/m; `None` with too few samples or too little depth.
    pub(crate) fn value(&self) -> Option<f64> {
        let Regression { count, spread, product, .. } = self.contact?;
        let is_known = count >= MIN_SAMPLES && spread >= count * MIN_SPREAD * MIN_SPREAD;
        Some(product / spread).filter(|stiffness| is_known && STIFFNESSES.contains(stiffness))
    }

    /// Computes the energy in J that the contact stores at object force `f_m` and grip force `f_g_task`. It is
    /// `½ Σ f_g f_m / (K_P k_e)` over the translations, at most [`MAX_STORED`].
    pub(crate) fn stored(&self, f_g_task: &Wrench, f_m: &Wrench, pose_gain: &Gains) -> f64 {
        let Some(stiffness) = self.value() else { return 0.0 };
        let axes = f_g_task.force.iter().zip(f_m.force.iter()).zip(pose_gain.values());
        let energy = |((f_g, f_m), k_p): ((&f64, &f64), &f64)| {
            if *k_p > 0.0 { (f_g * f_m).abs() / (2.0 * k_p * stiffness) } else { 0.0 }
        };
        let stored: f64 = axes.map(energy).sum();
        if stored.is_finite() { stored.min(MAX_STORED) } else { 0.0 }
    }
}

impl Regression {
    const fn starting_at(x_b_first: Vector3<f64>) -> Self {
        Self { x_b_first, count: 0.0, mean: [0.0; 2], spread: 0.0, product: 0.0 }
    }

    fn add(&mut self, depth: f64, force: f64) {
        let [mean_depth, mean_force] = &mut self.mean;
        self.count += 1.0;
        let deviation = depth - *mean_depth;
        *mean_depth += deviation / self.count;
        *mean_force += (force - *mean_force) / self.count;
        self.spread += deviation * (depth - *mean_depth);
        self.product += deviation * (force - *mean_force);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn gains(value: f64) -> Gains {
        Gains::new([value; 6], "K").unwrap()
    }

    /// Presses along -x into a spring while sliding along y by `slide` m.
    fn pressed(
        stiffness: f64,
        depths: impl IntoIterator<Item = f64>,
        slide: f64,
    ) -> ContactStiffness {
        let mut contact = ContactStiffness::default();
        for (place, depth) in depths.into_iter().enumerate() {
            let y = slide * f64::from(u32::try_from(place).unwrap());
            contact
                .update(&Vector3::new(stiffness * depth, 0.0, 0.0), &Vector3::new(-depth, y, 0.0));
        }
        contact
    }

    fn depths() -> impl Iterator<Item = f64> {
        (1..=20).map(|step| 1e-3 * f64::from(step))
    }

    proptest! {
        #[test]
        fn stiffness_is_found_while_the_object_slides(
            stiffness in 600.0..1e6_f64, slide in -0.01..0.01_f64
        ) {
            let found = pressed(stiffness, depths(), slide).value().unwrap();
            prop_assert!((found / stiffness - 1.0).abs() < 1e-6, "{found} for {stiffness} N/m");
        }

        #[test]
        fn stored_energy_is_that_of_the_felt_spring(
            stiffness in 600.0..1e4_f64, k_t in 0.05..1.0_f64, k_p in 0.2..5.0_f64
        ) {
            let contact = pressed(stiffness, depths(), 0.0);
            let f_m = Wrench { force: Vector3::new(0.0, 10.0, 0.0), ..Wrench::ZERO };
            let stored = contact.stored(&(f_m * k_t), &f_m, &gains(k_p));
            // Work of the hand: 1/K_P of the object's motion against K_T times its force.
            let expected = (0.5 * (10.0 * k_t) * (10.0 / stiffness / k_p)).min(MAX_STORED);
            prop_assert!((stored - expected).abs() < 1e-9 * expected.max(1.0), "{stored} J");
        }
    }

    #[test]
    fn contact_that_was_not_moved_in_has_no_stiffness() {
        let held = pressed(2000.0, std::iter::repeat_n(5e-3, 1_000), 0.0);
        assert_eq!(held.value(), None);
        assert!(held.stored(&Wrench::ZERO, &Wrench::ZERO, &gains(1.0)).abs() <= 0.0);
        assert_eq!(ContactStiffness::default().value(), None);
    }

    #[test]
    fn contact_that_ends_is_forgotten() {
        for nothing in [0.0, 0.4, f64::NAN] {
            let mut contact = pressed(2000.0, depths(), 0.0);
            assert!(contact.value().is_some());
            contact.update(&Vector3::new(nothing, 0.0, 0.0), &Vector3::zeros());
            assert_eq!(contact.value(), None);
        }
    }

    #[test]
    fn stored_energy_is_bounded_and_finite() {
        let contact = pressed(600.0, depths(), 0.0);
        let f_m = |force| Wrench { force: Vector3::new(force, 0.0, 0.0), ..Wrench::ZERO };
        let most = contact.stored(&f_m(1e4), &f_m(1e4), &gains(1.0));
        assert!((most - MAX_STORED).abs() <= 0.0, "{most} J");
        assert!(contact.stored(&f_m(f64::NAN), &f_m(1.0), &gains(1.0)).abs() <= 0.0);
        assert!(contact.stored(&f_m(1.0), &f_m(1.0), &gains(0.0)).abs() <= 0.0);
    }
}
