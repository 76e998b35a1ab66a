//! Frames around the trip of a fault record, and the state of the joints that it has kept.

use std::time::Duration;

use serde_json::Value;

use crate::frames::Reader;
use crate::html::{Cell, Html};
use crate::view::View;
use crate::words::with_unit;

/// Writes the joints at the trip, and the frames around it.
pub(crate) fn write(html: &mut Html, view: &View<'_>) {
    let Some(fault) = &view.subject.fault else { return };
    html.section("trip", "At the trip");
    let joints = fault.get("status").and_then(|status| status.get("joints"));
    let joints = joints.and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    if joints.is_empty() {
        html.missing("fault.json has no state of the joints.");
    } else {
        let rows: Vec<Vec<Cell>> = joints.iter().map(joint).collect();
        html.table(
            "Joints in the cycle of the trip",
            &["Joint", "Position", "Torque", "Target in ‰"],
            &rows,
        );
    }
    let seconds = fault.get("seconds").and_then(Value::as_f64).filter(|at| (0.0..1e9).contains(at));
    let subject = view.subject;
    if let (Some(seconds), Ok(log)) = (seconds, subject.log()) {
        let mut reader =
            Reader::new(subject.config.as_ref(), &subject.interfaces(), subject.origin_us());
        let frames = reader.around(log, Duration::from_secs_f64(seconds));
        let rows: Vec<Vec<Cell>> = frames
            .iter()
            .map(|frame| {
                let time = (frame.at.as_secs_f64() - seconds) * 1e3;
                vec![
                    Cell::Number(format!("{time:+.3}").replace('-', "\u{2212}")),
                    Cell::Code(frame.interface.clone()),
                    Cell::Code(frame.frame.clone()),
                    frame.name.clone().into(),
                    frame.text.clone().into(),
                ]
            })
            .collect();
        let heads = ["Time in ms", "Bus", "Frame", "Message", "Content"];
        html.log("Frames around the trip; time zero is the SYNC of its cycle", &heads, &rows);
    }
    html.end_section();
}

fn joint(of: &Value) -> Vec<Cell> {
    let text = |key: &str| of.get(key).and_then(Value::as_str).unwrap_or_default();
    let number = |key: &str| of.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN);
    vec![
        text("name").into(),
        Cell::Number(with_unit(number("position"), text("position_unit"))),
        Cell::Number(with_unit(number("torque"), text("torque_unit"))),
        Cell::Number(crate::words::number(number("target_per_mille"))),
    ]
}
