//! The files of `config/` and `eds/` inside the program, so that `frhc demo` and every scenario run anywhere.

use std::path::Path;

/// Two tables: names of the hand controllers, and names and contents of all files.
macro_rules! tables {
    (hand_controllers: [$($hand:literal,)*], others: [$($other:literal,)*],) => {
        /// Configurations of hand controllers: those of the arms, and the complete ones of drives by their data sheets.
        pub const HAND_CONTROLLERS: [&str; 9] = [$($hand,)*];

        /// Every file, as it was when the program was built.
        const FILES: &[(&str, &[u8])] = &[
            $(($hand, include_bytes!(concat!("../../", $hand)).as_slice()),)*
            $(($other, include_bytes!(concat!("../../", $other)).as_slice()),)*
        ];
    };
}

tables! {
    hand_controllers: [
        "config/kraft_like.toml",
        "config/kraft_like_500hz.toml",
        "config/jpl_like.toml",
        "config/sixr_spherical.toml",
        "config/drives/elmo_gold.toml",
        "config/drives/ingenia_eve.toml",
        "config/drives/maxon_epos4.toml",
        "config/drives/nanotec_cl4e.toml",
        "config/drives/technosoft_ipos.toml",
    ],
    others: [
        "config/robots/eight_r_synthetic.toml",
        "config/robots/puma560.toml",
        "config/scenarios/contact_10s.toml",
        "config/scenarios/free.toml",
        "config/scenarios/relaxed_10s.toml",
        "config/scenarios/stiff-wall.toml",
        "config/scenarios/stretched.toml",
        "config/scenarios/teleoperation.toml",
        "config/scenarios/faults/bus_off.toml",
        "config/scenarios/faults/corrupt.toml",
        "config/scenarios/faults/deadman_bounce.toml",
        "config/scenarios/faults/deadman_stuck.toml",
        "config/scenarios/faults/delay.toml",
        "config/scenarios/faults/drop.toml",
        "config/scenarios/faults/drop_some.toml",
        "config/scenarios/faults/duplicate.toml",
        "config/scenarios/faults/emergency.toml",
        "config/scenarios/faults/encoder_frozen.toml",
        "config/scenarios/faults/encoder_jump.toml",
        "config/scenarios/faults/fault.toml",
        "config/scenarios/faults/foreign_frame.toml",
        "config/scenarios/faults/foreign_nmt.toml",
        "config/scenarios/faults/foreign_sync.toml",
        "config/scenarios/faults/freeze.toml",
        "config/scenarios/faults/heartbeat_stop.toml",
        "config/scenarios/faults/impersonate.toml",
        "config/scenarios/faults/link_frozen.toml",
        "config/scenarios/faults/link_loss.toml",
        "config/scenarios/faults/reorder.toml",
        "config/scenarios/faults/reset.toml",
        "config/scenarios/faults/resize.toml",
        "config/scenarios/faults/rpdo_lost.toml",
        "config/scenarios/faults/sto.toml",
        "config/scenarios/faults/switches_unplugged.toml",
        "config/scenarios/faults/sync_lost.toml",
        "config/scenarios/faults/torque_actual_scale.toml",
        "config/scenarios/faults/unplug.toml",
        "config/scenarios/faults/wire_cut.toml",
        "config/scenarios/quirks/deaf-to-master.toml",
        "config/scenarios/quirks/double-replies.toml",
        "config/scenarios/quirks/emcy-storm.toml",
        "config/scenarios/quirks/filtered-torque.toml",
        "config/scenarios/quirks/fixed-mapping.toml",
        "config/scenarios/quirks/forgetful.toml",
        "config/scenarios/quirks/heartbeat-liar.toml",
        "config/scenarios/quirks/holds-torque.toml",
        "config/scenarios/quirks/keeps-torque.toml",
        "config/scenarios/quirks/late-boot.toml",
        "config/scenarios/quirks/lost-sdo-reply.toml",
        "config/scenarios/quirks/lost-write-reply.toml",
        "config/scenarios/quirks/mode-when-enabled.toml",
        "config/scenarios/quirks/mode-when-operational.toml",
        "config/scenarios/quirks/no-boot-up.toml",
        "config/scenarios/quirks/no-rpdo-timer.toml",
        "config/scenarios/quirks/no-rtr.toml",
        "config/scenarios/quirks/no-sync-counter.toml",
        "config/scenarios/quirks/open-rpdos.toml",
        "config/scenarios/quirks/polarity-reversed.toml",
        "config/scenarios/quirks/quiet-fault.toml",
        "config/scenarios/quirks/running-at-start.toml",
        "config/scenarios/quirks/slow-first-answer.toml",
        "config/scenarios/quirks/slow-sdo.toml",
        "config/scenarios/quirks/stored.toml",
        "config/scenarios/quirks/two-reset-edges.toml",
        "config/scenarios/quirks/unsized-replies.toml",
        "config/scenarios/quirks/vague-aborts.toml",
        "config/scenarios/quirks/wrong-identity.toml",
        "eds/drives/elmo-gold.eds",
        "eds/drives/elmo-simpliq.eds",
        "eds/drives/eyou-euservo.eds",
        "eds/drives/faulhaber-3150.eds",
        "eds/drives/infranor-easy-ak.eds",
        "eds/drives/ingenia-eve-net-c.eds",
        "eds/drives/ingenia-eve-xcr-c.eds",
        "eds/drives/maxon-epos2.eds",
        "eds/drives/maxon-epos4-50-15.eds",
        "eds/drives/maxon-epos4.eds",
        "eds/drives/nanotec-cl4-e.eds",
        "eds/drives/pilz-prbt.eds",
        "eds/drives/roboteq.eds",
        "eds/drives/schunk-lwa4p.eds",
        "eds/drives/technosoft-ipos.eds",
        "eds/frhc_drive.eds",
        "eds/frhc_switches.eds",
    ],
}

