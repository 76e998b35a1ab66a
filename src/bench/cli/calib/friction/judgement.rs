//! Fitted friction of one joint, its gravity in held postures, and the reasons to reject them.

use serde::Serialize;

use crate::calib::friction::sweep::{FrictionInput, Source};
use calibration::fit::posture::{Posture, postures};
use calibration::fit::sweep::JointFriction;
use controller::arm::JointKind;

/// Error of gravity that is a warning, relative to the capacity.
const MAX_GRAVITY_ERROR: f64 = 0.05;

/// Friction and gravity of one joint, with the verdict on them.
pub(super) struct FrictionResult<'c> {
    pub(super) swept: FrictionInput<'c>,
    /// Friction, if the readings determine it.
    pub(super) friction: Option<JointFriction>,
    /// Errors of held postures that were approached from both sides.
    pub(super) gravity: Option<Gravity>,
    /// Reasons to reject the friction; empty if accepted.
    pub(super) reasons: Vec<String>,
    /// Remarks that do not affect acceptance.
    pub(super) warnings: Vec<String>,
}

/// Errors of the configured gravity in held postures.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Gravity {
    /// Number of postures.
    pub(super) postures: usize,
    /// RMS error, in N·m or N.
    pub(super) rms: f64,
    /// Largest error with its sign, in N·m or N.
    pub(super) largest: f64,
    /// Largest error as a share of the capacity.
    #[serde(rename = "largest_share_of_capacity")]
    pub(super) share: f64,
    /// Reading with the largest error.
    #[serde(flatten)]
    pub(super) at: Source,
    /// Mean friction at rest, in N·m or N.
    #[serde(rename = "friction_at_rest")]
    pub(super) friction: f64,
}

impl FrictionResult<'_> {
    pub(super) fn name(&self) -> &str {
        &self.swept.parameters.name
    }

    /// Returns the friction; `None` if rejected.
    pub(super) fn accepted(&self) -> Option<&JointFriction> {
        self.friction.as_ref().filter(|_| self.reasons.is_empty())
    }

    /// Returns the end of the calibrated range, in N·m or N.
    pub(super) fn capacity(&self) -> f64 {
        self.swept.parameters.calibration.curve().max_torque()
    }

    /// Returns the units of torque and of viscous friction.
    pub(super) const fn units(&self) -> [&'static str; 2] {
        match self.swept.parameters.plant.link.kind {
            JointKind::Revolute => ["N·m", "N·m·s/rad"],
            JointKind::Prismatic => ["N", "N·s/m"],
        }
    }

    /// Returns file, line and distance of each outlier.
    pub(super) fn outliers(&self) -> Vec<(&Source, f64)> {
        let outliers = self.friction.iter().flat_map(|friction| &friction.outliers);
        let source = |place: usize| self.swept.moving_at.get(place);
        outliers.filter_map(|outlier| Some((source(outlier.place)?, outlier.distance))).collect()
    }
}

/// Fits friction, and compares the torques of held postures with gravity.
pub(super) fn judge(swept: FrictionInput<'_>) -> FrictionResult<'_> {
    let resolution = swept.parameters.calibration.resolution();
    let fitted = JointFriction::fit(&swept.moving, resolution, swept.has_gravity);
    let found = postures(&swept.held);
    let capacity = swept.parameters.calibration.curve().max_torque();
    let gravity = Gravity::from_postures(&found, &swept.held_at, capacity);
    let (reasons, warnings) = (Vec::new(), Vec::new());
    let mut judged = FrictionResult { swept, friction: None, gravity, reasons, warnings };
    match fitted {
        Ok(friction) => judged.friction = Some(friction),
        Err(error) => judged.reasons.push(error.to_string()),
    }
    doubt_friction(&mut judged);
    doubt_gravity(&mut judged, &found);
    judged
}

fn doubt_friction(judged: &mut FrictionResult<'_>) {
    let [unit, viscous] = judged.units();
    let Some(friction) = &judged.friction else { return };
    let reasons = friction.doubts().iter().map(|doubt| doubt.reason(unit, viscous)).collect();
    let load = friction.load.value;
    let share = load.abs() / judged.capacity();
    if !judged.swept.has_gravity {
        judged.warnings.push(
            "without q1 to q6 gravity is not subtracted; a constant load is fitted, and must be one".to_owned(),
        );
    } else if share > MAX_GRAVITY_ERROR {
        judged.warnings.push(format!(
            "a constant torque of {load:+.4} {unit} is left besides gravity, {:.1} % of the capacity; check masses, \
             centres of mass and the torque curve",
            100.0 * share
        ));
    }
    judged.reasons.extend::<Vec<String>>(reasons);
}

fn doubt_gravity(judged: &mut FrictionResult<'_>, found: &[Posture]) {
    let [unit, _] = judged.units();
    for posture in found.iter().filter(|posture| posture.error.is_none()) {
        if let Some(Source { file, line }) = judged.swept.held_at.get(posture.place) {
            judged.warnings.push(format!(
                "{file}:{line}: this posture was reached from one side only; gravity is not checked there"
            ));
        }
    }
    let Some(Gravity { largest, share, at, friction, .. }) = &judged.gravity else { return };
    let Source { file, line } = at;
    if *share > MAX_GRAVITY_ERROR {
        judged.warnings.push(format!(
            "{file}:{line}: the held torque is {largest:+.4} {unit} off the configured gravity, {:.1} % of the capacity; \
             check masses and centres of mass",
            100.0 * share
        ));
    }
    if *friction < 0.0 {
        judged.reasons.push(format!(
            "held postures need more torque from above than from below, by {:.4} {unit}; exchange up and down",
            -2.0 * friction
        ));
    }
}

impl Gravity {
    /// Returns the errors of postures that were approached from both sides; `None` without such a posture.
    fn from_postures(postures: &[Posture], held_at: &[Source], capacity: f64) -> Option<Self> {
        let both = postures.iter().filter_map(|posture| {
            Some((posture.error?, posture.friction?, held_at.get(posture.place)?))
        });
        let both: Vec<(f64, f64, &Source)> = both.collect();
        let count = u32::try_from(both.len()).map_or(f64::INFINITY, f64::from);
        let (largest, _, at) =
            both.iter().max_by(|(a, ..), (b, ..)| a.abs().total_cmp(&b.abs()))?;
        Some(Self {
            postures: both.len(),
            rms: (both.iter().map(|(error, ..)| error * error).sum::<f64>() / count).sqrt(),
            largest: *largest,
            share: largest.abs() / capacity,
            at: (*at).clone(),
            friction: both.iter().map(|(_, friction, _)| friction).sum::<f64>() / count,
        })
    }
}
