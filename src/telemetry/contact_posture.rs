//! Check of the arm's postures in contact against the bounds within which contact is rendered well.

use std::fmt;

use serde::Serialize;

use controller::JointVector;
use controller::contact_posture::{ContactPosture, PostureBounds};
use node::record::{Mode, Record};

/// Minimum force on the object that counts as contact, in N.
const CONTACT_FORCE: f64 = 0.5;

/// Cycles of contact per checked posture. Postures change slowly.
const CHECK_CYCLES: u32 = 20;

/// Postures outside the bounds so far.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct ContactPostures {
    /// Time of contact in postures outside the bounds, in s.
    pub poor_seconds: f64,
    /// Smallest singular value of the Jacobian in these postures, in m and rad.
    pub smallest_singular_value: Option<f64>,
    /// Largest Coulomb friction of the joints along the contact force in these postures, in N.
    pub largest_friction_n: Option<f64>,
    #[serde(skip)]
    bounds: PostureBounds,
    #[serde(skip)]
    coulomb: JointVector,
    #[serde(skip)]
    cycles: u32,
    #[serde(skip)]
    is_poor: bool,
}

impl ContactPostures {
    /// Creates a check for joints with the Coulomb friction `coulomb`, in N·m or N.
    pub fn new(bounds: PostureBounds, coulomb: JointVector) -> Self {
        Self { bounds, coulomb, ..Self::default() }
    }

    /// Adds a record; the cycle lasted `dt` s.
    pub fn add(&mut self, record: &Record, dt: f64) {
        if record.mode != Mode::Engaged || record.f_s.force.norm() < CONTACT_FORCE {
            self.cycles = 0;
            return;
        }
        if self.cycles.is_multiple_of(CHECK_CYCLES) {
            self.judge(record);
        }
        self.cycles = self.cycles.wrapping_add(1);
        self.poor_seconds += if self.is_poor { dt } else { 0.0 };
    }

    fn judge(&mut self, record: &Record) {
        let output = &record.output;
        let push = output.f_g_task.force.try_normalize(1e-9).unwrap_or_default();
        let posture = ContactPosture::new(&output.q, &output.j_g, &push, &self.coulomb);
        self.is_poor = !self.bounds.permit(&posture);
        if self.is_poor {
            let ContactPosture { sigma_min, friction_n, .. } = posture;
            let smallest = self.smallest_singular_value;
            self.smallest_singular_value =
                Some(smallest.map_or(sigma_min, |one| one.min(sigma_min)));
            let largest = self.largest_friction_n;
            self.largest_friction_n = Some(largest.map_or(friction_n, |one| one.max(friction_n)));
        }
    }
}

/// One line for people; empty while all contact was within the bounds.
impl fmt::Display for ContactPostures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Some(sigma), Some(friction)) = (self.smallest_singular_value, self.largest_friction_n)
        else {
            return Ok(());
        };
        write!(
            f,
            "{:.1} s of contact where the arm renders it badly: dry friction up to {friction:.1} N at the grip, \
             smallest singular value {sigma:.3}",
            self.poor_seconds
        )
    }
}
