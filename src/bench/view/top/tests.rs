//! Screen as a terminal of a given size has it.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::style::Color;
use serde_json::{Value, json};

use super::choices::View;
use super::palette::Palette;
use super::state::State;
use super::text::width;
use super::view::Scene;
use crate::feed::{Kind, Line, News};

/// Lines of a node: description, mode and snapshot.
const FEED: &str = include_str!("../../../../tests/golden/telemetry.jsonl");

/// Marks screens in the golden file.
const MARK: &str = "=== ";

/// Returns the lines of [`FEED`].
fn feed() -> [Value; 3] {
    let lines: Vec<Value> = FEED.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    lines.try_into().unwrap()
}

fn state(lines: &[Value]) -> State {
    let mut state = State::default();
    for value in lines {
        let kind = serde_json::from_value::<Kind>(value["kind"].clone()).unwrap();
        state.on_news(News::Line(Line { kind, text: value.to_string().into() }));
    }
    state
}

/// Returns a stop: two drives are not off.
fn stopped() -> State {
    let [description, mut mode, mut snapshot] = feed();
    let cause = "joint 3 (elbow): no sample for 3 cycles";
    for line in [&mut mode, &mut snapshot] {
        line["mode"] = json!("drives-off");
        line["stopped_by"] = json!(cause);
        line["reflection"] = json!("on when engaged");
    }
    mode["not_off"] = json!(["elbow", "roll"]);
    mode["way_out"] = json!([
        "The drives of elbow, roll did not report that they are off. Such a drive may push: press the emergency stop, which cuts its power by wire.",
        "Remove the cause at elbow: position samples of a drive missing for several cycles in a row.",
        "`frhc ctl status` shows the cause while it is present.",
        "`frhc ctl reset` ends the stop. It boots the network again, since a node may have lost its configuration, and fails while the cause is present.",
        "`frhc ctl arm` with the deadman released, if the node is ready, not armed; then release the deadman and press it again: both contacts open for 25 ms, then closed for 25 ms."
    ]);
    snapshot["not_off"] = json!([3, 6]);
    snapshot["sampled"][2] = json!(false);
    snapshot["limit_used"][1] = json!(0.93);
    snapshot["command"] = json!({ "kind": "hold" });
    state(&[description, snapshot, mode])
}

/// Returns a node on two buses that leads a robot in pose mode, with numbers that are not finite.
fn linked() -> State {
    let [mut description, mode, mut snapshot] = feed();
    description["buses"] = json!([
        { "name": "can0", "load_limit_percent": 85.5 }, { "name": "can1", "load_limit_percent": 90 }
    ]);
    snapshot["buses"] = json!([{ "load_percent": 77.1 }, { "load_percent": 78.2 }]);
    snapshot["command"] = json!({ "kind": "pose", "x_b_d": { "position": [0.45, -0.01, 0.2], "quaternion": [1, 0, 0, 0] } });
    snapshot["link"] = json!({ "connected": true, "far_side": "holding: no command for 50 ms", "round_trip_p50_ms": 1.25, "round_trip_p99_ms": 3.5, "lost": 12 });
    snapshot["scale"] = json!({ "motion": 0.5, "rotation": 1, "force": 0.25 });
    (snapshot["locked"], snapshot["aligning"]) = (json!(["z", "rx"]), json!(false));
    snapshot["gripper"] = json!({ "state": "commanded", "commanded_m": 0.0, "max_force_n": 15, "opening_m": 0.027, "force_n": 14.96 });
    snapshot["f_g"] = json!(null);
    snapshot["tau"][3] = json!(null);
    state(&[description, mode, snapshot])
}

fn screen(state: &State, view: View, (columns, rows): (u16, u16)) -> Terminal<TestBackend> {
    let mut terminal = Terminal::new(TestBackend::new(columns, rows)).unwrap();
    let scene = Scene { state, view, palette: Palette { is_coloured: true }, silent_s: None };
    terminal.draw(|frame| scene.draw(frame.area(), frame.buffer_mut())).unwrap();
    terminal
}

