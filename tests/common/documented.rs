//! Table of the `sh` blocks of the documentation: where each is run. `tests/program/documented.rs` runs those that need no bus,
//! `tests/vcan.rs` the others; `src/program/tests.rs` gives every command to the command line.

use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use crate::common::sh_blocks::{ShBlock, blocks};

/// Where a block is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lane {
    /// On any machine, without a session.
    AnyMachine,
    /// On any machine, where `/tmp/session` is a recorded session of ten seconds.
    Session,
    /// On vcan0, after these commands.
    Vcan(&'static str),
    /// On vcan0 with `frhc-link`, after these commands.
    Network(&'static str),
    /// Nowhere, for this reason.
    NotRun(&'static str),
}

/// One block, by its page and the start of its first line.
pub(crate) struct Row {
    pub(crate) page: &'static str,
    begins: &'static str,
    pub(crate) lane: Lane,
    /// Starts of lines that are not run, each with the reason.
    left_out: &'static [(&'static str, &'static str)],
}

const fn row(page: &'static str, begins: &'static str, lane: Lane) -> Row {
    Row { page, begins, lane, left_out: &[] }
}

const fn row_without(
    page: &'static str,
    begins: &'static str,
    lane: Lane,
    left_out: &'static [(&'static str, &'static str)],
) -> Row {
    Row { page, begins, lane, left_out }
}

/// Bus without other stations.
const EMPTY_BUS: &str = "";
/// Simulated drives of `my_arm.toml`.
const DRIVES: &str = "frhc sim --config my_arm.toml --scenario contact_10s &";
/// A node that is armed.
const ARMED: &str = "frhc sim --config my_arm.toml --scenario contact_10s & frhc run --config my_arm.toml & frhc ctl --wait arm";
/// A node that another master's SYNC has stopped.
const STOPPED: &str = "frhc sim --config my_arm.toml & frhc run --config my_arm.toml & \
                       frhc ctl --wait arm; cansend vcan0 080#; candump -n 200 vcan0 > seen";
/// A node whose drives count from power-up.
const INCREMENTAL: &str = r#"sed -e '/^zero_counts/d' -e 's/^zero = "absolute"/zero = "rest"/' -e 's|"\.\./eds/|"eds/|' config/kraft_like.toml > incremental.toml
echo 'seconds = 600.0' > still.toml
frhc sim --config incremental.toml --scenario still.toml & frhc run --config incremental.toml &"#;
/// The same, armed, after a reboot of a drive.
const REBOOTED: &str = r#"sed -e '/^zero_counts/d' -e 's/^zero = "absolute"/zero = "rest"/' -e 's|"\.\./eds/|"eds/|' config/kraft_like.toml > incremental.toml
echo 'seconds = 600.0' > still.toml
frhc sim --config incremental.toml --scenario still.toml & frhc run --config incremental.toml &
frhc ctl --wait zero; frhc ctl arm; cansend vcan0 000#8103; candump -n 200 vcan0 > seen"#;
/// A recording as `bus.log`.
const RECORDING: &str =
    "frhc -q demo --scenario contact_10s --out recorded; ln -s recorded/bus.log bus.log";

/// A node whose robot is to come, on simulated drives.
const WITHOUT_A_ROBOT: &str = r#"sed -e 's|"../eds/|"eds/|' -e 's/^kind = "virtual"/kind = "link"/' -e '/^.remote.wall/,/^.safety/{//!d}' \
  -e 's/^.remote.wall./[remote.link]\nround_trip_ms = 5.0\nstiffest_contact_n_per_m = 2000.0\n/' config/kraft_like.toml > my_link.toml
frhc sim --config my_link.toml --scenario contact_10s & frhc run --config my_link.toml &"#;

/// The session of `Lane::Session`.
pub(crate) const SESSION: &str = "frhc -q demo --scenario contact_10s --out session > /dev/null";

const BUILDS: &str = "builds the program, or runs its tests";
const INTERFACES: (&str, &str) = ("scripts/vcan_setup.sh", "the test has its interfaces");
const REAL_INTERFACE: (&str, &str) = ("ip link set can0", "sets up a real interface");

pub(crate) const ROWS: &[Row] = &[
    row("CONTRIBUTING.md", "cargo test", Lane::NotRun(BUILDS)),
    row("CONTRIBUTING.md", "scripts/check.sh", Lane::NotRun(BUILDS)),
    row("README.md", "cargo demo", Lane::NotRun(BUILDS)),
    row("README.md", "cargo install", Lane::NotRun(BUILDS)),
    row_without("README.md", "scripts/vcan_setup.sh", Lane::Vcan(EMPTY_BUS), &[INTERFACES]),
    row_without(
        "README.md",
        "frhc check",
        Lane::Vcan(DRIVES),
        &[("frhc run", "ends by Ctrl-C; getting-started has it, too")],
    ),
    row("docs/adr/0028-a-held-torque-is-seen.md", "cargo test", Lane::NotRun(BUILDS)),
    row("docs/bus.md", "frhc plan", Lane::AnyMachine),
    row("docs/calibration.md", "frhc sim", Lane::AnyMachine),
    row("docs/candump.md", "candump can0", Lane::Vcan(ARMED)),
    row("docs/candump.md", "log2asc", Lane::Vcan(RECORDING)),
    row("docs/candump.md", "frhc export", Lane::AnyMachine),
    row("docs/candump.md", "frhc scan", Lane::Vcan(DRIVES)),
    row("docs/drives.md", "frhc check --eds eds/drives/elmo-gold.eds  #", Lane::Vcan(DRIVES)),
    row_without(
        "docs/drives.md",
        "frhc check --eds eds/drives/elmo-gold.eds",
        Lane::Vcan(EMPTY_BUS),
        &[("frhc demo", "takes seconds; getting-started has it, too")],
    ),
    row("docs/drives.md", "frhc commission", Lane::Vcan(DRIVES)),
    row(
        "docs/drives/README.md",
        "scripts/with_vcan.sh",
        Lane::NotRun("scripts/test.sh compares the table"),
    ),
    row(
        "docs/faults.md",
        "frhc demo",
        Lane::Vcan("cp config/scenarios/contact_10s.toml my_scenario.toml"),
    ),
    row_without(
        "docs/faults.md",
        "frhc campaign",
        Lane::AnyMachine,
        &[
            ("frhc campaign --seed", "scripts/test.sh runs it"),
            ("frhc campaign -c", "takes seconds; the same on one configuration"),
            ("frhc campaign --only", "takes seconds; the same with one kind"),
            ("frhc campaign --faults 60", "takes seconds; tests/memory/campaign.rs does the same"),
            ("scripts/soak.sh", "scripts/test.sh runs it"),
        ],
    ),
    row("docs/faults.md", "modprobe", Lane::NotRun("tests/vcan_faults run what it shows")),
    row_without(
        "docs/getting-started.md",
        "cargo install",
        Lane::NotRun("builds the program; scripts/test_demo.sh runs the demo"),
        &[],
    ),
    row_without(
        "docs/getting-started.md",
        "scripts/vcan_setup.sh",
        Lane::Vcan(EMPTY_BUS),
        &[INTERFACES],
    ),
    row("docs/getting-started.md", "sed", Lane::AnyMachine),
    row_without(
        "docs/getting-started.md",
        "ip link",
        Lane::Vcan(DRIVES),
        &[REAL_INTERFACE, ("sudo install", "changes the machine")],
    ),
    row("docs/operation.md", "frhc ctl status", Lane::Vcan(STOPPED)),
    row_without(
        "docs/operation.md",
        "frhc ctl scale",
        Lane::Vcan(ARMED),
        &[("frhc ctl align", "needs pose mode and a hand at the deadman")],
    ),
    row("docs/sessions.md", "frhc demo --seconds 20", Lane::AnyMachine),
    row("docs/sessions.md", "frhc demo --seconds 5", Lane::AnyMachine),
    row("docs/sessions.md", "frhc signals", Lane::Session),
    row(
        "docs/sessions.md",
        "lab/mutants.sh",
        Lane::NotRun("takes minutes; scripts/test.sh runs shorter sessions"),
    ),
    row("docs/sessions.md", "frhc export mcap", Lane::Session),
    row("docs/sessions.md", "frhc report", Lane::Session),
    row("docs/operation.md", "groupadd", Lane::NotRun("changes the users of the machine")),
    row("docs/paper.md", "frhc explain", Lane::AnyMachine),
    row("docs/performance.md", "frhc ctl status", Lane::Vcan(ARMED)),
    row(
        "docs/python.md",
        "python3 -m venv",
        Lane::NotRun("fetches packages: tests/interop/python_package.py installs it"),
    ),
    row("docs/robots.md", "frhc demo", Lane::AnyMachine),
    row("docs/robots.md", "export", Lane::Vcan(EMPTY_BUS)),
    row("docs/robots.md", "scripts/three_modes.sh", Lane::AnyMachine),
    row("docs/net-ft.md", "export", Lane::Vcan(EMPTY_BUS)),
    row("docs/top.md", "frhc top", Lane::NotRun("needs a terminal: tests/interop/top.py has one")),
    row("docs/robots.md", "frhc-link key", Lane::Network(WITHOUT_A_ROBOT)),
    row(
        "docs/mujoco.md",
        "lab/mujoco_arm.sh",
        Lane::NotRun("installs MuJoCo; tests/interop/mujoco_felt.py plays the same"),
    ),
    row("docs/network.md", "cargo build", Lane::NotRun(BUILDS)),
    row("docs/network.md", "useradd", Lane::NotRun("changes the users of the machine")),
    row(
        "docs/telemetry.md",
        "socat",
        Lane::NotRun("needs socat: tests/vcan/telemetry.rs reads it"),
    ),
    row(
        "docs/view.md",
        "frhc demo --view",
        Lane::NotRun("needs a browser: tests/interop/view_judges.py has one"),
    ),
    row("docs/view.md", "frhc view", Lane::NotRun("serves until Ctrl-C: tests/program/view.rs")),
    row("docs/view.md", "ssh", Lane::NotRun("needs another machine")),
    row("docs/zero.md", "sed", Lane::AnyMachine),
    row("docs/zero.md", "frhc ctl --wait zero", Lane::Vcan(INCREMENTAL)),
    row_without(
        "docs/zero.md",
        "frhc ctl reset",
        Lane::Vcan(REBOOTED),
        &[("frhc ctl arm                   # refused", "fails: tests/vcan/zero.rs")],
    ),
];

impl Row {
    pub(crate) fn is_of(&self, block: &ShBlock) -> bool {
        self.page == block.page && block.lines[0].starts_with(self.begins)
    }

    /// Returns the block as a script: an endless command ends, and `can0` and folders are those of the test.
    fn script(&self, block: &ShBlock, before: &str) -> String {
        let is_run =
            |line: &&String| !self.left_out.iter().any(|(start, _)| line.starts_with(start));
        let lines = block.lines.iter().filter(is_run).map(String::as_str).collect::<Vec<_>>();
        for (start, _) in self.left_out {
            assert!(
                block.lines.iter().any(|line| line.starts_with(start)),
                "{}: {start}",
                self.page
            );
        }
        let lines = lines.join("\n").replace(" can0", " vcan0");
        let lines = lines.replace("/var/lib/frhc", "$PWD/recorded").replace("/tmp/", "$PWD/");
        format!("{PREAMBLE}\n{before}\n{lines}\n")
    }
}

/// Each failure ends the script, together with its background processes.
const PREAMBLE: &str = r#"set -euo pipefail
trap 'kill $(jobs -p) 2>/dev/null || true; wait || true' EXIT
export XDG_RUNTIME_DIR=$PWD STATE_DIRECTORY=$PWD/state NO_COLOR=1
unset RUNTIME_DIRECTORY
candump() { timeout 0.2 "$(type -P candump)" "$@" || true; }
frhc() {
  case "$*" in
    "nmt watch"*) timeout --preserve-status -s INT 0.5 "$FRHC" "$@" || true ;;
    "sim "*" --quirks "*) timeout --preserve-status -s INT 0.5 "$FRHC" "$@" ;;
    "sim "*" --scenario faults/"*) timeout --preserve-status -s INT 0.5 "$FRHC" "$@" ;;
    # Its fault stops the node.
    "demo --scenario faults/"*) "$FRHC" "$@" || (($? == 6)) ;;
    # In the background it is the job that is ended.
    *) if ((BASHPID == $$)); then "$FRHC" "$@"; else exec "$FRHC" "$@"; fi ;;
  esac
}
frhc-link() { if ((BASHPID == $$)); then "$FRHC_LINK" "$@"; else exec "$FRHC_LINK" "$@"; fi; }
"#;

