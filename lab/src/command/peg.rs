//! `frhc-lab peg`: contact of the simulation's peg with plate and hole, for comparison with other programs.

use std::io::{self, Read};

use clap::Args;
use serde::Deserialize;
use serde_json::json;

use crate::peg_rig::{Approach, Grip, LoweringResult, PegRig, PegRigSettings};
use run::exit::{Failure, Kind, OrFail};
use run::print;

/// `frhc-lab peg`.
#[derive(Debug, Args)]
#[command(
    after_help = "The frame is that of the plate: origin where the hole's axis meets the face, z out of the material. A pose is \
        [x, y, depth, a, b]: centre of the peg's end, its depth below the face, and a rotation vector [a, b, 0]. An approach is \
        [x, y, a, b]: the peg is lowered from there by the grip. Lengths in m, angles in rad. Prints one JSON object per pose or \
        approach and line.\n\nExamples:\n  \
        frhc-lab peg '{\"poses\": [[0.0001, 0, 0.01, 0, 0]]}' | jq .f_e\n  \
        frhc-lab peg '{\"approaches\": [[0.0005, 0, 0, 0], [0.003, 0, 0, 0]], \"insert_depth_m\": 0.01}'"
)]
pub struct Peg {
    /// JSON object with poses and approaches; `-` reads stdin.
    #[arg(value_name = "QUESTION")]
    question: String,
}

/// Maximum length of a question, in bytes.
const MAX_LENGTH: u64 = 1 << 20;

/// Peg, hole, and the poses and approaches of the peg.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Question {
    peg_radius_m: f64,
    peg_length_m: f64,
    peg_chamfer_m: [f64; 2],
    hole_radius_m: f64,
    hole_chamfer_m: [f64; 2],
    thickness_m: f64,
    friction: f64,
    stiffness_n_per_m: f64,
    grip_centre_m: f64,
    grip_lateral_n_per_m: f64,
    grip_angular_nm_per_rad: f64,
    grip_force_n: f64,
    insert_depth_m: f64,
    poses: Vec<[f64; 5]>,
    approaches: Vec<[f64; 4]>,
}

impl Default for Question {
    fn default() -> Self {
        Self {
            peg_radius_m: 5e-3,
            peg_length_m: 0.03,
            peg_chamfer_m: [0.0; 2],
            hole_radius_m: 5.05e-3,
            hole_chamfer_m: [1e-3; 2],
            thickness_m: 0.03,
            friction: 0.3,
            stiffness_n_per_m: 3.6e6,
            grip_centre_m: 0.0,
            grip_lateral_n_per_m: 1e3,
            grip_angular_nm_per_rad: 5.0,
            grip_force_n: 20.0,
            insert_depth_m: 0.02,
            poses: Vec::new(),
            approaches: Vec::new(),
        }
    }
}

/// Computes and prints every pose, then every approach.
///
/// # Errors
/// When the question is no JSON object of its keys, or asks of a peg that does not fit.
pub fn run(args: &Peg) -> Result<(), Failure> {
    let question = match args.question.as_str() {
        "-" => parse("stdin", &stdin()?)?,
        text => parse("QUESTION", text)?,
    };
    question.check().map_err(|reason| Failure::new(Kind::Usage, reason))?;
    let rig = PegRig::new(question.settings()).or_fail(Kind::Usage)?;
    let (grip, depth) = (question.grip(), question.insert_depth_m);
    for [x, y, depth, a, b] in &question.poses {
        let approach = Approach { offset: [*x, *y], tilt: [*a, *b] };
        let touched = rig.touched(&approach, *depth);
        let f_e = touched.f_e.components();
        print::line(&json!({ "f_e": f_e, "points": touched.features }).to_string());
    }
    for [x, y, a, b] in &question.approaches {
        let LoweringResult { outcome, depth, features, .. } =
            rig.lower(&Approach { offset: [*x, *y], tilt: [*a, *b] }, &grip, depth);
        let answer = json!({ "outcome": outcome, "depth_m": depth, "points": features });
        print::line(&answer.to_string());
    }
    Ok(())
}

fn stdin() -> Result<String, Failure> {
    let mut text = String::new();
    let read = io::stdin().lock().take(MAX_LENGTH).read_to_string(&mut text);
    read.map_err(|error| Failure::new(Kind::File, format!("stdin: {error}")))?;
    Ok(text)
}

fn parse(name: &str, text: &str) -> Result<Question, Failure> {
    let wrong = |error| Failure::new(Kind::Usage, format!("{name}: {error}"));
    serde_json::from_str(text).map_err(wrong)
}

impl Question {
    /// Checks the values that the rig does not check.
    fn check(&self) -> Result<(), String> {
        for (key, value) in [
            ("grip_centre_m", self.grip_centre_m),
            ("grip_lateral_n_per_m", self.grip_lateral_n_per_m),
            ("grip_angular_nm_per_rad", self.grip_angular_nm_per_rad),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(format!("{key} must be 0 or above and finite, got {value}"));
            }
        }
        let force = self.grip_force_n;
        if !(force.is_finite() && force > 0.0) {
            return Err(format!("grip_force_n must be positive and finite, got {force}"));
        }
        let (depth, deepest) = (self.insert_depth_m, self.thickness_m.min(self.peg_length_m));
        if !(depth > 0.0 && depth <= deepest) {
            let limit = "must be positive, and within thickness_m and peg_length_m";
            return Err(format!("insert_depth_m {limit}, {deepest}, got {depth}"));
        }
        if self.poses.is_empty() && self.approaches.is_empty() {
            return Err("a question must have poses or approaches; neither is given".to_owned());
        }
        Ok(())
    }

    const fn settings(&self) -> PegRigSettings {
        PegRigSettings {
            peg_radius: self.peg_radius_m,
            peg_length: self.peg_length_m,
            peg_chamfer: self.peg_chamfer_m,
            hole_radius: self.hole_radius_m,
            hole_chamfer: self.hole_chamfer_m,
            thickness: self.thickness_m,
            friction: self.friction,
            stiffness: self.stiffness_n_per_m,
        }
    }

    const fn grip(&self) -> Grip {
        Grip {
            centre: self.grip_centre_m,
            lateral: self.grip_lateral_n_per_m,
            angular: self.grip_angular_nm_per_rad,
            force: self.grip_force_n,
        }
    }
}
