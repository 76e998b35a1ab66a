//! Tables, picture and CSV of the runs over a link.

use std::fmt::Write;

use super::{Figure, LINKS, Part};
use crate::command::picture::{Ink, Panel, Series};
use crate::command::table::Table;
use crate::delay::measured::Outcome;
use crate::delay::script::Commanded;
use crate::delay::trial::Row;

/// Mark of a gain that the gain check accepts.
const ACCEPTED: &str = " ✓";

/// Returns what each delay costs, the maps, and the links that are disturbed.
pub(super) fn tables(figures: &[Figure]) -> Vec<Table> {
    let mut accepted = accepted(figures);
    let shaking = figures.iter().filter_map(|Figure { row, .. }| Some((&row.led, row.shaking?)));
    if let Some((led, shaking)) = shaking.max_by(|(_, a), (_, b)| a.peak_n.total_cmp(&b.peak_n)) {
        accepted.note.push_str(&format!("; {led} {shaking}"));
    }
    vec![accepted, map(figures, Commanded::Pose), map(figures, Commanded::Rate), disturbed(figures)]
}

/// A run without the layer, and the same with it.
struct Pair<'f> {
    without: &'f Row,
    with: &'f Row,
}

/// Returns the pairs of a part, in their order.
fn pairs(figures: &[Figure], part: Part) -> Vec<Pair<'_>> {
    let rows: Vec<&Row> = rows(figures, part).collect();
    let pairs = rows.chunks_exact(2).filter_map(|pair| match pair {
        [without, with] => Some(Pair { without, with }),
        _ => None,
    });
    pairs.collect()
}

fn rows(figures: &[Figure], part: Part) -> impl Iterator<Item = &Row> {
    figures.iter().filter(move |figure| figure.part == part).map(|figure| &figure.row)
}

/// One row per delay and what is led: the largest accepted gain, and contact with it in both modes.
fn accepted(figures: &[Figure]) -> Table {
    let pairs = pairs(figures, Part::Accepted);
    let most = pairs.iter().map(|pair| pair.with.k_t).fold(0.0, f64::max);
    let energy = |Pair { without, with }: &Pair<'_>| {
        [
            format!("{}, {:.0}", without.outcome, 1e3 * without.driven_j),
            format!("{}, {:.0}", with.outcome, 1e3 * with.driven_j),
            format!("{:.0}", 1e3 * with.taken_j),
        ]
    };
    let row = |modes: &[Pair<'_>]| {
        let [pose, rate] = modes else { return Vec::new() };
        let Row { link, led, k_t, felt_stiffness_n_per_m, .. } = pose.with;
        let head = [
            format!("{:.0}", link.delay_ms),
            format!("{:.0}", link.max_age_ms),
            led.clone(),
            format!("{k_t:.2}"),
            format!("{felt_stiffness_n_per_m:.0}"),
            format!("{:.0}", 100.0 * (1.0 - k_t / most)),
        ];
        head.into_iter().chain(energy(pose)).chain(energy(rate)).collect()
    };
    Table {
        lead: Some("the largest K_T that frhc check accepts, and contact with it".to_owned()),
        columns: vec![
            "one way, ms",
            "max age, ms",
            "the hand leads",
            "K_T",
            "K_T k_e, N/m",
            "given up, %",
            "pose: without layer, mJ",
            "with layer, mJ",
            "taken, mJ",
            "rate: without layer, mJ",
            "with layer, mJ",
            "taken, mJ",
        ],
        rows: pairs.chunks_exact(2).map(row).collect(),
        note: "given up: of the free object's K_T at no delay; mJ: energy with which contact drove the hand; taken: energy that the \
               passivity layer took from the hand"
            .to_owned(),
    }
}

/// One row per gain, one column per delay.
fn map(figures: &[Figure], commanded: Commanded) -> Table {
    let pairs = pairs(figures, Part::Map);
    let of_mode: Vec<&Pair<'_>> =
        pairs.iter().filter(|pair| pair.with.commanded == commanded).collect();
    let first = of_mode.first().map_or(f64::NAN, |pair| pair.with.k_t);
    let delays = of_mode.iter().filter(|pair| same(pair.with.k_t, first));
    let columns = delays.map(|pair| column(pair.with.link.delay_ms));
    let row = |gain: &[&Pair<'_>]| {
        let k_t = gain.first().map(|pair| format!("{:.2}", pair.with.k_t));
        k_t.into_iter().chain(gain.iter().map(|pair| cell(pair))).collect()
    };
    Table {
        lead: Some(format!("{commanded} mode, the free object, K_T over the delay of one way")),
        columns: ["K_T"].into_iter().chain(columns).collect(),
        rows: of_mode.chunk_by(|a, b| same(a.with.k_t, b.with.k_t)).map(row).collect(),
        note: "calm: the hand rests at the wall; layer: it rests with the passivity layer alone; swings, stopped: also with it; ✓: \
               frhc check accepts gains and delay"
            .to_owned(),
    }
}

fn same(a: f64, b: f64) -> bool {
    a.total_cmp(&b).is_eq()
}