/// Returns the rows of the screen, without spaces at their ends.
fn rows(state: &State, view: View, size: (u16, u16)) -> Vec<String> {
    let terminal = screen(state, view, size);
    let buffer = terminal.backend().buffer();
    let row = |y| {
        let mut skipped = 0;
        let mut text = String::new();
        for x in 0..size.0 {
            let symbol = buffer[(x, y)].symbol();
            if skipped == 0 {
                text.push_str(symbol);
            }
            skipped = width(symbol).max(skipped).saturating_sub(1);
        }
        text.trim_end().to_owned()
    };
    (0..size.1).map(row).collect()
}

#[test]
fn screens_of_all_sizes_match_the_golden_file() {
    let paused = View { is_paused: true, ..View::default() };
    let budget = View { is_budget: true, ..View::default() };
    let mut absent = state(&feed());
    absent.on_news(News::Absent("No node offers /run/frhc-view/telemetry.sock.".to_owned()));
    let screens = [
        ("engaged 80x24", state(&feed()), View::default(), (80, 24)),
        ("engaged 40x12", state(&feed()), View::default(), (40, 12)),
        ("engaged 120x40", state(&feed()), View::default(), (120, 40)),
        ("engaged 20x5", state(&feed()), View::default(), (20, 5)),
        ("budget 80x24", state(&feed()), budget, (80, 24)),
        ("paused 40x12", state(&feed()), paused, (40, 12)),
        ("stopped 80x24", stopped(), View::default(), (80, 24)),
        ("stopped 80x40", stopped(), View::default(), (80, 40)),
        ("stopped 40x12", stopped(), View::default(), (40, 12)),
        ("linked 80x24", linked(), View::default(), (80, 24)),
        ("linked 40x12", linked(), View::default(), (40, 12)),
        ("linked 40x30", linked(), View::default(), (40, 30)),
        ("absent 80x24", absent, View::default(), (80, 24)),
        ("waiting 40x12", State::default(), View::default(), (40, 12)),
    ];
    let drawn = screens.map(|(name, state, view, size)| {
        format!("{MARK}{name}\n{}\n", rows(&state, view, size).join("\n"))
    });
    let drawn = drawn.concat();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../tests/golden/top.txt");
    if std::env::var_os("GOLDEN").is_some_and(|golden| golden == "write") {
        std::fs::write(path, &drawn).unwrap();
    }
    assert_eq!(drawn, std::fs::read_to_string(path).unwrap(), "GOLDEN=write writes it anew");
}

#[test]
fn page_of_the_book_shows_this_screen() {
    let page = include_str!("../../../../docs/top.md");
    let screen = rows(&state(&feed()), View::default(), (80, 24)).join("\n");
    assert!(page.contains(&format!("```text\n{screen}\n```")), "{screen}");
}

#[test]
fn no_row_is_wider_than_its_screen() {
    for state in [state(&feed()), stopped(), linked(), hostile(), extreme(), State::default()] {
        for columns in 40..200 {
            let palette = Palette { is_coloured: true };
            let scene = |is_budget| Scene {
                state: &state,
                view: View { is_budget, is_paused: is_budget },
                palette,
                silent_s: Some(7),
            };
            for row in [scene(false).all_rows(columns), scene(true).all_rows(columns)].concat() {
                assert!(row.width() <= columns, "{columns}: {row}");
            }
        }
    }
}

#[test]
fn columns_do_not_move_with_the_values() {
    let places = |state: &State| -> Vec<usize> {
        let rows = rows(state, View::default(), (80, 24));
        let joints = rows.iter().filter_map(|row| row.find("rad ").map(|byte| width(&row[..byte])));
        let shares =
            rows.iter().filter_map(|row| row.find(" %  in").map(|byte| width(&row[..byte])));
        joints.chain(shares).collect()
    };
    let mut extreme = extreme();
    extreme.snapshot["sampled"] = json!([true, true, true, true, true, true]);
    let [fine, wild] = [places(&state(&feed())), places(&extreme)];
    assert_eq!(fine, wild);
    assert!(fine.len() >= 12, "{fine:?}");
}

