//! Scripts that install tools, with fake apt-get, cargo and sudo on PATH.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::{Command, Output};

/// Copy of `scripts/`, and a folder of fake commands before PATH. Each fake adds its command line to `journal`.
struct Tree(PathBuf);

impl Tree {
    fn new(name: &str) -> Self {
        let tree = Self(std::env::temp_dir().join(format!("frhc-{name}-{}", std::process::id())));
        fs::remove_dir_all(&tree.0).ok(); // left by an earlier process with this id
        let entries = fs::read_dir("scripts").unwrap().flatten();
        for script in entries.filter(|entry| entry.path().is_file()) {
            let name = script.file_name().into_string().unwrap();
            tree.write(&format!("scripts/{name}"), &fs::read(script.path()).unwrap());
        }
        tree.write("journal", b"");
        tree.stand_in("bin/sudo", "shift; exec \"$@\"");
        // Time passes for no test.
        tree.stand_in("bin/sleep", "note sleep");
        // Complete Python packages, so that none is fetched.
        tree.write("tests/interop/requirements.txt", b"");
        tree.write("target/interop/installed.txt", b"");
        tree.stand_in("target/interop/venv/bin/python", "");
        tree
    }

    fn write(&self, path: &str, content: &[u8]) {
        let path = self.0.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, content).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Writes a program whose shell text may use `note`, which adds a line to the journal.
    fn stand_in(&self, path: &str, text: &str) {
        let journal = self.0.join("journal");
        let note = format!("note() {{ echo \"$*\" >>{}; }}", journal.display());
        self.write(path, format!("#!/bin/bash\n{note}\n{text}\n").as_bytes());
    }

    fn run(&self, script: &str, args: &[&str]) -> Output {
        let path = format!("{}:/usr/bin:/bin", self.0.join("bin").display());
        let mut command = Command::new("bash");
        command.arg(self.0.join(script)).args(args);
        // A shell function would hide the stand-ins, and tools of this host are absent in no test.
        command.env_clear().env("PATH", path).env("HOME", &self.0).output().unwrap()
    }

    fn journal(&self) -> String {
        fs::read_to_string(self.0.join("journal")).unwrap()
    }
}

impl Drop for Tree {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).ok();
    }
}

/// An apt-get whose lock another process holds at the first three attempts of an update and at the first of an install.
const LOCKED_APT: &str = r#"
note "apt-get $*"
attempts=$(grep -c "^apt-get.* $verb" "$journal")
if ((attempts <= busy)); then
  echo "E: Could not get lock $lock. It is held by process 7 (apt-get)" >&2
  exit 100
fi
"#;

/// Returns a fake apt-get that fails as often as another process holds its locks.
fn locked_apt(tree: &Tree) -> String {
    let journal = tree.0.join("journal");
    let by_verb = "case \" $* \" in *' update '*) verb=update busy=3 lock=/var/lib/apt/lists/lock ;; \
        *) verb=install busy=1 lock=/var/cache/apt/archives/lock ;; esac";
    format!("journal={}\n{by_verb}\n{LOCKED_APT}", journal.display())
}

#[test]
fn installing_waits_for_another_apt_to_release_its_locks() {
    let tree = Tree::new("apt-locked");
    tree.stand_in("bin/apt-get", &locked_apt(&tree));
    let ended = tree.run("scripts/apt.sh", &["install", "can-utils"]);
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{stderr}");
    let journal = tree.journal();
    let count = |what: &str| journal.lines().filter(|line| line.contains(what)).count();
    assert_eq!((count(" update"), count(" install "), count("sleep")), (4, 2, 4), "{journal}");
    let installs = journal.lines().filter(|line| line.contains(" install "));
    for line in installs {
        assert!(line.contains("-o DPkg::Lock::Timeout=600"), "{line}");
    }
    assert!(stderr.contains("waiting for another apt"), "{stderr}");
}

#[test]
fn installing_does_not_repeat_another_failure_of_apt() {
    let tree = Tree::new("apt-failed");
    tree.stand_in("bin/apt-get", "note \"apt-get $*\"; echo 'E: no network' >&2; exit 100");
    let ended = tree.run("scripts/apt.sh", &["install", "can-utils"]);
    assert!(!ended.status.success());
    assert!(String::from_utf8_lossy(&ended.stderr).contains("E: no network"));
    assert_eq!(tree.journal().lines().count(), 1, "{}", tree.journal());
}

