//! Tables, picture and CSV of the runs over a link.

use super::{Figure, LINKS, Part};
use crate::command::table::{self, Column, Table};
use crate::delay::link::LinkConditions;
use crate::delay::measurement::Outcome;
use crate::delay::script::CommandMode;
use crate::delay::trial::TrialResult;
use crate::pool;
use picture::{Ink, Panel, Series};

/// Names of the columns of runs.csv.
const HEAD: &str = "part,led,commanded,delay_ms,jitter_ms,loss_percent,max_age_ms,k_t,has_layer,is_accepted,outcome,\
unrest_m_per_s,reflected_n,driven_j,taken_j,largest_nm";

/// Meaning of the columns of each table.
const ACCEPTED_NOTE: &str = "given up: of the free object's K_T at no delay; mJ: energy with which contact drove the hand; taken: energy that the \
passivity layer took from the hand";
const MAP_NOTE: &str = "calm: the hand rests at the wall; layer: it rests with the passivity layer alone; swings, stopped: also with it; ✓: \
frhc check accepts gains and delay";
const DISTURBED_NOTE: &str = "reflected at the end: mean of the last second at the wall; largest torque: of a joint, beyond gravity compensation, in \
the whole run; ended: since the start of the outage";

/// Mark of a gain that the gain check accepts.
const ACCEPTED: &str = " ✓";

/// Returns the tables: accepted gain by delay, maps of both modes, and disturbed links.
pub(super) fn tables(figures: &[Figure]) -> Vec<Table> {
    let mut accepted = accepted(figures);
    let shaking = figures.iter().filter_map(|Figure { row, .. }| Some((&row.led, row.shaking?)));
    if let Some((led, shaking)) = shaking.max_by(|(_, a), (_, b)| a.peak_n.total_cmp(&b.peak_n)) {
        accepted.note.push_str(&format!("; {led} {shaking}"));
    }
    vec![
        accepted,
        map(figures, CommandMode::Pose),
        map(figures, CommandMode::Rate),
        disturbed(figures),
    ]
}

/// Runs of the same settings without and with the passivity layer.
struct Pair<'f> {
    without: &'f TrialResult,
    with: &'f TrialResult,
}

/// Returns the pairs of a part, in their order.
fn pairs(figures: &[Figure], part: Part) -> Vec<Pair<'_>> {
    let rows: Vec<&TrialResult> = rows(figures, part).collect();
    let pairs = rows.chunks_exact(2).filter_map(|pair| match pair {
        [without, with] => Some(Pair { without, with }),
        _ => None,
    });
    pairs.collect()
}

fn rows(figures: &[Figure], part: Part) -> impl Iterator<Item = &TrialResult> {
    figures.iter().filter(move |figure| figure.part == part).map(|figure| &figure.row)
}

/// Runs of both modes at one delay, and the largest accepted K_T of all delays.
struct DelayRow<'p, 'f> {
    pose: &'p Pair<'f>,
    rate: &'p Pair<'f>,
    most: f64,
}

/// Returns the table of the largest accepted gain and contact in both modes, a row per delay and object or arm.
fn accepted(figures: &[Figure]) -> Table {
    let pairs = pairs(figures, Part::Accepted);
    let most = pool::max(pairs.iter().map(|pair| pair.with.k_t));
    let delayed = pairs.chunks_exact(2).filter_map(|modes| match modes {
        [pose, rate] => Some(DelayRow { pose, rate, most }),
        _ => None,
    });
    let columns: [Column<DelayRow<'_, '_>>; 12] = [
        ("one way, ms", |of| format!("{:.0}", of.pose.with.link.delay_ms)),
        ("max age, ms", |of| format!("{:.0}", of.pose.with.link.max_age_ms)),
        ("the hand leads", |of| of.pose.with.led.clone()),
        ("K_T", |of| format!("{:.2}", of.pose.with.k_t)),
        ("K_T k_e, N/m", |of| format!("{:.0}", of.pose.with.displayed_stiffness_n_per_m)),
        ("given up, %", |of| format!("{:.0}", 100.0 * (1.0 - of.pose.with.k_t / of.most))),
        ("pose: without layer, mJ", |of| driven(of.pose.without)),
        ("with layer, mJ", |of| driven(of.pose.with)),
        ("taken, mJ", |of| taken(of.pose)),
        ("rate: without layer, mJ", |of| driven(of.rate.without)),
        ("with layer, mJ", |of| driven(of.rate.with)),
        ("taken, mJ", |of| taken(of.rate)),
    ];
    Table::new(delayed, columns, ACCEPTED_NOTE)
        .below("the largest K_T that frhc check accepts, and contact with it")
}

fn driven(row: &TrialResult) -> String {
    format!("{}, {:.0}", row.outcome, 1e3 * row.driven_j)
}

fn taken(pair: &Pair<'_>) -> String {
    format!("{:.0}", 1e3 * pair.with.taken_j)
}

/// Returns the pairs of the map in one mode.
fn mapped(figures: &[Figure], commanded: CommandMode) -> Vec<Pair<'_>> {
    let mut pairs = pairs(figures, Part::Map);
    pairs.retain(|pair| pair.with.commanded == commanded);
    pairs
}

