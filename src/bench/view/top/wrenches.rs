//! Wrenches on the object and on the hand, the command, and the reflection port.

use ratatui::style::Style;

use super::number::{fixed, percent};
use super::page::{ScreenRow, plain, row};
use super::palette::Palette;
use super::state::State;
use super::text::{cut, fitted};
use super::value::{at, magnitude, number, numbers, text};

/// Wrenches with their keys and names, the most important first.
const WRENCHES: [(&str, &str); 3] =
    [("f_s", "sensed f_s"), ("f_g", "felt f_g"), ("f_g_task", "task f_g")];

/// Force and moment of a wrench.
struct Wrench {
    force: [Option<f64>; 3],
    moment: [Option<f64>; 3],
}

fn wrench(state: &State, key: &str) -> Wrench {
    let [fx, fy, fz, mx, my, mz] = numbers(at(&state.snapshot, &[key]));
    Wrench { force: [fx, fy, fz], moment: [mx, my, mz] }
}

fn fixed_all(values: &[Option<f64>], width: usize, decimals: usize) -> String {
    values.iter().map(|value| fixed(*value, width, decimals)).collect()
}

/// Returns the wrenches with their components, below a heading: 80 columns.
pub(super) fn wide(state: &State) -> Vec<ScreenRow> {
    let heading = format!(
        "{:10}{:>8}{:>8}{:>8}{:>9}  {:>8}{:>8}{:>8}{:>11}",
        "wrench", "x", "y", "z", "force N", "x", "y", "z", "moment N·m"
    );
    let of_key = |(key, name): (&str, &str)| {
        let Wrench { force, moment } = wrench(state, key);
        row([
            (format!("{name:10}{}", fixed_all(&force, 8, 2)), Style::new()),
            (fixed(magnitude(&force), 9, 2), Palette::strong()),
            (format!("  {}", fixed_all(&moment, 8, 3)), Style::new()),
            (fixed(magnitude(&moment), 11, 3), Palette::strong()),
        ])
    };
    [row([(heading, Palette::strong())])].into_iter().chain(WRENCHES.map(of_key)).collect()
}

/// Returns the magnitudes of the forces on the object and on the hand: 40 columns.
pub(super) fn forces(state: &State) -> ScreenRow {
    let force = |key| fixed(magnitude(&wrench(state, key).force), 8, 2);
    plain(format!("sensed{} N   felt{} N", force("f_s"), force("f_g")))
}

/// Returns the components of the forces and moments: 40 columns.
pub(super) fn components(state: &State) -> Vec<ScreenRow> {
    let of_key = |(key, name): (&str, &str)| {
        let Wrench { force, moment } = wrench(state, key);
        let force = plain(format!("{name:10}{} N", fixed_all(&force, 8, 2)));
        [force, plain(format!("{:10}{} N·m", "", fixed_all(&moment, 8, 3)))]
    };
    WRENCHES.into_iter().flat_map(of_key).collect()
}

/// Returns the command: 80 columns.
pub(super) fn command(state: &State) -> ScreenRow {
    let command = at(&state.snapshot, &["command"]);
    let kind = text(at(command, &["kind"])).unwrap_or_else(|| "–".to_owned());
    let name = format!("command   {}", fitted(&kind, 6));
    plain(match kind.as_str() {
        "rate" => {
            let [x, y, z, a, b, c] = numbers(at(command, &["v_m"]));
            let (linear, angular) = (fixed_all(&[x, y, z], 8, 4), fixed_all(&[a, b, c], 8, 4));
            format!("{name}{linear} m/s{angular} rad/s")
        }
        "pose" => {
            let position: [Option<f64>; 3] = numbers(at(command, &["x_b_d", "position"]));
            let quaternion: [Option<f64>; 4] = numbers(at(command, &["x_b_d", "quaternion"]));
            format!("{name}{} m   q{}", fixed_all(&position, 8, 4), fixed_all(&quaternion, 7, 3))
        }
        _ => name,
    })
}

