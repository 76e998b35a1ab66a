//! Fidelity of wrench reflection: wrench at the hand against its reference, K_T times the sensed wrench, by situation.
//!
//! A simulation provides the wrench between hand and grip. On real drives it is unknown, and the wrench commanded by the
//! torques is used instead. Each sample is compared with the sensed wrench that caused it, so the delay of the drives does
//! not count as an error.
//!
//! | situation         | force on the object             | grip 0.25 s before and after |
//! |-------------------|---------------------------------|------------------------------|
//! | [`StillContact`]  | from 0.5 N, also before and after | within 2 mm                |
//! | [`MovingContact`] | from 0.5 N                      | any other                    |
//! | [`FreeMotion`]    | less                            | beyond 2 mm                  |
//! | [`FreeRest`]      | less                            | within 2 mm                  |
//!
//! [`StillContact`]: Situation::StillContact
//! [`MovingContact`]: Situation::MovingContact
//! [`FreeMotion`]: Situation::FreeMotion
//! [`FreeRest`]: Situation::FreeRest

pub mod command;
mod figures;
mod sample;
mod situation;

pub use command::CommandSampler;
pub use figures::{Figures, Report, Shares};
pub use sample::{Sample, WrenchParts, WrenchSource};
pub use situation::Situation;

use crate::fidelity::figures::ErrorSums;
use crate::fidelity::situation::Classifier;

/// Figures of a run so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Fidelity {
    judged: WrenchSource,
    classifier: Classifier,
    sums: [ErrorSums; 4],
}

impl Fidelity {
    /// Creates figures without samples.
    pub fn new(judged: WrenchSource) -> Self {
        Self { judged, classifier: Classifier::default(), sums: Default::default() }
    }

    /// Adds a sample; `None` without reflection restarts the window.
    pub fn add(&mut self, sample: Option<&Sample>) {
        let Some(sample) = sample.filter(|sample| !sample.is_saturated) else {
            self.classifier.restart();
            return;
        };
        if let Some((judged, situation)) = self.classifier.next(sample) {
            situation.entry_mut(&mut self.sums).add(&judged);
        }
    }

    /// Adds the figures of another run.
    pub fn join(&mut self, other: &Self) {
        for (sums, other) in self.sums.iter_mut().zip(&other.sums) {
            sums.join(other);
        }
    }

    /// Returns the figures of a situation; `None` without a sample.
    pub fn figures(&self, situation: Situation) -> Option<Figures> {
        situation.entry(&self.sums).figures()
    }

    /// Returns all figures; `None` without a sample.
    pub fn report(&self) -> Option<Report> {
        let report = Report {
            judged: self.judged,
            still_contact: self.figures(Situation::StillContact),
            moving_contact: self.figures(Situation::MovingContact),
            free_motion: self.figures(Situation::FreeMotion),
            free_rest: self.figures(Situation::FreeRest),
        };
        (!report.is_empty()).then_some(report)
    }
}
