//! `frhc ctl park`: the way of each joint, and the progress of the motion until the arm lies in its rest posture.

use std::time::Duration;

use serde_json::Value;
use tokio::time::sleep;

use crate::ctl::Connection;
use crate::ctl::table::row;
use crate::exit::{Failure, Kind};
use crate::print;
use units::wording::without_minus_zero;

/// Interval between two looks at the node.
const INTERVAL: Duration = Duration::from_millis(100);

/// Prints the way, then waits until the arm is parked.
///
/// # Errors
/// When the node stops or leaves the mode before (exit 1), or responds no more (exit 4).
pub(super) fn watch(node: &Connection) -> Result<(), Failure> {
    let answer = node.status()?;
    let status = answer.get("status").unwrap_or(&Value::Null);
    way(status).iter().for_each(|row| print::line(row));
    print::line("Hold the deadman: the arm moves along this way. Released, it stays where it is.");
    loop {
        let answer = node.status()?;
        let status = answer.get("status").unwrap_or(&Value::Null);
        match outcome(status) {
            Outcome::UnderWay => {}
            Outcome::Parked => {
                print::line("parked: release the deadman, then `frhc ctl disarm`");
                return Ok(());
            }
            Outcome::Ended(reason) => return Err(Failure::new(Kind::Negative, reason)),
        }
        node.runtime.block_on(async { sleep(INTERVAL).await });
    }
}

/// State of the motion.
#[derive(Debug, PartialEq, Eq)]
enum Outcome {
    UnderWay,
    Parked,
    /// Ended before, with the reason.
    Ended(String),
}

/// Returns the state of the motion in a status.
fn outcome(status: &Value) -> Outcome {
    let text = |key: &str| status.get(key).and_then(Value::as_str);
    let state = status.get("hold").and_then(|hold| hold.get("state")).and_then(Value::as_str);
    match (text("stopped_by"), text("mode"), state) {
        (Some(cause), _, _) => Outcome::Ended(format!("not parked: {cause}")),
        (None, Some("measuring"), Some("arrived")) => Outcome::Parked,
        (None, Some("measuring"), _) => Outcome::UnderWay,
        (None, mode, _) => {
            let mode = mode.unwrap_or("of unknown mode");
            Outcome::Ended(format!("not parked: the node is {mode}"))
        }
    }
}

/// Returns where each joint is and where it goes.
fn way(status: &Value) -> Vec<String> {
    let to = status.get("hold").and_then(|hold| hold.get("to")).and_then(Value::as_array);
    let joints = status.get("joints").and_then(Value::as_array).into_iter().flatten();
    let rows = joints.zip(to.into_iter().flatten()).map(|(joint, to)| {
        let text = |key: &str| joint.get(key).and_then(Value::as_str).unwrap_or_default();
        let is_sliding = text("position_unit") == "m";
        let shown = |value: Option<&Value>| match value.and_then(Value::as_f64) {
            Some(at) if is_sliding => {
                format!("{} mm", without_minus_zero(format!("{:.1}", at * 1e3)))
            }
            Some(at) => format!("{}°", without_minus_zero(format!("{:.1}", at.to_degrees()))),
            None => "unknown".to_owned(),
        };
        let [from, to] = [shown(joint.get("position")), shown(Some(to))];
        row(text("name"), &format!("{from:>10} to {to:>10}"))
    });
    rows.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(mode: &str, state: &str, cause: Option<&str>) -> Value {
        serde_json::json!({
            "mode": mode, "stopped_by": cause,
            "hold": { "state": state, "done": 0.5, "to": [-1e-9, -0.872_664_6, 0.4] },
            "joints": [
                { "name": "azimuth", "position": 0.5, "position_unit": "rad" },
                { "name": "elevation", "position": null, "position_unit": "rad" },
                { "name": "slide", "position": 0.42, "position_unit": "m" },
            ],
        })
    }

    #[test]
    fn only_an_arrival_while_measuring_is_parked() {
        let of = |mode, state, cause| outcome(&status(mode, state, cause));
        assert_eq!(of("measuring", "arrived", None), Outcome::Parked);
        for state in ["waiting", "moving"] {
            assert_eq!(of("measuring", state, None), Outcome::UnderWay);
        }
        let blocked = of("reflection-off", "arrived", Some("joint 3: blocked at 12.0°"));
        assert_eq!(blocked, Outcome::Ended("not parked: joint 3: blocked at 12.0°".to_owned()));
        assert_eq!(
            of("ready", "arrived", None),
            Outcome::Ended("not parked: the node is ready".to_owned())
        );
        assert!(matches!(outcome(&Value::Null), Outcome::Ended(_)));
    }

    #[test]
    fn way_has_each_joint_in_its_unit() {
        assert_eq!(
            way(&status("measuring", "waiting", None)).join("\n"),
            "azimuth               28.6° to       0.0°\n\
             elevation           unknown to     -50.0°\n\
             slide              420.0 mm to   400.0 mm"
        );
    }
}
