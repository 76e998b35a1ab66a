//! Files of `config/` and `eds/` built into the program. The scenarios are built into the bench.

use std::path::Path;

/// Declares [`HAND_CONTROLLERS`] and [`FILES`].
macro_rules! tables {
    (hand_controllers: [$($hand:literal,)*], others: [$($other:literal,)*],) => {
        /// Paths of the shipped hand controllers: simulated arms, and one complete configuration per drive maker.
        pub const HAND_CONTROLLERS: [&str; 10] = [$($hand,)*];

        /// Paths and contents of all shipped files.
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
        "config/jpl_like_1538hz.toml",
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

/// Returns the content of the shipped file with this path.
pub(super) fn file(path: &Path) -> Option<&'static [u8]> {
    FILES.iter().find(|(name, _)| Path::new(name) == path).map(|(_, bytes)| *bytes)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// Returns all files below `folder` of the repository.
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
    fn every_configuration_and_eds_is_shipped() {
        let mut files = [below("config"), below("eds")].concat();
        // Files that only the bench reads are built into the bench.
        files.retain(|name| !name.starts_with("config/scenarios/"));
        files.retain(|name| name.ends_with(".toml") || name.ends_with(".eds"));
        let missing: Vec<_> = files.iter().filter(|name| file(Path::new(name)).is_none()).collect();
        assert!(missing.is_empty(), "{missing:?}");
        assert_eq!(files.len(), FILES.len());
    }
}
