//! Situation at the onset of a fault: ready, armed (also after zeros were set), parking, moving freely, or pressing against a wall.

use derive_more::Display;
use serde::Serialize;

use config::Config;
use sim::scenario::operator::{Console, Hold, Move, Switch};
use sim::scenario::{ConsoleRequest, Entry};

/// Situation of the operator at the onset.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Situation {
    /// Drives enabled at zero torque; the operator has not armed.
    #[display("ready")]
    Ready,
    /// Gravity compensation is on, the deadman open.
    #[display("armed")]
    Armed,
    /// The same, after a person has set the zeros of drives that lost theirs with the power.
    #[display("armed, zeros set")]
    Zeroed,
    /// Deadman pressed, and nobody at the grip: the arm moves itself to its rest posture.
    #[display("parking")]
    Parking,
    /// Deadman pressed; the hand moves the object freely.
    #[display("free motion")]
    Free,
    /// Object pressed against the wall, with reflection on.
    #[display("in contact")]
    Contact,
}

impl Situation {
    /// Situations, each closer to contact than the one before.
    pub const ALL: [Self; 6] =
        [Self::Ready, Self::Armed, Self::Zeroed, Self::Parking, Self::Free, Self::Contact];

    /// Situations with gravity compensation.
    pub const ARMED: [Self; 4] = [Self::Armed, Self::Parking, Self::Free, Self::Contact];

    /// Situations in which the grip commands.
    pub const ENGAGED: [Self; 2] = [Self::Free, Self::Contact];

    /// Returns the index in [`ALL`](Self::ALL).
    pub(super) fn index(self) -> usize {
        Self::ALL.iter().position(|other| *other == self).unwrap_or(0)
    }

    /// Returns whether the deadman is pressed.
    pub const fn is_pressed(self) -> bool {
        match self {
            Self::Ready | Self::Armed | Self::Zeroed => false,
            Self::Parking | Self::Free | Self::Contact => true,
        }
    }

    /// Returns the situation, or that of an armed arm where this configuration states no rest posture to park in.
    pub(super) fn possible(self, config: &Config) -> Self {
        let has_rest = config.joints.iter().all(|joint| joint.rest.is_some());
        if self == Self::Parking && !has_rest { Self::Armed } else { self }
    }

    /// Returns the time at which the situation is reached, in s after the first SYNC.
    pub(super) const fn reached_s(self) -> f64 {
        match self {
            Self::Ready => 0.3,
            Self::Armed | Self::Free => 1.3,
            Self::Zeroed => 2.8,
            Self::Parking => 3.6,
            Self::Contact => 5.0,
        }
    }

    /// Returns the time from which the hand rests, in s after the first SYNC.
    pub(super) const fn rests_s(self) -> f64 {
        match self {
            Self::Ready | Self::Armed | Self::Zeroed | Self::Parking => 0.0,
            Self::Free => 1.9,
            Self::Contact => 2.0,
        }
    }

    /// Returns the operator's actions that lead to the situation.
    pub(super) fn entries(self) -> Vec<Entry> {
        let request = |at_s, request| Entry::Console(Console::new(at_s, request));
        let mut entries = vec![request(0.05, ConsoleRequest::Arm)];
        match self {
            Self::Ready => entries.clear(),
            Self::Armed => {}
            // The joints must be at rest for 1 s.
            Self::Zeroed => {
                entries =
                    vec![request(1.4, ConsoleRequest::Zero), request(1.5, ConsoleRequest::Arm)];
            }
            Self::Parking => entries.extend([
                Entry::Move(Move::new(1.2, 1.0, [0.04, 0.06, 0.05]).turning([0.1, 0.2, -0.1])),
                request(2.4, ConsoleRequest::Park),
                Entry::Switch(Switch::deadman(2.5, true)),
                Entry::Hold(Hold::new(2.6, false)),
            ]),
            Self::Free => {
                entries.extend(engage([0.3, 0.4, 0.45, 0.5, 0.55]));
                entries.push(Entry::Move(Move::new(0.6, 1.3, [0.0, 0.05, 0.0])));
            }
            Self::Contact => {
                entries.extend(engage([1.2, 1.3, 1.35, 1.4, 1.45]));
                entries.push(Entry::Move(Move::new(1.5, 0.5, [0.045, 0.0, 0.0])));
            }
        }
        entries
    }
}

/// Presses the deadman, then presses and releases reflection and reference, at these times in s.
fn engage([deadman, on, off, press, release]: [f64; 5]) -> [Entry; 5] {
    [
        Switch::deadman(deadman, true),
        Switch::reflection(on, true),
        Switch::reflection(off, false),
        Switch::reference(press, true),
        Switch::reference(release, false),
    ]
    .map(Entry::Switch)
}
