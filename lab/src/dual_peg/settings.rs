//! Settings of the dual-peg experiment, from `lab/config/dual_peg.toml`. They apply to every condition; the two
//! switches are not among them.

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use toml::de::DeTable;

use crate::dual_peg::peg_operator::PegOperatorSettings;
use crate::dual_peg::settings_file as raw;
use config::Config;
use config::files::{self, Files};
use config::problem::{self, Invalid, Problems};
use config::robots::RobotArm;
use config::section::{Section, Table};
use config::trust::Trust;
use config::value::{HasPlace, Value};
use controller::gains::Gains;
use controller::stability::bounds;
use remote::site::Virtual;
use robot::accommodation::Accommodation;
use robot::wrench_limit::WrenchLimit;
use sim::contact::{Holes, Pegs, Plate, Surface};
use sim::wrist_sensor::WristSensorSettings;
use toml_input::List;

/// Path of the settings that are compiled in.
const SHIPPED: &str = "lab/config/dual_peg.toml";

/// Text of the compiled-in settings.
const TEXT: &str = include_str!("../../config/dual_peg.toml");

/// Number of pegs, and of holes.
const COUNT: u8 = 2;

/// Depth at which the damping of the plate reaches its full value, in m.
const DAMPING_DEPTH: f64 = 1e-4;

/// Checked settings of the experiment.
#[derive(Clone, Debug)]
pub struct DualPeg {
    /// Path of the settings file.
    pub file: PathBuf,
    /// Hand controller with the robot, accommodation and reflection of the experiment, both switches on.
    pub config: Config,
    /// Names of the operators' presets.
    pub operators: Vec<String>,
    /// Trials of each operator in each condition.
    pub trials: u32,
    /// Time after which a trial has failed, in s.
    pub max_seconds: f64,
    /// Pegs, with {MRF} at their ends.
    pub pegs: Pegs,
    /// Plate with holes, at the origin.
    pub plate: Plate,
    /// Contact force and moment that stop the arm, in N and N·m.
    pub stop: WrenchLimit,
    /// Wrist sensor, ideal except for its noise.
    pub sensor: WristSensorSettings,
    /// Task and visual error of the operator.
    pub task: PegOperatorSettings,
    /// Height of the start above the plate, in m.
    pub start_height: f64,
    /// Range of the initial position error, in m.
    pub misalignment: [f64; 2],
    /// Range of the initial orientation error, in rad.
    pub turn: [f64; 2],
    /// Values of the sweeps over visual error and misalignment.
    pub sweep: Sweep,
}

/// Values of the sweeps, one at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Visual errors, in m.
    pub visual_errors: Vec<f64>,
    /// Initial position errors, in m.
    pub misalignments: Vec<f64>,
    /// Number of trials of each operator at each value.
    pub trials: u32,
}

impl DualPeg {
    /// Reads and checks a file. If `lab/config/dual_peg.toml` does not exist, the compiled-in copy is used.
    ///
    /// # Errors
    /// Returns every problem found, in the file and in the files that it names.
    pub fn load(file: &Path) -> Result<Self, Invalid> {
        let shipped = (file == Path::new(SHIPPED) && !file.exists()).then_some(TEXT);
        match shipped {
            Some(text) => Self::parse(file, text),
            None => Self::parse(file, &problem::text(&Files::on_disk(Trust::Any), file)?),
        }
    }

    /// Checks `text`, the content of `file`; paths in it are relative to the folder of `file`.
    ///
    /// # Errors
    /// Returns every problem found, in the text and in the files that it names.
    pub fn parse(file: &Path, text: &str) -> Result<Self, Invalid> {
        let mut problems = Problems::new(file, text, &Files::on_disk(Trust::Any));
        let document = DeTable::parse(text).map_err(|error| problems.add_error(&error));
        let raw = document.ok().map(|document| {
            let table = Table::root(&document, &problems);
            raw::DualPegFile::from_table(&table, &mut problems)
        });
        let read = raw.and_then(|raw| read(file, &raw, &mut problems));
        problems.finish()?;
        read.ok_or_else(|| Invalid(Vec::new()))
    }
}

