//! Inputs of an explained cycle: joint positions, wrench, switches, and changes of the configuration.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use thiserror::Error;

use controller::calibration::{Calibration, JointCalibration, TorqueCurve};
use controller::channels::Channels;
use controller::gains::{Gains, InvalidGain, MAX_GAIN};
use controller::interpretation::Interpretation;
use controller::limits::AssistFraction;
use controller::period::Period;
use controller::reflection::Reflection;
use controller::switches::CommandMode;
use controller::{Extensions, JointVector, Settings};
use units::spatial::Wrench;

/// Pose as its 4 × 4 matrix, row by row.
type Rows = [[f64; 4]; 4];

/// Largest deviation of a rotation's rows from unit length and right angles.
const MAX_NON_ORTHONORMAL: f64 = 1e-6;

/// Largest force and moment of a question that sets its own gains, in N and N·m.
const UNLIMITED: f64 = 1e6;

/// Inputs of an explained cycle. Keys are the names of this program; those of the paper's symbols are accepted, too.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Question {
    /// Joint positions now, in rad or m.
    #[serde(alias = "q_now")]
    pub q: Option<[f64; 6]>,
    /// Joint positions one cycle earlier, in rad or m; those of `q` by default.
    #[serde(alias = "q_prev")]
    pub q_before: Option<[f64; 6]>,
    /// Joint positions when the reference was set, in rad or m; those of `q` by default.
    #[serde(alias = "q_ref")]
    pub q_reference: Option<[f64; 6]>,
    /// Wrench on the object at {S}, payload removed, in N and N·m.
    #[serde(alias = "F_S_contact")]
    pub f_s: Option<[f64; 6]>,
    /// Pose of the object in {b} when the reference was set.
    #[serde(alias = "T_ref_object")]
    pub x_b_r: Option<Rows>,
    /// `rate` or `pose`.
    pub mode: Option<String>,
    /// `consistent` or `paper1997`.
    pub preset: Option<String>,
    /// State of the deadman; pressed by default.
    pub deadman: Option<bool>,
    /// State of reflection; on by default.
    pub reflection: Option<bool>,
    /// State of the extensions of the paper's law; off by default.
    pub layers: bool,
    /// Pose of the sensor in {MRF}.
    #[serde(alias = "T_MRF_S")]
    pub x_m_s: Option<Rows>,
    /// Gravity in {0}, in m/s².
    pub gravity_m_per_s2: Option<[f64; 3]>,
    /// Cycle period, in s.
    #[serde(alias = "T_cycle")]
    pub period_s: Option<f64>,
    /// K_V, in 1/s.
    #[serde(alias = "K_V")]
    pub rate_gain: Option<[f64; 6]>,
    /// K_P.
    #[serde(alias = "K_P")]
    pub pose_gain: Option<[f64; 6]>,
    /// K_T.
    #[serde(alias = "K_T")]
    pub wrench_gain: Option<[f64; 6]>,
    /// Half-widths of the deadbands, in m and rad.
    pub deadband: Option<[f64; 6]>,
    /// Parabolic constant of Eq. 8: plateau over deadband squared.
    #[serde(alias = "a")]
    pub parabola: Option<[f64; 6]>,
    /// K_D, in N·s/m and N·m·s/rad.
    #[serde(alias = "K_D_SI")]
    pub damping: Option<[f64; 6]>,
    /// Capacities, in N·m or N; torque curves become straight lines to 1000 ‰.
    #[serde(alias = "tau_cap")]
    pub max_torque: Option<[f64; 6]>,
    /// Share of the capacities for the assist, 0 to 1.
    pub assist_fraction: Option<f64>,
}

/// Invalid key of a question.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{key}: {reason}")]
pub struct InvalidQuestion {
    /// Name of the key.
    pub key: &'static str,
    /// Reason to reject its value.
    pub reason: String,
}

/// Checked inputs with all defaults.
#[derive(Clone, Debug)]
pub(super) struct CycleInputs {
    pub(super) settings: Settings,
    pub(super) q: JointVector,
    pub(super) q_before: JointVector,
    pub(super) q_reference: JointVector,
    pub(super) f_s: Wrench,
    pub(super) x_b_r: Isometry3<f64>,
    pub(super) mode: CommandMode,
    pub(super) deadman: bool,
    pub(super) reflection: bool,
}