/// Runs the blocks of `is_wanted` lanes, each in a folder that has what a clone has, and `my_arm.toml`. Returns their number.
pub(crate) fn run(folder: &Path, is_wanted: impl Fn(Lane) -> Option<&'static str>) -> usize {
    let blocks = blocks(Path::new("."));
    let mut count = 0;
    for (number, row) in ROWS.iter().enumerate() {
        let Some(before) = is_wanted(row.lane) else { continue };
        let block = first(&blocks, number);
        let clone = folder.join(number.to_string());
        prepare(&clone, &blocks);
        let script = row.script(block, before);
        let mut bash = Command::new("bash");
        bash.args(["-c", &script]).current_dir(&clone).env("FRHC", crate::common::program());
        bash.env("FRHC_LINK", crate::common::link_program());
        let output = bash.output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
        assert!(output.status.success(), "{}: {script}\n{stdout}\n{stderr}", row.page);
        let is_empty = stdout.trim().is_empty() && !script.contains(" > ");
        let is_null = stdout.contains("null") && script.contains("| jq");
        assert!(!is_empty && !is_null, "{} prints nothing: {script}\n{stdout}\n{stderr}", row.page);
        count += 1;
    }
    count
}

/// Returns the first block of a row that no earlier row has.
fn first(blocks: &[ShBlock], number: usize) -> &ShBlock {
    let is_own = |block: &&ShBlock| ROWS.iter().position(|row| row.is_of(block)) == Some(number);
    blocks.iter().find(is_own).unwrap_or_else(|| {
        let Row { page, begins, .. } = &ROWS[number];
        panic!("{page} has no block that begins with {begins}")
    })
}

/// Makes a folder that has what a clone has, and `my_arm.toml` as the first line of its block in getting-started makes it.
fn prepare(clone: &Path, blocks: &[ShBlock]) {
    std::fs::create_dir_all(clone).unwrap();
    for name in ["config", "eds", "scripts", "tests"] {
        symlink(std::env::current_dir().unwrap().join(name), clone.join(name)).unwrap();
    }
    let makes = |block: &&ShBlock| block.lines[0].contains("> my_arm.toml");
    let line = &blocks.iter().find(makes).expect("a block that makes my_arm.toml").lines[0];
    let made = Command::new("bash").args(["-ec", line]).current_dir(clone).status().unwrap();
    assert!(made.success(), "{line}");
}
