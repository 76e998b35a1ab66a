//! `frhc explain`, run as a user runs it, against independently computed cycles.

use std::io::Write;
use std::process::Output;

use crate::common::oracle::{self, TOLERANCE, list};
use crate::common::prelude::*;
use node::cause::CauseKind;
use node::safety::table;

/// Names of the values: the oracle's and ours.
const CONSISTENT: [(&str, &str); 18] = [
    ("T_0G0", "x_0_h"),
    ("T_0G", "x_0_g"),
    ("dX_recommended", "dx"),
    ("rotation_vector", "rotation_vector"),
    ("dX_db", "dx_db"),
    ("omega", "omega"),
    ("rate_command", "v_m"),
    ("pose_command", "x_b_d"),
    ("F_MRF_T", "f_m_task"),
    ("G_F_T", "f_g_task"),
    ("W_F_T", "f_w_task"),
    ("tau_T", "tau_task"),
    ("G_F_R", "f_g_centring"),
    ("G_F_D", "f_g_damping"),
    ("tau_assist", "tau_assist"),
    ("assist_scale", "assist_scale"),
    ("tau_gravity", "tau_gravity"),
    ("tau_C", "tau"),
];

/// The same for the preset `paper1997`.
const PRINTED: [(&str, &str); 6] = [
    ("G_F_R", "f_g_centring"),
    ("G_F_D", "f_g_damping"),
    ("tau_RG", "tau_rg"),
    ("assist_scale", "assist_scale"),
    ("final_scale", "rest_scale"),
    ("tau_C", "tau"),
];

/// Runs `frhc explain` with flags, and a question on stdin.
fn explain(flags: &[&str], question: &str) -> Output {
    let mut child = Command::new(crate::common::program())
        .arg("explain")
        .args(flags)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(question.as_bytes()).ok();
    child.wait_with_output().unwrap()
}

fn answer(flags: &[&str], question: &Value) -> Value {
    let output = explain(flags, &question.to_string());
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Every number in a value, depth first.
fn flat(value: &Value) -> Vec<f64> {
    value.as_array().map_or_else(
        || vec![value.as_f64().unwrap()],
        |values| values.iter().flat_map(flat).collect(),
    )
}

/// Fails unless every value named in `names` is as expected.
fn assert_explained(answer: &Value, expected: &Value, names: &[(&str, &str)]) {
    for (theirs, ours) in names {
        let (found, expected) = (flat(&answer[ours]["value"]), flat(&expected[theirs]));
        assert_eq!(found.len(), expected.len(), "{ours}");
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() <= TOLERANCE, "{ours}: {found} is not {expected}");
        }
    }
}

#[test]
fn every_random_cycle_is_reproduced_from_stdin() {
    for case in list(&oracle::oracle("paper_random.json")["cases"]) {
        let mut case = case.clone();
        // Adds gravity to the balanced arm: the oracle has values for both.
        case["inputs"]["gravity_m_per_s2"] = serde_json::json!([0.0, 0.0, -9.81]);
        let found = answer(&["--json", "-"], &case);
        assert_explained(&found, &case["expected"], &CONSISTENT);
        let expected = case["expected"]["rest_scale"].as_f64().unwrap();
        assert!((found["rest_scale"]["value"].as_f64().unwrap() - expected).abs() <= TOLERANCE);

        let found = answer(&["--json", "--preset", "paper1997", "-"], &case);
        assert_explained(&found, &case["expected"]["literal"], &PRINTED);
    }
}

#[test]
fn balanced_arm_has_no_gravity_torque() {
    for case in list(&oracle::oracle("paper_random.json")["cases"]) {
        if case["device"] == "jpl_like" {
            let found = answer(&["--json", "-"], case);
            assert_explained(&found, &case["expected"], &[("no_gravity_tau_C", "tau")]);
        }
    }
}

#[test]
fn flags_and_json_question_give_the_same_cycle() {
    let flags = [
        "--json",
        "--q",
        "0.05,-0.8,1.6,-0.7,0.1,0.2",
        "--q-before",
        "0.05,-0.8,1.6,-0.7,0.1,0.21",
        "--q-reference",
        "0,-0.87,1.66,-0.79,0,0",
        "--wrench",
        "-5,0,0,0,0,0.1",
    ];
    let by_flags = explain(&flags, "");
    let question = serde_json::json!({
        "q": [0.05, -0.8, 1.6, -0.7, 0.1, 0.2],
        "q_before": [0.05, -0.8, 1.6, -0.7, 0.1, 0.21],
        "q_reference": [0.0, -0.87, 1.66, -0.79, 0.0, 0.0],
        "f_s": [-5.0, 0.0, 0.0, 0.0, 0.0, 0.1],
    });
    let by_question = explain(&["--json", "-"], &question.to_string());
    assert!(by_flags.status.success() && !by_flags.stdout.is_empty());
    assert_eq!(by_flags.stdout, by_question.stdout);
}

