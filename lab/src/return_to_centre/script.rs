//! Script of one axis: the operator moves the grip slowly along it to both sides of the reference, and lets go.
//!
//! ```text
//!  0 … 3.5 s      rate mode; deadman, reflection and reference are pressed, the hand rests
//!  out            to the positive end
//!  across, back   to the negative end and to the positive one: both sides are crossed in both directions
//!  release        the hand opens at the positive end; the deadman stays closed, so that the return acts
//! ```

use nalgebra::Vector3;

use crate::displacement;
use crate::opening;
use config::Config;
use sim::operator_settings::OperatorSettings;
use sim::scenario::operator::{Hold, Move};
use sim::scenario::{ConsoleRequest, Entry, Scenario};

/// Start of the motion, in s: every ramp of the reflection is over.
const START_S: f64 = 3.5;

/// Displacement along an axis with a deadband, in half-widths of it.
const REACH_DEADBANDS: f64 = 4.0;

/// Displacement into a configured wall, in half-widths of the deadband.
const INTO_WALL_DEADBANDS: f64 = 1.0;

/// Displacement along an axis without a deadband, in m and rad.
const REACH_WITHOUT: [f64; 2] = [0.03, 0.2];

/// Rest at each end, and time after the release, in s.
const REST_S: f64 = 0.5;
const RETURN_S: f64 = 3.0;

/// Names of the components of ΔX.
pub const AXES: [&str; 6] = ["x", "y", "z", "about x", "about y", "about z"];

/// Motion along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Axis of ΔX, 0 to 5.
    pub axis: usize,
    /// Displacement to both sides, in m or rad.
    pub reach: f64,
    /// Time from the reference to an end, in s.
    pub leg_s: f64,
}

impl Sweep {
    /// Creates the motion along `axis` of `config`: through the deadband into the working range, and into a configured wall.
    pub fn new(config: &Config, axis: usize, leg_s: f64) -> Self {
        let channels = &config.controller.channels;
        let deadband = channels.deadbands().get(axis).copied().unwrap_or(0.0);
        let free = if deadband > 0.0 {
            REACH_DEADBANDS * deadband
        } else if axis < 3 {
            REACH_WITHOUT[0]
        } else {
            REACH_WITHOUT[1]
        };
        let wall = channels.walls().get(axis).copied().flatten();
        let reach = wall.map_or(free, |wall| wall + INTO_WALL_DEADBANDS * deadband);
        Self { axis, reach, leg_s }
    }

    /// Returns the name of the axis.
    pub fn name(&self) -> &'static str {
        AXES.get(self.axis).copied().unwrap_or_default()
    }

    /// Returns the start of the first crossing, in s: both sides are measured from then on.
    pub const fn crossing_s(&self) -> f64 {
        START_S + self.leg_s + REST_S
    }

    /// Returns the time of the release, in s.
    pub const fn release_s(&self) -> f64 {
        self.crossing_s() + 2.0 * (2.0 * self.leg_s + REST_S)
    }

    /// Returns the length of the script, in s.
    pub const fn seconds(&self) -> f64 {
        self.release_s() + RETURN_S
    }

    /// Returns the script; `None` where the hand cannot reach the ends.
    pub fn script(&self, config: &Config) -> Option<Scenario> {
        let Self { reach, leg_s, .. } = *self;
        let crossing = self.crossing_s();
        let entries = opening::referenced(ConsoleRequest::Rate).chain([
            self.to(config, START_S, leg_s, reach),
            self.to(config, crossing, 2.0 * leg_s, -reach),
            self.to(config, crossing + 2.0 * leg_s + REST_S, 2.0 * leg_s, reach),
            Entry::Hold(Hold::new(self.release_s(), false)),
        ]);
        let scenario = Scenario::new(self.seconds(), entries).ok()?;
        Some(scenario.with_operator(OperatorSettings::STEADY))
    }

    /// Returns the motion to `displacement`, in m or rad, along the axis of ΔX.
    fn to(&self, config: &Config, at_s: f64, seconds: f64, displacement: f64) -> Entry {
        let along = unit(self.axis % 3) * displacement;
        if self.axis >= 3 {
            return Entry::Move(Move::turn(at_s, seconds, along.into()));
        }
        let along = displacement::in_base(config, &along);
        Entry::Move(Move::new(at_s, seconds, along.into()))
    }
}

fn unit(place: usize) -> Vector3<f64> {
    match place {
        0 => Vector3::x(),
        1 => Vector3::y(),
        _ => Vector3::z(),
    }
}
