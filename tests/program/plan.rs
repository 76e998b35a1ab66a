//! The bus planner against the simulated bus, and `frhc plan` as a user runs it.

use crate::common::bench::booted;
use crate::common::prelude::*;
use canopen::bits;
use canopen::load::network::Assumptions;
use canopen::load::streams::Role;
use canopen_tools::bus_figures::{self, BusPlan, PlannedFrame, values};

/// Asserts that the simulated buses of a moved arm carry the planned load, with no frame later than planned.
fn assert_carried_as_planned(file: &str) {
    let (mut bench, wire) = booted(file, "teleoperation");
    until(&mut bench, |record| record.mode == Mode::Armed);
    wire.clear();
    let cycles: u32 = 1_700;
    bench.run(cycles.into());
    let configuration = config(file);
    let values = values::typical_values(&configuration);
    let plan = bus_figures::plans(&configuration.network(), &values, &Assumptions::default());
    let carried = wire.all();
    for (channel, bus) in (0..).map(Channel).zip(&plan) {
        let here = carried.iter().filter(|(_, telegram)| telegram.channel == channel);
        let bits: u32 = here.map(|(_, telegram)| bits::exact(&telegram.frame)).sum();
        let exact = f64::from(bits) / f64::from(cycles);
        let error = 100.0 * (bus.utilisation.typical.used / exact - 1.0);
        assert!(error.abs() < 1.0, "{file}, {}: {error:.2} % off {exact:.1} bits", bus.name);
    }
    no_frame_is_late(&plan, &carried);
}

/// Returns whether `planned` includes frames with this identifier. The plan has one SDO exchange at a time, with the
/// node of the highest priority.
fn includes(planned: &PlannedFrame, cob_id: u16) -> bool {
    match planned.stream.role {
        Role::SdoRequest => (0x601..=0x67F).contains(&cob_id),
        Role::SdoResponse => (0x581..=0x5FF).contains(&cob_id),
        Role::Sync | Role::Tpdo(_) | Role::Rpdo(_) | Role::Heartbeat | Role::Emergency => {
            planned.stream.cob_id == cob_id
        }
    }
}

/// Asserts that positions follow their SYNC, and torques the last position of any bus, within the planned time.
fn no_frame_is_late(plan: &[BusPlan], carried: &[(Instant, Telegram)]) {
    let mut synced = vec![None; plan.len()];
    let mut sampled = None;
    let mut compared = 0;
    for (at, Telegram { channel: Channel(place), frame }) in carried {
        let place = usize::from(*place);
        let mut planned = plan[place].frames.iter();
        let planned: &PlannedFrame = planned
            .find(|planned| includes(planned, frame.cob_id))
            .unwrap_or_else(|| panic!("{frame} is not planned"));
        assert!(bits::exact(frame) <= planned.stream.worst_bits());
        let queued = match planned.stream.role {
            Role::Sync => {
                synced[place] = Some(*at);
                None
            }
            Role::Tpdo(_) if planned.stream.is_cyclic() => {
                sampled = Some(*at);
                synced[place]
            }
            Role::Rpdo(_) if planned.stream.is_cyclic() => sampled,
            Role::Tpdo(_)
            | Role::Rpdo(_)
            | Role::Heartbeat
            | Role::Emergency
            | Role::SdoRequest
            | Role::SdoResponse => None,
        };
        if let Some(queued) = queued {
            let took = at.since(queued);
            assert!(Some(took) <= planned.response, "{frame} took {took:?}");
            compared += 1;
        }
    }
    assert!(compared > 10_000, "{compared} frames compared");
}

#[test]
fn one_bus_at_500_hz_is_carried_as_planned() {
    assert_carried_as_planned(KRAFT_500HZ);
}

#[test]
fn kraft_like_is_carried_as_planned() {
    assert_carried_as_planned(KRAFT);
}

#[test]
fn jpl_like_is_carried_as_planned() {
    assert_carried_as_planned(JPL);
}

#[test]
fn jpl_like_1538hz_is_carried_as_planned() {
    assert_carried_as_planned("config/jpl_like_1538hz.toml");
}

#[test]
fn spherical_wrist_is_carried_as_planned() {
    assert_carried_as_planned("config/sixr_spherical.toml");
}

/// Returns whether the master sends frames with this identifier.
fn is_sent_by_master(cob_id: u16) -> bool {
    match cob_id {
        0x000 | 0x080 | 0x100 | 0x77F => true,
        _ => matches!(cob_id & 0x780, 0x200 | 0x300 | 0x400 | 0x500 | 0x600) && cob_id & 0x7F != 0,
    }
}

