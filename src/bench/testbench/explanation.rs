//! One cycle of the controller: every intermediate of Fig. 3 by name, with unit, frame and equation.
//!
//! The values are those of the step in the loop; the command of the other mode is computed in addition. Earlier cycles set
//! the reference, press the deadman, and play the cycle before.

use nalgebra::{Isometry3, Vector3};
use serde::Serialize;

use crate::question::{CycleInputs, InvalidQuestion, Question};
use config::Config;
use controller::interpretation::{DisplacementFrame, Interpretation};
use controller::reference::Displacement;
use controller::switches::{CommandMode, Switches};
use controller::{Controller, Input, JointVector, Output};
use units::drive::PerMille;
use units::spatial::{Jacobian, Motion, Twist, Wrench, rotation};

/// Time for which the hand rests before the explained cycle, in s, until every ramp is over.
const SETTLING_TIME: f64 = 10.0;

/// Torques of friction compensation.
const TAU_FRICTION: &str = "tau_friction";

/// Value of Fig. 3.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// Scalar.
    Number(f64),
    /// Number for each axis or joint.
    Numbers(Vec<f64>),
    /// Pose, as the rows of its 4 × 4 matrix.
    Pose([[f64; 4]; 4]),
    /// Matrix, row by row.
    Matrix(Vec<Vec<f64>>),
    /// Targets of drives.
    Targets([i16; 6]),
    /// Word, or its absence.
    Word(Option<String>),
}

/// Entry of the explanation. It serializes without its name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// Name of the value, as in code and records.
    #[serde(skip)]
    pub name: &'static str,
    /// Number, pose, matrix or word, in `unit` and `frame`.
    pub value: Value,
    /// SI unit; empty without one.
    pub unit: &'static str,
    /// Frame that the value is written in.
    pub frame: &'static str,
    /// Equation or section of the paper.
    pub place: &'static str,
    /// Description.
    pub what: &'static str,
}

/// Entries of a cycle, in the order of computation.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation(pub Vec<Entry>);

/// Explains a cycle of the controller of `config` with the inputs of `question`; the default posture is `start`.
///
/// # Errors
/// Returns the first invalid key of the question.
pub fn explain(
    config: &Config,
    start: &JointVector,
    question: &Question,
) -> Result<Explanation, InvalidQuestion> {
    let x_b_m = &config.remote.x_b_m;
    let posed = question.pose(&config.controller, start, x_b_m, config.command_mode)?;
    let output = run(&posed);
    Ok(Explanation(entries(&posed, &output)))
}

/// Runs the preceding cycles and the explained one.
fn run(posed: &CycleInputs) -> Output {
    let mut controller = Controller::new(&posed.settings);
    let up = Switches::default();
    let held = Switches { deadman: posed.deadman, ..up };
    let pressed = Switches { reference: true, reflection: posed.reflection, ..held };
    let mut step = |q: &JointVector, switches, restart| {
        controller.step_at(
            q,
            &Input {
                counts: posed.settings.calibration.counts(q),
                f_s: posed.f_s,
                x_b_m: posed.x_b_r,
                switches,
                mode: posed.mode,
                gravity_share: 1.0,
                reflection_share: 1.0,
                hold: false,
                held: None,
                restart,
            },
        )
    };
    step(&posed.q_reference, up, true);
    step(&posed.q_reference, pressed, false);
    let period = posed.settings.period;
    for _ in 0..period.cycles(SETTLING_TIME) {
        step(&posed.q_before, held, false);
    }
    step(&posed.q, held, false)
}

/// Returns Fig. 3 from top to bottom.
fn entries(posed: &CycleInputs, output: &Output) -> Vec<Entry> {
    let mut entries = motion(posed, output);
    entries.extend(wrenches(posed, output));
    entries.extend(torques(output));
    if posed.settings.extensions.friction.is_none() {
        // The paper has no friction compensation: the entry is omitted without it.
        entries.retain(|entry| entry.name != TAU_FRICTION);
    }
    entries
}

