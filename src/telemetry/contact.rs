//! Quality of contact: reversals of the hand, and energy balance at the grip.
//!
//! Computed from the records, independently of the controller's own monitoring.

use serde::Serialize;

use controller::JointVector;
use node::record::{Mode, Record};
use units::spatial::Wrench;

/// Speed below which the hand is at standstill, in m/s. Slower motion does not count as a reversal.
const STANDSTILL_SPEED: f64 = 5e-3;

/// Minimum force on the object that counts as contact, in N.
const CONTACT_FORCE: f64 = 0.5;

/// Counters of all contacts of a session.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Contact {
    /// Number of reversals of the hand along the reflected force.
    pub reversals: u32,
    /// Energy from the hand into the reflected wrench, over all contacts, in J; negative if the hand was driven.
    pub energy_j: f64,
    /// Minimum of that energy, in J.
    pub lowest_energy_j: f64,
    /// Maximum speed of the grip in contact, in m/s.
    pub peak_speed_m_per_s: f64,
    #[serde(skip)]
    last_speed: f64,
    #[serde(skip)]
    q_before: Option<JointVector>,
    #[serde(skip)]
    pending: [JointVector; 2],
}

impl Contact {
    /// Adds the next record.
    pub fn add(&mut self, record: &Record) {
        let output = &record.output;
        let q_before = self.q_before.replace(output.q).unwrap_or(output.q);
        let [last, acted] = self.pending; // a target acts from the SYNC after next
        let ledger = &output.ledger;
        let let_through = ledger.rest_scale * ledger.share;
        self.pending = [(ledger.task + ledger.passivity) * let_through, last];
        // Without reflection contact is not rendered, and the last wrench may be stale.
        if record.mode != Mode::Engaged || record.f_s.force.norm() < CONTACT_FORCE {
            self.last_speed = 0.0;
            return;
        }
        self.energy_j -= acted.dot(&(output.q - q_before));
        self.lowest_energy_j = self.lowest_energy_j.min(self.energy_j);
        let v_g = &output.twist.v_g_raw.linear;
        self.peak_speed_m_per_s = self.peak_speed_m_per_s.max(v_g.norm());
        self.turn(v_g.dot(&direction(&output.f_g_task)));
    }

    /// Counts a reversal by the speed of the hand along the reflected force, in m/s.
    fn turn(&mut self, speed: f64) {
        if speed.abs() > STANDSTILL_SPEED {
            self.reversals += u32::from(self.last_speed * speed < 0.0);
            self.last_speed = speed;
        }
    }
}

/// Returns the direction of a force; zero for no force.
fn direction(f_g: &Wrench) -> nalgebra::Vector3<f64> {
    f_g.force.try_normalize(1e-9).unwrap_or_default()
}
