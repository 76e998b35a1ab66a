//! Test forces along one axis at a time (4.2): the wrench on a hand that holds still, with either torque curve.
//!
//! The motors have the rig's curves, the controller has the maker's lines or the fitted polynomials. Gravity compensation
//! uses the same curves, so its error acts on the hand, too, and is reported as the force without a test force.

use derive_more::Display;
use nalgebra::Vector3;
use serde::Serialize;

use crate::fidelity::trial::Arm;
use crate::no_trial::NoTrial;
use crate::opening;
use crate::torque_curves::calibration::JointCurves;
use config::Config;
use controller::calibration::TorqueCurve;
use sim::operator_settings::OperatorSettings;
use sim::scenario::{ConsoleRequest, Problem, Scenario};
use testbench::bench::Bench;
use testbench::truth::Truth;
use units::spatial::Wrench;

/// Test force in N, and test moment in N·m, at the grip.
pub const TEST_FORCE: f64 = 5.0;
pub const TEST_MOMENT: f64 = 0.15;

/// Start of the first segment, in s: every ramp of the reflection is over.
const START_S: f64 = 4.0;

/// Duration of a segment, of the rise of its force, and of the average at its end, in s.
const SEGMENT_S: f64 = 1.5;
const RISE_S: f64 = 0.4;
const AVERAGED_S: f64 = 0.5;

/// Segments: rest before, between and after the six test forces.
const SEGMENTS: u8 = 13;

/// Torque curve of the controller.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Curve {
    /// Straight line of the data sheets.
    #[display("maker's line")]
    MakersLine,
    /// Polynomial of 5th order, fitted on the rig.
    #[display("polynomial")]
    Polynomial,
}

impl Curve {
    /// Both curves.
    pub const ALL: [Self; 2] = [Self::MakersLine, Self::Polynomial];

    const fn torque_curve(self, joint: &JointCurves) -> TorqueCurve {
        match self {
            Self::MakersLine => joint.line,
            Self::Polynomial => joint.fitted,
        }
    }
}

/// Errors of one test force or moment at the hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ForceError {
    /// Error of the component along the wanted force, in percent of its magnitude.
    pub size_percent: f64,
    /// Angle between the measured and the wanted force, in degrees.
    pub turned_deg: f64,
    /// Magnitude of the vector error, in percent of the wanted magnitude.
    pub error_percent: f64,
}

/// Result of one run.
#[derive(Clone, Debug, Serialize)]
pub struct TestForceResult {
    /// Name of the configuration.
    pub config: String,
    /// Simulated arm.
    pub arm: Arm,
    /// Torque curve of the controller.
    pub curve: Curve,
    /// Seed of the motors.
    pub seed: u64,
    /// Force on the hand before the first test force, in N; absent where the reflection ended early.
    pub weight_n: Option<f64>,
    /// Errors of forces along x, y, z and moments about them; absent where K_T is zero or the reflection ended early.
    pub felt: [Option<ForceError>; 6],
    /// Cause of a stop.
    pub stopped_by: Option<String>,
}

impl TestForceResult {
    /// Plays one run: the motors have the curves of `joint_curves`, the controller has `curve`.
    ///
    /// # Errors
    /// Returns an error if the number of curves is not six, or the drives cannot be enabled.
    pub fn play(
        name: &str,
        config: &Config,
        joint_curves: &[JointCurves],
        (arm, curve, seed): (Arm, Curve, u64),
    ) -> Result<Self, NoTrial> {
        let curves = |of: fn(Curve, &JointCurves) -> TorqueCurve| {
            let curves: Vec<TorqueCurve> =
                joint_curves.iter().map(|joint| of(curve, joint)).collect();
            <[TorqueCurve; 6]>::try_from(curves)
                .map_err(|curves| NoTrial::Joints { found: curves.len() })
        };
        let world = config.clone().with_friction(arm.friction());
        let world = world.with_torque_curves(curves(|_, joint| joint.truth)?);
        let node = arm.controlled(config).with_torque_curves(curves(Curve::torque_curve)?);
        let mut bench = Bench::in_world_of(&world, &node, script()?, seed, ());
        bench.bring_up()?;
        let mut truth = Truth::new(&node);
        let mut segments = vec![Segment::default(); SEGMENTS.into()];
        let mut stopped_by = None;
        for _ in 0..config.controller.period.cycles(seconds()) {
            let t = bench.elapsed().as_secs_f64() - START_S;
            bench.set_sensor_fault(Some(sensed(config, t)));
            let record = bench.cycle();
            stopped_by = record.cause.map(|cause| cause.to_string());
            let Some(sample) = truth.sample(&bench, &record) else { continue };
            let t = record.at.since(bench.begun()).as_secs_f64() - START_S;
            if let Some(segment) = averaged(t).and_then(|place| segments.get_mut(place)) {
                segment.add(&sample.reference, &sample.felt);
            }
        }
        Ok(Self {
            config: name.to_owned(),
            arm,
            curve,
            seed,
            weight_n: segments.first().and_then(Segment::weight),
            felt: feelings(&segments),
            stopped_by,
        })
    }
}