/// Returns the name of a delay's column.
fn column(delay_ms: f64) -> &'static str {
    let names = ["0 ms", "2 ms", "5 ms", "8 ms", "20 ms", "40 ms"];
    let place = LINKS.iter().position(|[delay, _]| same(*delay, delay_ms));
    place.and_then(|place| names.get(place)).copied().unwrap_or_default()
}

fn cell(Pair { without, with }: &Pair<'_>) -> String {
    let word = match (without.outcome, with.outcome) {
        (Outcome::Calm, Outcome::Calm) => "calm".to_owned(),
        (_, Outcome::Calm) => "layer".to_owned(),
        (_, outcome) => outcome.to_string(),
    };
    word + if with.is_accepted { ACCEPTED } else { "" }
}

/// One row per link.
fn disturbed(figures: &[Figure]) -> Table {
    let row = |row: &Row| {
        let link = &row.link;
        let outage = link.outage_s.map(|[start, end]| format!("{:.0}", 1e3 * (end - start)));
        let ended = row.reflected_for_s.map(|seconds| format!("{:.0}", 1e3 * seconds));
        vec![
            format!("{:.0}", link.delay_ms),
            format!("{:.0}", link.jitter_ms),
            format!("{:.0}", link.loss_percent),
            outage.unwrap_or_else(|| "–".to_owned()),
            format!("{:.0}", link.max_age_ms),
            row.outcome.to_string(),
            format!("{:.1}", row.reflected_n),
            format!("{:.2}", row.largest_nm),
            ended.unwrap_or_else(|| "–".to_owned()),
        ]
    };
    Table {
        lead: Some("links that jitter, are too slow, or fail; pose mode, K_T as configured".to_owned()),
        columns: vec![
            "one way, ms",
            "jitter, ms",
            "lost, %",
            "outage, ms",
            "max age, ms",
            "outcome",
            "reflected at the end, N",
            "largest torque, N·m",
            "reflection ended after, ms",
        ],
        rows: rows(figures, Part::Disturbed).map(row).collect(),
        note: "reflected at the end: mean of the last second at the wall; largest torque: of a joint, beyond gravity compensation, in \
               the whole run; ended: since the start of the outage"
            .to_owned(),
    }
}

/// Returns the largest gain that is calm with all smaller ones, over the delay, in either mode.
pub(super) fn panels(figures: &[Figure]) -> Vec<Panel> {
    let panel = |commanded: Commanded| {
        let pairs = pairs(figures, Part::Map);
        let of_mode: Vec<&Pair<'_>> =
            pairs.iter().filter(|pair| pair.with.commanded == commanded).collect();
        let points = |is_calm: fn(&Pair<'_>) -> bool| {
            LINKS.map(|[delay, _]| {
                let at_delay = of_mode.iter().filter(|pair| same(pair.with.link.delay_ms, delay));
                let calm = at_delay.take_while(|pair| is_calm(pair)).last();
                calm.map(|pair| [delay, pair.with.k_t])
            })
        };
        let curve = |name: &str, ink: Ink, is_calm: fn(&Pair<'_>) -> bool| {
            Series::new(name, ink, points(is_calm).into_iter().flatten().collect())
        };
        let mut accepted: Vec<[f64; 2]> =
            rows(figures, Part::Accepted).map(|row| [row.link.delay_ms, row.k_t]).collect();
        // The free object, as in the map, is the first at each delay.
        accepted.dedup_by(|after, before| same(after[0], before[0]));
        Panel {
            title: format!("{commanded} mode: largest K_T at which the hand rests"),
            axes: ["delay of one way, ms", "K_T"],
            places: Vec::new(),
            series: vec![
                curve("with the layer", Ink::Line, |pair| pair.with.outcome == Outcome::Calm),
                curve("without it", Ink::Line, |pair| pair.without.outcome == Outcome::Calm),
                Series::new("frhc check", Ink::Dashed, accepted),
            ],
        }
    };
    [Commanded::Pose, Commanded::Rate].map(panel).into()
}

/// Returns all runs.
pub(super) fn csv(figures: &[Figure]) -> String {
    let mut text = "part,led,commanded,delay_ms,jitter_ms,loss_percent,max_age_ms,k_t,has_layer,is_accepted,outcome,\
                    unrest_m_per_s,reflected_n,driven_j,taken_j,largest_nm\n"
        .to_owned();
    for Figure { part, row } in figures {
        let part = match part {
            Part::Accepted => "accepted",
            Part::Map => "map",
            Part::Disturbed => "disturbed",
        };
        let link = &row.link;
        let numbers = [link.delay_ms, link.jitter_ms, link.loss_percent, link.max_age_ms, row.k_t];
        let numbers = numbers.map(|number| number.to_string()).join(",");
        let measured =
            [row.unrest_m_per_s, row.reflected_n, row.driven_j, row.taken_j, row.largest_nm];
        let measured = measured.map(|number| format!("{number:.9e}")).join(",");
        let (led, outcome) = (row.led.replace(',', ";"), row.outcome.to_string().replace(' ', "_"));
        _ = writeln!(
            text,
            "{part},{led},{},{numbers},{},{},{outcome},{measured}",
            row.commanded, row.has_layer, row.is_accepted
        );
    }
    text
}