#[test]
fn transmit_queue_holds_the_largest_burst_of_any_cycle() {
    for (file, allowed) in [
        (KRAFT, &[16][..]),
        (KRAFT_500HZ, &[16]),
        (JPL, &[8, 10]),
        ("config/sixr_spherical.toml", &[8, 10]),
    ] {
        let (mut bench, wire) = booted(file, "teleoperation");
        wire.clear();
        bench.run(1_500);
        let config = config(file);
        assert_eq!(config.bursts(), allowed, "{file}");
        for (channel, max) in (0..).map(Channel).zip(config.bursts()) {
            let carried = wire.all();
            let here = carried.iter().filter(|(_, telegram)| telegram.channel == channel);
            let ids: Vec<u16> = here.map(|(_, telegram)| telegram.frame.cob_id).collect();
            let cycles = ids.chunk_by(|_, next| *next != 0x80);
            let burst = cycles.map(|ids| ids.iter().filter(|id| is_sent_by_master(**id)).count());
            let largest = u32::try_from(burst.max().unwrap()).unwrap();
            assert!((3..=max).contains(&largest), "{file}: {largest} frames, {max} allowed");
        }
    }
}

/// Exit code and output of `frhc`.
struct PlanOutput {
    code: Option<i32>,
    out: String,
    err: String,
}

impl PlanOutput {
    fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap()
    }

    /// Returns the only bus.
    fn bus(&self) -> Value {
        self.json()["buses"][0].clone()
    }
}

