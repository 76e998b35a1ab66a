//! `frhc config merge`, as a user runs it.

use std::os::unix::fs::{PermissionsExt, symlink};

use crate::common::cli::typed;
use crate::common::prelude::*;

/// Folder with `my_arm.toml`, a copy of a shipped configuration, and the data sheets that it names.
struct Arm(PathBuf);

impl Arm {
    fn new(test: &str, file: &str) -> Self {
        let folder = folder("config_merge", test);
        let depth = Path::new(file).components().count();
        let text = text(file).replace("../../eds/", "../eds/").replace("../eds/", "eds/");
        assert!(depth > 1 && text.contains("\"eds/"), "{file}");
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        symlink(root.join("eds"), folder.join("eds")).unwrap();
        symlink(root.join("config/robots"), folder.join("robots")).unwrap();
        fs::write(folder.join("my_arm.toml"), text).unwrap();
        Self(folder)
    }

    fn kraft(test: &str) -> Self {
        Self::new(test, KRAFT)
    }

    fn write(&self, name: &str, text: &str) -> &Self {
        fs::write(self.0.join(name), text).unwrap();
        self
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.0.join(name)).unwrap()
    }

    fn frhc(&self, args: &[&str]) -> CommandOutput {
        self.with_stdin(args, "")
    }

    fn with_stdin(&self, args: &[&str], stdin: &str) -> CommandOutput {
        let mut command = Command::new(crate::common::program());
        typed(command.args(args).current_dir(&self.0), stdin)
    }

    fn merge(&self, args: &[&str]) -> CommandOutput {
        self.frhc(&[&["config", "merge", "my_arm.toml"], args].concat())
    }

    /// Asserts that a merge with `--write` ends with this code and text, and that no file is changed or left behind.
    #[track_caller]
    fn refuses(&self, args: &[&str], code: i32, reason: &str) {
        let before = self.files();
        let ended = self.merge(&[args, &["--write"]].concat());
        assert_eq!(ended.code, code, "{args:?}: {}{}", ended.stdout, ended.stderr);
        assert!(ended.stderr.contains(reason), "{args:?}: {}", ended.stderr);
        assert_eq!(self.files(), before, "{args:?}");
    }

    /// Names of the files, with the contents of the regular ones.
    fn files(&self) -> Vec<(PathBuf, Option<Vec<u8>>)> {
        let entries = fs::read_dir(&self.0).unwrap().map(|entry| entry.unwrap());
        let mut files: Vec<_> = entries
            .map(|entry| {
                let is_file = entry.file_type().unwrap().is_file();
                (entry.path(), is_file.then(|| fs::read(entry.path()).unwrap()))
            })
            .collect();
        files.sort();
        files
    }
}

const ELBOW_CURVE: &str = "[[joint]]\nname = \"elbow\"\nmax_torque_nm = 4.1\n\
                           torque_curve = [242.5, -1.6, 0.267]    # slope at least 238 ‰/N·m\n";

