//! Stops of a session as text, combined from log, replay, fault records and summary.

use serde_json::Value;

use crate::modes::{Moment, Stop};
use crate::subject::Subject;
use node::cause::{self, CauseKind};
use node::record::Mode;
use units::numbering::Joint;

/// Maximum time between a stop in the log and the same one in its record, in s.
const SAME: f64 = 0.5;

/// Latched stop, as the report shows it.
#[derive(Clone, Debug)]
pub(crate) struct StopReport {
    /// Time of its SYNC, in s since time zero.
    pub(crate) at: f64,
    pub(crate) cycle: Option<u64>,
    /// Names of the modes: before, the first latched one, the last one.
    pub(crate) modes: [String; 3],
    /// Time at which a reset has ended it, in s.
    pub(crate) ended: Option<f64>,
    /// Cause with the name of its joint.
    pub(crate) cause: String,
    pub(crate) kind: Option<CauseKind>,
    /// Name of its joint.
    pub(crate) joint: Option<String>,
    /// Folder of its fault record.
    pub(crate) record: Option<String>,
    /// Names of joints whose drives did not report that they are off.
    pub(crate) not_off: Vec<String>,
    /// Seconds around it.
    pub(crate) moments: Vec<Moment>,
}

/// Returns all stops of a session, in the order of time.
pub(crate) fn stops(subject: &Subject, found: &[Stop]) -> Vec<StopReport> {
    let joints = subject.joints();
    let mut records: Vec<_> = subject.records.iter().map(|(name, of)| (name.clone(), of)).collect();
    records.extend(subject.fault.as_ref().map(|of| (subject.name.clone(), of)));
    let mut stops: Vec<StopReport> = Vec::new();
    for stop in found {
        let is_same = |(_, record): &(String, &Value)| {
            number(record, "seconds").is_some_and(|at| (at - stop.at).abs() < SAME)
        };
        let record = records.iter().position(is_same).map(|place| records.remove(place));
        stops.push(of_log(subject, stop, record, &joints));
    }
    // Records whose cycles the log does not have.
    stops.extend(records.into_iter().map(|(name, record)| of_record(name, record, &joints)));
    stops.sort_by(|one, other| one.at.total_cmp(&other.at));
    stops
}

fn of_log(
    subject: &Subject,
    stop: &Stop,
    record: Option<(String, &Value)>,
    joints: &[String],
) -> StopReport {
    let of_record = record.map(|(name, record)| of_record(name, record, joints));
    let by_replay = stop.cause.map(|cause| cause.with_name(joints));
    let by_summary = || {
        let summary = subject.summary.as_ref().filter(|_| stop.ended.is_none())?;
        Some(cause::with_name(&text(summary, "stopped_by")?, joints))
    };
    let joint = stop.cause.and_then(|cause| cause.joint());
    let joint = joint.and_then(|joint| joints.get(joint.index()).cloned());
    let cause = by_replay.or(of_record.as_ref().map(|record| record.cause.clone()));
    let cause = cause.or_else(by_summary);
    let joint = joint.or_else(|| joint_of(cause.as_ref()?, joints));
    let unknown = "cause unknown: there is neither a replay nor a fault record of it";
    StopReport {
        at: stop.at,
        cycle: Some(stop.cycle),
        modes: [stop.from, stop.to, stop.last].map(|mode| mode.name().to_owned()),
        ended: stop.ended,
        cause: cause.unwrap_or_else(|| unknown.to_owned()),
        kind: stop.cause.map(|cause| cause.kind()).or(of_record.as_ref().and_then(|of| of.kind)),
        joint: joint.or(of_record.as_ref().and_then(|of| of.joint.clone())),
        not_off: of_record.as_ref().map(|of| of.not_off.clone()).unwrap_or_default(),
        record: of_record.and_then(|of| of.record),
        moments: stop.moments.clone(),
    }
}