impl Question {
    /// Returns the given keys that change the configuration, each with the setting that takes its place.
    pub fn keys_of_the_configuration(
        &self,
    ) -> impl Iterator<Item = (&'static str, &'static str)> + use<> {
        [
            (self.gravity_m_per_s2.is_some(), "gravity_m_per_s2", "arm.gravity_m_per_s2=[…]"),
            (self.period_s.is_some(), "period_s", "node.sync_period_us=…"),
            (self.rate_gain.is_some(), "rate_gain", "controller.rate_gain_per_s=[…]"),
            (self.pose_gain.is_some(), "pose_gain", "controller.pose_gain=[…]"),
            (self.wrench_gain.is_some(), "wrench_gain", "controller.wrench_gain=[…]"),
            (self.deadband.is_some(), "deadband", "controller.deadband_m=[…], deadband_rad=[…]"),
            (self.parabola.is_some(), "parabola", "controller.centring_n=[…], centring_nm=[…]"),
            (
                self.damping.is_some(),
                "damping",
                "controller.damping_ns_per_m=[…], damping_nms_per_rad=[…]",
            ),
            (self.max_torque.is_some(), "max_torque", "joint[0].max_torque_nm=…"),
            (self.assist_fraction.is_some(), "assist_fraction", "controller.assist_fraction=…"),
        ]
        .into_iter()
        .filter_map(|(is_given, key, setting)| is_given.then_some((key, setting)))
    }

    /// Completes the question by `settings`, the arm at `start`, the object at `x_b_m` and commands of `mode`.
    ///
    /// # Errors
    /// Returns the first invalid key.
    pub(super) fn pose(
        &self,
        settings: &Settings,
        start: &JointVector,
        x_b_m: &Isometry3<f64>,
        mode: CommandMode,
    ) -> Result<CycleInputs, InvalidQuestion> {
        let q = joints("q", self.q, start)?;
        Ok(CycleInputs {
            settings: self.over(settings)?,
            q,
            q_before: joints("q_before", self.q_before, &q)?,
            q_reference: joints("q_reference", self.q_reference, &q)?,
            f_s: Wrench::from_components(self.f_s.unwrap_or_default()),
            x_b_r: self.x_b_r.as_ref().map_or(Ok(*x_b_m), |rows| pose("x_b_r", rows))?,
            mode: match self.mode.as_deref() {
                None => mode,
                Some("rate") => CommandMode::Rate,
                Some("pose") => CommandMode::Pose,
                Some(other) => {
                    return Err(wrong("mode", format!("must be rate or pose, got \"{other}\"")));
                }
            },
            deadman: self.deadman.unwrap_or(true),
            reflection: self.reflection.unwrap_or(true),
        })
    }

    /// Returns `settings` with the changes of the question.
    fn over(&self, settings: &Settings) -> Result<Settings, InvalidQuestion> {
        let mut over = *settings;
        if !self.layers {
            over.extensions = Extensions::default();
        }
        over.interpretation = match self.preset.as_deref() {
            None => over.interpretation,
            Some("consistent") => Interpretation::CONSISTENT,
            Some("paper1997") => Interpretation::PAPER_1997,
            Some(other) => {
                return Err(wrong(
                    "preset",
                    format!("must be consistent or paper1997, got \"{other}\""),
                ));
            }
        };
        if let Some(period) = self.period_s {
            over.period = named("period_s", Period::new(period))?;
        }
        let gains = |key, values: Option<[f64; 6]>, kept| {
            values.map_or(Ok(kept), |values| checked_gains(key, values))
        };
        over.command.rate_gain = gains("rate_gain", self.rate_gain, over.command.rate_gain)?;
        over.command.pose_gain = gains("pose_gain", self.pose_gain, over.command.pose_gain)?;
        over.damping = gains("damping", self.damping, over.damping)?;
        if let Some(gravity) = self.gravity_m_per_s2 {
            over.arm = named("gravity_m_per_s2", over.arm.in_gravity(gravity))?;
        }
        if let Some(fraction) = self.assist_fraction {
            over.assist_fraction = named("assist_fraction", AssistFraction::new(fraction))?;
        }
        over.channels = self.channels(over.channels)?;
        over.reflection = self.reflecting(over.reflection)?;
        over.calibration = self.calibrated(over.calibration)?;
        Ok(over)
    }

