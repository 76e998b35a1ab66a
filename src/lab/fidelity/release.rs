//! Release: the passivity layer must not brake a hand that only lets go.

use crate::fidelity::script::RELEASE_S;
use node::record::Record;

/// Force on the object below which the contact has ended, in N.
const CONTACT: f64 = 0.2;

/// Braking after the end of the last contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Release {
    has_ended: bool,
    peak: f64,
    braked: f64,
}

impl Release {
    /// Adds a cycle at `t` s of the script; each lasts `dt` s.
    pub fn add(&mut self, t: f64, dt: f64, record: &Record) {
        let is_contact = record.f_s.force.norm() >= CONTACT;
        self.has_ended |= t > RELEASE_S && !is_contact;
        if self.has_ended && !is_contact {
            let force = record.output.port.f_g_passivity.force.norm();
            self.peak = self.peak.max(force);
            self.braked += if force > 1.0 { dt } else { 0.0 };
        }
    }

    /// Largest braking force after the end of the contact, in N.
    pub const fn peak_n(&self) -> f64 {
        self.peak
    }

    /// Time for which more than 1 N braked, in s.
    pub const fn braked_s(&self) -> f64 {
        self.braked
    }
}
