//! Layouts that drives cannot have, and those that are offered in their place.

use crate::common::prelude::*;

const DRIVE: &str = include_str!("../../eds/frhc_drive.eds");

/// Change of the EDS: old text and new text.
type Edit<'t> = (&'t str, &'t str);

const NO_DUMMY: Edit<'_> = ("Dummy0003=1", "Dummy0003=0");
const NO_TIMER: Edit<'_> = ("[1400sub5]", "[1400sub6]");
const NO_THIRD_TPDO: Edit<'_> = ("1802", "2802");
const NO_SECOND_RPDO: Edit<'_> = ("1401", "2401");
const FIXED: Edit<'_> = (
    "Number of mapped objects\nObjectType=0x7\nDataType=0x0005\nAccessType=rw",
    "Number of mapped objects\nObjectType=0x7\nDataType=0x0005\nAccessType=ro",
);

/// Returns the problems of a configuration whose joints at `places` have a drive with other abilities.
fn problems(name: &str, text: &str, drives: &[(&[usize], &[Edit<'_>])]) -> Vec<String> {
    let folder = folder("layouts", name);
    fs::create_dir_all(folder.join("eds")).unwrap();
    for file in ["frhc_drive.eds", "frhc_switches.eds"] {
        fs::copy(Path::new("eds").join(file), folder.join("eds").join(file)).unwrap();
    }
    let mut joints: Vec<String> = text.split("[[joint]]").map(str::to_owned).collect();
    for (number, (places, edits)) in drives.iter().enumerate() {
        let eds = edits.iter().fold(DRIVE.to_owned(), |eds, (from, to)| {
            assert!(eds.contains(from), "{from}");
            eds.replace(from, to)
        });
        let file = format!("drive_{number}.eds");
        fs::write(folder.join("eds").join(&file), eds).unwrap();
        for place in *places {
            let joint = joints.get_mut(place + 1).unwrap();
            *joint = joint.replace("frhc_drive.eds", &file);
        }
    }
    let file = folder.join("arm.toml");
    fs::write(&file, joints.join("[[joint]]").replace("../eds/", "eds/")).unwrap();
    let found = Config::load(&file).err().map(|invalid| invalid.0).unwrap_or_default();
    found.into_iter().map(|problem| format!("{}: {}", problem.key, problem.reason)).collect()
}

const ALL: &[usize] = &[0, 1, 2, 3, 4, 5];

#[test]
fn drives_without_dummies_are_offered_one_rpdo_each() {
    let found = problems("dummies", KRAFT_TEXT, &[(ALL, &[NO_DUMMY])]);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(
        found.first().unwrap(),
        "joint[0].eds: joints 1, 2, 3, 4, 5 and 6: its drive cannot have layout \"grouped\": its EDS lacks dummy \
         mapping of 0003h; layouts that fit: \"per-drive\" at 500 Hz, 75 % of joints, 83.3 N"
    );
}

#[test]
fn drives_without_rpdo_timer_allow_less_force() {
    let found = problems("timer", KRAFT_TEXT, &[(ALL, &[NO_DUMMY, NO_TIMER])]);
    let (layouts, others): (Vec<_>, Vec<_>) =
        found.iter().partition(|problem| problem.contains("cannot have layout"));
    assert!(
        layouts
            .iter()
            .all(|it| it.ends_with("500 Hz, 77 % of joints, 0 N (20 N with weaker dampers)")),
        "{layouts:#?}"
    );
    // The configured force is too large with any layout, and said once; the timer contradicts the EDS.
    assert_eq!((layouts.len(), others.len()), (1, 2), "{others:#?}");
    let [force, timer] = ["controller.max_force_n: ", "safety.rpdo_timer_ms: no drive has"];
    assert!(others.iter().any(|it| it.starts_with(force)), "{others:#?}");
    assert!(others.iter().any(|it| it.starts_with(timer)), "{others:#?}");
}

#[test]
fn only_the_drive_that_lacks_parts_is_named() {
    let found = problems("one", KRAFT_TEXT, &[(&[4], &[NO_THIRD_TPDO, NO_SECOND_RPDO])]);
    let [only] = &found[..] else { panic!("{found:#?}") };
    assert!(only.starts_with("joint[4].eds: joint 5 "), "{only}");
    assert!(only.contains("lacks TPDO3 (1802h), RPDO2 (1401h); layouts that fit: \"per-drive\""));
}

#[test]
fn fixed_mapping_fits_no_layout_and_says_what_it_needs() {
    for (name, text, other) in
        [("fixed", KRAFT_TEXT, "per-drive"), ("fixed_slow", KRAFT_500HZ_TEXT, "grouped")]
    {
        let found = problems(name, text, &[(&[2], &[FIXED])]);
        let [only] = &found[..] else { panic!("{found:#?}") };
        let needs =
            format!("no layout fits: for \"{other}\" the drive would need writable 1A00h, 1");
        assert!(only.contains(&needs), "{only}");
    }
}

#[test]
fn layout_that_another_drive_cannot_have_is_not_offered() {
    let found = problems("two", KRAFT_TEXT, &[(&[1], &[NO_DUMMY]), (&[3], &[FIXED])]);
    assert_eq!(found.len(), 2, "{found:#?}");
    let second = found.first().unwrap();
    assert!(second.ends_with("no layout fits: joint 4 cannot have \"per-drive\""), "{second}");
}