/// Returns the stop that a `fault.json` describes.
pub(crate) fn of_record(name: String, record: &Value, joints: &[String]) -> StopReport {
    let mode = |key: &str| text(record, key).unwrap_or_else(|| "unknown".to_owned());
    let cause = text(record, "cause").unwrap_or_else(|| "its fault.json names no cause".to_owned());
    let kind = text(record, "kind");
    let not_off = record.get("not_off").and_then(Value::as_array).into_iter().flatten();
    let named = |number: &Value| {
        let number = usize::try_from(number.as_u64()?).ok()?;
        joints.get(number.checked_sub(1)?).cloned()
    };
    StopReport {
        at: number(record, "seconds").unwrap_or(f64::NAN),
        cycle: record.get("cycle").and_then(Value::as_u64),
        modes: [mode("mode_before"), mode("mode"), mode("mode")],
        ended: None,
        cause: cause::with_name(&cause, joints),
        kind: CauseKind::ALL.into_iter().find(|one| kind.as_ref() == Some(&hyphenated(*one))),
        joint: text(record, "joint_name"),
        record: Some(name),
        not_off: not_off.filter_map(named).collect(),
        moments: Vec::new(),
    }
}

/// Returns the state of a mode as text.
pub(crate) fn state(mode: &str) -> &'static str {
    match Mode::ALL.into_iter().find(|one| one.name() == mode) {
        Some(Mode::ReflectionOff) => {
            "reflection off (S1): the object is held, gravity compensation stays on, nothing is felt"
        }
        Some(Mode::ZeroTorque) => {
            "zero torque (S2): all torques are zero, and the drives are off 100 ms later"
        }
        Some(Mode::DrivesOff) => "drives off (S3): all torques are zero, and voltage is disabled",
        Some(Mode::Boot | Mode::Ready | Mode::Armed | Mode::Engaged | Mode::Measuring) | None => {
            "not stopped"
        }
    }
}

/// Returns the joint at the start of a text about a joint.
pub(crate) fn joint_of(text: &str, joints: &[String]) -> Option<String> {
    let number = |joint: &Joint| text.starts_with(&format!("joint {joint}"));
    let joint = Joint::ALL.into_iter().find(number)?;
    joints.get(joint.index()).cloned()
}

/// Converts `SamplesMissing` to `samples-missing`, as fault records have it.
fn hyphenated(kind: CauseKind) -> String {
    let mut text = String::new();
    for letter in format!("{kind:?}").chars() {
        if letter.is_ascii_uppercase() && !text.is_empty() {
            text.push('-');
        }
        text.push(letter.to_ascii_lowercase());
    }
    text
}

fn text(of: &Value, key: &str) -> Option<String> {
    of.get(key).and_then(Value::as_str).map(str::to_owned)
}

fn number(of: &Value, key: &str) -> Option<f64> {
    of.get(key).and_then(Value::as_f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn joints() -> Vec<String> {
        ["a", "b", "elbow", "d", "e", "f"].map(str::to_owned).to_vec()
    }

    fn record() -> Value {
        json!({
            "cause": "joint 3: no sample for 3 cycles", "kind": "samples-missing", "joint_name": "elbow",
            "cycle": 1099, "seconds": 1.7, "mode_before": "engaged", "mode": "zero-torque", "not_off": [3, 9]
        })
    }

    #[test]
    fn fault_record_has_its_cause_with_name_and_its_row() {
        let stop = of_record("001".to_owned(), &record(), &joints());
        assert_eq!(stop.cause, "joint 3 (elbow): no sample for 3 cycles");
        assert_eq!(
            (stop.kind, stop.not_off),
            (Some(CauseKind::SamplesMissing), vec!["elbow".to_owned()])
        );
        let empty = of_record("001".to_owned(), &json!({}), &joints());
        assert!(empty.at.is_nan() && empty.kind.is_none());
    }

    #[test]
    fn joint_of_a_text_is_named() {
        assert_eq!(joint_of("joint 3: lost", &joints()), Some("elbow".to_owned()));
        assert_eq!(joint_of("bus 0: lost", &joints()), None);
    }
}
