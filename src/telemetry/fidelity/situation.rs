//! Situations with separate figures: contact or free motion, at rest or moving.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::Vector3;

use crate::fidelity::sample::Sample;

/// Time before and after a sample that decides on rest and motion. Both together exceed two periods of a tremor, which
/// does not count as motion.
const WINDOW: Duration = Duration::from_millis(250);

/// Maximum distance that a grip at rest moves within the window, in m.
const REST: f64 = 2e-3;

/// Factor that covers rounding of a sum of two distances.
const ROUNDING: f64 = 1.0 + 1e-12;

/// Minimum force on the object that counts as contact, in N.
const CONTACT: f64 = 0.5;

/// Situation of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Situation {
    /// Contact, the grip at rest.
    StillContact,
    /// Contact, the grip in motion or the contact new.
    MovingContact,
    /// No contact, the grip in motion.
    FreeMotion,
    /// No contact, the grip at rest.
    FreeRest,
}

impl Situation {
    pub(super) fn entry<T>(self, all: &[T; 4]) -> &T {
        self.entry_mut(&mut all.each_ref())
    }

    pub(super) const fn entry_mut<T>(self, all: &mut [T; 4]) -> &mut T {
        let [still_contact, moving_contact, free_motion, free_rest] = all;
        match self {
            Self::StillContact => still_contact,
            Self::MovingContact => moving_contact,
            Self::FreeMotion => free_motion,
            Self::FreeRest => free_rest,
        }
    }
}

/// Classifier of the sample between two [`WINDOW`]s of samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Classifier {
    samples: VecDeque<Sample>,
    /// Number of these without contact.
    free: usize,
    /// Position of the last classified sample, and an upper bound of its distance from the others, in m.
    reach: Option<(Vector3<f64>, f64)>,
}

impl Classifier {
    /// Drops all samples.
    pub(super) fn restart(&mut self) {
        *self = Self { samples: std::mem::take(&mut self.samples), ..Self::default() };
        self.samples.clear();
    }

    /// Takes the next sample; returns the one a window ago with its situation, once the windows are full.
    pub(super) fn next(&mut self, sample: &Sample) -> Option<(Sample, Situation)> {
        self.samples.push_back(*sample);
        self.free += usize::from(sample.contact_force < CONTACT);
        let first = self.samples.front()?.at;
        if sample.at.since(first) < WINDOW * 2 {
            return None;
        }
        let place = self.samples.partition_point(|sample| sample.at.since(first) < WINDOW);
        let judged = *self.samples.get(place)?;
        let is_still = self.is_still(judged.x_0, sample.x_0);
        let is_contact = self.free == 0;
        let oldest = self.samples.pop_front()?;
        self.free -= usize::from(oldest.contact_force < CONTACT);
        let situation = match (judged.contact_force >= CONTACT, is_still) {
            (true, true) if is_contact => Situation::StillContact,
            (true, _) => Situation::MovingContact,
            (false, true) => Situation::FreeRest,
            (false, false) => Situation::FreeMotion,
        };
        Some((judged, situation))
    }

    /// Returns whether the grip stays within [`REST`] of `judged` in both windows; `newest` is the last sample. An upper
    /// bound grows by the distance between classified samples, and all samples are compared only if it is too large.
    fn is_still(&mut self, judged: Vector3<f64>, newest: Vector3<f64>) -> bool {
        let bound = self.reach.map(|(before, reach)| {
            let grown = (reach + (judged - before).norm()) * ROUNDING;
            grown.max((newest - judged).norm())
        });
        let reach = bound.filter(|bound| *bound <= REST).or_else(|| self.farthest(judged));
        self.reach = reach.map(|reach| (judged, reach));
        reach.is_some()
    }

