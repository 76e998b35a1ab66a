//! `frhc robot` with files, keys, paths and options that it refuses: one line, and the exit code of docs/commands.md. The
//! figures that a node's file demands of a robot.

use std::os::unix::net::UnixListener;

use serde_json::json;

use crate::common::linked::{LINK, linked, with_model};
use crate::common::prelude::*;

/// Folder of the repository.
const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn command<'a>(config: &'a str, socket: &'a str) -> Vec<&'a str> {
    vec!["robot", "--config", config, "--robot", PUMA, "--socket", socket]
}

/// Asserts that the command ends with this exit code and one line with these words.
#[track_caller]
fn is_refused(args: &[&str], code: i32, words: &[&str]) {
    let ended = frhc(args);
    assert_eq!(ended.code, code, "{args:?}: {}", ended.stderr);
    assert_eq!(ended.stderr.lines().count(), 1, "{}", ended.stderr);
    for word in words {
        assert!(ended.stderr.contains(word), "{word}: {}", ended.stderr);
    }
}

#[test]
fn robots_that_cannot_be_simulated_are_refused() {
    let scratch = Scratch::new("robot-refused");
    let socket = scratch.path("far.sock");
    let robot =
        |config: &str| ["robot", "--socket", &socket, "--config", config].map(str::to_owned);
    let refused = |config: &str, more: &[&str], words: &[&str]| {
        let args = robot(config);
        let args: Vec<&str> = args.iter().map(String::as_str).chain(more.iter().copied()).collect();
        is_refused(&args, 3, words);
    };
    refused(KRAFT, &[], &["config/kraft_like.toml: remote.robot: absent", "--robot FILE"]);
    refused(KRAFT, &["--robot", "nowhere.toml"], &["nowhere.toml"]);
    refused("nowhere.toml", &[], &["nowhere.toml"]);
    let puma = fs::read_to_string(PUMA).unwrap();
    let puma = puma.replacen("base_m = [-0.31630315,", "base_m = [-0.18,", 1);
    let wall = scratch.write("in_the_wall.toml", &puma);
    refused(KRAFT, &["--robot", &wall], &[&wall, "would start in a surface", "change start_deg"]);
    let other = scratch.variant(KRAFT, &[("kind = \"virtual\"", "kind = \"magic\"")]);
    refused(&other, &["--robot", PUMA], &[&other, "remote.kind", "\"magic\""]);
    let text = linked("kraft_like", LINK).replace("\"../eds/", &format!("\"{ROOT}/eds/"));
    let node = scratch.write("node.toml", &text);
    refused(&node, &[], &[&node, "remote.robot: absent; give --robot FILE"]);
}

#[test]
fn simulations_name_the_kind_of_the_far_side_they_refuse() {
    let scratch = Scratch::new("robot-kinds");
    for (kind, text) in [("link", linked("kraft_like", LINK)), ("both", with_model("kraft_like"))] {
        let file = scratch.write(kind, &text.replace("\"../eds/", &format!("\"{ROOT}/eds/")));
        let named = format!("remote.kind: \"{kind}\"");
        is_refused(&["campaign", "--config", &file], 3, &[&file, &named, "set \"virtual\""]);
        let biased = text.replacen("[remote]\n", "[remote]\nsensor_bias_n = [1.0, 0.0, 0.0]\n", 1);
        let file = scratch.write(kind, &biased.replace("\"../eds/", &format!("\"{ROOT}/eds/")));
        let named = format!("with kind = \"{kind}\" the far side has it");
        is_refused(&["check", "--config", &file], 3, &["remote.sensor_bias_n: ", &named]);
    }
}

#[test]
fn robot_without_a_wrench_limit_in_range_is_refused() {
    let scratch = Scratch::new("robot-limits");
    let socket = scratch.path("far.sock");
    for key in ["wrench_limit_n", "wrench_limit_nm"] {
        let key_named = format!("remote.link.{key}: ");
        for (value, reason) in [
            ("nan", "must be within"),
            ("inf", "must be within"),
            ("-40.0", "must be within"),
            ("0.0", "must be within"),
            ("1e10", "must be within"),
            ("\"40 N\"", "expected"),
        ] {
            let section = format!("[remote.link]\n{key} = {value}\n\n[safety]");
            let config = scratch.variant(KRAFT, &[("[safety]", &section)]);
            is_refused(&command(&config, &socket), 3, &[&config, &key_named, reason]);
        }
    }
}

