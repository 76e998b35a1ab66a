//! Kind of a file by the keys at its root: the file of another kind gets one problem, not one for each missing key.

use std::fmt;

use toml::de::DeTable;

/// Kind of a file of this program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// Configuration of a hand controller.
    HandController,
    /// Arm of a robot at the commanded side.
    Robot,
    /// Scenario of a simulation.
    Scenario,
}

impl FileKind {
    /// Returns the kind of a file with this text; `None` if it is not TOML, or its keys belong to none.
    pub fn from_text(text: &str) -> Option<Self> {
        Self::from_keys(DeTable::parse(text).ok()?.get_ref())
    }

    /// Returns the kind of a file with these keys; `None` if they belong to none.
    pub(super) fn from_keys(root: &DeTable<'_>) -> Option<Self> {
        [("node", Self::HandController), ("tool_m", Self::Robot), ("seconds", Self::Scenario)]
            .into_iter()
            .find_map(|(key, kind)| root.contains_key(key).then_some(kind))
    }
}

/// Returns whether a text has the sections of an EDS or DCF (CiA 306-1).
pub(super) fn is_eds(text: &str) -> bool {
    let is_section = |line: &str| {
        ["[FileInfo]", "[DeviceInfo]"].iter().any(|it| line.trim().eq_ignore_ascii_case(it))
    };
    text.lines().any(is_section)
}

/// Formats the kind with the option or command that takes it.
impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::HandController => {
                "the configuration of a hand controller; `frhc check --config FILE` checks it"
            }
            Self::Robot => {
                "the file of a robot, for remote.robot and --robot; `frhc explain robot FILE` checks it"
            }
            Self::Scenario => "a scenario, for --scenario",
        })
    }
}
