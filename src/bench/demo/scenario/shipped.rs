//! Scenarios of `config/scenarios`, compiled in.

use std::path::{Path, PathBuf};

/// Names and contents of all scenarios.
macro_rules! scenarios {
    ($($name:literal,)*) => {
        const SCENARIOS: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../../../config/scenarios/", $name, ".toml"))),)*];
    };
}

scenarios! {
    "contact_10s",
    "free",
    "relaxed_10s",
    "stiff-wall",
    "stretched",
    "teleoperation",
    "faults/bus_off",
    "faults/corrupt",
    "faults/deadman_bounce",
    "faults/deadman_stuck",
    "faults/delay",
    "faults/drop",
    "faults/drop_some",
    "faults/duplicate",
    "faults/emergency",
    "faults/encoder_frozen",
    "faults/encoder_jump",
    "faults/far_side_holds",
    "faults/fault",
    "faults/foreign_frame",
    "faults/foreign_nmt",
    "faults/foreign_sync",
    "faults/freeze",
    "faults/heartbeat_stop",
    "faults/impersonate",
    "faults/link_foreign",
    "faults/link_frozen",
    "faults/link_loss",
    "faults/link_slow",
    "faults/reorder",
    "faults/reset",
    "faults/resize",
    "faults/rpdo_lost",
    "faults/sto",
    "faults/switches_unplugged",
    "faults/sync_lost",
    "faults/torque_actual_scale",
    "faults/unplug",
    "faults/wire_cut",
    "quirks/deaf-to-master",
    "quirks/double-replies",
    "quirks/emcy-storm",
    "quirks/encoder-slipped",
    "quirks/filtered-torque",
    "quirks/fixed-mapping",
    "quirks/forgetful",
    "quirks/heartbeat-liar",
    "quirks/holds-torque",
    "quirks/homing-moves",
    "quirks/incremental",
    "quirks/keeps-torque",
    "quirks/late-boot",
    "quirks/lost-sdo-reply",
    "quirks/lost-write-reply",
    "quirks/mode-when-enabled",
    "quirks/mode-when-operational",
    "quirks/no-boot-up",
    "quirks/no-rpdo-timer",
    "quirks/no-rtr",
    "quirks/no-sync-counter",
    "quirks/open-rpdos",
    "quirks/polarity-reversed",
    "quirks/quiet-fault",
    "quirks/referenced-bit",
    "quirks/running-at-start",
    "quirks/slow-first-answer",
    "quirks/slow-sdo",
    "quirks/stored",
    "quirks/two-reset-edges",
    "quirks/unsized-replies",
    "quirks/vague-aborts",
    "quirks/wrong-identity",
    "quirks/wrong-revolution",
}

/// Names of the shipped scenarios, as `frhc demo --scenario` takes them.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    SCENARIOS.iter().map(|(name, _)| *name)
}

/// Returns the file of the scenario of this name.
pub(super) fn path(name: &str) -> PathBuf {
    Path::new("config/scenarios").join(name).with_extension("toml")
}

/// Returns the content of a shipped file at build time; `None` for any other file.
pub(super) fn text(file: &Path) -> Option<&'static str> {
    SCENARIOS.iter().find(|(name, _)| path(name) == file).map(|(_, text)| *text)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../config/scenarios");

    /// Returns all files below `folder`.
    fn below(folder: &Path) -> Vec<PathBuf> {
        let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        paths.flat_map(|path| if path.is_dir() { below(&path) } else { vec![path] }).collect()
    }

    #[test]
    fn every_scenario_is_shipped() {
        let mut files = below(Path::new(FOLDER));
        files.retain(|path| path.extension().is_some_and(|end| end == "toml"));
        let name = |path: &PathBuf| {
            let name = path.strip_prefix(FOLDER).unwrap().with_extension("");
            name.to_str().unwrap().to_owned()
        };
        let mut found: Vec<_> = files.iter().map(name).collect();
        let mut shipped: Vec<_> = names().collect();
        found.sort();
        shipped.sort_unstable();
        assert_eq!(found, shipped);
    }

    #[test]
    fn shipped_scenario_is_that_of_the_folder() {
        let file = Path::new(FOLDER).join("faults/drop.toml");
        assert_eq!(text(&path("faults/drop")), Some(fs::read_to_string(file).unwrap().as_str()));
        assert_eq!(text(&path("no-such-scenario")), None);
    }
}