/// Returns the settings, or `None` with at least one problem added.
fn read(file: &Path, raw: &raw::DualPegFile, problems: &mut Problems<'_>) -> Option<DualPeg> {
    let config = config(file, raw, problems);
    let trials = problems.within(&raw.trials, 1..=10_000);
    let max_seconds = problems.within(&raw.max_seconds, 5.0..=600.0);
    let pegs = pegs(&raw.pegs, problems);
    let insert_depth = insert_depth(raw, problems);
    let plate = plate(raw, pegs, problems);
    let stop_force = problems.positive(&raw.control.stop_force_n);
    let stop_moment = problems.positive(&raw.control.stop_moment_nm);
    let noise_force = problems.not_negative(&raw.control.sensor_noise_n);
    let noise_moment = problems.not_negative(&raw.control.sensor_noise_nm);
    let task = task(&raw.operator, insert_depth, problems);
    let start_height = problems.within(&raw.start.height_m, 1e-3..=0.2);
    let misalignment = range(&raw.start.misalignment_m, 0.02, problems);
    let turn = range(&raw.start.misalignment_deg, 20.0, problems);
    check_start(start_height, pegs, turn, raw, problems);
    let sweep = sweep(&raw.sweep, problems);
    let operators = raw.operators.as_ref()?.clone();
    if operators.is_empty() {
        problems.add(&raw.operators, "must name at least one operator");
    }
    let config = config?;
    check_accommodation(&config, raw, problems);
    let noise = per_axis(noise_force?, noise_moment?);
    Some(DualPeg {
        file: file.to_path_buf(),
        config,
        operators,
        trials: trials?,
        max_seconds: max_seconds?,
        pegs: pegs?,
        plate: plate?,
        stop: WrenchLimit { force: stop_force?, moment: stop_moment? },
        sensor: WristSensorSettings { noise, ..WristSensorSettings::IDEAL },
        task: task?,
        start_height: start_height?,
        misalignment: misalignment?,
        turn: turn?.map(f64::to_radians),
        sweep: sweep?,
    })
}

/// Returns six values: one for the three linear axes, and one for the three angular ones.
const fn per_axis(linear: f64, angular: f64) -> [f64; 6] {
    [linear, linear, linear, angular, angular, angular]
}

/// Returns the hand controller with the robot, accommodation and reflection of the experiment.
fn config(file: &Path, raw: &raw::DualPegFile, problems: &mut Problems<'_>) -> Option<Config> {
    let named = |name: &String| files::beside(file, name);
    let hand = Config::load(&named(raw.hand_controller.as_ref()?));
    let robot = RobotArm::load(&named(raw.robot.as_ref()?));
    let hand = hand.map_err(|invalid| problems.absorb(invalid)).ok();
    let robot = robot.map_err(|invalid| problems.absorb(invalid)).ok();
    let linear = problems.within(&raw.control.accommodation_m_per_ns, 0.0..=1e3);
    let angular = problems.within(&raw.control.accommodation_rad_per_nms, 0.0..=1e3);
    let List([force, moment]) = raw.control.wrench_gain.get()?;
    let gain = Gains::new(per_axis(force, moment), "wrench_gain");
    let gain = problems.take(&raw.control.wrench_gain, gain);
    let law = Accommodation::new(per_axis(linear?, angular?), [0.0; 6]);
    let law = problems.take(&raw.control.accommodation_m_per_ns, law);
    let config = hand?.with_robot(robot?);
    // The plate is the only thing to touch.
    let remote = Virtual { wall: None, block: None, sphere: None, ..config.remote.clone() };
    Some(config.with_remote(remote).with_switches_at(gain?, law?))
}

/// Adds a problem where K_FA exceeds the servo's bound (`controller::stability`) at the stiffness of both pegs.
fn check_accommodation(config: &Config, raw: &raw::DualPegFile, problems: &mut Problems<'_>) {
    let Some(stiffness) = raw.contact.stiffness_n_per_m.get() else { return };
    let (lag, both) = (config.remote.servo.time_constant(), 2.0 * stiffness);
    let yield_rate = config.remote.interaction.accommodation.gain()[2] * both;
    let fastest = bounds::max_yield_rate_without_oscillation(lag);
    if yield_rate > fastest {
        let reason = format!(
            "K_FA k_e τ_s must be at most {}, got {:.3} with k_e = {both:.0} N/m of both pegs and \
             τ_s = {lag} s: at most {:.2e} m/s per N, or a softer contact",
            fastest * lag,
            yield_rate * lag,
            fastest / both
        );
        problems.add(&raw.control.accommodation_m_per_ns, reason);
    }
}

/// Adds a problem where pegs that are turned as far as allowed would start inside the plate.
fn check_start(
    height: Option<f64>,
    pegs: Option<Pegs>,
    turn: Option<[f64; 2]>,
    raw: &raw::DualPegFile,
    problems: &mut Problems<'_>,
) {
    let (Some(height), Some(pegs), Some([_, turn])) = (height, pegs, turn) else { return };
    let reach = (pegs.spacing / 2.0 + pegs.radius) * turn.to_radians().sin();
    if height <= reach {
        let reason = format!(
            "must be above {reach:.4}, got {height}: pegs that are turned by {turn}° would start in the plate; \
             start higher, or lower misalignment_deg"
        );
        problems.add(&raw.start.height_m, reason);
    }
}

fn pegs(raw: &raw::Pegs, problems: &mut Problems<'_>) -> Option<Pegs> {
    let radius = problems.within(&raw.radius_m, 1e-3..=0.1);
    let length = problems.within(&raw.length_m, 1e-3..=0.5);
    let spacing = problems.within(&raw.spacing_m, 2e-3..=1.0);
    let chamfer = problems.not_negative(&raw.chamfer_m);
    Some(Pegs {
        x_m_t: Isometry3::translation(0.0, 0.0, -length?),
        count: COUNT,
        radius: radius?,
        length: length?,
        spacing: spacing?,
        chamfer_width: chamfer?,
        chamfer_length: chamfer?,
    })
}

