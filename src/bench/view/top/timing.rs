//! Times of the cycle, and counts of overruns, missed samples and losses.

use ratatui::style::Style;

use super::number::fixed;
use super::page::{ScreenRow, plain, row};
use super::palette::Palette;
use super::state::State;
use super::text::{cut, fitted};
use super::value::{at, number, text};

/// Columns of the table.
pub(super) const COLUMNS: usize = 39;

/// Rows of the table, with its heading.
pub(super) const ROWS: usize = TIMES.len() + 1;

/// Times with their keys.
const TIMES: [(&str, &str); 4] = [
    ("wake_up_late_us", "wake-up late"),
    ("sync_to_last_sample_us", "SYNC to samples"),
    ("step_us", "controller step"),
    ("sync_to_last_target_us", "SYNC to targets"),
];

/// Returns the table of the times, below a heading.
pub(super) fn table(state: &State) -> Vec<ScreenRow> {
    let heading = format!("{:15}{:>8}{:>8}{:>8}", "timing, µs", "p50", "p99", "max");
    let of_key = |(key, name): (&str, &str)| {
        let value = |part| fixed(number(at(&state.snapshot, &["timing", key, part])), 8, 0);
        plain(format!("{name:15}{}{}{}", value("p50"), value("p99"), value("max")))
    };
    [row([(heading, Palette::strong())])].into_iter().chain(TIMES.map(of_key)).collect()
}

/// Returns overruns, missed samples and losses, in one row where `columns` are at least 80.
pub(super) fn counters(state: &State, palette: Palette, columns: usize) -> Vec<ScreenRow> {
    let counter = |key| number(at(&state.snapshot, &[key]));
    let style = |count: Option<f64>| match count {
        Some(count) if count > 0.0 => palette.bad(),
        Some(_) | None => Style::new(),
    };
    let (overruns, missing, lost) =
        (counter("overruns"), counter("missing_samples"), losses(state));
    let first = [
        (format!("overruns{}", fixed(overruns, 7, 0)), style(overruns)),
        (format!("   missed samples{}", fixed(missing, 7, 0)), style(missing)),
    ];
    let second = (format!("lost on the way to the disk{}", fixed(lost, 8, 0)), style(lost));
    if columns < 80 {
        return vec![row(first), row([second])];
    }
    let [overruns, missing] = first;
    vec![row([overruns, missing, ("   ".to_owned(), Style::new()), second])]
}

/// Returns the number of all entries lost.
fn losses(state: &State) -> Option<f64> {
    let kinds = at(&state.snapshot, &["lost"]).as_object()?;
    kinds.values().map(number).sum()
}

/// Returns warnings about the recording, the switch box and other masters; no row without a warning.
pub(super) fn others(state: &State, palette: Palette, columns: usize) -> Vec<ScreenRow> {
    let snapshot = |path: &[&str]| at(&state.snapshot, path);
    let mut rows = Vec::new();
    if snapshot(&["switches_online"]).as_bool() == Some(false) {
        rows.push(row([("switch box offline".to_owned(), palette.bad())]));
    }
    if let Some(reason) = text(snapshot(&["recording", "ended_early"])) {
        rows.push(row([(
            cut(&format!("recording ended early: {reason}"), columns),
            palette.bad(),
        )]));
    } else if let Some(parts) = number(snapshot(&["recording", "parts"])) {
        rows.push(plain(format!("recording, parts {}", fixed(Some(parts), 6, 0))));
    }
    for (key, name) in [
        ("foreign_uploads", "SDO uploads of other clients"),
        ("unread_settings", "settings not read again"),
    ] {
        if let Some(count) = number(snapshot(&[key])).filter(|count| *count > 0.0) {
            rows.push(row([(
                format!("{} {}", fitted(name, 28), fixed(Some(count), 8, 0)),
                Palette::strong(),
            )]));
        }
    }
    rows
}
