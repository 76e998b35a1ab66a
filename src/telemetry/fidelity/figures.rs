//! Figures of each situation: RMS and maxima of the wrench at the hand, of its reference, and of the known parts.

use std::fmt;

use serde::Serialize;

use crate::fidelity::sample::{Sample, WrenchParts, WrenchSource};
use units::spatial::Wrench;

/// Figures of all situations that occurred.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Source of the wrench at the hand.
    pub judged: WrenchSource,
    /// Contact at rest.
    pub still_contact: Option<Figures>,
    /// Contact in motion.
    pub moving_contact: Option<Figures>,
    /// Motion without contact.
    pub free_motion: Option<Figures>,
    /// Rest without contact.
    pub free_rest: Option<Figures>,
}

/// Figures of one situation. Forces are magnitudes of vectors, in N.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Number of samples.
    pub samples: u64,
    /// RMS of the reference force: K_T times the sensed force.
    pub wanted_rms_n: f64,
    /// RMS of the force at the hand.
    pub felt_rms_n: f64,
    /// RMS of the force error: force at the hand minus reference.
    pub error_rms_n: f64,
    /// Maximum of the force error.
    pub error_max_n: f64,
    /// RMS of the moment error, in N·m.
    pub error_rms_nm: f64,
    /// RMS of the error along each axis of {G}, in N and N·m.
    pub error_rms_of_axes: [f64; 6],
    /// RMS of the force error without commanded assist and inertia. Friction, its compensation, and torque errors remain.
    pub beyond_assist_rms_n: f64,
    /// RMS of each known part.
    pub shares: Shares,
}

/// RMS of the force of each known part, in N.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Shares {
    /// Friction and end stops.
    pub friction_n: f64,
    /// Friction compensation.
    pub compensation_n: f64,
    /// Return to centre.
    pub centring_n: f64,
    /// Damper of the assist (Eq. 9).
    pub damping_n: f64,
    /// Damper of the passivity layer.
    pub passivity_n: f64,
    /// Inertia of the arm; zero on real drives, where it is unknown.
    pub inertia_n: f64,
}

impl Report {
    pub(super) const fn is_empty(&self) -> bool {
        self.still_contact.is_none()
            && self.moving_contact.is_none()
            && self.free_motion.is_none()
            && self.free_rest.is_none()
    }
}

impl Figures {
    /// Returns the RMS error as a share of the RMS reference force.
    pub fn relative_error(&self) -> f64 {
        self.error_rms_n / self.wanted_rms_n
    }

    /// Returns the maximum error as a share of the RMS reference force.
    pub fn relative_max(&self) -> f64 {
        self.error_max_n / self.wanted_rms_n
    }
}

/// Columns for people, behind a heading of 17 characters: a row for each situation, or that there was none.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let still = self.still_contact.as_ref().map(|still| ("still contact", still));
        let free = self.free_motion.as_ref().map(|free| ("free motion", free));
        if still.is_none() && free.is_none() {
            return f.write_str("no still contact and no free motion");
        }
        f.write_str("N off (rms)   at most   without assist and inertia   wanted")?;
        for (name, figures) in still.into_iter().chain(free) {
            let Figures { error_rms_n, error_max_n, beyond_assist_rms_n, wanted_rms_n, .. } =
                figures;
            write!(f, "\n  {name:15} {error_rms_n:11.2} {error_max_n:9.2}")?;
            write!(f, " {beyond_assist_rms_n:28.2} {wanted_rms_n:8.2}")?;
        }
        Ok(())
    }
}

/// Sums over the samples of one situation, for their root mean squares.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ErrorSums {
    samples: u64,
    count: f64,
    reference: f64,
    felt: f64,
    error: f64,
    moment: f64,
    beyond: f64,
    max: f64,
    axes: [f64; 6],
    shares: [f64; 6],
}

impl ErrorSums {
    pub(super) fn add(&mut self, sample: &Sample) {
        let Sample { reference, felt, parts, .. } = sample;
        let error = *felt + *reference * -1.0;
        let beyond = error + parts.intended() * -1.0;
        self.samples += 1;
        self.count += 1.0;
        self.reference += reference.force.norm_squared();
        self.felt += felt.force.norm_squared();
        self.error += error.force.norm_squared();
        self.moment += error.moment.norm_squared();
        self.beyond += beyond.force.norm_squared();
        self.max = self.max.max(error.force.norm());
        for (sum, part) in self.axes.iter_mut().zip(error.components()) {
            *sum += part * part;
        }
        for (sum, part) in self.shares.iter_mut().zip(all(parts)) {
            *sum += part.force.norm_squared();
        }
    }