#[test]
fn other_torque_limits_keep_the_joint_coupling() {
    let root = env!("CARGO_MANIFEST_DIR");
    let coupling = "[coupling]\nmatrix = [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], \
        [0, -1, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]]\n\n[switches]";
    let text = include_str!("../../config/kraft_like.toml")
        .replace("../eds", &format!("{root}/eds"))
        .replacen("[switches]", coupling, 1);
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("coupled.toml");
    fs::write(&file, text).unwrap();
    let question = serde_json::json!({ "q": [0.0, -0.8, 1.6, -0.7, 0.0, 0.0], "max_torque": [10, 10, 10, 10, 10, 10] });
    let answer = answer(&["--json", "--config", file.to_str().unwrap(), "-"], &question);
    let (tau, targets) = (flat(&answer["tau"]["value"]), flat(&answer["targets"]["value"]));
    // The elbow motor's reaction acts on the shoulder motor.
    assert!((targets[1] - 100.0 * (tau[1] - tau[2])).abs() <= 0.5, "{targets:?} for {tau:?}");
    assert!((targets[2] - 100.0 * tau[2]).abs() <= 0.5 && tau[2].abs() > 1.0);
}

#[test]
fn every_value_has_its_name_and_every_quantity_its_unit() {
    let output = explain(&["--q", "0,-0.8,1.6,-0.7,0,0"], "");
    let text = String::from_utf8(output.stdout).unwrap();
    for name in
        ["x_0_g", "dx", "v_m", "f_m_task", "f_g_task", "j_g", "tau_gravity", "tau", "targets"]
    {
        assert!(text.lines().any(|line| line.starts_with(name)), "{name} in\n{text}");
    }
    assert!(text.contains("[N·m, N]") && text.contains("{g}") && text.contains("(Eq. 5)"));
}