#[test]
fn every_script_installs_packages_through_the_one_that_waits() {
    let entries =
        ["scripts", "scripts/icount", "scripts/peers"].map(|folder| fs::read_dir(folder).unwrap());
    let paths = entries.into_iter().flatten().map(|entry| entry.unwrap().path());
    for script in paths.filter(|path| path.is_file()) {
        let text = fs::read_to_string(&script).unwrap();
        let is_apt = script.ends_with("apt.sh");
        let installs = |line: &&str| line.contains("apt-get") && line.contains("install");
        let direct: Vec<_> = text.lines().filter(installs).collect();
        assert!(is_apt || direct.is_empty(), "{}: {direct:?}", script.display());
    }
}

/// Creates fakes of the commands that `test.sh` runs; `setup` is the text of `setup.sh`.
fn test_tree(name: &str, setup: &str) -> Tree {
    let tree = Tree::new(name);
    tree.stand_in("bin/cargo", "note \"cargo $*\"");
    tree.stand_in("scripts/setup.sh", setup);
    for script in ["test_demo.sh", "soak.sh", "with_vcan.sh", "interop.sh", "icount.sh"] {
        tree.stand_in(&format!("scripts/{script}"), &format!("note {script}"));
    }
    tree.stand_in("target/dist/frhc", "note \"frhc $*\"");
    tree
}

#[test]
fn tests_that_need_no_tool_run_before_any_is_installed() {
    let tree = test_tree("test-order", "note \"setup.sh $*\"");
    tree.run("scripts/test.sh", &[]);
    let journal = tree.journal();
    let place = |what: &str| journal.lines().position(|line| line.starts_with(what)).unwrap();
    let installed = place("setup.sh tools");
    let tests = journal
        .lines()
        .position(|it| it.starts_with("cargo test --workspace") && !it.ends_with("--no-run"));
    assert!(tests.unwrap() < installed, "{journal}");
    assert!(place("test_demo.sh") > installed, "the demo's log is compared by a tool:\n{journal}");
}

#[test]
fn failed_installation_leaves_out_the_tests_on_vcan_alone() {
    let setup = "note \"setup.sh $*\"; [[ $1 == --missing ]] && echo can-utils; exit 1";
    let tree = test_tree("test-no-tools", setup);
    let ended = tree.run("scripts/test.sh", &[]);
    let (journal, stderr) = (tree.journal(), String::from_utf8_lossy(&ended.stderr).into_owned());
    assert_eq!(ended.status.code(), Some(1), "{stderr}");
    for what in ["test_demo.sh", "frhc -q campaign", "soak.sh"] {
        assert!(journal.lines().any(|line| line.starts_with(what)), "{what}:\n{journal}");
    }
    assert!(!journal.contains("with_vcan.sh"), "{journal}");
    assert!(stderr.contains("test: FAILED: install tools"), "{stderr}");
    assert!(stderr.contains("missing: can-utils"), "{stderr}");
}

#[test]
fn end_of_the_tests_names_those_that_failed() {
    let tree = test_tree("test-failed", "exit 1");
    let failing = "[[ $* == *--no-fail-fast* ]] || exit 0
        echo 'test arm::is_armed ... ok'; echo 'test arm::is_held ... FAILED'; exit 101";
    tree.stand_in("bin/cargo", failing);
    let stderr = tree.run("scripts/test.sh", &[]).stderr;
    let stderr = String::from_utf8_lossy(&stderr);
    let named = "(exit code 101)\ntest arm::is_held ... FAILED\n";
    assert!(stderr.contains(named) && !stderr.contains("is_armed"), "{stderr}");
}

#[test]
fn first_line_of_the_tests_says_what_they_install_and_how_long() {
    let setup = "[[ $1 != --missing ]] || echo qemu-system-x86";
    let tree = test_tree("test-announced", setup);
    let ended = tree.run("scripts/test.sh", &[]);
    let stderr = String::from_utf8_lossy(&ended.stderr).into_owned();
    let first = stderr.lines().next().unwrap();
    for part in
        ["installs qemu-system-x86", "the link over a network (", "a kernel", "minutes here"]
    {
        assert!(first.contains(part), "{part} in {first}");
    }
    // Its release build is there.
    assert!(first.contains("the tests (") && !first.contains("the program ("), "{first}");
}
