//! Figures of a session in words: those that the report computes, and those of `summary.json`.

use serde_json::Value;

use crate::html::Html;
use crate::replayed;
use crate::view::View;
use crate::words::{count, counted, duration, number, with_unit};

/// Writes the figures.
pub(crate) fn write(html: &mut Html, view: &View<'_>) {
    html.section("summary", "Summary");
    html.definitions(&computed(view));
    match &view.subject.summary {
        Some(summary) => {
            html.subheading("summary-json", "As the session has summed itself up");
            html.definitions(&recorded(summary));
        }
        None if view.subject.is_record() => {}
        None => {
            html.missing("The session has no summary.json: its recording did not come to its end.");
        }
    }
    html.end_section();
}

/// Returns the figures that were computed from the cycles.
pub(crate) fn computed(view: &View<'_>) -> Vec<(&'static str, String)> {
    let figures = &view.gathered.figures;
    let [first, last] = view.gathered.ends.unwrap_or([0.0; 2]);
    let mut rows = vec![
        ("Time", duration(last - first)),
        ("Cycles", count(figures.cycles)),
        (
            "Engaged",
            format!(
                "{} in {}",
                duration(figures.engaged_seconds),
                counted(figures.engagements, "spell")
            ),
        ),
        ("Greatest force sensed", with_unit(figures.sensed.force, "N")),
        ("Greatest moment sensed", with_unit(figures.sensed.moment, "N·m")),
        (
            "Force sensed, rms",
            figures.sensed.rms().map_or_else(|| "\u{2013}".to_owned(), |rms| with_unit(rms, "N")),
        ),
    ];
    if view.gathered.has_replay() {
        rows.push(("Greatest force felt", with_unit(figures.felt.force, "N")));
        rows.push(("Greatest moment felt", with_unit(figures.felt.moment, "N·m")));
        rows.push(("Overruns", count(figures.overruns)));
    }
    rows.push((
        "Missing samples",
        format!("{} in {}", count(figures.missing), counted(figures.cycles_with_missing, "cycle")),
    ));
    if view.subject.config.is_some() {
        let interfaces = view.subject.interfaces();
        let loads = figures.loads.iter().zip(&interfaces);
        let loads: Vec<String> =
            loads.map(|(load, name)| format!("{name} {} %", number(load.mean()))).collect();
        rows.push(("Bus load, mean", loads.join(", ")));
    }
    rows.push(("Stops", count(u64::try_from(view.stops.len()).unwrap_or(0))));
    rows.push(("Replay", replayed::short(&view.gathered.findings).to_owned()));
    rows
}

/// Returns the figures of `summary.json` that only it has.
fn recorded(summary: &Value) -> Vec<(&'static str, String)> {
    let at = |path: &str| path.split('/').try_fold(summary, |value, key| value.get(key));
    let float = |path: &str| at(path).and_then(Value::as_f64);
    let whole = |path: &str| at(path).and_then(Value::as_u64);
    let mut rows = Vec::new();
    let mut add =
        |name: &'static str, text: Option<String>| rows.extend(text.map(|text| (name, text)));
    add("Mode at the end", at("final_mode").and_then(Value::as_str).map(str::to_owned));
    add(
        "Ended by the user",
        at("is_interrupted")
            .and_then(Value::as_bool)
            .map(|is| if is { "yes, before its time" } else { "no" }.to_owned()),
    );
    add("In contact", float("contact_seconds").map(duration));
    add("Greatest contact force", float("peak_contact_force_n").map(|force| with_unit(force, "N")));
    add("Greatest force felt", float("peak_felt_force_n").map(|force| with_unit(force, "N")));
    add("Contact reversals", whole("contact/reversals").map(count));
    add(
        "Energy in contact",
        float("contact/energy_j").map(|energy| with_unit(energy * 1e3, "mJ from the hand")),
    );
    add(
        "Rate mode, free",
        float("rate_tracking_rms_m_per_s").map(|rms| with_unit(rms * 1e3, "mm/s off (rms)")),
    );
    add(
        "Pose mode, free",
        float("pose_tracking_rms_m").map(|rms| with_unit(rms * 1e3, "mm off (rms)")),
    );
    add("Object travelled", float("object_travel_m").map(|travel| with_unit(travel, "m")));
    add("Torque limited", whole("saturated_cycles").map(|cycles| counted(cycles, "cycle")));
    let lost = at("lost").and_then(Value::as_object).map(|lost| {
        let lost: Vec<String> = lost
            .iter()
            .filter_map(|(name, value)| {
                value
                    .as_u64()
                    .filter(|count| *count > 0)
                    .map(|lost| format!("{} {}", count(lost), name.replace('_', " ")))
            })
            .collect();
        if lost.is_empty() { "nothing".to_owned() } else { lost.join(", ") }
    });
    add("Lost by the recorder", lost);
    rows
}
