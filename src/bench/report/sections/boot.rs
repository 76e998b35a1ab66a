//! Boot: how long it took, and what happened on the buses.

use std::time::Duration;

use crate::frames::{FrameText, Reader};
use crate::html::{Cell, Html};
use crate::view::View;
use crate::words::{count, counted, moment};
use node::record::Mode;

/// Time shown if the node never became ready, in s.
const WITHOUT_END: f64 = 20.0;

/// Writes the boot.
pub(crate) fn write(html: &mut Html, view: &View<'_>) {
    html.section("boot", "Boot");
    let ready = view.gathered.modes.first(Mode::Ready);
    html.paragraph(&match ready {
        Some(at) => format!("The node was ready {} after time zero.", moment(at)),
        None => "The node never became ready.".to_owned(),
    });
    let end = ready.unwrap_or(WITHOUT_END).clamp(0.0, 1e6);
    let Ok(log) = view.subject.log() else {
        html.missing("bus.log cannot be read, so nothing is known of the frames of the boot.");
        html.end_section();
        return;
    };
    let subject = view.subject;
    let mut reader =
        Reader::new(subject.config.as_ref(), &subject.interfaces(), subject.origin_us());
    let boot = reader.boot(log, Duration::from_secs_f64(end));
    let frames: Vec<String> = boot
        .frames
        .iter()
        .map(|(bus, frames)| format!("{} on {bus}", counted(*frames, "frame")))
        .collect();
    let frames = if frames.is_empty() { "no frame".to_owned() } else { frames.join(", ") };
    html.paragraph(&format!(
        "Until then: {frames}, {} of them replies of SDO servers.",
        count(boot.sdo_replies)
    ));
    if !boot.events.is_empty() {
        let rows: Vec<Vec<Cell>> = boot.events.iter().map(row).collect();
        let heads = ["Time", "Bus", "Message", "Content"];
        let number = u64::try_from(rows.len()).unwrap_or(0);
        html.details(&format!("Events of the boot: {}", count(number)));
        html.advice("NMT commands, changes of nodes, and emergencies. Emergencies 8250h and 8130h here are those of the proof test, by which each drive shows that it stops by itself.");
        html.log("Events of the boot", &heads, &rows);
        if boot.more > 0 {
            html.advice(&format!(
                "{} more are in bus.log: `frhc decode` prints them.",
                count(boot.more)
            ));
        }
        html.close("details");
    }
    html.end_section();
}

/// Returns a frame as the row of a table.
pub(crate) fn row(event: &FrameText) -> Vec<Cell> {
    vec![
        Cell::Number(format!("{:.6}", event.at.as_secs_f64())),
        Cell::Code(event.interface.clone()),
        event.name.clone().into(),
        event.text.clone().into(),
    ]
}
