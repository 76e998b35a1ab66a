//! Files that are refused before they are read: pipes, devices, folders, endless ones, and those that others may write.

use std::os::unix::fs::{PermissionsExt, chown, symlink};

use crate::common::prelude::*;
use crate::refused::{NO_INTERFACE, installation, is_refused, run_in};
/// Runs `frhc` with a timeout of 10 s.
fn within_ten_seconds(args: &[&str]) -> CommandOutput {
    let mut command = Command::new("timeout");
    let output = command.args(["10", crate::common::program()]).args(args).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    CommandOutput { code, stdout: text(output.stdout), stderr: text(output.stderr) }
}

#[test]
fn hazard_18_pipes_devices_and_folders_are_refused_as_files() {
    let folder = folder("refused", "irregular");
    let pipe = folder.join("pipe.toml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let zero = folder.join("zero.toml");
    symlink("/dev/zero", &zero).unwrap();
    for (path, kind) in [(&pipe, "pipe"), (&zero, "device"), (&folder, "directory")] {
        let path = path.to_str().unwrap();
        let at = format!("@{path}");
        for args in [
            &["check", "--config", path][..],
            &["run", "--config", path, "--insecure"],
            &["check", "--eds", path],
            &["sdo", "read", "3", "6041", "--eds", path, "-i", NO_INTERFACE],
            &["sdo", "write", "3", "1F50:1", "d", &at, "-i", NO_INTERFACE],
            &["decode", path],
            &["calib", "fit", path, "--config", KRAFT],
            &["calib", "friction", path, "--config", KRAFT],
            &["explain", path],
        ] {
            let ended = within_ten_seconds(args);
            assert!([3, 4].contains(&ended.code), "{args:?}: {} {}", ended.code, ended.stderr);
            let words = format!("is a {kind}, must be a regular file");
            assert!(ended.stderr.contains(&words), "{args:?}: {}", ended.stderr);
            assert!(
                !ended.stderr.contains(NO_INTERFACE),
                "the interface comes later: {}",
                ended.stderr
            );
        }
    }
    for path in [&pipe, &zero] {
        let ended = within_ten_seconds(&["demo", "--scenario", path.to_str().unwrap()]);
        assert_eq!(ended.code, 3, "{}", ended.stderr);
        assert!(ended.stderr.contains("must be a regular file"), "{}", ended.stderr);
    }
}

#[test]
fn oversized_or_endless_value_file_is_refused_before_the_bus() {
    let folder = folder("refused", "endless");
    let large = folder.join("large.bin");
    fs::File::create(&large).unwrap().set_len((16 << 20) + 1).unwrap();
    let at = format!("@{}", large.display());
    let ended = within_ten_seconds(&["sdo", "write", "3", "1F50:1", "d", &at, "-i", NO_INTERFACE]);
    assert_eq!(ended.code, 4, "{}", ended.stderr);
    assert!(ended.stderr.contains("larger than 16 MiB"), "{}", ended.stderr);
    let ended = Command::new("timeout")
        .args([
            "10",
            crate::common::program(),
            "sdo",
            "write",
            "3",
            "1F50:1",
            "d",
            "-",
            "-i",
            NO_INTERFACE,
        ])
        .stdin(fs::File::open("/dev/zero").unwrap())
        .output()
        .unwrap();
    assert_eq!(ended.status.code(), Some(4));
    assert!(String::from_utf8(ended.stderr).unwrap().contains("larger than 16 MiB"));
}

#[test]
fn campaign_with_too_many_threads_is_refused() {
    for threads in ["100000", "257", "0", "many"] {
        let ended = within_ten_seconds(&["campaign", "--faults", "1", "--threads", threads]);
        assert_eq!(ended.code, 2, "{}", ended.stderr);
        assert!(
            ended.stderr.contains(&format!("must be 1 to 256, got {threads}")),
            "{}",
            ended.stderr
        );
    }
}

#[test]
fn hazard_18_files_of_other_users_are_refused_by_run() {
    let other = Some(54_321);
    for (name, path) in [
        ("others_config", "config/arm.toml"),
        ("others_eds", "eds/frhc_drive.eds"),
        ("others_folder", "config"),
    ] {
        let folder = installation(name, KRAFT_TEXT);
        if chown(folder.join(path), other, None).is_err() {
            // Only root can change the owner; `config::trust` has a test of the rule.
            return;
        }
        is_refused(&folder, &[path, "belongs to user 54321, must belong to root"]);
        let ended = run_in(&folder, &["--insecure"]);
        assert_eq!(ended.code, 4, "{}", ended.stderr);
    }
}

#[test]
fn hazard_18_files_writable_by_others_need_insecure() {
    let check = |name: &str, change: &dyn Fn(&Path), words: &[&str]| {
        let folder = installation(name, KRAFT_TEXT);
        change(&folder);
        is_refused(&folder, words);
        let ended = run_in(&folder, &["--insecure"]);
        assert_eq!(ended.code, 4, "{}", ended.stderr);
        fs::set_permissions(folder.join("config"), fs::Permissions::from_mode(0o755)).unwrap();
    };
    let set = |path: PathBuf, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode));
    let anyones = "anyone may write it (mode 0666): chmod o-w it, or say --insecure";
    let of_config = |folder: &Path| set(folder.join("config/arm.toml"), 0o666).unwrap();
    check("anyones_config", &of_config, &["config/arm.toml", anyones]);
    let of_eds = |folder: &Path| set(folder.join("eds/frhc_switches.eds"), 0o666).unwrap();
    check("anyones_eds", &of_eds, &["switches.eds", "frhc_switches.eds", anyones]);
    let folder_too = |folder: &Path| set(folder.join("config"), 0o777).unwrap();
    check("anyones_folder", &folder_too, &["anyone may write", "config (mode 0777)"]);
    let link = |folder: &Path| {
        let (file, real) = (folder.join("config/arm.toml"), folder.join("config/real.toml"));
        fs::rename(&file, &real).unwrap();
        symlink(real, file).unwrap();
    };
    check("link", &link, &["config/arm.toml", "is a symbolic link"]);
}

#[test]
fn hazard_18_check_reads_files_writable_by_others() {
    let folder = installation("harmless", KRAFT_TEXT);
    let file = folder.join("config/arm.toml");
    fs::set_permissions(&file, fs::Permissions::from_mode(0o666)).unwrap();
    let ended = frhc(&["check", "--config", file.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
}