    fn channels(&self, kept: Channels) -> Result<Channels, InvalidQuestion> {
        match (self.deadband, self.parabola) {
            (None, None) => Ok(kept),
            (Some(deadband), Some(parabola)) => {
                let mut plateau = parabola;
                for (plateau, deadband) in plateau.iter_mut().zip(deadband) {
                    *plateau *= deadband * deadband;
                }
                named("deadband", Channels::new(deadband, plateau))
            }
            _ => Err(wrong("deadband", "deadband and parabola must be given together".to_owned())),
        }
    }

    fn reflecting(&self, kept: Reflection) -> Result<Reflection, InvalidQuestion> {
        if self.wrench_gain.is_none() && self.x_m_s.is_none() {
            return Ok(kept);
        }
        let x_m_s = self.x_m_s.as_ref().map_or(Ok(*kept.sensor()), |rows| pose("x_m_s", rows))?;
        let gain = self.wrench_gain;
        let gain = gain.map_or(Ok(*kept.gain()), |values| checked_gains("wrench_gain", values))?;
        named("wrench_gain", Reflection::new(x_m_s, gain, UNLIMITED, UNLIMITED))
    }

    fn calibrated(&self, kept: Calibration<6>) -> Result<Calibration<6>, InvalidQuestion> {
        let Some(max_torque) = self.max_torque else { return Ok(kept) };
        let [a, b, c, d, e, f] = max_torque.map(|max| {
            let line = TorqueCurve::new([1e3 / max, 0.0, 0.0], max);
            let line = named("max_torque", line)?;
            named("max_torque", JointCalibration::new(1_000, 1.0, 0, line))
        });
        Ok(Calibration::new([a?, b?, c?, d?, e?, f?]).coupled(*kept.coupling()))
    }
}

fn wrong(key: &'static str, reason: String) -> InvalidQuestion {
    InvalidQuestion { key, reason }
}

/// Returns gains of a key, which the error names once.
fn checked_gains(key: &'static str, values: [f64; 6]) -> Result<Gains, InvalidQuestion> {
    let wrong_axis = |InvalidGain { axis, value, .. }| {
        wrong(key, format!("{axis} must be within 0 and {MAX_GAIN}, got {value}"))
    };
    Gains::new(values, key).map_err(wrong_axis)
}

fn named<T, E: std::fmt::Display>(
    key: &'static str,
    result: Result<T, E>,
) -> Result<T, InvalidQuestion> {
    result.map_err(|error| wrong(key, error.to_string()))
}

fn joints(
    key: &'static str,
    given: Option<[f64; 6]>,
    otherwise: &JointVector,
) -> Result<JointVector, InvalidQuestion> {
    let q = given.map_or(*otherwise, JointVector::from);
    if q.iter().all(|position| position.abs() <= 1e3) {
        Ok(q)
    } else {
        Err(wrong(key, "joint positions must be within -1000..=1000".to_owned()))
    }
}

/// Returns a pose from its matrix.
fn pose(key: &'static str, rows: &Rows) -> Result<Isometry3<f64>, InvalidQuestion> {
    let [[a, b, c, x], [d, e, f, y], [g, h, i, z], last] = *rows;
    let matrix = Matrix3::new(a, b, c, d, e, f, g, h, i);
    let square = (matrix * matrix.transpose() - Matrix3::identity()).norm();
    let is_pose = square < MAX_NON_ORTHONORMAL
        && matrix.determinant() > 0.0
        && last
            .iter()
            .zip([0.0, 0.0, 0.0, 1.0])
            .all(|(is, should)| (is - should).abs() < MAX_NON_ORTHONORMAL)
        && Vector3::new(x, y, z).norm() < UNLIMITED;
    if !is_pose {
        return Err(wrong(key, "must be the 4 × 4 matrix of a pose".to_owned()));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}