    pub(super) fn join(&mut self, other: &Self) {
        self.samples += other.samples;
        self.count += other.count;
        self.reference += other.reference;
        self.felt += other.felt;
        self.error += other.error;
        self.moment += other.moment;
        self.beyond += other.beyond;
        self.max = self.max.max(other.max);
        for (sum, other) in self.axes.iter_mut().zip(other.axes) {
            *sum += other;
        }
        for (sum, other) in self.shares.iter_mut().zip(other.shares) {
            *sum += other;
        }
    }

    pub(super) fn figures(&self) -> Option<Figures> {
        let rms = |sum: f64| (sum / self.count).sqrt();
        let [friction_n, compensation_n, centring_n, damping_n, passivity_n, inertia_n] =
            self.shares.map(rms);
        (self.samples > 0).then(|| Figures {
            samples: self.samples,
            wanted_rms_n: rms(self.reference),
            felt_rms_n: rms(self.felt),
            error_rms_n: rms(self.error),
            error_max_n: self.max,
            error_rms_nm: rms(self.moment),
            error_rms_of_axes: self.axes.map(rms),
            beyond_assist_rms_n: rms(self.beyond),
            shares: Shares {
                friction_n,
                compensation_n,
                centring_n,
                damping_n,
                passivity_n,
                inertia_n,
            },
        })
    }
}

/// Returns the parts in the order of [`Shares`].
const fn all(parts: &WrenchParts) -> [Wrench; 6] {
    let WrenchParts { friction, compensation, centring, damping, passivity, inertia, .. } = *parts;
    [friction, compensation, centring, damping, passivity, inertia]
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use units::time::Instant;

    fn along_x(force: f64) -> Wrench {
        Wrench { force: Vector3::new(force, 0.0, 0.0), ..Wrench::ZERO }
    }

    fn sample(reference: f64, felt: f64, parts: WrenchParts) -> Sample {
        Sample {
            at: Instant::ZERO,
            x_0: Vector3::zeros(),
            contact_force: 0.0,
            is_saturated: false,
            reference: along_x(reference),
            felt: along_x(felt),
            parts,
        }
    }

    #[test]
    fn errors_are_root_mean_squares_and_maxima() {
        let mut sums = ErrorSums::default();
        sums.add(&sample(10.0, 13.0, WrenchParts::default()));
        sums.add(&sample(10.0, 6.0, WrenchParts::default()));
        let figures = sums.figures().unwrap();
        let expected = 12.5_f64.sqrt();
        assert!((figures.error_rms_n - expected).abs() < 1e-12);
        assert!((figures.relative_error() - expected / 10.0).abs() < 1e-12);
        assert!((figures.relative_max() - 0.4).abs() < 1e-12);
        assert!((figures.error_rms_of_axes[0] - expected).abs() < 1e-12);
        assert_eq!(figures.samples, 2);
    }

    #[test]
    fn assist_and_inertia_are_no_drag_but_friction_is() {
        let mut sums = ErrorSums::default();
        let parts = WrenchParts {
            friction: along_x(1.5),
            compensation: along_x(-1.0),
            damping: along_x(2.0),
            centring: along_x(0.3),
            inertia: along_x(-0.7),
            ..WrenchParts::default()
        };
        sums.add(&sample(0.0, 1.5 - 1.0 + 2.0 + 0.3 - 0.7, parts));
        let figures = sums.figures().unwrap();
        assert!((figures.beyond_assist_rms_n - 0.5).abs() < 1e-12);
        assert!((figures.shares.friction_n - 1.5).abs() < 1e-12);
        assert!((figures.shares.inertia_n - 0.7).abs() < 1e-12);
    }

    #[test]
    fn joined_runs_are_one_run() {
        let samples = [(10.0, 13.0), (5.0, 4.0), (8.0, 8.5)].map(|(reference, felt)| {
            sample(
                reference,
                felt,
                WrenchParts { friction: along_x(0.3), ..WrenchParts::default() },
            )
        });
        let (mut all, mut first, mut rest) =
            (ErrorSums::default(), ErrorSums::default(), ErrorSums::default());
        samples.iter().for_each(|sample| all.add(sample));
        first.add(&samples[0]);
        samples[1..].iter().for_each(|sample| rest.add(sample));
        first.join(&rest);
        assert_eq!(first, all);
    }

    #[test]
    fn nothing_sampled_has_no_figures() {
        assert_eq!(ErrorSums::default().figures(), None);
    }
}
