//! Explanation as JSON, and as text.

use serde_json::Value as Json;

use telemetry::digits;
use testbench::explanation::{Entry, Explanation, Value};

/// Returns one object: name to value, unit, frame, equation and description.
pub(super) fn json(explanation: &Explanation) -> String {
    let Explanation(entries) = explanation;
    let object: Json = entries.iter().map(|entry| (entry.name, serde_json::json!(entry))).collect();
    object.to_string()
}

/// Returns one line per value; poses and matrices take several.
pub(super) fn text(explanation: &Explanation) -> String {
    let Explanation(entries) = explanation;
    let lines: Vec<String> = entries.iter().map(line).collect();
    lines.join("\n")
}

fn line(entry: &Entry) -> String {
    let Entry { name, value, unit, frame, place, what } = entry;
    let place = match place.chars().next() {
        None => String::new(),
        Some('F') => format!(" ({place})"),
        Some(_) if place.contains('.') => format!(" (section {place})"),
        Some(_) => format!(" (Eq. {place})"),
    };
    let frame = if frame.is_empty() { String::new() } else { format!(" {{{frame}}}") };
    let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
    let head = format!("{name:15}{}", shown(value));
    format!("{head}{unit}{frame}  {what}{place}")
}

fn shown(value: &Value) -> String {
    // Shows values that round to -0.00000 as zero.
    let number = |number: &f64| if number.abs() < 5e-6 { 0.0 } else { *number };
    let row = |numbers: &[f64]| {
        numbers.iter().map(|n| digits::column(number(n), 10, 5)).collect::<Vec<_>>().join(" ")
    };
    let rows = |rows: Vec<String>| rows.join("\n               ");
    match value {
        Value::Number(number) => row(&[*number]),
        Value::Numbers(numbers) => row(numbers),
        Value::Pose(matrix) => rows(matrix.iter().take(3).map(|numbers| row(numbers)).collect()),
        Value::Matrix(matrix) => rows(matrix.iter().map(|numbers| row(numbers)).collect()),
        Value::Targets(targets) => {
            targets.iter().map(|target| format!("{target:10}")).collect::<Vec<_>>().join(" ")
        }
        Value::Word(word) => format!("{:>10}", word.as_deref().unwrap_or("none")),
    }
}