#[test]
fn difference_and_check_are_shown_and_nothing_is_written() {
    let arm = Arm::kraft("dry");
    arm.write("elbow.toml", ELBOW_CURVE);
    let before = arm.files();
    let ended = arm.merge(&["elbow.toml"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{}", ended.stdout);
    for part in [
        "--- my_arm.toml\n+++ my_arm.toml\n@@ ",
        "\n-max_torque_nm = 4.0    # of the joint: the end of the calibrated range\n",
        "\n+max_torque_nm = 4.1    # of the joint: the end of the calibrated range\n",
        "\nmy_arm.toml: valid",
        "at most 4.1 N·m\n",
    ] {
        assert!(ended.stdout.contains(part), "{part:?}: {}", ended.stdout);
    }
    assert!(ended.stdout.ends_with("\nmy_arm.toml: not written; --write writes it\n"));
    assert_eq!(arm.files(), before);
}

#[test]
fn written_file_is_what_calib_measured_and_the_old_one_is_kept() {
    let arm = Arm::kraft("written");
    let steps: [&[&str]; 4] = [
        &["sim", "--config", "my_arm.toml", "--calibrate", "elbow", "--out", "elbow.csv"],
        &["calib", "fit", "elbow.csv", "--config", "my_arm.toml", "--out", "elbow"],
        &["sim", "--config", "my_arm.toml", "--calibrate-friction", "elbow", "--out", "sweep.csv"],
        &["calib", "friction", "sweep.csv", "--config", "my_arm.toml", "--out", "sweep"],
    ];
    for step in steps {
        let ended = arm.frhc(step);
        assert_eq!(ended.code, 0, "{step:?}: {}", ended.stderr);
    }
    let before = arm.read("my_arm.toml");
    let mode = fs::Permissions::from_mode(0o640);
    fs::set_permissions(arm.0.join("my_arm.toml"), mode.clone()).unwrap();
    let fragments = ["elbow/torque_curves.toml", "sweep/friction.toml"];
    let ended = arm.merge(&[&fragments[..], &["--write"]].concat());
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{}", ended.stdout);
    assert!(
        ended.stdout.ends_with("\nmy_arm.toml: written; the file as it was is my_arm.toml.1\n"),
        "{}",
        ended.stdout
    );
    assert_eq!(arm.read("my_arm.toml.1"), before);
    for name in ["my_arm.toml", "my_arm.toml.1"] {
        let found = fs::metadata(arm.0.join(name)).unwrap().permissions();
        assert_eq!(found.mode() & 0o7777, mode.mode(), "{name}");
    }
    let merged = Config::load(&arm.0.join("my_arm.toml")).unwrap();
    let elbow = merged.joint("elbow").unwrap();
    for fragment in fragments {
        let given: toml::Table = arm.read(fragment).parse().unwrap();
        let number = |key: &str| Some(given["joint"][0].get(key)?.as_float().unwrap());
        for (key, found) in [
            ("max_torque_nm", elbow.plant.actuator.max_torque),
            ("coulomb_friction_nm", elbow.plant.friction.coulomb),
            ("viscous_friction_nms_per_rad", elbow.plant.friction.viscous),
        ] {
            assert!(number(key).is_none_or(|number| number == found), "{fragment}: {key}");
        }
    }

    let files = arm.files();
    let again = arm.merge(&[&fragments[..], &["--write"]].concat());
    assert_eq!((again.code, again.stderr.as_str()), (0, ""));
    let nothing = "my_arm.toml: nothing to change, as it has the values of elbow/torque_curves.toml and sweep/friction.toml\n";
    assert!(again.stdout.starts_with(nothing), "{}", again.stdout);
    assert_eq!(arm.files(), files);
}

#[test]
fn shipped_files_are_the_same_to_check_with_a_key_of_each_joint() {
    for file in HAND_CONTROLLERS {
        let arm = Arm::new(&file.replace('/', "_"), file);
        let table: toml::Table = arm.read("my_arm.toml").parse().unwrap();
        let joints = table["joint"].as_array().unwrap().iter();
        let fragment = joints.map(|joint| {
            let kind = joint.get("kind").map_or("revolute", |kind| kind.as_str().unwrap());
            format!("[[joint]]\nname = {}\nkind = \"{kind}\"\n", joint["name"])
        });
        let fragment: String = fragment.collect();
        arm.write("kinds.toml", &fragment);
        let check = |arm: &Arm| arm.frhc(&["check", "--config", "my_arm.toml", "--json"]).stdout;
        let before = check(&arm);
        assert!(before.starts_with("{\"ok\":true"), "{file}: {before}");
        let ended = arm.merge(&["kinds.toml", "--write"]);
        assert_eq!(ended.code, 0, "{file}: {}", ended.stderr);
        assert!(arm.0.join("my_arm.toml.1").exists(), "{file}");
        assert_eq!(check(&arm), before, "{file}");
    }
}

#[test]
fn configuration_that_check_refuses_is_not_written() {
    let arm = Arm::kraft("invalid");
    arm.write("steep.toml", "[[joint]]\nname = \"elbow\"\ntorque_curve = [1.0, -9.0, 0.0]\n")
        .write("unknown.toml", "[controller]\nasist_fraction = 0.2\n");
    for (fragment, reason) in [
        ("steep.toml", ": joint[2].torque_curve: the curve stops rising"),
        ("unknown.toml", ": controller.asist_fraction: unknown key"),
    ] {
        arm.refuses(&[fragment], 3, reason);
        let dry = arm.merge(&[fragment]);
        assert_eq!(dry.code, 3);
        assert!(dry.stdout.starts_with("--- my_arm.toml\n"), "{}", dry.stdout);
        let last = "frhc: my_arm.toml: not written, as check refuses it with these values; \
                    lines are those of the merged text";
        assert_eq!(dry.stderr.lines().last(), Some(last));
    }
    // A merge may also repair.
    let broken = arm.read("my_arm.toml").replace("torque_curve = [199.779", "torque_curve = [-1.0");
    arm.write("my_arm.toml", &broken).write("elbow.toml", ELBOW_CURVE);
    assert_eq!(arm.frhc(&["check", "--config", "my_arm.toml"]).code, 3);
    assert_eq!(arm.merge(&["elbow.toml", "--write"]).code, 0);
    assert_eq!(arm.frhc(&["check", "--config", "my_arm.toml"]).code, 0);
}

#[test]
fn invalid_fragments_are_refused_by_line_and_key() {
    let arm = Arm::kraft("fragments");
    arm.write("elbow.toml", ELBOW_CURVE)
        .write("other.toml", &ELBOW_CURVE.replace("4.1", "4.2"))
        .write("knee.toml", &ELBOW_CURVE.replace("elbow", "knee"))
        .write("twice.toml", &[ELBOW_CURVE, ELBOW_CURVE].concat())
        .write("type.toml", &ELBOW_CURVE.replace("4.1", "\"4.1\""))
        .write("data.csv", "joint,direction,per_mille,torque_nm\n")
        .write("rejected.toml", "# elbow: rejected: the curve stops rising\n")
        .write("empty.toml", "");
    fs::write(arm.0.join("latin.toml"), b"# H\xE4nd\n").unwrap();
    let elbow = "elbow.toml";
    for (fragments, reason) in [
        (
            &[elbow, "other.toml"][..],
            "other.toml:3: joint[0].max_torque_nm: is 4.2, but 4.1 in elbow.toml:3",
        ),
        (
            &["knee.toml"],
            "knee.toml:2: joint[0].name: the configuration has no [[joint]] named \"knee\"",
        ),
        (
            &["twice.toml"],
            "twice.toml:6: joint[1].name: \"elbow\" is the name of an earlier [[joint]], in line 2",
        ),
        (
            &["type.toml"],
            "type.toml:3: joint[0].max_torque_nm: must be a number, as in the configuration, got a string",
        ),
        (&["data.csv"], "data.csv:1: "),
        (&["rejected.toml"], "rejected.toml: has no key to merge"),
        (&[elbow, "empty.toml"], "empty.toml: has no key to merge"),
        (&["latin.toml"], "latin.toml:1: byte E4h is not UTF-8"),
        (&["none.toml"], "none.toml: No such file or directory"),
        (&["eds"], "eds: is a directory, must be a regular file"),
    ] {
        arm.refuses(fragments, 3, reason);
    }
    arm.refuses(&["my_arm.toml"], 2, "my_arm.toml is the configuration itself");
    arm.refuses(&["./my_arm.toml"], 2, "is the configuration itself");
    arm.refuses(&["-", "-"], 2, "stdin (-) can be read only once");
    arm.refuses(&[], 2, "required arguments were not provided");
}

#[test]
fn unusable_configurations_are_refused() {
    let arm = Arm::kraft("configurations");
    arm.write("elbow.toml", ELBOW_CURVE).write("scenario.toml", "seconds = 1.0\n");
    symlink("nowhere.toml", arm.0.join("dangling.toml")).unwrap();
    for (file, reason) in [
        ("none.toml", "none.toml: No such file or directory"),
        ("dangling.toml", "dangling.toml: No such file or directory"),
        ("eds", "eds: is a directory, must be a regular file"),
        ("scenario.toml", "scenario.toml: is a scenario"),
    ] {
        let ended = arm.frhc(&["config", "merge", file, "elbow.toml", "--write"]);
        assert_eq!((ended.code, ended.stdout.as_str()), (3, ""), "{}", ended.stderr);
        assert_eq!(ended.stderr, format!("frhc: {reason}{}\n", rest(&ended.stderr, reason)));
    }
    // In the wrong order.
    let ended = arm.frhc(&["config", "merge", "elbow.toml", "my_arm.toml", "--write"]);
    assert_eq!(ended.code, 3, "{}", ended.stderr);
    assert!(ended.stderr.contains("elbow.toml: has no [node]"), "{}", ended.stderr);

    let file = arm.0.join("my_arm.toml");
    fs::set_permissions(&file, fs::Permissions::from_mode(0o444)).unwrap();
    arm.refuses(
        &["elbow.toml"],
        4,
        "my_arm.toml: is write-protected (mode 0444): chmod u+w it first",
    );
    assert_eq!(arm.merge(&["elbow.toml"]).code, 0, "without --write it is only read");
}

/// Text of the only line behind a reason.
fn rest<'t>(stderr: &'t str, reason: &str) -> &'t str {
    stderr.split_once(reason).map_or("", |(_, rest)| rest.trim_end())
}

