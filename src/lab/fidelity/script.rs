//! The script of the experiment: an operator moves freely, meets a wall, holds, slides along it, presses and lets go.
//!
//! ```text
//!  3 … 6.5 s   free motion: 5 cm to both sides, up and down
//!  7 … 8.5 s   approach; until 11 s the hand holds
//!  11 … 13 s   slides 2 cm along the wall to both sides; until 14 s it holds
//!  14 … 14.5 s presses harder, to 11 N
//!  15.5 s      lets the force go within 0.3 s, and withdraws
//! ```
//!
//! The way into the wall depends on the hand: at rest its spring and the wall's, in series, carry the same force.

use std::fmt;

use config::Config;
use remote::scene::HALF_CUBE;
use sim::operator_settings::OperatorSettings;
use sim::scenario::operator::{Console, Move, Switch};
use sim::scenario::{ConsoleRequest, Entry, Scenario};

/// Force felt while the hand holds, in N.
pub const HELD: f64 = 9.0;

/// Force felt before the release, in N.
pub const PRESSED: f64 = 11.0;

/// Start of the sliding, in s.
pub const SLIDE_S: f64 = 11.0;

/// Start of the release, in s.
pub const RELEASE_S: f64 = 15.5;

/// Length of the script, in s.
pub const SECONDS: f64 = 17.5;

/// The four hands.
pub const HANDS: [Hand; 4] = [
    Hand("steady", OperatorSettings::STEADY),
    Hand("relaxed", OperatorSettings::RELAXED),
    Hand("firm", OperatorSettings::FIRM),
    Hand("nervous", OperatorSettings::NERVOUS),
];

/// A named operator.
#[derive(Clone, Copy, Debug)]
pub struct Hand(pub &'static str, pub OperatorSettings);

impl fmt::Display for Hand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

/// Returns the script of one hand, in pose mode, for the wall of `config`; `None` without a wall.
pub fn script(config: &Config, hand: &Hand) -> Option<Scenario> {
    let Hand(_, operator) = hand;
    let (to_wall, felt_stiffness) = wall(config)?;
    let deep = |force: f64| to_wall + operator.deflection(force) + force / felt_stiffness;
    let (held, pressed) = (deep(HELD), deep(PRESSED));
    let at = |at_s, seconds, [x, y, z]: [f64; 3]| Entry::Move(Move::new(at_s, seconds, [x, y, z]));
    let entries = switches().into_iter().chain([
        at(3.0, 0.75, [0.0, 0.05, 0.0]),
        at(3.75, 1.0, [0.0, -0.05, 0.0]),
        at(4.75, 1.0, [0.0, 0.0, 0.05]),
        at(5.75, 0.75, [0.0, 0.0, 0.0]),
        at(7.0, 1.5, [held, 0.0, 0.0]),
        at(SLIDE_S, 0.5, [held, 0.02, 0.0]),
        at(11.5, 1.0, [held, -0.02, 0.0]),
        at(12.5, 0.5, [held, 0.0, 0.0]),
        at(14.0, 0.5, [pressed, 0.0, 0.0]),
        at(RELEASE_S, 0.3, [to_wall, 0.0, 0.0]),
        at(RELEASE_S + 0.3, 0.7, [0.0, 0.0, 0.0]),
    ]);
    let scenario = Scenario::new(SECONDS, entries).ok()?;
    Some(scenario.with_operator(*operator))
}

/// Pose mode, armed; the deadman and reflection on before the motion.
fn switches() -> [Entry; 6] {
    let request = |at_s, request| Entry::Console(Console::new(at_s, request));
    [
        request(0.1, ConsoleRequest::Pose),
        request(0.2, ConsoleRequest::Arm),
        Entry::Switch(Switch::deadman(1.5, true)),
        Entry::Switch(Switch::reflection(1.6, true)),
        Entry::Switch(Switch::reflection(1.7, false)),
        Entry::Switch(Switch::deadman(17.2, false)),
    ]
}

/// Returns the hand's way to the wall along x of {0} in m, if the object moves as the grip, and the stiffness that it feels there in N/m.
fn wall(config: &Config) -> Option<(f64, f64)> {
    let (point, normal, contact) = config.remote.wall?;
    let x_b_m = config.remote.x_b_m;
    let [k_t, ..] = *config.controller.reflection.gain().values();
    let [k_p, ..] = *config.controller.command.pose_gain.values();
    let away = (point - x_b_m.translation.vector).dot(&-normal.into_inner());
    Some(((away - HALF_CUBE) / k_p, k_t * k_p * contact.stiffness))
}
