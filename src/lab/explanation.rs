//! One cycle of the controller, every intermediate of Fig. 3 by name, with unit, frame and equation.
//!
//! Nothing is computed twice: the values are those of the very step that the loop runs. The cycles
//! before it are those that lead there: reference set, deadman held, a cycle ago.

use nalgebra::Isometry3;

use crate::config::Config;
use crate::controller::Controller;
use crate::controller::Input;
use crate::controller::JointVector;
use crate::controller::Output;
use crate::controller::readings::Axes;
use crate::controller::readings::Readings;
use crate::controller::switches::Mode;
use crate::controller::switches::Switches;
use crate::lab::question::Posed;
use crate::lab::question::Question;
use crate::lab::question::Unanswerable;
use crate::spatial::Motion;
use crate::spatial::Twist;
use crate::spatial::Wrench;
use crate::spatial::rotation;

/// So long the hand rests where it was a cycle ago, in s, until every ramp is over.
const SETTLING: f64 = 2.0;

/// A value of Fig. 3.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// One number.
    Number(f64),
    /// A number of each axis or joint.
    Six([f64; 6]),
    /// Three numbers.
    Three([f64; 3]),
    /// A pose, as the rows of its 4 × 4 matrix.
    Pose([[f64; 4]; 4]),
    /// A matrix, row by row.
    Matrix([[f64; 6]; 6]),
    /// Targets of drives.
    Targets([i16; 6]),
    /// A word; nothing where there is none.
    Word(Option<String>),
}

/// One line of the explanation.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its name, as everywhere in this program.
    pub name: &'static str,
    /// What it is.
    pub what: &'static str,
    /// Equation or section of the paper.
    pub place: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The frame it is written in.
    pub frame: &'static str,
    /// Its value.
    pub value: Value,
}

/// The whole cycle, in the order it is computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation(pub Vec<Entry>);

/// Answers `question` for the controller of `config`, whose arm is at `start` if nothing is said.
///
/// # Errors
/// The first key of the question that cannot be.
pub fn explain(
    config: &Config,
    start: &JointVector,
    question: &Question,
) -> Result<Explanation, Unanswerable> {
    let x_b_m = &config.remote.x_b_m;
    let posed = question.pose(&config.controller, start, x_b_m, config.command_mode)?;
    let output = run(&posed);
    Ok(Explanation(entries(&posed, &output)))
}

/// The cycles that lead there, and the cycle itself.
fn run(posed: &Posed) -> Output {
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
                restart,
            },
        )
    };
    step(&posed.q_reference, up, true);
    step(&posed.q_reference, pressed, false);
    let period = posed.settings.period;
    for _ in 0..period.cycles(SETTLING) {
        step(&posed.q_before, held, false);
    }
    step(&posed.q, held, false)
}

