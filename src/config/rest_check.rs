//! Rest posture of a whole arm: it must verify the signs and position scales that are accepted as stated only.

use crate::joints::JointParameters;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::rest::{MIN_DISTANCE, key_of, tolerance};
use crate::{facts, raw};
use canopen::fact::Fact;
use controller::JointVector;
use controller::coupling::Coupling;
use units::numbering::Joint;

/// Refuses an arm whose rest posture does not verify the accepted facts.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let calibration = &config.controller.calibration;
    let rests = config.joints.each_ref().map(|joint| joint.rest);
    let accepting = Joint::each(config.joints.each_ref().map(accepted));
    let accepting: Vec<_> = accepting.filter(|(_, facts)| !facts.is_empty()).collect();
    let Some((_, facts)) = accepting.first() else { return };
    let names_are = facts::names(facts);
    // Each actuator of a coupled arm moves several joints, so its position at rest needs all of them.
    let is_coupled = calibration.coupling().matrix() != Coupling::<6>::none().matrix();
    let needs = |joint: &Joint| is_coupled || accepting.iter().any(|(other, _)| other == joint);
    let missing: Vec<_> = Joint::ALL
        .into_iter()
        .filter(|joint| joint.entry(&rests).is_none() && needs(joint))
        .collect();
    let key = |joint: &Joint| raw.joint.all().get(joint.index());
    if let Some(first) = missing.first() {
        let names: Vec<_> =
            missing.iter().map(|joint| joint.entry(&config.joints).name.as_str()).collect();
        let reason = format!(
            "{}: {names_are} verified by no object of the drive, so {} must state where the joint rests when the arm is \
             armed for the first time after a boot",
            names.join(", "),
            key_of(first.entry(&config.joints).plant.link.kind),
        );
        if let Some(place) = key(first) {
            problems.add(&place.rest_deg, reason);
        }
        return;
    }
    let at_rest = rests.map(|rest| rest.map_or(0.0, |rest| rest.position()));
    let actuators: [f64; 6] = calibration.coupling().actuators(&JointVector::from(at_rest)).into();
    for (joint, facts) in accepting {
        let (Some(rest), Some(place)) = (joint.entry(&rests), key(&joint)) else { continue };
        // A wrong factor applies to the position of the actuator.
        let min = MIN_DISTANCE * tolerance(rest.kind());
        let distance = joint.entry(&actuators).abs();
        if distance < min {
            let given = if place.rest_deg.is_absent() { &place.rest_m } else { &place.rest_deg };
            let reason = format!(
                "must be at least {} from the zero of its actuator, as the rest posture alone verifies {}; got {}",
                rest.format(min),
                facts.iter().map(Fact::to_string).collect::<Vec<_>>().join(" and "),
                rest.format(distance),
            );
            problems.add(given, reason);
        }
    }
}

/// Returns sign and position scale of a joint, as far as its drive may verify them by no object.
fn accepted(joint: &JointParameters) -> Vec<Fact> {
    let facts = joint.accepted.iter().copied();
    facts.filter(|fact| matches!(fact, Fact::Sign | Fact::PositionScale)).collect()
}