/// The folder of the scenarios, and the end of their names.
const SCENARIOS: (&str, &str) = ("config/scenarios/", ".toml");

/// Returns the shipped file of this name.
pub(super) fn file(path: &Path) -> Option<&'static [u8]> {
    FILES.iter().find(|(name, _)| Path::new(name) == path).map(|(_, bytes)| *bytes)
}

/// Names of the shipped scenarios, as `frhc demo --scenario` takes them.
pub fn scenarios() -> impl Iterator<Item = &'static str> {
    let (folder, end) = SCENARIOS;
    FILES.iter().filter_map(move |(name, _)| name.strip_prefix(folder)?.strip_suffix(end))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// Every file below `folder` of the repository.
    fn below(folder: &str) -> Vec<String> {
        const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let entries = fs::read_dir(format!("{ROOT}/{folder}")).unwrap().map(Result::unwrap);
        let names = entries.map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (entry.path().is_dir(), format!("{folder}/{name}"))
        });
        names
            .flat_map(|(is_folder, name)| if is_folder { below(&name) } else { vec![name] })
            .collect()
    }

    #[test]
    fn every_hand_controller_in_config_is_listed() {
        let mut files = below("config");
        files.retain(|name| {
            let folder = Path::new(name).parent().and_then(Path::to_str);
            name.ends_with(".toml") && ["config", "config/drives"].map(Some).contains(&folder)
        });
        let mut listed = HAND_CONTROLLERS.to_vec();
        files.sort();
        listed.sort_unstable();
        assert_eq!(files, listed);
    }

    #[test]
    fn every_configuration_scenario_and_eds_is_shipped() {
        let mut files = [below("config"), below("eds")].concat();
        // What only an experiment reads is with the experiment.
        files.retain(|name| !name.starts_with("config/experiments/"));
        files.retain(|name| name.ends_with(".toml") || name.ends_with(".eds"));
        let missing: Vec<_> = files.iter().filter(|name| file(Path::new(name)).is_none()).collect();
        assert!(missing.is_empty(), "{missing:?}");
        assert_eq!(files.len(), FILES.len());
    }
}
