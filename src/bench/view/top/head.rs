//! First rows: mode with its cause, drives that are not off, the steps that lead on, and faults of the feed.

use ratatui::style::Style;

use super::choices::View;
use super::number::{clock, fixed};
use super::page::{Block, ScreenRow, plain, row};
use super::palette::Palette;
use super::state::State;
use super::text::{cut, fitted, width, wrapped};
use super::value::{at, text};

/// Columns of a mode's word, with a space on both sides.
const BADGE: usize = 16;

/// Maximum columns of a joint's name in a list.
const MAX_NAME: usize = 14;

/// Maximum number of rows of a text.
const MAX_ROWS: usize = 3;

/// Returns the first row. `columns` is at least 40.
pub(super) fn title(state: &State, view: &View, palette: Palette, columns: usize) -> ScreenRow {
    let (word, style) = match (&state.absence, state.mode_name()) {
        (Some(_), _) => ("no node".to_owned(), palette.alarm()),
        (None, mode) if mode.is_empty() => ("waiting".to_owned(), palette.mode("")),
        (None, mode) => {
            let style = palette.mode(&mode);
            (mode, style)
        }
    };
    let badge = format!(" {} ", fitted(&word, BADGE - 2));
    let time = clock(state.at_us());
    let right = format!(" cycle {}", fixed(state.cycle(), 8, 0));
    let pause = if view.is_paused { " PAUSED" } else { "" };
    let rest = columns.saturating_sub(BADGE + width(&right) + width(&time) + 1 + pause.len());
    let middle = match rest {
        // The word PAUSED replaces the cycle.
        0..10 if view.is_paused => return narrow_pause(badge, style, &time, columns),
        0..10 => fitted("", rest),
        _ => fitted(&format!("  {}", origin(state)), rest),
    };
    row([
        (badge, style),
        (middle, Style::new()),
        (pause.to_owned(), Palette::strong()),
        (format!("{right} {time}"), Style::new()),
    ])
}

fn narrow_pause(badge: String, style: Style, time: &str, columns: usize) -> ScreenRow {
    let rest = columns.saturating_sub(BADGE + width(time));
    row([
        (badge, style),
        (fitted("  PAUSED", rest), Palette::strong()),
        (time.to_owned(), Style::new()),
    ])
}

/// Returns program, source and configuration.
fn origin(state: &State) -> String {
    let part = |key| text(at(&state.description, &[key]));
    let parts: Vec<String> =
        ["program", "source", "configuration"].into_iter().filter_map(part).collect();
    parts.join(" · ")
}

/// Returns the rows that say why nothing moves, and what to do.
pub(super) fn remarks(
    state: &State,
    silent_s: Option<u64>,
    palette: Palette,
    columns: usize,
) -> Vec<Block> {
    let styled = |text: &str, style: Style| -> Vec<ScreenRow> {
        let rows = wrapped(text, columns, MAX_ROWS);
        rows.into_iter().map(|text| row([(text, style)])).collect()
    };
    let mut blocks = Vec::new();
    if let Some(reason) = &state.absence {
        let values =
            if state.snapshot.is_null() { "" } else { " Values are the last ones received." };
        let text = format!("{reason} Waiting for a node.{values}");
        blocks.push(Block::divisible(99, styled(&text, palette.bad())));
    } else if let Some(seconds) = silent_s {
        let text = format!("No telemetry for {seconds} s: the node is stopped, or hangs.");
        blocks.push(Block::whole(99, styled(&text, palette.alarm())));
    }
    let not_off: Vec<String> = state.not_off().iter().map(|name| cut(name, MAX_NAME)).collect();
    if !not_off.is_empty() {
        let text = format!("NOT OFF, do not touch: {}", not_off.join(", "));
        blocks.push(Block::whole(98, styled(&text, palette.alarm())));
    }
    let unknown: Vec<String> = (0..super::joints::JOINTS)
        .filter_map(|place| {
            let why = state.unknown_zero(place)?;
            Some(format!("{}: {why}", cut(&state.joint_name(place), MAX_NAME)))
        })
        .collect();
    if !unknown.is_empty() {
        let text = format!("zero unknown: {}", unknown.join("; "));
        let short = vec![row([(cut(&text, columns), palette.bad())])];
        blocks.push(Block::abridged((96, short), (81, styled(&text, palette.bad()))));
    }
    if let Some(cause) = state.cause() {
        let text = format!("stopped by: {cause}");
        let short = vec![row([(cut(&text, columns), palette.bad())])];
        blocks.push(Block::abridged((97, short), (83, styled(&text, palette.bad()))));
    }
    if let Some(age) = state.age_of_values() {
        let text = format!("Values are those of the last cycle, {age:.0} s ago.");
        blocks.push(Block::whole(82, styled(&text, Palette::strong())));
    }
    blocks.extend(way_out(&state.way_out(), columns));
    blocks
}

/// Returns the steps out of this mode: the first is more important than the others.
fn way_out(steps: &[String], columns: usize) -> Vec<Block> {
    let rows_of = |step: &String, max| -> Vec<ScreenRow> {
        let rows = wrapped(step, columns.saturating_sub(2), max);
        let marked = rows.iter().enumerate();
        marked
            .map(|(place, text)| plain(format!("{} {text}", if place == 0 { "→" } else { " " })))
            .collect()
    };
    let block = |(place, step): (usize, &String)| {
        let importance = if place == 0 { 84 } else { 79 };
        Block::abridged((importance, rows_of(step, 1)), (76, rows_of(step, MAX_ROWS)))
    };
    steps.iter().enumerate().map(block).collect()
}

/// Returns the last row: the keys.
pub(super) fn keys(view: &View, has_budget: bool, columns: usize) -> ScreenRow {
    let pause = if view.is_paused { "p go on" } else { "p pause" };
    let budget = match (has_budget, view.is_budget) {
        (false, _) => "",
        (true, false) => "   b torque budget",
        (true, true) => "   b timing and buses",
    };
    plain(cut(&format!("q quit   {pause}{budget}"), columns))
}
