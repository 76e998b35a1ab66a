//! What contact was like: whether the hand was shaken, and whether it got more energy than it gave.
//!
//! From the records alone, and whether or not the controller watches the same.

use serde::Serialize;

use controller::JointVector;
use node::record::Record;
use units::spatial::Wrench;

/// Below this the hand stands still, in m/s: no reversal.
const STILL: f64 = 5e-3;

/// Below this nothing touches, in N on the object.
const TOUCHES: f64 = 0.5;

/// Counters of all contacts of a session.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Contact {
    /// How often the hand turned round along what it felt.
    pub reversals: u32,
    /// What the hand put into the reflected wrench less what it got out, over all contacts, in J.
    /// Below zero it was driven.
    pub energy_j: f64,
    /// The lowest that sum came to, in J.
    pub lowest_energy_j: f64,
    /// The fastest the grip moved in contact, in m/s.
    pub peak_speed_m_per_s: f64,
    #[serde(skip)]
    way: f64,
    #[serde(skip)]
    q_before: Option<JointVector>,
    #[serde(skip)]
    held: [JointVector; 2],
}

impl Contact {
    /// Takes the next record.
    pub fn add(&mut self, record: &Record) {
        let output = &record.output;
        let q_before = self.q_before.replace(output.q).unwrap_or(output.q);
        let [last, acted] = self.held; // a target acts from the SYNC after the one it answers
        let ledger = &output.ledger;
        let let_through = ledger.rest_scale * ledger.share;
        self.held = [(ledger.task + ledger.passivity) * let_through, last];
        if record.f_s.force.norm() < TOUCHES {
            self.way = 0.0;
            return;
        }
        self.energy_j -= acted.dot(&(output.q - q_before));
        self.lowest_energy_j = self.lowest_energy_j.min(self.energy_j);
        let v_g = &output.moving.v_g_raw.linear;
        self.peak_speed_m_per_s = self.peak_speed_m_per_s.max(v_g.norm());
        self.turn(v_g.dot(&direction(&output.f_g_task)));
    }

    /// The hand moves along what it feels with `speed`.
    fn turn(&mut self, speed: f64) {
        if speed.abs() > STILL {
            self.reversals += u32::from(self.way * speed < 0.0);
            self.way = speed;
        }
    }
}

/// Which way a wrench pushes; none where it does not.
fn direction(f_g: &Wrench) -> nalgebra::Vector3<f64> {
    f_g.force.try_normalize(1e-9).unwrap_or_default()
}