/// Returns the pose of the grip, and the command.
fn motion(posed: &CycleInputs, output: &Output) -> Vec<Entry> {
    let settings = &posed.settings;
    let (interpretation, law) = (&settings.interpretation, &settings.command);
    let Output { q, reference, x_0_g, x_h_g, dx, dx_db, command, .. } = output;
    let rotation = rotation::rotation_vector(&x_h_g.rotation);
    let omega = interpretation.orientation.rate(&dx_db.orientation);
    // The commands of both modes from here.
    let rate_db = law.effective(CommandMode::Rate, &settings.channels, dx);
    let pose_db = law.effective(CommandMode::Pose, &settings.channels, dx);
    let v_m = law.rate(interpretation.orientation, &rate_db);
    let x_b_d = law.pose(interpretation, reference, &pose_db);
    let h = axes(interpretation);
    vec![
        entry("q", q, "", ["rad, m", "joints"], "joint positions"),
        entry("x_0_h", &reference.x_0_h, "1", ["m", "0"], "grip at the reference"),
        entry("x_0_g", x_0_g, "1", ["m", "0"], "grip"),
        entry("x_h_g", x_h_g, "2, 3", ["m", "h"], "grip from the reference"),
        entry("dx", dx, "4", ["m, rad", h], "the same as six numbers"),
        entry("rotation_vector", &rotation, "4", ["rad", "h"], "its rotation as a vector"),
        entry("dx_db", dx_db, "Fig. 4", ["m, rad", h], "less the deadband"),
        entry("omega", &omega, "5", ["rad", "m"], "angular rate of the numbers"),
        entry("v_m", &v_m, "Fig. 3", ["m/s, rad/s", "m"], "rate command"),
        entry("x_b_d", &x_b_d, "3.5", ["m", "b"], "pose command"),
        entry("command", command, "3.5", ["", ""], "what is commanded"),
    ]
}

/// Returns the sensed wrench, and the wrenches on the grip.
fn wrenches(posed: &CycleInputs, output: &Output) -> Vec<Entry> {
    let Output { f_m_task, f_g_task, f_g_centring, f_g_damping, port, .. } = output;
    let f_w_task = f_g_task.at(posed.settings.arm.grip());
    let v_g = &output.twist.v_g;
    let unit = "N, N·m";
    vec![
        entry("f_s", &posed.f_s, "3.2", [unit, "s"], "wrench on the object at the sensor"),
        entry("f_m_task", f_m_task, "6", [unit, "m"], "the same at the frame under control"),
        entry("f_g_task", f_g_task, "Fig. 3", [unit, "g"], "felt at the grip"),
        entry("f_w_task", &f_w_task, "6", [unit, "w"], "the same at the wrist"),
        entry("f_g_centring", f_g_centring, "8", [unit, "g"], "return to centre"),
        entry("v_g", v_g, "9", ["m/s, rad/s", "g"], "twist of the grip"),
        entry("f_g_damping", f_g_damping, "9", [unit, "g"], "damping"),
        entry("f_g_passivity", &port.f_g_passivity, "", [unit, "g"], "keeping contact passive"),
    ]
}

