//! Check that the rest posture can set the zero of each joint that asks for it, and that a second posture verifies the
//! signs and position scales that are stated only: a reading that is set to fit fits whatever the factor.

use crate::joints::JointParameters;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use crate::rest_check::{accepted, list, note};
use crate::zero::ZeroSource;
use crate::zeroing::Zeroing;
use canopen::object::Object;
use controller::JointVector;
use controller::arm::JointKind;
use units::numbering::Joint;

/// Minimum distance of the two rest positions of an actuator, in rad: 20°.
const MIN_ROTATION: f64 = 20.0_f64.to_radians();

/// Minimum distance of the two rest positions of an actuator, in m.
const MIN_TRANSLATION: f64 = 0.04;

/// Maximum tolerance of the rest posture, in revolutions of a single-turn encoder.
const MAX_SHARE: f64 = 0.25;

/// Refuses a joint whose zero the rest posture cannot set or verify.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let zeroing = Zeroing::new(config);
    for (joint, parameters) in Joint::each(&config.joints) {
        let source = parameters.zero.source;
        if source.is_absolute() {
            continue;
        }
        if let Some(other) = missing(&zeroing, joint, |other| zeroing.rest(other).is_some()) {
            let name = &other.entry(&config.joints).name;
            let reason = format!(
                "\"{}\" requires the rest position of {name}, which sets the zero: rest_deg (rest_m)",
                source.key()
            );
            add(joint, raw, problems, reason);
            continue;
        }
        if let ZeroSource::SingleTurn { counts } = source {
            check_revolution(config, joint, counts, raw, problems);
        }
        if matches!(source, ZeroSource::Homing(_)) {
            check_home(config, &zeroing, joint, raw, problems);
        }
        check_second(config, &zeroing, joint, raw, problems);
    }
}

/// Returns the first joint tied to `joint` that lacks something.
fn missing(zeroing: &Zeroing, joint: Joint, has: impl Fn(Joint) -> bool) -> Option<Joint> {
    let tied = Joint::each(zeroing.group(joint)).filter(|(_, is_tied)| *is_tied);
    tied.map(|(other, _)| other).find(|other| !has(*other))
}

/// Refuses a tolerance at the actuator above a quarter of the revolution: near a half every posture would look like rest.
fn check_revolution(
    config: &Parameters,
    joint: Joint,
    counts: f64,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) {
    let parameters = joint.entry(&config.joints);
    let tolerances = config.joints.each_ref().map(|one| one.rest.map_or(0.0, |it| it.tolerance()));
    let coupling = config.controller.calibration.coupling();
    let at_actuators: [f64; 6] = coupling.fastest(&JointVector::from(tolerances)).into();
    let (tolerance, revolution) =
        (*joint.entry(&at_actuators), counts * parameters.calibration.quantum());
    if tolerance <= MAX_SHARE * revolution {
        return;
    }
    let Some(rest) = parameters.rest else { return };
    let reason = format!(
        "the tolerance of the rest position must be at most a quarter of the revolution that it selects, {} of {}, got {}: \
         state a smaller rest_tolerance_deg (rest_tolerance_m)",
        rest.format(MAX_SHARE * revolution),
        rest.format(revolution),
        rest.format(tolerance)
    );
    add(joint, raw, problems, reason);
}

/// Refuses a drive without 607Ch, whose home reads 0, unless the rest position does.
fn check_home(
    config: &Parameters,
    zeroing: &Zeroing,
    joint: Joint,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) {
    let parameters = joint.entry(&config.joints);
    let offset = parameters.eds.object(Object::HOME_OFFSET);
    let (at_rest, zero) = (zeroing.rest_counts(joint).0, parameters.plant.actuator.zero_counts);
    if offset.is_some_and(|object| object.access.is_writable()) || at_rest == 0 {
        return;
    }
    let Some(place) = raw.joint.all().get(joint.index()) else { return };
    let reason = format!(
        "must be {}, so that the rest position reads 0: the drive has no home offset (607Ch) to write, got {zero}",
        zero.wrapping_sub(at_rest)
    );
    problems.add(&place.zero_counts, reason);
}

/// Refuses a joint with facts stated only whose second rest position is absent or too close to the first.
fn check_second(
    config: &Parameters,
    zeroing: &Zeroing,
    joint: Joint,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) {
    let parameters = joint.entry(&config.joints);
    let facts = accepted(parameters);
    if facts.is_empty() && parameters.second_rest.is_none() {
        return;
    }
    if let Some(other) = missing(zeroing, joint, |other| zeroing.second_rest(other).is_some()) {
        let of = if facts.is_empty() { "the zero".to_owned() } else { list(&facts) };
        let reason = format!(
            "second_rest_deg (second_rest_m) of {} must state a second position, such as a stop, which alone verifies {of} \
             with zero = \"{}\"",
            other.entry(&config.joints).name,
            parameters.zero.source.key()
        );
        note(joint, reason, config, raw, problems);
        return;
    }
    let Some((distance, min)) = too_close(config, joint) else { return };
    let reason = format!(
        "must be at least {min} from second_rest_deg (second_rest_m) at its actuator, got {distance}"
    );
    note(joint, reason, config, raw, problems);
}

/// Returns the distance of the two rest positions of an actuator, and the required one, if they are too close.
fn too_close(config: &Parameters, joint: Joint) -> Option<(String, String)> {
    let at = |of: fn(&JointParameters) -> Option<f64>| {
        let q = config.joints.each_ref().map(|joint| of(joint).unwrap_or(0.0));
        let coupling = config.controller.calibration.coupling();
        let actuators: [f64; 6] = coupling.actuators(&JointVector::from(q)).into();
        *joint.entry(&actuators)
    };
    let first = at(|joint| joint.rest.map(|rest| rest.position()));
    // A joint without second position stays where it is.
    let second = at(|joint| joint.second_rest.or(joint.rest).map(|rest| rest.position()));
    let rest = joint.entry(&config.joints).rest?;
    let min = match joint.entry(&config.joints).plant.link.kind {
        JointKind::Revolute => MIN_ROTATION,
        JointKind::Prismatic => MIN_TRANSLATION,
    };
    let distance = (second - first).abs();
    // 20° are not exact in rad.
    (distance < min * (1.0 - 1e-9)).then(|| (rest.format(distance), rest.format(min)))
}

/// Adds a problem at the key `zero` of a joint.
fn add(joint: Joint, raw: &raw::File, problems: &mut Problems<'_>, reason: String) {
    if let Some(place) = raw.joint.all().get(joint.index()) {
        problems.add(&place.zero, reason);
    }
}