fn plate(raw: &raw::DualPegFile, pegs: Option<Pegs>, problems: &mut Problems<'_>) -> Option<Plate> {
    let radius = problems.positive(&raw.holes.radius_m);
    let chamfer = problems.not_negative(&raw.holes.chamfer_m);
    let thickness = problems.positive(&raw.holes.thickness_m);
    let stiffness = problems.within(&raw.contact.stiffness_n_per_m, 1e2..=1e6);
    let damping = problems.not_negative(&raw.contact.damping_ns_per_m);
    let friction = problems.within(&raw.contact.friction, 0.0..=2.0);
    if let (Some(hole), Some(peg)) = (radius, raw.pegs.radius_m.get())
        && hole <= peg
    {
        let reason = format!(
            "must be above pegs.radius_m = {peg}, got {hole}: no peg enters; widen the holes or use thinner pegs"
        );
        problems.add(&raw.holes.radius_m, reason);
    }
    let (chamfer, spacing) = (chamfer?, pegs?.spacing);
    let (chamfer_width, chamfer_depth) = (chamfer, chamfer);
    let (stiffness, damping, friction) = (stiffness?, damping?, friction?);
    Some(Plate {
        x_b_p: Isometry3::identity(),
        half_size: [spacing, spacing],
        thickness: thickness?,
        holes: Holes { count: COUNT, radius: radius?, spacing, chamfer_width, chamfer_depth },
        surface: Surface { stiffness, damping, damping_depth: DAMPING_DEPTH, friction },
    })
}

fn insert_depth(raw: &raw::DualPegFile, problems: &mut Problems<'_>) -> Option<f64> {
    let insert_depth = problems.positive(&raw.holes.insert_depth_m);
    if let (Some(depth), Some(length)) = (insert_depth, raw.pegs.length_m.get())
        && depth >= length
    {
        let reason = format!("must be below pegs.length_m = {length}, got {depth}");
        problems.add(&raw.holes.insert_depth_m, reason);
    }
    insert_depth
}

fn task(
    raw: &raw::PegOperator,
    insert_depth: Option<f64>,
    problems: &mut Problems<'_>,
) -> Option<PegOperatorSettings> {
    let visual_delay = problems.within(&raw.visual_delay_s, 0.0..=1.0);
    let visual_error = problems.within(&raw.visual_error_m, 0.0..=0.05);
    let visual_turn_error = problems.within(&raw.visual_error_deg, 0.0..=20.0);
    let tolerance = problems.not_negative(&raw.tolerance_m);
    let turn_tolerance = problems.not_negative(&raw.tolerance_deg);
    let approach_speed = problems.within(&raw.approach_m_per_s, 1e-4..=0.5);
    let insert_speed = problems.within(&raw.insert_m_per_s, 1e-4..=0.5);
    let near = problems.positive(&raw.near_m);
    let correction = problems.positive(&raw.correction_per_s);
    let max_correction = problems.positive(&raw.max_correction_m_per_s);
    let max_turn = problems.positive(&raw.max_turn_deg_per_s);
    let effort = problems.within(&raw.effort_per_s, 0.0..=10.0);
    let stall_distance = problems.positive(&raw.stall_m);
    let stall_time = problems.positive(&raw.stall_s);
    let back_off = problems.positive(&raw.back_off_m);
    let search_step = problems.not_negative(&raw.search_m);
    Some(PegOperatorSettings {
        visual_delay: visual_delay?,
        visual_error: visual_error?,
        visual_turn_error: visual_turn_error?.to_radians(),
        tolerance: tolerance?,
        turn_tolerance: turn_tolerance?.to_radians(),
        approach_speed: approach_speed?,
        insert_speed: insert_speed?,
        near: near?,
        correction: correction?,
        max_correction: max_correction?,
        max_turn: max_turn?.to_radians(),
        effort: effort?,
        stall_distance: stall_distance?,
        stall_time: stall_time?,
        back_off: back_off?,
        search_step: search_step?,
        insert_depth: insert_depth?,
    })
}

/// Returns a rising range within 0 and `most`.
fn range(value: &Value<List<f64, 2>>, most: f64, problems: &mut Problems<'_>) -> Option<[f64; 2]> {
    let List([low, high]) = value.get()?;
    if !(0.0 <= low && low <= high && high <= most) {
        let reason = format!("must rise within 0..={most}, got {low} to {high}");
        problems.add(value, reason);
    }
    Some([low, high])
}

fn sweep(raw: &raw::PegSweep, problems: &mut Problems<'_>) -> Option<Sweep> {
    let trials = problems.within(&raw.trials, 1..=10_000);
    let mut list = |value: &Value<Vec<f64>>| {
        let all = value.as_ref()?.clone();
        if let Some(wrong) = all.iter().find(|one| !(0.0..=0.05).contains(*one)) {
            problems.add(value.place(), format_args!("must be within 0..=0.05, got {wrong}"));
        }
        Some(all)
    };
    let (visual_errors, misalignments) = (list(&raw.visual_error_m), list(&raw.misalignment_m));
    Some(Sweep { visual_errors: visual_errors?, misalignments: misalignments?, trials: trials? })
}
