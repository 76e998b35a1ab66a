//! `frhc ctl zero`: the joint of a request by its name, and the zeros of the joints as rows.

use serde_json::Value;

use crate::ctl::table::row;
use units::numbering::Joint;

/// Returns the joint that `called` names in a status: its displayed name, or its number from 1 at the base.
///
/// # Errors
/// When no joint has this name; the error lists them.
pub(super) fn joint(status: &Value, called: &str) -> Result<Joint, String> {
    let joints = joints(status);
    let named = joints.iter().find(|joint| text(joint, "name") == called);
    let number = named.and_then(|joint| joint.get("joint")?.as_u64()?.try_into().ok());
    let number: Option<u8> = number.or_else(|| called.parse().ok());
    number.and_then(Joint::new).ok_or_else(|| {
        let names: Vec<_> = joints.iter().map(|joint| text(joint, "name")).collect();
        let called = called.escape_debug();
        format!("no joint is called \"{called}\"; expected {}, or 1 to 6", names.join(", "))
    })
}

/// Returns the zero of each joint: counts, position, and the reason if it is unknown.
pub(super) fn states(status: &Value) -> Vec<String> {
    joints(status).iter().map(|joint| row(text(joint, "name"), &state(status, joint))).collect()
}

/// Returns the position that each joint has, and would have if its zero were set now.
pub(super) fn preview(status: &Value) -> Vec<String> {
    let line = |joint: &Value| {
        let now = position(joint, "position").unwrap_or_else(|| "unknown".to_owned());
        let then = match position(joint, "if_zeroed") {
            Some(then) => format!("{then} after ctl zero"),
            None => "absolute: ctl zero sets nothing".to_owned(),
        };
        let counts = joint.get("counts").and_then(Value::as_i64).unwrap_or_default();
        row(text(joint, "name"), &format!("{counts:>11} counts, now {now:>9}; {then}"))
    };
    joints(status).iter().map(line).collect()
}

fn state(status: &Value, joint: &Value) -> String {
    let number = joint.get("joint");
    let unknown = status.get("zero_unknown").and_then(Value::as_array);
    let unknown = unknown.into_iter().flatten().find(|it| it.get("joint") == number);
    match unknown {
        Some(unknown) => format!("zero unknown: {}", text(unknown, "why")),
        None => {
            let at = position(joint, "position").unwrap_or_default();
            format!("zero known, at {at}")
        }
    }
}

/// Formats a position in degrees or mm; `None` if it is unknown.
fn position(joint: &Value, member: &str) -> Option<String> {
    let position = joint.get(member)?.as_f64()?;
    Some(match text(joint, "position_unit") {
        "m" => format!("{:.1} mm", position * 1e3),
        _ => format!("{:.2}°", position.to_degrees()),
    })
}

fn joints(status: &Value) -> &[Value] {
    status.get("joints").and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn text<'v>(value: &'v Value, member: &str) -> &'v str {
    value.get(member).and_then(Value::as_str).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status() -> Value {
        let unit = |kind: &str| if kind == "slide" { "m" } else { "rad" };
        let joint = |number: u8, name: &str, position: Option<f64>, then: Option<f64>| {
            serde_json::json!({
                "joint": number, "name": name, "position": position, "position_unit": unit(name),
                "counts": 1_200, "if_zeroed": then,
            })
        };
        serde_json::json!({
            "zero_unknown": [{ "joint": 2, "why": "the drive has rebooted" }],
            "joints": [
                joint(1, "azimuth", Some(0.5), None),
                joint(2, "elbow", None, Some(1.0)),
                joint(3, "slide", Some(0.42), Some(0.4)),
            ],
        })
    }

    #[test]
    fn joints_are_called_by_name_or_number() {
        let status = status();
        assert_eq!(joint(&status, "elbow"), Ok(Joint::of::<2>()));
        assert_eq!(joint(&status, "3"), Ok(Joint::of::<3>()));
        let error = joint(&status, "knee").unwrap_err();
        assert_eq!(error, "no joint is called \"knee\"; expected azimuth, elbow, slide, or 1 to 6");
        assert!(joint(&status, "7").is_err());
    }

    #[test]
    fn unknown_zero_shows_its_reason_and_no_position() {
        let rows = states(&status()).join("\n");
        assert_eq!(
            rows,
            "azimuth          zero known, at 28.65°\n\
             elbow            zero unknown: the drive has rebooted\n\
             slide            zero known, at 420.0 mm"
        );
        let rows = preview(&status()).join("\n");
        for part in ["now    28.65°; absolute: ", "now   unknown; 57.30° after", "400.0 mm after"]
        {
            assert!(rows.contains(part), "{part} in\n{rows}");
        }
    }
}