#[test]
fn symbolic_link_stays_and_its_target_is_written() {
    let arm = Arm::kraft("link");
    arm.write("elbow.toml", ELBOW_CURVE);
    fs::rename(arm.0.join("my_arm.toml"), arm.0.join("real.toml")).unwrap();
    symlink("real.toml", arm.0.join("my_arm.toml")).unwrap();
    let ended = arm.merge(&["elbow.toml", "--write"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(
        ended.stdout.contains("real.toml: written; the file as it was is "),
        "{}",
        ended.stdout
    );
    assert!(fs::symlink_metadata(arm.0.join("my_arm.toml")).unwrap().is_symlink());
    assert!(arm.read("real.toml").contains("max_torque_nm = 4.1 "));
    assert!(arm.read("real.toml.1").contains("max_torque_nm = 4.0 "));
}

#[test]
fn fragment_is_read_from_stdin() {
    let arm = Arm::kraft("stdin");
    let args = ["config", "merge", "my_arm.toml", "-", "--write"];
    let ended = arm.with_stdin(&args, ELBOW_CURVE);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(arm.read("my_arm.toml").contains("max_torque_nm = 4.1 "));
    let ended = arm.with_stdin(&args, "[[joint]]\nname = 3\n");
    assert_eq!(ended.code, 3);
    assert_eq!(ended.stderr, "frhc: stdin:2: joint[0].name: must be a string, got a number\n");
}

#[test]
fn line_ends_stay() {
    let arm = Arm::kraft("line_ends");
    let unix = arm.read("my_arm.toml");
    let dos = unix.trim_end().replace('\n', "\r\n");
    arm.write("my_arm.toml", &dos).write("elbow.toml", ELBOW_CURVE);
    let ended = arm.merge(&["elbow.toml", "--write"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let merged = arm.read("my_arm.toml");
    assert_eq!(merged.matches('\n').count(), merged.matches("\r\n").count());
    assert!(!merged.ends_with('\n'));
    let differs = |(old, new): &(&str, &str)| old != new;
    assert_eq!(dos.split('\n').zip(merged.split('\n')).filter(differs).count(), 2);
}
