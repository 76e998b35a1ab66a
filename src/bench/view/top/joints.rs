//! Joints: position, torque, share of the greatest torque, and whether the sample was in time.

use ratatui::style::Style;

use super::number::{bar, fixed, percent};
use super::page::{ScreenRow, row};
use super::palette::Palette;
use super::state::State;
use super::text::fitted;
use super::value::{at, nth, number, text};

/// Number of joints of a hand controller.
pub(super) const JOINTS: usize = 6;

/// Columns of a name on a wide screen.
const NAME: usize = 14;

/// Values of a joint.
struct Values {
    name: String,
    position: Option<f64>,
    position_unit: String,
    torque: Option<f64>,
    torque_unit: String,
    share: Option<f64>,
    is_sampled: Option<bool>,
    is_zero_unknown: bool,
}

impl Values {
    /// Formats the position; one without a zero has none.
    fn position(&self, columns: usize, digits: usize) -> String {
        if self.is_zero_unknown {
            format!("{:>columns$}", "unknown")
        } else {
            fixed(self.position, columns, digits)
        }
    }
}

fn values(state: &State, place: usize) -> Values {
    let description = state.joint(place);
    let snapshot = |key| nth(at(&state.snapshot, &[key]), place);
    let unit =
        |key, default: &str| text(at(description, &[key])).unwrap_or_else(|| default.to_owned());
    Values {
        name: state.joint_name(place),
        position: number(snapshot("q")),
        position_unit: fitted(&unit("position_unit", ""), 3),
        torque: number(snapshot("tau")),
        torque_unit: fitted(&unit("torque_unit", ""), 3),
        share: number(snapshot("limit_used")),
        is_sampled: snapshot("sampled").as_bool(),
        is_zero_unknown: state.unknown_zero(place).is_some(),
    }
}

/// Returns the heading of the table of at least 80 columns.
pub(super) fn heading(columns: usize) -> ScreenRow {
    let bar = bar_columns(columns) + 6;
    let text = format!(
        "{:NAME$} {:>9}     {:>9}      {:bar$}  {:7}",
        "joint", "position", "torque", "of its limit", "sample"
    );
    row([(text, Palette::strong())])
}

/// Returns a row for each joint, of at least 80 columns.
pub(super) fn wide(state: &State, palette: Palette, columns: usize) -> Vec<ScreenRow> {
    let of_joint = |place| {
        let values = values(state, place);
        let position = values.position(9, 3);
        let Values { name, position_unit, torque, torque_unit, share, is_sampled, .. } = values;
        let (sample, sample_style) = match is_sampled {
            Some(true) => ("in time", Style::new()),
            Some(false) => ("MISSED", palette.bad()),
            None => ("–", Style::new()),
        };
        let (name, torque) = (fitted(&name, NAME), fixed(torque, 9, 2));
        row([
            (format!("{name} {position} {position_unit} {torque} {torque_unit}  "), Style::new()),
            (
                format!("{} {}", bar(share, bar_columns(columns)), percent(share)),
                palette.share(share),
            ),
            ("  ".to_owned(), Style::new()),
            (sample.to_owned(), sample_style),
        ])
    };
    (0..JOINTS).map(of_joint).collect()
}

fn bar_columns(columns: usize) -> usize {
    columns.saturating_sub(NAME + 45)
}

/// Returns a row for each joint, of at least 40 columns; a missed sample has an exclamation mark.
pub(super) fn narrow(state: &State, palette: Palette, columns: usize) -> Vec<ScreenRow> {
    let of_joint = |place| {
        let values = values(state, place);
        let position = values.position(7, 3);
        let Values { name, position_unit, torque, torque_unit, share, is_sampled, .. } = values;
        let name = fitted(&name, columns.saturating_sub(30));
        let torque = fixed(torque, 8, 2);
        let missed = if is_sampled == Some(false) { "!" } else { "" };
        row([
            (format!("{name}{position} {position_unit}{torque} {torque_unit} "), Style::new()),
            (percent(share), palette.share(share)),
            (missed.to_owned(), palette.bad()),
        ])
    };
    (0..JOINTS).map(of_joint).collect()
}
