//! Commanded wrench against K_T times the sensed one: all that is known on real drives.

use nalgebra::Matrix6;

use crate::fidelity::sample::{Parts, Sample};
use controller::interpretation::ReflectionFrame;
use controller::{JointVector, Ledger, Output, Settings};
use node::record::{Mode, Record};
use units::spatial::{Jacobian, Wrench};

/// Time of uninterrupted reflection before a sample counts, in s: every ramp is over.
const RAMPS: f64 = 1.0;

/// Largest Frobenius norm of an inverse Jacobian that is used: far from a singularity it is about 10.
const MAX_INVERSE: f64 = 40.0;

/// Samples from records.
#[derive(Clone, Copy, Debug)]
pub struct Commanded {
    settings: Settings,
    /// Cycles with reflection so far, without a break.
    reflected: u32,
}

impl Commanded {
    /// Creates a judge of records of a controller with these settings.
    pub const fn new(settings: &Settings) -> Self {
        Self { settings: *settings, reflected: 0 }
    }

    /// Returns the sample of a record; `None` where reflection is off, ramps, or the arm is near a singularity.
    pub fn sample(&mut self, record: &Record) -> Option<Sample> {
        let Record { output, .. } = record;
        let is_reflected = record.mode == Mode::Engaged && output.permissions.task;
        self.reflected = if is_reflected { self.reflected.saturating_add(1) } else { 0 };
        if self.reflected <= self.settings.period.cycles(RAMPS) {
            return None;
        }
        let at_grip = AtGrip::of(&output.j_g)?;
        Some(Sample {
            at: record.at,
            x_0: output.x_0_g.translation.vector,
            contact_force: record.f_s.force.norm(),
            is_saturated: output.is_saturated(),
            wanted: self.wanted(record),
            felt: at_grip.wrench(&(output.tau - output.ledger.gravity)),
            parts: commanded_parts(&output.ledger, &at_grip),
        })
    }

    /// K_T times the sensed wrench, at {G} in {G}.
    pub fn wanted(&self, record: &Record) -> Wrench {
        let Settings { reflection, interpretation, .. } = &self.settings;
        let Output { x_h_g, .. } = &record.output;
        let f_g = reflection.at_grip(&reflection.at_object(&record.f_s));
        match interpretation.task {
            ReflectionFrame::Grip => f_g,
            ReflectionFrame::Reference => f_g.turned(&x_h_g.rotation.inverse()),
        }
    }
}

/// Converts joint torques to the wrench at the grip that they balance.
#[derive(Clone, Copy, Debug)]
pub struct AtGrip(Matrix6<f64>);

impl AtGrip {
    /// From the Jacobian at {G}; `None` near a singularity, where torques say little about the wrench.
    pub fn of(j_g: &Jacobian<6>) -> Option<Self> {
        let inverse = j_g.matrix().transpose().try_inverse()?;
        (inverse.norm() <= MAX_INVERSE).then_some(Self(inverse))
    }

    /// Returns the wrench at {G} in {G} of joint torques in N·m (N).
    pub fn wrench(&self, tau: &JointVector) -> Wrench {
        Wrench::from_components((self.0 * tau).into())
    }
}

/// Returns the parts of a wrench that a ledger asks for.
pub fn commanded_parts(ledger: &Ledger, at_grip: &AtGrip) -> Parts {
    let rest = ledger.rest_scale * ledger.share;
    let assist = rest * ledger.assist_scale;
    Parts {
        centring: at_grip.wrench(&(ledger.centring * assist)),
        damping: at_grip.wrench(&(ledger.damping * assist)),
        compensation: at_grip.wrench(&(ledger.friction * rest)),
        passivity: at_grip.wrench(&(ledger.passivity * rest)),
        soft_stops: at_grip.wrench(&(ledger.soft_stops * rest)),
        ..Parts::default()
    }
}
