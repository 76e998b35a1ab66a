//! Torque budget: the components of each joint's torque, in its unit.

use super::joints::JOINTS;
use super::number::{fixed, percent};
use super::page::{ScreenRow, plain, row};
use super::palette::Palette;
use super::state::State;
use super::text::fitted;
use super::value::{at, nth, number};

/// Components: key, name, and columns.
const COMPONENTS: [(&str, &str, usize); 7] = [
    ("task", "task", 9),
    ("gravity", "gravity", 9),
    ("centring", "centring", 9),
    ("damping", "damping", 9),
    ("passivity", "passivity", 11),
    ("soft_stops", "soft stops", 11),
    ("friction", "friction", 9),
];

/// Columns of a joint's name.
const NAME: usize = 13;

/// Returns the budget of each joint below a heading, and the scales of its terms: 80 columns.
pub(super) fn table(state: &State) -> Vec<ScreenRow> {
    let budget = |key: &'static str| at(&state.snapshot, &["budget", key]);
    let names: String =
        COMPONENTS.iter().map(|(_, name, columns)| format!("{name:>columns$}")).collect();
    let heading = row([(format!("{:NAME$}{names}", "torque budget"), Palette::strong())]);
    let of_joint = |place| {
        let component = |(key, _, columns): (&'static str, &str, usize)| {
            fixed(number(nth(budget(key), place)), columns, 2)
        };
        let components: String = COMPONENTS.map(component).concat();
        plain(format!("{}{components}", fitted(&state.joint_name(place), NAME)))
    };
    let limiting =
        budget("limiting_joint").as_u64().and_then(|number| usize::try_from(number).ok());
    let limiting =
        limiting.and_then(|number| number.checked_sub(1)).map(|place| state.joint_name(place));
    let scales = format!(
        "scales: assist {}   task and assist {}   set by {}",
        percent(number(budget("assist_scale"))),
        percent(number(budget("rest_scale"))),
        fitted(limiting.as_deref().unwrap_or("–"), 20)
    );
    [heading].into_iter().chain((0..JOINTS).map(of_joint)).chain([plain(scales)]).collect()
}