/// Sums over the averaged part of a segment.
#[derive(Clone, Copy, Debug, Default)]
struct Segment {
    count: f64,
    reference: Wrench,
    felt: Wrench,
}

impl Segment {
    fn add(&mut self, reference: &Wrench, felt: &Wrench) {
        self.count += 1.0;
        self.reference = self.reference + *reference;
        self.felt = self.felt + *felt;
    }

    fn mean(&self, sum: &Wrench) -> Wrench {
        Wrench::from_components(sum.components().map(|sum| sum / self.count.max(1.0)))
    }

    fn weight(&self) -> Option<f64> {
        (self.count > 0.0).then(|| self.felt().force.norm())
    }

    fn reference(&self) -> Wrench {
        self.mean(&self.reference)
    }

    fn felt(&self) -> Wrench {
        self.mean(&self.felt)
    }
}

/// Returns the errors of the six test forces, each the mean of a segment minus that of its neighbours.
fn feelings(segments: &[Segment]) -> [Option<ForceError>; 6] {
    [0, 1, 2, 3, 4, 5].map(|place: usize| {
        let [before, pressed, after] = segments.get(2 * place..2 * place + 3)? else { return None };
        if [before, pressed, after].iter().any(|segment| segment.count <= 0.0) {
            return None;
        }
        let felt = pressed.felt() - (before.felt() + after.felt()) * 0.5;
        let reference = pressed.reference();
        match place {
            0..3 => feel(&reference.force, &felt.force),
            _ => feel(&reference.moment, &felt.moment),
        }
    })
}

fn feel(reference: &Vector3<f64>, felt: &Vector3<f64>) -> Option<ForceError> {
    let size = reference.norm();
    (size > f64::EPSILON).then(|| ForceError {
        size_percent: 100.0 * (felt.dot(reference) / (size * size) - 1.0),
        turned_deg: reference.angle(felt).to_degrees(),
        error_percent: 100.0 * (felt - reference).norm() / size,
    })
}

/// Returns a script in pose mode, armed, with deadman and reflection on until the end.
fn script() -> Result<Scenario, Problem> {
    let entries = opening::engaged(ConsoleRequest::Pose, opening::SWITCHES_S);
    Ok(Scenario::new(seconds(), entries)?.with_operator(OperatorSettings::STEADY))
}

fn seconds() -> f64 {
    START_S + SEGMENT_S * f64::from(SEGMENTS)
}

/// Returns the sensed wrench at `t` s after the start: the test force at the grip, divided by K_T.
fn sensed(config: &Config, t: f64) -> Wrench {
    let mut components = [0.0; 6];
    let gains = config.controller.reflection.gain().values();
    let sizes = [TEST_FORCE, TEST_FORCE, TEST_FORCE, TEST_MOMENT, TEST_MOMENT, TEST_MOMENT];
    let axes = components.iter_mut().zip(gains.iter().zip(sizes));
    for (place, (component, (gain, size))) in (0..6_u8).zip(axes) {
        let since = t - SEGMENT_S * f64::from(2 * place + 1);
        // The force falls at the same rate in the segment of rest that follows.
        let share = (since / RISE_S).min(1.0 + (SEGMENT_S - since) / RISE_S).clamp(0.0, 1.0);
        if *gain > 0.0 {
            *component = size / gain * share;
        }
    }
    Wrench::from_components(components)
}

/// Returns the segment that is averaged at `t` s after the start; `None` at other times.
fn averaged(t: f64) -> Option<usize> {
    (0..usize::from(SEGMENTS)).zip(0..SEGMENTS).find_map(|(place, segment)| {
        let end = SEGMENT_S * (f64::from(segment) + 1.0);
        (end - AVERAGED_S..end).contains(&t).then_some(place)
    })
}