    /// Returns the largest distance of a sample from `judged`; `None` if one is too far for rest.
    fn farthest(&self, judged: Vector3<f64>) -> Option<f64> {
        self.samples.iter().try_fold(0.0_f64, |farthest, one| {
            let distance = (one.x_0 - judged).norm();
            (distance <= REST).then(|| farthest.max(distance))
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fidelity::sample::WrenchParts;
    use units::math;
    use units::spatial::Wrench;
    use units::time::Instant;

    fn sample(ms: u64, x: f64, contact_force: f64) -> Sample {
        Sample {
            at: Instant::from_micros(1_000 * ms),
            x_0: Vector3::new(x, 0.0, 0.0),
            contact_force,
            is_saturated: false,
            reference: Wrench::ZERO,
            felt: Wrench::ZERO,
            parts: WrenchParts::default(),
        }
    }

    /// Returns the situation after 0.6 s at this speed in m/s.
    fn after(speed: f64, contact_force: f64) -> Option<Situation> {
        let mut classifier = Classifier::default();
        let at = |ms: u64| {
            sample(ms, 1e-3 * f64::from(u32::try_from(ms).unwrap()) * speed, contact_force)
        };
        (0..600).map(|ms| classifier.next(&at(ms))).last().unwrap().map(|(_, situation)| situation)
    }

    #[test]
    fn rest_and_motion_with_and_without_contact() {
        assert_eq!(after(0.004, 3.0), Some(Situation::StillContact));
        assert_eq!(after(0.1, 3.0), Some(Situation::MovingContact));
        assert_eq!(after(0.1, 0.4), Some(Situation::FreeMotion));
        assert_eq!(after(0.004, 0.4), Some(Situation::FreeRest));
    }

    #[test]
    fn contact_is_still_after_and_before_a_window() {
        let mut classifier = Classifier::default();
        let mut found = Vec::new();
        for ms in 0..2_000_u64 {
            let force = if (500..1_500).contains(&ms) { 5.0 } else { 0.0 };
            found.extend(classifier.next(&sample(ms, 0.0, force)));
        }
        let of = |situation| {
            let of = found.iter().filter(|(_, found)| *found == situation);
            of.map(|(sample, _)| sample.at).collect::<Vec<_>>()
        };
        let still = of(Situation::StillContact);
        assert_eq!(still.first(), Some(&Instant::from_micros(750_000)));
        assert_eq!(still.last(), Some(&Instant::from_micros(1_249_000)));
        assert_eq!(of(Situation::MovingContact).len(), 500);
        assert_eq!(of(Situation::FreeRest).first(), Some(&Instant::from_micros(250_000)));
    }

    #[test]
    fn tremor_is_no_motion() {
        let mut classifier = Classifier::default();
        let place = |ms: u64| 0.5e-3 * math::sin(0.06 * f64::from(u32::try_from(ms).unwrap()));
        let last = (0..600).map(|ms| classifier.next(&sample(ms, place(ms), 5.0))).last().unwrap();
        assert_eq!(last.map(|(_, situation)| situation), Some(Situation::StillContact));
    }

    proptest! {
        #[test]
        fn rest_is_that_of_all_samples_of_both_windows(
            steps in prop::collection::vec((-1e-4..1e-4, 0.0..1.0), 700..900),
        ) {
            let (mut classifier, mut samples, mut x) = (Classifier::default(), Vec::new(), 0.0);
            for (ms, (step, force)) in (0..).zip(steps) {
                x += step;
                samples.push(sample(ms, x, if force > 0.01 { 1.0 } else { 0.0 }));
                let Some((judged, situation)) = classifier.next(samples.last().unwrap()) else { continue };
                let window = &samples[samples.len() - 501..];
                let is_still = window.iter().all(|one| (one.x_0 - judged.x_0).norm() <= REST);
                let is_contact = window.iter().all(|one| one.contact_force >= CONTACT);
                let expected = match (judged.contact_force >= CONTACT, is_still) {
                    (true, true) if is_contact => Situation::StillContact,
                    (true, _) => Situation::MovingContact,
                    (false, true) => Situation::FreeRest,
                    (false, false) => Situation::FreeMotion,
                };
                prop_assert_eq!(situation, expected, "{} ms", ms);
            }
        }
    }

    #[test]
    fn gap_begins_a_new_window() {
        let mut classifier = Classifier::default();
        (0..600).for_each(|ms| _ = classifier.next(&sample(ms, 0.0, 0.0)));
        classifier.restart();
        assert_eq!(classifier.next(&sample(601, 0.0, 0.0)), None);
    }
}