fn frhc(task: &str, config: &Path, args: &[&str]) -> PlanOutput {
    let mut command = Command::new(crate::common::program());
    let output = command.arg(task).arg("--config").arg(config).args(args).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    PlanOutput { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

fn plan(args: &[&str]) -> PlanOutput {
    frhc("plan", Path::new(KRAFT_500HZ), args)
}

/// Writes the 500 Hz configuration with changes to it and to its drive's EDS; returns its path.
fn changed(name: &str, lines: &[(&str, &str)], eds: &[(&str, &str)]) -> PathBuf {
    let replace = |text: String, changes: &[(&str, &str)]| {
        changes.iter().fold(text, |text, (from, to)| {
            assert!(text.contains(from), "{from} is not there");
            text.replace(from, to)
        })
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(folder.join("eds")).unwrap();
    for file in ["frhc_drive.eds", "frhc_switches.eds"] {
        let text = fs::read_to_string(Path::new("eds").join(file)).unwrap();
        let text = if file == "frhc_drive.eds" { replace(text, eds) } else { text };
        fs::write(folder.join("eds").join(file), text).unwrap();
    }
    let text = fs::read_to_string(KRAFT_500HZ).unwrap().replace("../eds/", "eds/");
    let file = folder.join("arm.toml");
    fs::write(&file, replace(text, lines)).unwrap();
    file
}

const AT_1_KHZ: (&str, &str) = ("sync_period_us = 2000", "sync_period_us = 1000");
const QUIET: [(&str, &str); 3] = [
    AT_1_KHZ,
    ("drive_heartbeat_ms = 25", "drive_heartbeat_ms = 100"),
    ("drive_lost_ms = 60", "drive_lost_ms = 240"),
];

#[test]
fn shipped_configurations_fit() {
    for entry in fs::read_dir("config").unwrap() {
        let file = entry.unwrap().path();
        if file.extension().is_some_and(|extension| extension == "toml") {
            let ended = frhc("plan", &file, &["--json"]);
            assert_eq!((ended.code, ended.err.as_str()), (Some(0), ""), "{}", file.display());
            assert_eq!(ended.json()["fits"], true);
        }
    }
}

#[test]
fn six_drives_at_1_khz_on_one_bus_are_planned_and_refused() {
    let file = changed("overloaded", &[AT_1_KHZ], &[]);
    let ended = frhc("plan", &file, &[]);
    assert_eq!(ended.code, Some(3));
    for line in [
        "  SYNC and its PDOs, unstuffed         1187.0 bits  118.7 %  a cycle",
        "  SYNC and its PDOs, worst case        1435.0 bits  143.5 %",
        "bus joints, 1000000 bit/s: does not fit",
    ] {
        assert!(ended.out.lines().any(|found| found == line), "{line}\n{}", ended.out);
    }
    let reason =
        "bus[0].load_limit_percent: bus load of 1477.0 of 1000 bits a cycle, 147.7 % is above";
    assert!(ended.err.contains(reason), "{}", ended.err);
    assert!(ended.err.contains("arm.toml:13: "), "{}", ended.err);
}

#[test]
fn check_and_run_refuse_an_overloaded_bus_as_plan_does() {
    let file = changed("refused", &[AT_1_KHZ], &[]);
    for task in ["check", "run"] {
        let ended = frhc(task, &file, &[]);
        assert_eq!((ended.code, ended.out.as_str()), (Some(3), ""));
        assert!(ended.err.contains("bus load of 1477.0"), "{}", ended.err);
    }
}

#[test]
fn grouped_torques_fit_at_1_khz() {
    let ended = frhc("plan", &changed("quiet", &QUIET, &[]), &["--layout", "grouped", "--json"]);
    assert_eq!((ended.code, ended.err.as_str()), (Some(0), ""));
    let load = &ended.bus()["load"];
    assert_eq!(load["cycle_worst"]["bits_per_cycle"], 855.0);
    let percent = load["worst"]["percent"].as_f64().unwrap();
    assert!((89.5..90.0).contains(&percent), "{percent}");
}

#[test]
fn proposals_for_an_overload_fit() {
    let ended = plan(&["--rate", "1000", "--json"]);
    assert_eq!(ended.code, Some(3));
    let proposals = ended.json()["proposals"].as_array().unwrap().clone();
    let first = |proposal: &Value| proposal["changes"][0].as_str().unwrap().to_owned();
    let fitting: Vec<_> = proposals.iter().filter(|it| it["fits"] == true).map(first).collect();
    let expected = ["three torques in one RPDO", "a second bus for half of the drives", "500 Hz"];
    assert_eq!(fitting, expected);
    assert_eq!(plan(&["--rate", "500"]).code, Some(0));
    // The reported highest rate fits, a slightly higher one does not.
    let highest = proposals[0]["highest_rate_hz"].as_f64().unwrap();
    let quiet = changed("highest", &QUIET, &[]);
    let at = |hz: f64| frhc("plan", &quiet, &["--layout", "grouped", "--rate", &hz.to_string()]);
    assert_eq!(at((highest - 2.0).floor()).code, Some(0));
    assert_eq!(at((highest + 2.0).ceil()).code, Some(3));
}

#[test]
fn drives_that_cannot_share_an_rpdo_are_named() {
    let file = changed("no-dummy", &[AT_1_KHZ], &[("Dummy0003=1", "Dummy0003=0")]);
    let ended = frhc("plan", &file, &[]);
    assert_eq!(ended.code, Some(3));
    let reason = "torques cannot be grouped: its EDS lacks dummy mapping of 0003h";
    assert!(ended.out.contains(&format!("joint 3 (elbow): {reason}")), "{}", ended.out);
    assert!(!ended.out.contains("three torques in one RPDO"));
    let ended = frhc("plan", &file, &["--layout", "grouped"]);
    assert_eq!((ended.code, ended.out.as_str()), (Some(3), ""));
    assert_eq!(ended.err.lines().filter(|line| line.ends_with(reason)).count(), 6);
}

#[test]
fn half_the_bit_rate_doubles_the_load() {
    let percent = |args: &[&str]| {
        let ended = plan(&[args, &["--json"]].concat());
        ended.bus()["load"]["worst"]["percent"].as_f64().unwrap()
    };
    let (whole, half) = (percent(&[]), percent(&["--bitrate", "500000"]));
    assert!((half - 2.0 * whole).abs() < 1e-9, "{half} is not twice {whole}");
}

#[test]
fn every_frame_is_listed_with_its_response_time() {
    let bus = plan(&["--json"]).bus();
    let frames = bus["frames"].as_array().unwrap();
    // SYNC, 7 emergencies, 7 TPDOs, 6 RPDOs, an SDO exchange, 8 heartbeats.
    assert_eq!(frames.len(), 1 + 7 + 7 + 6 + 2 + 8);
    for frame in frames {
        let bits = |kind: &str| frame["bits"][kind].as_f64().unwrap();
        assert!(bits("unstuffed") <= bits("typical") && bits("typical") <= bits("worst"));
        assert!(frame["response_us"].as_f64().unwrap() >= bits("worst"));
    }
}

#[test]
fn slower_host_and_bus_errors_add_time() {
    let done = |args: &[&str]| {
        let bus = plan(&[args, &["--json"]].concat()).bus();
        (
            bus["cycle"]["worst"]["done_us"].as_f64().unwrap(),
            bus["frames"][20]["response_us"].as_f64().unwrap(),
        )
    };
    let (done_us, response_us) = done(&[]);
    assert!((done(&["--host-us", "260"]).0 - done_us - 200.0).abs() < 1e-9);
    assert!(done(&["--error-every-ms", "20"]).1 >= response_us + 31.0 + 135.0);
}

#[test]
fn invalid_arguments_are_usage_errors() {
    for args in [["--rate", "0"], ["--rate", "x"], ["--bitrate", "1"], ["--layout", "none"]] {
        assert_eq!(plan(&args).code, Some(2));
    }
}
