//! Scripts of the fidelity experiment: an operator moves freely, meets a wall, holds, slides along it, presses, releases.
//!
//! ```text
//!  pose mode                                                          contact alone
//!  3 … 6.5 s     free motion: 5 cm to both sides, up and down         –
//!  7 … 8.5 s     approach; until 11 s the hand holds                  3 … 4.5 s; until 6 s
//!  11 … 13 s     slides 2 cm to both sides; until 14.5 s it holds     –
//!  14.5 … 15 s   presses 2 N more; until 16.5 s it holds              –
//!  16.5 … 17 s   withdraws to half of that; until 18.5 s it holds     –
//!  18.5 s        lets the force go within 0.3 s, and withdraws        6 s
//! ```
//!
//! In rate mode the hand deflects until the object presses with the same force; the release is the same.
//!
//! The depth in the wall depends on the hand: at rest its spring and the wall's, in series, carry the same force.

use derive_more::Display;
use serde::Serialize;

use crate::opening;
use config::Config;
use remote::scene::HALF_CUBE;
use sim::operator_settings::OperatorSettings;
use sim::scenario::operator::{Move, Switch};
use sim::scenario::{ConsoleRequest, Entry, Scenario};

/// Additional force of the press, in N.
const PRESS: f64 = 2.0;

/// Duration of the release, in s.
const LET_GO_S: f64 = 0.3;

/// Presets of the operator model, with their names in tables.
pub const HANDS: [Hand; 4] = [
    Hand("steady", OperatorSettings::STEADY),
    Hand("relaxed", OperatorSettings::RELAXED),
    Hand("firm", OperatorSettings::FIRM),
    Hand("nervous", OperatorSettings::NERVOUS),
];

/// Named operator.
#[derive(Clone, Copy, Debug, Display)]
#[display("{}", self.0)]
pub struct Hand(pub &'static str, pub OperatorSettings);

/// Motion of the hand in a run.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Course {
    /// Free motion, approach, slide, press, half release and release, in pose mode.
    #[display("full")]
    Full,
    /// Contact and release in pose mode.
    #[display("pose")]
    PoseRelease,
    /// Contact and release in rate mode.
    #[display("rate")]
    RateRelease,
}

/// Start of the release and end of the script, in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Times {
    /// Start of the release.
    pub release: f64,
    /// End of the run.
    pub end: f64,
}

impl Course {
    /// Returns the start of the release and the end, in s.
    pub const fn times(self) -> Times {
        match self {
            Self::Full => Times { release: 18.5, end: 21.0 },
            Self::PoseRelease => Times { release: 6.0, end: 8.5 },
            Self::RateRelease => Times { release: 9.0, end: 11.5 },
        }
    }

    /// Returns the script of one hand that holds a reflected force, in N, at the wall of `config`; `None` without a wall.
    pub fn script(self, config: &Config, hand: &Hand, felt: f64) -> Option<Scenario> {
        let Hand(_, operator) = hand;
        let wall = FeltWall::new(config)?;
        let at =
            |at_s, seconds, [x, y, z]: [f64; 3]| Entry::Move(Move::new(at_s, seconds, [x, y, z]));
        let Times { release, end } = self.times();
        let deep = |force: f64| wall.way + operator.deflection(force) + force / wall.stiffness;
        let (hold, press) = (deep(felt), deep(felt + PRESS));
        let moves = match self {
            Self::Full => vec![
                at(3.0, 0.75, [0.0, 0.05, 0.0]),
                at(3.75, 1.0, [0.0, -0.05, 0.0]),
                at(4.75, 1.0, [0.0, 0.0, 0.05]),
                at(5.75, 0.75, [0.0, 0.0, 0.0]),
                at(7.0, 1.5, [hold, 0.0, 0.0]),
                at(11.0, 0.5, [hold, 0.02, 0.0]),
                at(11.5, 1.0, [hold, -0.02, 0.0]),
                at(12.5, 0.5, [hold, 0.0, 0.0]),
                at(14.5, 0.5, [press, 0.0, 0.0]),
                at(16.5, 0.5, [deep((felt + PRESS) / 2.0), 0.0, 0.0]),
                at(release, LET_GO_S, [wall.way, 0.0, 0.0]),
                at(release + LET_GO_S, 0.7, [0.0, 0.0, 0.0]),
            ],
            Self::PoseRelease => vec![
                at(3.0, 1.5, [hold, 0.0, 0.0]),
                at(release, LET_GO_S, [wall.way, 0.0, 0.0]),
                at(release + LET_GO_S, 0.7, [0.0, 0.0, 0.0]),
            ],
            Self::RateRelease => {
                let deflected = wall.deflection(felt) + operator.deflection(felt + wall.plateau);
                vec![at(3.0, 1.0, [deflected, 0.0, 0.0]), at(release, LET_GO_S, [0.0, 0.0, 0.0])]
            }
        };
        let mode = match self {
            Self::Full | Self::PoseRelease => ConsoleRequest::Pose,
            Self::RateRelease => ConsoleRequest::Rate,
        };
        let entries = opening::engaged(mode, opening::SWITCHES_S).into_iter().chain(moves);
        let entries = entries.chain([Entry::Switch(Switch::deadman(end - 0.3, false))]);
        let scenario = Scenario::new(end, entries).ok()?;
        Some(scenario.with_operator(*operator))
    }
}

/// Wall as seen from the grip, along x of {0}, for an object that moves in the direction of the grip.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FeltWall {
    /// Distance of the hand to it in pose mode, in m.
    way: f64,
    /// Stiffness at the grip in pose mode, `K_T K_P k_e`, in N/m.
    stiffness: f64,
    /// Half-width of the deadband, in m.
    deadband: f64,
    /// Deflection beyond the deadband per reflected force in rate mode, in m/N: `K_FA/(K_V K_T)`.
    compliance: f64,
    /// Plateau of the return to centre, in N.
    plateau: f64,
}

impl FeltWall {
    fn new(config: &Config) -> Option<Self> {
        let (point, normal, contact) = config.remote.wall?;
        let x_b_m = config.remote.x_b_m;
        let [k_t, ..] = *config.controller.reflection.gain().values();
        let [k_p, ..] = *config.controller.command.pose_gain.values();
        let [k_v, ..] = *config.controller.command.rate_gain.values();
        let [k_fa, ..] = config.remote.interaction.accommodation.gain();
        let channels = &config.controller.channels;
        let ([deadband, ..], [plateau, ..]) = (channels.deadbands(), channels.plateaus());
        let away = (point - x_b_m.translation.vector).dot(&-normal.into_inner());
        Some(Self {
            way: (away - HALF_CUBE) / k_p,
            stiffness: k_t * k_p * contact.stiffness,
            deadband,
            compliance: k_fa / (k_v * k_t),
            plateau,
        })
    }

    /// Returns the deflection of the grip, in m, that makes the reflected force at rest `force` N in rate mode.
    fn deflection(&self, force: f64) -> f64 {
        self.deadband + force * self.compliance
    }
}