/// Returns the joint torques.
fn torques(output: &Output) -> Vec<Entry> {
    let Output { j_g, ledger, tau, targets, invalid_value, .. } = output;
    let assist = ledger.centring + ledger.damping;
    let with_gravity = assist + ledger.gravity;
    let joints = ["N·m, N", "joints"];
    let none = ["", ""];
    let invalid = invalid_value.map(|invalid| invalid.to_string());
    let [limiting, slewing] = [ledger.limiting_joint, ledger.slewing_joint]
        .map(|joint| joint.map(|joint| joint.to_string()));
    vec![
        entry("j_g", j_g, "7", ["m, 1", "g"], "Jacobian of the grip"),
        entry("tau_task", &ledger.task, "7", joints, "torques of the task"),
        entry("tau_centring", &ledger.centring, "7", joints, "of the return to centre"),
        entry("tau_damping", &ledger.damping, "7", joints, "of damping"),
        entry("tau_passivity", &ledger.passivity, "", joints, "of passivity"),
        entry("tau_soft_stops", &ledger.soft_stops, "", joints, "of the soft stops"),
        entry(TAU_FRICTION, &ledger.friction, "", joints, "against the joints' friction"),
        entry("tau_gravity", &ledger.gravity, "3.3", joints, "carrying the arm"),
        entry("tau_assist", &assist, "10", joints, "return to centre and damping"),
        entry("tau_rg", &with_gravity, "10", joints, "the same with gravity"),
        entry("assist_scale", &ledger.assist_scale, "3.4", none, "what is left of the assist"),
        entry("rest_scale", &ledger.rest_scale, "3.4", none, "what is left of the sum"),
        entry("limiting_joint", &limiting, "3.4", none, "the joint that left no more"),
        entry("slewing_joint", &slewing, "", none, "the joint that is on its way"),
        entry("tau", tau, "10", joints, "torques asked for"),
        entry("targets", targets, "Fig. 6", ["‰", "drives"], "the same as the drives take it"),
        entry("fault", &invalid, "", none, "what cannot be"),
    ]
}

/// Returns the frame in which the translation of ΔX is written.
const fn axes(interpretation: &Interpretation) -> &'static str {
    match interpretation.displacement {
        DisplacementFrame::Base => "0",
        DisplacementFrame::Reference => "h",
    }
}

pub(crate) fn entry<'v, T>(
    name: &'static str,
    value: &'v T,
    place: &'static str,
    [unit, frame]: [&'static str; 2],
    what: &'static str,
) -> Entry
where
    Value: From<&'v T>,
{
    Entry { name, what, place, unit, frame, value: Value::from(value) }
}

impl From<&f64> for Value {
    fn from(number: &f64) -> Self {
        Self::Number(*number)
    }
}

impl From<&JointVector> for Value {
    fn from(joints: &JointVector) -> Self {
        Self::Numbers(joints.as_slice().to_vec())
    }
}

impl From<&Displacement> for Value {
    fn from(dx: &Displacement) -> Self {
        Self::Numbers(dx.components().to_vec())
    }
}

impl From<&Wrench> for Value {
    fn from(f: &Wrench) -> Self {
        Self::Numbers(f.components().to_vec())
    }
}

impl From<&Twist> for Value {
    fn from(v: &Twist) -> Self {
        Self::Numbers(v.components().to_vec())
    }
}

impl From<&Vector3<f64>> for Value {
    fn from(vector: &Vector3<f64>) -> Self {
        Self::Numbers(vector.as_slice().to_vec())
    }
}

impl From<&Isometry3<f64>> for Value {
    fn from(x: &Isometry3<f64>) -> Self {
        let matrix = x.to_homogeneous();
        Self::Pose(std::array::from_fn(|row| matrix.row(row).into_owned().into()))
    }
}

impl From<&Jacobian<6>> for Value {
    fn from(j_g: &Jacobian<6>) -> Self {
        let j_g = j_g.matrix();
        Self::Matrix(j_g.row_iter().map(|row| row.iter().copied().collect()).collect())
    }
}

impl From<&Vec<f64>> for Value {
    fn from(joints: &Vec<f64>) -> Self {
        Self::Numbers(joints.clone())
    }
}

impl From<&Vec<Vec<f64>>> for Value {
    fn from(rows: &Vec<Vec<f64>>) -> Self {
        Self::Matrix(rows.clone())
    }
}

impl From<&[PerMille; 6]> for Value {
    fn from(targets: &[PerMille; 6]) -> Self {
        Self::Targets(targets.map(|target| target.0))
    }
}

impl From<&Option<String>> for Value {
    fn from(word: &Option<String>) -> Self {
        Self::Word(word.clone())
    }
}

impl From<&Motion> for Value {
    fn from(command: &Motion) -> Self {
        let word = match command {
            Motion::Hold => "hold",
            Motion::Rate(_) => "rate v_m",
            Motion::Pose(_) => "pose x_b_d",
        };
        Self::Word(Some(word.to_owned()))
    }
}
