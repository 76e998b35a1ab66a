//! Positions and torques of the joints, the torques with their terms by the ledger.

use crate::gather::LEDGER;
use crate::html::Html;
use crate::view::{View, small};
use crate::words::with_unit;
use picture::strip::{Curve, Plot};

/// Colours of the ledger's parts, as [`LEDGER`], and of the total: the same for each joint.
const COLOURS: [usize; 7] = [0, 2, 1, 4, 3, 5, 7];
const TOTAL: usize = 6;

/// Joints of a picture of torques: half of them, so that a page has room for it.
const PER_PICTURE: usize = 3;

/// Writes the positions.
pub(crate) fn positions(html: &mut Html, view: &View<'_>) {
    html.section("positions", "Positions");
    let q = &view.gathered.q;
    if q.is_empty() {
        html.missing("Positions need a configuration, which says what the drives' frames mean: give --config FILE.");
        html.end_section();
        return;
    }
    let plots = view.units().into_iter().enumerate().map(|(place, (name, unit, _))| {
        small(Plot::new(name, unit, [q.curve(place, name, 1.0, 0.0)]), 52.0)
    });
    let picture = view.strip("Position of each joint over time", plots);
    html.figure(|width| picture.svg(width), "Position of each joint. An area shows least and greatest value where a pixel has many cycles.");
    html.end_section();
}

/// Writes the torques.
pub(crate) fn torques(html: &mut Html, view: &View<'_>) {
    html.section("torques", "Torques");
    if view.gathered.tau.is_empty() {
        html.missing("Torques need a configuration, which says what the drives' frames mean: give --config FILE.");
        html.end_section();
        return;
    }
    if !view.gathered.has_replay() {
        html.missing(&view.without_replay("The parts of the torques"));
    }
    let plots: Vec<Plot> = (0..6).map(|place| torque(view, place)).collect();
    for (half, plots) in plots.chunks(PER_PICTURE).enumerate() {
        let names: Vec<&str> = view
            .joints
            .iter()
            .skip(half * PER_PICTURE)
            .take(PER_PICTURE)
            .map(String::as_str)
            .collect();
        let names = names.join(", ");
        let picture = view.strip(&format!("Torques of {names} over time"), plots.to_vec());
        html.figure(
            |width| picture.svg(width),
            &format!("Commanded torque of {names} (Eq. 10), and the parts it is made of, before they are limited. Parts that are zero throughout are left out."),
        );
    }
    let peaks = view.units().into_iter().zip(view.gathered.figures.torques);
    let peaks: Vec<String> =
        peaks.map(|((name, _, unit), peak)| format!("{name} {}", with_unit(peak, unit))).collect();
    html.paragraph(&format!("Greatest torque: {}.", peaks.join(", ")));
    html.end_section();
}

fn torque(view: &View<'_>, place: usize) -> Plot {
    let (name, _, unit) = view.units().get(place).copied().unwrap_or(("", "", ""));
    let mut curves: Vec<Curve> = Vec::new();
    for (part, (title, colour)) in LEDGER.iter().zip(COLOURS).enumerate() {
        let at = place * LEDGER.len() + part;
        if view.gathered.ledger.is_used(at) {
            curves.push(Curve { colour, ..view.gathered.ledger.curve(at, title, 1.0, 0.0) });
        }
    }
    curves.push(Curve { colour: TOTAL, ..view.gathered.tau.curve(place, "commanded", 1.0, 0.0) });
    Plot { curves, height: 96.0, ..Plot::new(name, unit, []) }
}
