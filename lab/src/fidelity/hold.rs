//! Holds of a run: still contact after each kind of motion, measured separately.

use std::ops::Range;

use serde::Serialize;

use telemetry::fidelity::{Fidelity, Figures, Sample, Situation, WrenchSource};

/// Hold by the motion before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Hold {
    /// After the approach.
    Approach,
    /// After the slide to both sides.
    Slide,
    /// After the press.
    Press,
    /// After the half release.
    HalfRelease,
}

impl Hold {
    /// All holds, in their order.
    pub const ALL: [Self; 4] = [Self::Approach, Self::Slide, Self::Press, Self::HalfRelease];

    /// Returns the name of the hold in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Approach => "approach",
            Self::Slide => "slide",
            Self::Press => "press",
            Self::HalfRelease => "half release",
        }
    }

    /// Returns the interval of the hold in the full course, in s.
    const fn interval(self) -> Range<f64> {
        match self {
            Self::Approach => 8.5..11.0,
            Self::Slide => 13.0..14.5,
            Self::Press => 15.0..16.5,
            Self::HalfRelease => 17.0..18.5,
        }
    }
}

/// Figures of each hold.
#[derive(Clone, Debug)]
pub struct Holds {
    each: [(Hold, Fidelity); 4],
}

impl Default for Holds {
    fn default() -> Self {
        Self { each: Hold::ALL.map(|hold| (hold, Fidelity::new(WrenchSource::Hand))) }
    }
}

impl Holds {
    /// Adds the sample of a cycle at `t` s of the full course.
    pub fn add(&mut self, t: f64, sample: Option<&Sample>) {
        for (hold, fidelity) in &mut self.each {
            fidelity.add(sample.filter(|_| hold.interval().contains(&t)));
        }
    }

    /// Returns the figures of still contact of each hold; `None` where there was none.
    pub fn figures(&self) -> [(Hold, Option<Figures>); 4] {
        self.each.each_ref().map(|(hold, one)| (*hold, one.figures(Situation::StillContact)))
    }
}