/// Returns the map of one mode: a row per gain, a column per delay.
fn map(figures: &[Figure], commanded: CommandMode) -> Table {
    let pairs = mapped(figures, commanded);
    let gains = || pairs.chunk_by(|a, b| same(a.with.k_t, b.with.k_t));
    let delays = gains().next().into_iter().flatten();
    let delays = delays.map(|pair| format!("{:.0} ms", pair.with.link.delay_ms));
    let row = |gain: &[Pair<'_>]| {
        let k_t = gain.first().map(|pair| format!("{:.2}", pair.with.k_t));
        k_t.into_iter().chain(gain.iter().map(cell)).collect()
    };
    Table {
        lead: Some(format!("{commanded} mode, the free object, K_T over the delay of one way")),
        columns: ["K_T".to_owned()].into_iter().chain(delays).collect(),
        rows: gains().map(row).collect(),
        note: MAP_NOTE.to_owned(),
    }
}

fn same(a: f64, b: f64) -> bool {
    a.total_cmp(&b).is_eq()
}

fn cell(Pair { without, with }: &Pair<'_>) -> String {
    let word = match (without.outcome, with.outcome) {
        (Outcome::Calm, Outcome::Calm) => "calm".to_owned(),
        (_, Outcome::Calm) => "layer".to_owned(),
        (_, outcome) => outcome.to_string(),
    };
    word + if with.is_accepted { ACCEPTED } else { "" }
}

/// Returns the table of disturbed links, one row each.
fn disturbed(figures: &[Figure]) -> Table {
    let columns: [Column<&TrialResult>; 9] = [
        ("one way, ms", |row| format!("{:.0}", row.link.delay_ms)),
        ("jitter, ms", |row| format!("{:.0}", row.link.jitter_ms)),
        ("lost, %", |row| format!("{:.0}", row.link.loss_percent)),
        ("outage, ms", |row| millis(row.link.outage_s.map(|[start, end]| end - start))),
        ("max age, ms", |row| format!("{:.0}", row.link.max_age_ms)),
        ("outcome", |row| row.outcome.to_string()),
        ("reflected at the end, N", |row| format!("{:.1}", row.reflected_n)),
        ("largest torque, N·m", |row| format!("{:.2}", row.largest_nm)),
        ("reflection ended after, ms", |row| millis(row.reflected_for_s)),
    ];
    Table::new(rows(figures, Part::Disturbed), columns, DISTURBED_NOTE)
        .below("links that jitter, are too slow, or fail; pose mode, K_T as configured")
}

fn millis(seconds: Option<f64>) -> String {
    seconds.map_or_else(|| "–".to_owned(), |seconds| format!("{:.0}", 1e3 * seconds))
}

/// Returns a panel per mode: the gain up to which contact is calm, over the delay.
pub(super) fn panels(figures: &[Figure]) -> Vec<Panel> {
    let mut accepted: Vec<[f64; 2]> =
        rows(figures, Part::Accepted).map(|row| [row.link.delay_ms, row.k_t]).collect();
    // The first run at each delay is that of the free object, as in the map.
    accepted.dedup_by(|after, before| same(after[0], before[0]));
    let panel = |commanded: CommandMode| {
        let pairs = mapped(figures, commanded);
        let calm = |name: &str, row: fn(&Pair<'_>) -> Outcome| {
            let largest = LINKS.iter().filter_map(|[delay, _]| {
                let at_delay = pairs.iter().filter(|pair| same(pair.with.link.delay_ms, *delay));
                let calm = at_delay.take_while(|pair| row(pair) == Outcome::Calm).last();
                calm.map(|pair| [*delay, pair.with.k_t])
            });
            Series::new(name, Ink::Line, largest)
        };
        let title = format!("{commanded} mode: largest K_T at which the hand rests");
        let series = [
            calm("with the layer", |pair| pair.with.outcome),
            calm("without it", |pair| pair.without.outcome),
            Series::new("frhc check", Ink::Dashed, accepted.clone()),
        ];
        Panel::new(title, ["delay of one way, ms", "K_T"], series)
    };
    [CommandMode::Pose, CommandMode::Rate].map(panel).into()
}

/// Returns all runs.
pub(super) fn csv(figures: &[Figure]) -> anyhow::Result<String> {
    let run = |Figure { part, row }: &Figure| {
        let LinkConditions { delay_ms, jitter_ms, loss_percent, max_age_ms, .. } = row.link;
        let numbers = [delay_ms, jitter_ms, loss_percent, max_age_ms, row.k_t];
        let measured =
            [row.unrest_m_per_s, row.reflected_n, row.driven_j, row.taken_j, row.largest_nm];
        let (is_accepted, outcome) = (row.is_accepted, row.outcome);
        (
            *part,
            row.led.clone(),
            row.commanded,
            numbers,
            row.has_layer,
            is_accepted,
            outcome,
            measured,
        )
    };
    table::csv(HEAD, figures.iter().map(run))
}