#[test]
fn wrench_limit_in_the_file_of_a_node_is_refused() {
    let scratch = Scratch::new("robot-node-limit");
    let keys = format!("wrench_limit_n = 40.0\n{LINK}");
    let text = linked("kraft_like", &keys).replace("\"../eds/", &format!("\"{ROOT}/eds/"));
    let node = scratch.write("node.toml", &text);
    let words = [&node, "remote.link.wrench_limit_n: limits the robot itself", "frhc robot"];
    is_refused(&["check", "--config", &node], 3, &words);
}

#[test]
fn check_of_the_file_of_a_node_has_the_figures_of_its_robot() {
    let scratch = Scratch::new("robot-figures");
    let keys = format!("socket = \"far.sock\"\narm = 3\nhold_after_ms = 50.0\n{LINK}");
    let text = linked("kraft_like", &keys).replace("\"../eds/", &format!("\"{ROOT}/eds/"));
    let node = scratch.write("node.toml", &text);
    let far_side = |file: &str| {
        let ended = frhc(&["check", "--config", file, "--json"]);
        serde_json::from_str::<Value>(&ended.stdout).unwrap()["far_side"].clone()
    };
    let expected = json!({
        "arm": 3,
        "socket": "far.sock",
        "round_trip_ms": 5.0,
        "model_limit_m": null,
        "model_limit_deg": null,
        "stiffest_contact_n_per_m": 2000.0,
        "max_sample_period_s": null,
        "max_hold_after_s": 0.05,
        "min_sensor_range": [0.0, 0.0],
        "max_servo_lag_s": 0.01,
        "max_speed": [0.5, 2.0],
        "payload_removal": "weight",
        "accommodation": [0.01, 0.01, 0.01, 0.5, 0.5, 0.5],
        "accommodation_deadband": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    });
    assert_eq!((far_side(&node), far_side(KRAFT)), (expected, Value::Null));
    let text = with_model("kraft_like").replace("\"../eds/", &format!("\"{ROOT}/eds/"));
    let beside_a_model = far_side(&scratch.write("model.toml", &text));
    assert_eq!(beside_a_model["model_limit_m"], 0.02);
    assert_eq!(beside_a_model["max_hold_after_s"], 0.1, "by default");
    assert!((beside_a_model["model_limit_deg"].as_f64().unwrap() - 5.0).abs() < 1e-9);
}

#[test]
fn number_of_the_arm_out_of_range_is_a_wrong_command_line() {
    let scratch = Scratch::new("robot-arm");
    let socket = scratch.path("far.sock");
    for arm in ["70000", "-1"] {
        let ended = frhc(&[&command(KRAFT, &socket)[..], &["--arm", arm]].concat());
        assert_eq!(ended.code, 2, "{}", ended.stderr);
        let first = ended.stderr.lines().next().unwrap();
        assert!(first.contains("--arm <N>"), "{first}");
        assert!(first.contains(&format!("{arm} is not in 0..=65535")), "{first}");
    }
}

#[test]
fn paths_without_a_socket_for_a_far_side_are_refused() {
    let scratch = Scratch::new("robot-paths");
    let (file, stream) = (scratch.write("file", "1,2,3"), scratch.path("stream.sock"));
    let long = scratch.path(&"x".repeat(200));
    let _listener = UnixListener::bind(&stream).unwrap();
    is_refused(&command(KRAFT, &file), 4, &[&file, "not a socket"]);
    is_refused(&command(KRAFT, &stream), 4, &[&stream, "is it that of `frhc ctl`?"]);
    is_refused(&command(KRAFT, &long), 4, &["too long for a socket", "set a shorter path"]);
}