/// Returns a node whose names are hostile.
fn hostile() -> State {
    let [mut description, mut mode, mut snapshot] = feed();
    let long = "x".repeat(1_000);
    let names = [
        "\u{1b}[31mred",
        "<b>bold</b>",
        long.as_str(),
        "関節関節関節関節関節",
        "a\nb\tc\u{7}\u{9b}2J",
        "e\u{301}\u{200b}\u{202e}x👩‍🚀🇩🇪",
    ];
    for (place, name) in names.into_iter().enumerate() {
        description["hand"]["joints"][place]["name"] = json!(name);
        description["hand"]["joints"][place]["torque_unit"] = json!(name);
    }
    description["program"] = json!(long);
    description["configuration"] = json!(names[0]);
    description["buses"][0]["name"] = json!(names[0]);
    mode["mode"] = json!(names[0]);
    mode["stopped_by"] = json!(names.join(" "));
    mode["not_off"] = json!(names);
    mode["way_out"] = json!(names);
    snapshot["recording"]["ended_early"] = json!(names[4]);
    snapshot["command"]["kind"] = json!(names[3]);
    snapshot["reflection"] = json!(names[2]);
    for place in 0..4 {
        snapshot["watchdogs"][place]["name"] = json!(names[place]);
        snapshot["watchdogs"][place]["unit"] = json!(names[place + 2]);
    }
    state(&[description, snapshot, mode])
}

/// Returns a node with numbers near the limits of `f64`.
fn extreme() -> State {
    let [description, mode, mut snapshot] = feed();
    fn grow(value: &mut Value) {
        match value {
            Value::Number(number) => {
                *value = json!(if number.as_f64() < Some(0.0) { -1.7e308 } else { 1.7e308 });
            }
            Value::Array(values) => values.iter_mut().for_each(grow),
            Value::Object(values) => values.values_mut().for_each(grow),
            Value::Null | Value::Bool(_) | Value::String(_) => {}
        }
    }
    grow(&mut snapshot);
    state(&[description, mode, snapshot])
}

#[test]
fn hostile_names_are_shown_without_an_effect() {
    let state = hostile();
    for size in [(80, 24), (40, 12), (120, 40), (200, 60)] {
        let rows = rows(&state, View::default(), size);
        let text = rows.join("\n");
        assert!(
            text.chars().all(|character| character == '\n' || !character.is_control()),
            "{text}"
        );
        assert!(!text.contains(['\u{202e}', '\u{200b}']), "{text}");
        for name in ["\u{fffd}[31mred", "<b>bold", "関節", "a\u{fffd}b"] {
            assert!(text.contains(name), "{name}: {text}");
        }
        // Each joint's torque is in the column that it has with plain names.
        let torques = rows.iter().filter(|row| row.contains(" rad ")).count();
        assert_eq!(torques, 6, "{text}");
    }
}

#[test]
fn every_value_may_be_absent_or_of_another_type() {
    let wrong =
        [json!(null), json!(-1), json!("x"), json!([]), json!({}), json!(true), json!(1e308)];
    let lines = feed();
    let mut tried = 0;
    for (line, whole) in lines.iter().enumerate() {
        for key in whole.as_object().unwrap().keys().filter(|key| *key != "kind") {
            for value in &wrong {
                let mut changed = lines.clone();
                changed[line][key] = value.clone();
                if changed[line][key].is_null() {
                    changed[line].as_object_mut().unwrap().remove(key);
                }
                for size in [(80, 30), (40, 12)] {
                    let screen = rows(&state(&changed), View::default(), size).join("\n");
                    assert!(screen.contains("q quit"), "{key} {value}: {screen}");
                }
                tried += 1;
            }
        }
    }
    assert!(tried > 300, "{tried}");
}

#[test]
fn colours_are_used_only_where_they_are_wanted() {
    let mut stopped = stopped();
    stopped.on_news(News::Absent("no node".to_owned()));
    for is_coloured in [true, false] {
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
        let palette = Palette { is_coloured };
        let scene = Scene { state: &stopped, view: View::default(), palette, silent_s: None };
        terminal.draw(|frame| scene.draw(frame.area(), frame.buffer_mut())).unwrap();
        let cells = &terminal.backend().buffer().content;
        let coloured =
            cells.iter().filter(|cell| (cell.fg, cell.bg) != (Color::Reset, Color::Reset));
        assert_eq!(coloured.count() > 0, is_coloured);
    }
}

#[test]
fn node_that_falls_silent_is_remarked_on() {
    let state = state(&feed());
    let palette = Palette { is_coloured: false };
    let scene = Scene { state: &state, view: View::default(), palette, silent_s: Some(4) };
    let text: Vec<String> = scene.all_rows(80).iter().map(ToString::to_string).collect();
    assert!(text[1].contains("No telemetry for 4 s"), "{text:?}");
}
