//! Check that the rest posture of the arm verifies all signs and position scales accepted as stated only.

use crate::joints::JointParameters;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use crate::rest::{MIN_DISTANCE, key_of};
use canopen::fact::Fact;
use controller::JointVector;
use controller::arm::JointKind;
use controller::coupling::Coupling;
use units::numbering::Joint;

/// Refuses an arm whose rest posture does not verify the accepted facts.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let accepting = Joint::each(config.joints.each_ref().map(accepted));
    let accepting: Vec<_> = accepting.filter(|(_, facts)| !facts.is_empty()).collect();
    let Some((_, facts)) = accepting.first() else { return };
    let missing = missing(config, |joint| accepting.iter().any(|(other, _)| *other == joint));
    if let Some(first) = missing.first() {
        let names = missing.iter().map(|joint| joint.entry(&config.joints).name.as_str());
        let key = key_of(first.entry(&config.joints).plant.link.kind);
        let reason = format!(
            "{key} must state the position at the first arming after a boot, which alone verifies {}: {}",
            list(facts),
            names.collect::<Vec<_>>().join(", "),
        );
        note(*first, reason, config, raw, problems);
        return;
    }
    // A zero that the rest posture sets takes any reading: its second posture verifies it (`zero_check`).
    let absolute = accepting
        .into_iter()
        .filter(|(joint, _)| joint.entry(&config.joints).zero.source.is_absolute());
    for (joint, facts) in absolute {
        if let Some((distance, min)) = near_zero(joint, config) {
            let reason = format!(
                "must be at least {min} from the zero of its actuator, as the rest posture alone verifies {}; got {distance}",
                list(&facts),
            );
            note(joint, reason, config, raw, problems);
        }
    }
}

/// Returns the joints whose required rest position is absent. A coupled arm requires it of all joints, because each
/// actuator moves several of them.
fn missing(config: &Parameters, is_accepting: impl Fn(Joint) -> bool) -> Vec<Joint> {
    let coupling = config.controller.calibration.coupling().matrix();
    let is_coupled = coupling != Coupling::<6>::none().matrix();
    let lacks = |joint: &Joint| {
        let rest = joint.entry(&config.joints).rest;
        rest.is_none() && (is_coupled || is_accepting(*joint))
    };
    Joint::ALL.into_iter().filter(lacks).collect()
}

/// Returns distance at rest of an actuator from its zero, and the required distance, if it is too close. A wrong factor
/// multiplies the position of the actuator.
fn near_zero(joint: Joint, config: &Parameters) -> Option<(String, String)> {
    let rests = config.joints.each_ref().map(|joint| joint.rest);
    let rest = (*joint.entry(&rests))?;
    let at_rest = rests.map(|rest| rest.map_or(0.0, |rest| rest.position()));
    let coupling = config.controller.calibration.coupling();
    let actuators: [f64; 6] = coupling.actuators(&JointVector::from(at_rest)).into();
    let (distance, min) = (joint.entry(&actuators).abs(), MIN_DISTANCE * rest.tolerance());
    (distance < min).then(|| (rest.format(distance), rest.format(min)))
}

/// Adds a problem at the key of a joint's rest position.
pub(super) fn note(
    joint: Joint,
    reason: String,
    config: &Parameters,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) {
    let Some(place) = raw.joint.all().get(joint.index()) else { return };
    match joint.entry(&config.joints).plant.link.kind {
        JointKind::Revolute => problems.add(&place.rest_deg, reason),
        JointKind::Prismatic => problems.add(&place.rest_m, reason),
    }
}

pub(super) fn list(facts: &[Fact]) -> String {
    facts.iter().map(Fact::to_string).collect::<Vec<_>>().join(" and ")
}

/// Returns sign and position scale of a joint, as far as they are accepted as stated only.
pub(super) fn accepted(joint: &JointParameters) -> Vec<Fact> {
    let facts = joint.accepted.iter().copied();
    facts.filter(|fact| matches!(fact, Fact::Sign | Fact::PositionScale)).collect()
}