#[test]
fn invalid_question_is_refused_with_its_key() {
    for (question, expected) in [
        (r#"{"q": [0, 0]}"#, "stdin: "),
        (r#"{"r": 1}"#, "unknown field `r`"),
        (r#"{"q": [1e9, 0, 0, 0, 0, 0]}"#, "q: joint positions must be within"),
        (r#"{"mode": "fast"}"#, "mode: must be rate or pose, got \"fast\""),
        (
            r#"{"K_V": [1, 1, 1, 1, 1, -1]}"#,
            "rate_gain: about z must be within 0 and 1000000, got -1",
        ),
        (r#"{"period_s": 0}"#, "period_s: the cycle period must be within 10 µs and 1 s, got 0 s"),
        (r#"{"T_MRF_S": [[1,0,0,0],[0,1,0,0],[0,0,2,0],[0,0,0,1]]}"#, "x_m_s: "),
        (r#"{"tau_cap": [0, 1, 1, 1, 1, 1]}"#, "max_torque: "),
    ] {
        let output = explain(&["-"], question);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{question}: {stderr}");
        assert!(stderr.contains(expected) && stderr.lines().count() == 1, "{question}: {stderr}");
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn question_is_accepted_on_the_command_line() {
    let question = r#" {"q": [0, -0.8, 1.6, -0.7, 0, 0]}"#;
    let [inline, from_stdin] = [&["--json", question][..], &["--json", "-"]];
    let inline = explain(inline, "");
    assert!(inline.status.success(), "{}", String::from_utf8_lossy(&inline.stderr));
    assert_eq!(inline.stdout, explain(from_stdin, question).stdout);
    let wrong = explain(&[r#"{"q": 1}"#], "");
    assert!(String::from_utf8_lossy(&wrong.stderr).starts_with("frhc: QUESTION: "), "{wrong:?}");
}

#[test]
fn input_that_is_not_a_question_is_refused() {
    for (flags, question, expected) in [
        (&["-"][..], "", "stdin: empty; a question must be a JSON object"),
        (&[], " \n", "stdin: empty; a question must be a JSON object"),
        (&["-", "--mode", "rate"], "", "stdin: empty"),
        (&["-"], "[]", "stdin: a question must be a JSON object, got an array"),
        (&["[]"], "", "QUESTION: a question must be a JSON object, got an array"),
        (&["-"], "null", "got a single value"),
        (&["-"], r#"{"question": []}"#, "the question must be a JSON object, got an array"),
        (&["-"], r#"{"mode": "rate", "mode": "pose"}"#, "duplicate field `mode`"),
        (&["-"], r#"{"K_V": [1,1,1,1,1,1], "rate_gain": [1,1,1,1,1,1]}"#, "duplicate field"),
        (&["-"], r#"{"inputs": {"mode": "rate", "mode": "pose"}}"#, "duplicate field `mode`"),
        (&["-"], r#"{"inputs": {}, "question": {}}"#, "duplicate field `question`"),
    ] {
        let output = explain(flags, question);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{question}: {stderr}");
        assert!(stderr.contains(expected) && stderr.lines().count() == 1, "{question}: {stderr}");
        assert!(output.stdout.is_empty(), "{question}");
    }
    assert!(explain(&["--mode", "rate"], "").status.success(), "the flags are a question");
    assert!(explain(&["{}"], "").status.success(), "{{}} uses the start pose");
}

#[test]
fn fault_table_has_every_cause_as_text_and_json() {
    let text = String::from_utf8(explain(&["faults"], "").stdout).unwrap();
    let json = String::from_utf8(explain(&["faults", "--json"], "").stdout).unwrap();
    let rows: Vec<Value> = json.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(rows.len(), CauseKind::ALL.len());
    for (row, kind) in rows.iter().zip(CauseKind::ALL) {
        let name = format!("{kind:?}");
        assert_eq!(row["cause"], name);
        let line = text.lines().find(|line| line.split_whitespace().next() == Some(&name)).unwrap();
        assert!(line.ends_with(row["words"].as_str().unwrap()), "{line}");
        for mode in Mode::ALL {
            let after = table::reaction(kind, mode).mode().map(Mode::name);
            assert_eq!(row["leads_to"][mode.name()].as_str(), after, "{name} in {mode}");
        }
    }
    assert!(text.contains("S1     reflection off: ") && text.contains(" within 20 ms"));
    let both = explain(&["--q", "0,-0.8,1.6,-0.7,0,0", "faults"], "");
    assert_eq!(both.status.code(), Some(2), "a question or the table");
}

#[test]
fn robot_matches_the_reference() {
    for case in list(&oracle::oracle("puma560_corke_mdh.json")["configs"]) {
        let q: Vec<String> = flat(&case["q"]).iter().map(f64::to_string).collect();
        let output = explain(&["robot", PUMA, "--q", &q.join(","), "--json"], "");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{stderr}");
        let found = serde_json::from_slice(&output.stdout).unwrap();
        assert_explained(&found, case, &[("gravity", "tau_gravity"), ("M", "mass_matrix")]);
    }
}

/// Start of the PUMA, in rad.
const START: &str = "0,0.7853981633974483,-3.141592653589793,0,0.7853981633974483,0";

#[test]
fn robot_is_explained_once_per_posture() {
    let q = [format!("--q={START}"), format!("--q=-0.2{}", &START[1..])];
    let q = q.each_ref().map(String::as_str);
    let json = explain(&[&["robot", PUMA, "--json"], &q[..]].concat(), "");
    let lines: Vec<Value> = String::from_utf8(json.stdout)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let start = explain(&["robot", PUMA, "--json"], "");
    assert_eq!(lines.len(), 2);
    assert_eq!(lines[0], serde_json::from_slice::<Value>(&start.stdout).unwrap());
    assert!((flat(&lines[1]["q"]["value"])[0] + 0.2).abs() < 1e-12);

    let text = String::from_utf8(explain(&["robot", PUMA], "").stdout).unwrap();
    for name in ["q", "x_b_m", "j_m", "sigma_min", "tau_gravity", "mass_matrix"] {
        assert!(text.lines().any(|line| line.split(' ').next() == Some(name)), "{name} in {text}");
    }
    assert!(text.contains("[kg·m²] {joints}") && text.contains("[m] {b}"), "{text}");
}

#[test]
fn invalid_posture_of_a_robot_is_refused() {
    for (file, q, code, expected) in [
        (PUMA, "0,1", 2, "--q: must have one position for each of the 6 joints, got 2"),
        (PUMA, "0,1,x,0,0,0", 2, "expected a number, got \"x\""),
        (PUMA, "0,0,0,0,0,0,nan", 2, "joints, got 7"),
        (
            PUMA,
            "0,0,1,0,0,0",
            2,
            "joint 3 must be within -3.927 to 0.7854 rad, its limit_deg, got 1",
        ),
        (
            PUMA,
            "0,0,NaN,0,0,0",
            2,
            "joint 3 must be within -3.927 to 0.7854 rad, its limit_deg, got NaN",
        ),
        ("nope.toml", "0,0,0,0,0,0", 3, "nope.toml: No such file"),
    ] {
        // A good posture before it is not printed.
        let output = explain(&["robot", file, "--q", START, "--q", q], "");
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{q}: {stderr}");
        assert!(stderr.contains(expected) && output.stdout.is_empty(), "{q}: {stderr}");
    }
}