/// Returns the command as its speeds or its position: 40 columns.
pub(super) fn short_command(state: &State) -> ScreenRow {
    let command = at(&state.snapshot, &["command"]);
    let kind = text(at(command, &["kind"])).unwrap_or_else(|| "–".to_owned());
    let name = format!("command {}", fitted(&kind, 5));
    plain(match kind.as_str() {
        "rate" => {
            let [x, y, z, a, b, c] = numbers(at(command, &["v_m"]));
            let speed = |components: [Option<f64>; 3]| fixed(magnitude(&components), 7, 3);
            format!("{name}{} m/s{} rad/s", speed([x, y, z]), speed([a, b, c]))
        }
        "pose" => {
            let position: [Option<f64>; 3] = numbers(at(command, &["x_b_d", "position"]));
            format!("{name}{} m", fixed_all(&position, 8, 3))
        }
        _ => name,
    })
}

/// Returns reflection and energy of its port: 80 columns.
pub(super) fn port(state: &State) -> ScreenRow {
    let value = |key| number(at(&state.snapshot, &[key]));
    let (energy, tank) = (fixed(value("energy"), 8, 4), fixed(value("tank"), 8, 4));
    let dampers = percent(value("activity"));
    plain(format!(
        "reflection {}   energy{energy} J  tank{tank} J  dampers {dampers}",
        reflection(state)
    ))
}

/// Returns reflection and energy of its port in two rows: 40 columns.
pub(super) fn short_port(state: &State) -> Vec<ScreenRow> {
    let value = |key| number(at(&state.snapshot, &[key]));
    let (energy, tank) = (fixed(value("energy"), 8, 4), fixed(value("tank"), 8, 4));
    let port = format!("energy{energy} J  tank{tank} J");
    vec![plain(format!("reflection {}", reflection(state))), plain(port)]
}

/// Returns the scales other than 1, the locked axes and a running alignment; `None` without an adjustment.
pub(super) fn adjusted(state: &State, columns: usize) -> Option<ScreenRow> {
    let snapshot = &state.snapshot;
    let scale = |quantity: &str| {
        let factor = fixed(number(at(snapshot, &["scale", quantity])), 4, 2);
        let factor = factor.trim_start();
        (!matches!(factor, "1.00" | "–")).then(|| format!("{quantity} × {factor}"))
    };
    let scales = ["motion", "rotation", "force"].into_iter().filter_map(scale);
    let locked = at(snapshot, &["locked"]).as_array().into_iter().flatten().take(6);
    let locked = locked.filter_map(text).map(|axis| format!("{axis} locked"));
    let aligning = at(snapshot, &["aligning"]).as_bool() == Some(true);
    let parts = scales.chain(locked).chain(aligning.then(|| "aligning".to_owned()));
    let parts = parts.collect::<Vec<_>>().join(", ");
    (!parts.is_empty()).then(|| plain(cut(&format!("adjusted  {parts}"), columns)))
}

/// Returns measured and commanded opening and force of the gripper, or its state; `None` without a gripper command.
pub(super) fn gripper(state: &State, columns: usize) -> Option<ScreenRow> {
    let gripper = at(&state.snapshot, &["gripper"]);
    let description = text(at(gripper, &["state"]))?;
    let value = |key| number(at(gripper, &[key]));
    let newtons = |key| format!("{} N", fixed(value(key), 6, 1).trim_start());
    let millimetres =
        |key| format!("{} mm", fixed(value(key).map(|metres| 1e3 * metres), 7, 1).trim_start());
    let (opening, commanded) = (millimetres("opening_m"), millimetres("commanded_m"));
    let text = match (value("opening_m"), value("commanded_m")) {
        (Some(_), Some(_)) => {
            let (force, most) = (newtons("force_n"), newtons("max_force_n"));
            format!("{opening}, {force}   commanded {commanded}, at most {most}")
        }
        (Some(_), None) => format!("{opening}   {description}"),
        (None, _) => description,
    };
    Some(plain(cut(&format!("gripper   {text}"), columns)))
}

fn reflection(state: &State) -> String {
    fitted(&text(at(&state.snapshot, &["reflection"])).unwrap_or_else(|| "–".to_owned()), 15)
}
