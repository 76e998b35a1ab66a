//! Samples of the commanded wrench against K_T times the sensed one, as available on real drives.

use nalgebra::Matrix6;

use crate::fidelity::sample::{Sample, WrenchParts};
use controller::interpretation::ReflectionFrame;
use controller::{JointVector, Ledger, Output, Settings};
use node::record::{Mode, Record};
use units::spatial::{Jacobian, Wrench};

/// Minimum time of uninterrupted reflection before a sample counts, in s; longer than every ramp.
const RAMPS: f64 = 1.0;

/// Maximum Frobenius norm of an inverse Jacobian in use. Far from a singularity it is about 10.
const MAX_INVERSE: f64 = 40.0;

/// Sampler of the commanded wrench from records.
#[derive(Clone, Copy, Debug)]
pub struct CommandSampler {
    settings: Settings,
    /// Consecutive cycles with reflection.
    reflected: u32,
}

impl CommandSampler {
    /// Creates a sampler for the records of a controller with these settings.
    pub const fn new(settings: &Settings) -> Self {
        Self { settings: *settings, reflected: 0 }
    }

    /// Returns the sample of a record; `None` while reflection is off or ramps, and near a singularity.
    pub fn sample(&mut self, record: &Record) -> Option<Sample> {
        let Record { output, .. } = record;
        let is_reflected = record.mode == Mode::Engaged && output.permissions.task;
        self.reflected = if is_reflected { self.reflected.saturating_add(1) } else { 0 };
        if self.reflected <= self.settings.period.cycles(RAMPS) {
            return None;
        }
        let at_grip = AtGrip::new(&output.j_g)?;
        Some(Sample {
            at: record.at,
            x_0: output.x_0_g.translation.vector,
            contact_force: record.f_s.force.norm(),
            is_saturated: output.is_saturated(),
            reference: self.reference(record),
            felt: at_grip.wrench(&(output.tau - output.ledger.gravity)),
            parts: commanded_parts(&output.ledger, &at_grip),
        })
    }

    /// Returns K_T times the sensed wrench, at {G} in {G}.
    pub fn reference(&self, record: &Record) -> Wrench {
        let Settings { reflection, interpretation, .. } = &self.settings;
        let Output { x_h_g, .. } = &record.output;
        let f_g = reflection.at_grip(&reflection.at_object(&record.f_s));
        match interpretation.task {
            ReflectionFrame::Grip => f_g,
            ReflectionFrame::Reference => f_g.turned(&x_h_g.rotation.inverse()),
        }
    }
}

/// Map from joint torques to the wrench at the grip that they balance: the inverse transposed Jacobian.
#[derive(Clone, Copy, Debug)]
pub struct AtGrip(Matrix6<f64>);

impl AtGrip {
    /// Returns the map for the Jacobian at {G}; `None` near a singularity, where it amplifies errors of the torques.
    pub fn new(j_g: &Jacobian<6>) -> Option<Self> {
        let inverse = j_g.matrix().transpose().try_inverse()?;
        (inverse.norm() <= MAX_INVERSE).then_some(Self(inverse))
    }

    /// Returns the wrench at {G} in {G} of joint torques in N·m or N.
    pub fn wrench(&self, tau: &JointVector) -> Wrench {
        Wrench::from_components((self.0 * tau).into())
    }
}

/// Returns the commanded parts of the wrench at the grip, by the ledger.
pub fn commanded_parts(ledger: &Ledger, at_grip: &AtGrip) -> WrenchParts {
    let rest = ledger.rest_scale * ledger.share;
    let assist = rest * ledger.assist_scale;
    WrenchParts {
        centring: at_grip.wrench(&(ledger.centring * assist)),
        damping: at_grip.wrench(&(ledger.damping * assist)),
        compensation: at_grip.wrench(&(ledger.friction * rest)),
        passivity: at_grip.wrench(&(ledger.passivity * rest)),
        soft_stops: at_grip.wrench(&(ledger.soft_stops * rest)),
        ..WrenchParts::default()
    }
}
