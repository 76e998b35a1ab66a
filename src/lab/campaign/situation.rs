//! Where a fault finds the operator: armed alone, moving freely, or pressing against a wall.

use std::fmt;

use serde::Serialize;

/// What the operator does when it happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Situation {
    /// The arm is carried, the deadman open.
    Armed,
    /// The hand moves, and commands.
    Free,
    /// The object is pressed against the wall, and the hand feels it.
    Contact,
}

impl Situation {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Armed, Self::Free, Self::Contact];

    /// Those in which the deadman is held.
    pub const ENGAGED: [Self; 2] = [Self::Free, Self::Contact];

    /// Its number among all.
    pub(super) fn place(self) -> usize {
        Self::ALL.iter().position(|other| *other == self).unwrap_or(0)
    }

    /// Whether the deadman is held.
    pub const fn is_engaged(self) -> bool {
        match self {
            Self::Armed => false,
            Self::Free | Self::Contact => true,
        }
    }

    /// How long it takes to get there, in s after the first SYNC.
    pub(super) const fn warm_s(self) -> f64 {
        match self {
            Self::Armed | Self::Free => 1.3,
            Self::Contact => 5.0,
        }
    }

    /// How, as entries of a script.
    pub(super) const fn entries(self) -> &'static str {
        match self {
            Self::Armed => ARMED,
            Self::Free => FREE,
            Self::Contact => CONTACT,
        }
    }
}

/// As a table names it.
impl fmt::Display for Situation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Armed => "armed",
            Self::Free => "free motion",
            Self::Contact => "in contact",
        })
    }
}

const ARMED: &str = "\
[[console]]
at_s = 0.05
request = \"arm\"
";

const FREE: &str = "\
[[console]]
at_s = 0.05
request = \"arm\"

[[switch]]
at_s = 0.3
deadman = true

[[switch]]
at_s = 0.4
reflection = true

[[switch]]
at_s = 0.45
reflection = false

[[switch]]
at_s = 0.5
reference = true

[[switch]]
at_s = 0.55
reference = false

[[move]]
at_s = 0.6
duration_s = 1.3
to_m = [0.0, 0.05, 0.0]
";

const CONTACT: &str = "\
[[console]]
at_s = 0.05
request = \"arm\"

[[switch]]
at_s = 1.2
deadman = true

[[switch]]
at_s = 1.3
reflection = true

[[switch]]
at_s = 1.35
reflection = false

[[switch]]
at_s = 1.4
reference = true

[[switch]]
at_s = 1.45
reference = false

[[move]]
at_s = 1.5
duration_s = 0.5
to_m = [0.045, 0.0, 0.0]
";