/// Fig. 3 from top to bottom.
fn entries(posed: &Posed, output: &Output) -> Vec<Entry> {
    let settings = &posed.settings;
    let (readings, law) = (&settings.readings, &settings.command);
    let ledger = &output.ledger;
    let assist = ledger.centring + ledger.damping;
    let six = |tau: JointVector| Value::Six(tau.into());
    let joint = |joint: Option<usize>| Value::Word(joint.map(|joint| format!("{}", joint + 1)));
    let rotated = rotation::rotation_vector(&output.x_h_g.rotation);
    let omega = readings.orientation.rate(&output.dx_db.orientation);
    // What either mode would command from here.
    let rate_db = law.effective(Mode::Rate, &settings.channels, &output.dx);
    let pose_db = law.effective(Mode::Pose, &settings.channels, &output.dx);
    let v_m = law.rate(readings.orientation, &rate_db);
    let x_b_d = law.pose(readings, &output.reference, &pose_db);
    let f_w_task = output.f_g_task.at(settings.arm.grip());
    let entry =
        |name, what, place, unit, frame, value| Entry { name, what, place, unit, frame, value };
    vec![
        entry("q", "joint positions", "", "rad, m", "joints", six(output.q)),
        entry("x_0_h", "grip at the reference", "1", "m", "0", pose(&output.reference.x_0_h)),
        entry("x_0_g", "grip", "1", "m", "0", pose(&output.x_0_g)),
        entry("x_h_g", "grip from the reference", "2, 3", "m", "h", pose(&output.x_h_g)),
        entry(
            "dx",
            "the same as six numbers",
            "4",
            "m, rad",
            axes(readings),
            Value::Six(output.dx.components()),
        ),
        entry(
            "rotation_vector",
            "its rotation as a vector",
            "4",
            "rad",
            "h",
            Value::Three(rotated.into()),
        ),
        entry(
            "dx_db",
            "less the deadband",
            "Fig. 4",
            "m, rad",
            axes(readings),
            Value::Six(output.dx_db.components()),
        ),
        entry("omega", "angular rate of the numbers", "5", "rad", "m", Value::Three(omega.into())),
        entry("v_m", "rate command", "Fig. 3", "m/s, rad/s", "m", Value::Six(v_m.components())),
        entry("x_b_d", "pose command", "3.5", "m", "b", pose(&x_b_d)),
        entry(
            "command",
            "what is commanded",
            "3.5",
            "",
            "",
            Value::Word(Some(word(&output.command))),
        ),
        entry(
            "f_s",
            "wrench on the object at the sensor",
            "3.2",
            "N, N·m",
            "s",
            wrench(&posed.f_s),
        ),
        entry(
            "f_m_task",
            "the same at the frame under control",
            "6",
            "N, N·m",
            "m",
            wrench(&output.f_m_task),
        ),
        entry("f_g_task", "felt at the grip", "Fig. 3", "N, N·m", "g", wrench(&output.f_g_task)),
        entry("f_w_task", "the same at the wrist", "6", "N, N·m", "w", wrench(&f_w_task)),
        entry("f_g_centring", "return to centre", "8", "N, N·m", "g", wrench(&output.f_g_centring)),
        entry("v_g", "twist of the grip", "9", "m/s, rad/s", "g", twist(&output.moving.v_g)),
        entry("f_g_damping", "damping", "9", "N, N·m", "g", wrench(&output.f_g_damping)),
        entry(
            "f_g_passivity",
            "keeping contact passive",
            "",
            "N, N·m",
            "g",
            wrench(&output.port.f_g_passivity),
        ),
        entry("j_g", "Jacobian of the grip", "7", "m, 1", "g", jacobian(output)),
        entry("tau_task", "torques of the task", "7", "N·m, N", "joints", six(ledger.task)),
        entry(
            "tau_centring",
            "of the return to centre",
            "7",
            "N·m, N",
            "joints",
            six(ledger.centring),
        ),
        entry("tau_damping", "of damping", "7", "N·m, N", "joints", six(ledger.damping)),
        entry("tau_passivity", "of passivity", "", "N·m, N", "joints", six(ledger.passivity)),
        entry(
            "tau_soft_stops",
            "of the soft stops",
            "",
            "N·m, N",
            "joints",
            six(ledger.soft_stops),
        ),
        entry("tau_gravity", "carrying the arm", "3.3", "N·m, N", "joints", six(ledger.gravity)),
        entry("tau_assist", "return to centre and damping", "10", "N·m, N", "joints", six(assist)),
        entry(
            "tau_rg",
            "the same with gravity",
            "10",
            "N·m, N",
            "joints",
            six(assist + ledger.gravity),
        ),
        entry(
            "assist_scale",
            "what is left of the assist",
            "3.4",
            "",
            "",
            Value::Number(ledger.assist_scale),
        ),
        entry(
            "rest_scale",
            "what is left of the sum",
            "3.4",
            "",
            "",
            Value::Number(ledger.rest_scale),
        ),
        entry(
            "limiting_joint",
            "the joint that left no more",
            "3.4",
            "",
            "",
            joint(ledger.limiting_joint),
        ),
        entry(
            "slewing_joint",
            "the joint that is on its way",
            "",
            "",
            "",
            joint(ledger.slewing_joint),
        ),
        entry("tau", "torques asked for", "10", "N·m, N", "joints", six(output.tau)),
        entry(
            "targets",
            "the same as the drives take it",
            "Fig. 6",
            "‰",
            "drives",
            Value::Targets(output.targets.map(|target| target.0)),
        ),
        entry(
            "fault",
            "what cannot be",
            "",
            "",
            "",
            Value::Word(output.fault.map(|fault| fault.to_string())),
        ),
    ]
}

/// Where the translation of ΔX is written.
const fn axes(readings: &Readings) -> &'static str {
    match readings.displacement {
        Axes::Base => "0",
        Axes::Reference | Axes::Grip => "h",
    }
}

fn wrench(f: &Wrench) -> Value {
    Value::Six(f.components())
}

fn twist(v: &Twist) -> Value {
    Value::Six(v.components())
}

fn pose(x: &Isometry3<f64>) -> Value {
    let matrix = x.to_homogeneous();
    Value::Pose(std::array::from_fn(|row| matrix.row(row).into_owned().into()))
}

fn jacobian(output: &Output) -> Value {
    let mut rows = [[0.0; 6]; 6];
    let j_g = &output.j_g;
    let written = j_g.linear.row_iter().chain(j_g.angular.row_iter());
    for (row, from) in rows.iter_mut().zip(written) {
        *row = from.into_owned().into();
    }
    Value::Matrix(rows)
}

fn word(command: &Motion) -> String {
    match command {
        Motion::Hold => "hold",
        Motion::Rate(_) => "rate v_m",
        Motion::Pose(_) => "pose x_b_d",
    }
    .to_owned()
}
