//! Load of the buses, age of the commanded side's samples, the link, and the watchdogs.

use ratatui::style::Style;

use super::number::{bar, fixed, percent};
use super::page::{ScreenRow, beside, plain, row};
use super::palette::Palette;
use super::state::{State, Watchdog};
use super::text::{cut, fitted, width};
use super::value::{at, list, nth, number, text};

/// Watchdog of the age of the newest sample.
const SAMPLE_AGE: &str = "age of the commanded side";

/// Columns from which on a watchdog's share of its limit is shown beside the values.
const SHARE_COLUMNS: usize = 50;

/// Columns of a bus's name.
const BUS_NAME: usize = 8;

/// Returns a row for each bus: load, limit and bar.
pub(super) fn buses(state: &State, palette: Palette, columns: usize) -> Vec<ScreenRow> {
    let of_bus = |place: usize| {
        let Bus { name, load, limit } = bus(state, place);
        let share = load.map(|load| load / 100.0);
        let bar = bar(share, columns.saturating_sub(BUS_NAME + 18));
        let used = load.zip(limit).map(|(load, limit)| load / limit);
        row([(
            format!(
                "{}{} % of{} % {bar}",
                fitted(&name, BUS_NAME),
                fixed(load, 5, 1),
                fixed(limit, 5, 1)
            ),
            palette.share(used),
        )])
    };
    (0..bus_count(state)).map(of_bus).collect()
}

/// Returns the loads of the buses and the age of the newest sample, two values a row: 40 columns.
pub(super) fn short_buses(state: &State, palette: Palette) -> Vec<ScreenRow> {
    let of_bus = |place: usize| {
        let Bus { name, load, limit } = bus(state, place);
        let used = load.zip(limit).map(|(load, limit)| load / limit);
        row([(format!("{}{} %", fitted(&name, BUS_NAME), fixed(load, 5, 1)), palette.share(used))])
    };
    let values: Vec<ScreenRow> =
        (0..bus_count(state)).map(of_bus).chain([sample_age(state)]).collect();
    let pairs = values.chunks(2);
    pairs
        .flat_map(|pair| {
            beside(pair.get(..1).unwrap_or_default(), 18, pair.get(1..).unwrap_or_default())
        })
        .collect()
}

/// Name and load of a bus, and the limit of the load, in percent.
struct Bus {
    name: String,
    load: Option<f64>,
    limit: Option<f64>,
}

fn bus(state: &State, place: usize) -> Bus {
    let described = nth(at(&state.description, &["buses"]), place);
    let now = nth(at(&state.snapshot, &["buses"]), place);
    let name = text(at(described, &["name"])).or_else(|| text(at(now, &["name"])));
    Bus {
        name: name.unwrap_or_else(|| format!("bus {place}")),
        load: number(at(now, &["load_percent"])),
        limit: number(at(described, &["load_limit_percent"])),
    }
}

fn bus_count(state: &State) -> usize {
    let described = list(at(&state.description, &["buses"])).len();
    described.max(list(at(&state.snapshot, &["buses"])).len())
}

/// Returns the age of the newest sample of the commanded side.
pub(super) fn sample_age(state: &State) -> ScreenRow {
    let age_us = number(at(&state.snapshot, &["sample_age_us"]));
    plain(format!("sample age{} ms", fixed(age_us.map(|age| age / 1e3), 9, 2)))
}

/// Returns this age with its limit.
pub(super) fn bounded_sample_age(state: &State) -> ScreenRow {
    let watchdog = state.watchdogs.iter().find(|watchdog| watchdog.name == SAMPLE_AGE);
    let limit = watchdog.and_then(|watchdog| watchdog.limit);
    let mut age = sample_age(state);
    if let Some(limit) = limit {
        age.push_span(format!(" of {} ms", fixed(Some(limit), 7, 1).trim_start()));
    }
    age
}

/// Returns the state of the link; no row where the commanded side is in the node's process.
pub(super) fn link(state: &State, palette: Palette, columns: usize) -> Vec<ScreenRow> {
    let link = at(&state.snapshot, &["link"]);
    if !link.is_object() {
        return Vec::new();
    }
    if at(link, &["connected"]).as_bool() == Some(false) {
        return vec![row([("link NOT CONNECTED".to_owned(), palette.bad())])];
    }
    let far_side = text(at(link, &["far_side"])).unwrap_or_else(|| "–".to_owned());
    let value = |key| number(at(link, &[key]));
    let [p50, p99] = ["round_trip_p50_ms", "round_trip_p99_ms"].map(|key| fixed(value(key), 7, 2));
    let lost = fixed(value("lost"), 6, 0);
    vec![
        plain(cut(&format!("link {far_side}"), columns)),
        plain(format!("round trip{p50} p99{p99} ms")),
        plain(format!("messages lost{lost}")),
    ]
}

/// Returns the watchdog that is nearest to its limit, and then each of them.
pub(super) fn watchdogs(state: &State, palette: Palette, columns: usize) -> Vec<ScreenRow> {
    let each = state.watchdogs.iter().map(|watchdog| watchdog_row(watchdog, palette, columns));
    nearest(state, palette, columns).into_iter().chain(each).collect()
}

/// Returns the watchdog that is nearest to its limit; `None` without watchdogs.
pub(super) fn nearest(state: &State, palette: Palette, columns: usize) -> Option<ScreenRow> {
    let share = |watchdog: &&Watchdog| watchdog.share().unwrap_or(f64::NEG_INFINITY);
    let nearest =
        state.watchdogs.iter().max_by(|one, other| share(one).total_cmp(&share(other)))?;
    let label = "watchdog";
    let share = nearest.share();
    let name = fitted(&nearest.name, columns.saturating_sub(label.len() + 7));
    Some(row([
        (format!("{label} "), Palette::strong()),
        (percent(share), palette.share(share)),
        (format!(" {name}"), Style::new()),
    ]))
}

/// Returns value and limit of a watchdog, of a constant width, and its share where there are `SHARE_COLUMNS`.
fn watchdog_row(watchdog: &Watchdog, palette: Palette, columns: usize) -> ScreenRow {
    let Watchdog { name, unit, value, limit, .. } = watchdog;
    let share = watchdog.share();
    let decimals = match limit {
        _ if unit == "cycles" => 0,
        Some(limit) if *limit < 1.0 => 3,
        Some(limit) if *limit < 100.0 => 1,
        Some(_) | None => 0,
    };
    let limit = fixed(*limit, 5, decimals).trim_start().to_owned();
    let value = fixed(*value, width(&limit), decimals);
    let percent =
        if columns < SHARE_COLUMNS { String::new() } else { format!(" {}", percent(share)) };
    let values = format!(" {value}/{limit} {}{percent}", cut(unit, 6));
    let name = fitted(name, columns.saturating_sub(width(&values)));
    row([(format!("{name}{values}"), palette.share(share))])
}
