//! `frhc-lab peg`, run as a user runs it.

use serde_json::Value;

use crate::common::prelude::*;

/// Force and moment of an answer.
fn force(answer: &Value) -> Vec<f64> {
    answer["f_e"].as_array().unwrap().iter().map(|it| it.as_f64().unwrap()).collect()
}

#[test]
fn peg_is_put_and_lowered_as_asked() {
    let question = serde_json::json!({
        "poses": [[0.0, 0.0, 0.01, 0.0, 0.0], [0.0007, 0.0, 0.0005, 0.0, 0.0]],
        "approaches": [[0.0005, 0.0, 0.0, 0.0], [0.003, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]],
        "insert_depth_m": 0.01,
    });
    let text = frhc(&["peg", &question.to_string()]).stdout;
    let answers: Vec<Value> =
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(answers.len(), 5, "{text}");
    assert_eq!(force(&answers[0]), [0.0; 6]);
    assert!(answers[1]["points"]["cone"].as_u64() > Some(0), "{text}");
    let [x, z] = [0, 2].map(|axis| force(&answers[1])[axis]);
    assert!(x < 0.0 && z > 0.0, "{text}");
    let outcomes = answers[2..].iter().map(|answer| answer["outcome"].as_str().unwrap());
    assert_eq!(outcomes.collect::<Vec<_>>(), ["inserted", "rejected", "rejected"]);
}

#[test]
fn invalid_question_about_a_peg_is_refused() {
    for (question, expected) in [
        ("{}", "a question must have poses or approaches"),
        (r#"{"peg_radius": 1}"#, "QUESTION: unknown field `peg_radius`"),
        (r#"{"poses": [[0, 0, 0]]}"#, "QUESTION: invalid length 3"),
        (r#"{"poses": [[0,0,0,0,0]], "hole_radius_m": 0.004}"#, "the hole radius must be above"),
        (r#"{"poses": [[0,0,0,0,0]], "grip_force_n": 0}"#, "grip_force_n must be positive"),
        (r#"{"poses": [[0,0,0,0,0]], "insert_depth_m": 1}"#, "insert_depth_m must be positive"),
    ] {
        let ended = frhc(&["peg", question]);
        let stderr = &ended.stderr;
        assert_eq!(ended.code, 2, "{question}: {stderr}");
        assert!(stderr.contains(expected) && stderr.lines().count() == 1, "{question}: {stderr}");
        assert!(ended.stdout.is_empty());
    }
}
