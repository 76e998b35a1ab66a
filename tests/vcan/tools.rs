//! Bench tools and simulated drives: their output and their ends.

use std::io::BufRead;

use crate::common::log::NODES;
use crate::common::prelude::*;
use nix::sys::signal::Signal;

#[test]
fn tools_find_read_and_renumber_a_simulated_drive() {
    let scratch = Scratch::new("bench-tools");
    let mut candump = Candump::start("vcan0");
    let ended = |words: &str| {
        let mut command = Command::new(crate::common::program());
        command.args(words.split(' ')).args(["-i", "vcan0"]).output().unwrap()
    };
    let empty = ended("scan");
    assert_eq!(empty.status.code(), Some(1));
    let reason = "frhc: no node responds; no heartbeat was received\n";
    assert_eq!(String::from_utf8_lossy(&empty.stderr), reason);
    let sim = scratch.frhc(&["sim", "--config", KRAFT]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let tool = |words: &str| {
        let ended = ended(words);
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(0), "{words}: {stderr}");
        String::from_utf8(ended.stdout).unwrap()
    };
    let found: Value = serde_json::from_str(&tool("scan --json")).unwrap();
    let nodes = found["nodes"].as_array().unwrap().iter();
    let nodes: Vec<_> =
        nodes.map(|node| (node["node"].as_u64(), node["profile"].as_u64())).collect();
    let mut expected: Vec<_> = NODES.map(|node| (Some(u64::from(node)), Some(402))).collect();
    expected.push((Some(16), Some(401)));
    assert_eq!(nodes, expected);
    let states = found["nodes"].as_array().unwrap().iter().map(|node| node["state"].as_str());
    let asked: Vec<_> = states.map(Option::unwrap).collect();
    assert_eq!(asked, ["pre-operational"; 7], "they send no heartbeat yet");
    assert_eq!(tool("sdo read 3 1018:4 u32"), "3 0x00000003\n");
    assert_eq!(tool(&format!("sdo read elbow 1018:4 --config {KRAFT}")), "3 0x00000003\n");
    tool("nmt stop 5");
    let numbers = |words: &str| -> Vec<_> {
        let found: Value = serde_json::from_str(&tool(words)).unwrap();
        let nodes = found["nodes"].as_array().unwrap().iter();
        nodes.map(|it| (it["node"].as_u64().unwrap(), it["state"] == "stopped")).collect()
    };
    let [unseen, seen] =
        ["scan --json --nodes 4-6", "scan --json --nodes 4-6 --stopped"].map(numbers);
    assert_eq!(unseen, [(4, false), (6, false)]);
    assert_eq!(seen, [(4, false), (5, true), (6, false)]);
    let stopped = ended(&format!("scan --nodes 5 --stopped --config {KRAFT}"));
    let reason = "node 5: is NMT-stopped and responds to no SDO request until `frhc nmt preop`";
    let stderr = String::from_utf8_lossy(&stopped.stderr);
    assert!(stopped.status.code() == Some(5) && stderr.contains(reason), "{stderr}");
    tool("nmt preop 5");
    tool("sdo write 3 6071 i16 -100 --verify");
    assert_eq!(tool("nmt reset 3 --wait"), "node 3 booted up\n");
    let taken = ended("lss configure --select 0xF8C,0x04020010,0x00010000,3 --node-id 4");
    assert_eq!(taken.status.code(), Some(5));
    let reason = "node-id 4 is in use by 00000F8Ch 04020010h 00010000h 00000004h";
    assert!(String::from_utf8_lossy(&taken.stderr).contains(reason));
    tool("lss configure --select 0xF8C,0x04020010,0x00010000,3 --node-id none --store");
    tool("nmt reset-comm 3");
    tool("lss configure --fastscan --probe 5 --node-id 33 --store");
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x721));
    assert_eq!(tool("sdo read 33 1008 vs"), "frhc simulated drive\n");
    tool("sdo write 4 1017 u16 20");
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x704));
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x704));
    sim.terminate().succeeds();
    let dead = ended("nmt start 4 --wait --timeout 300");
    assert_eq!(dead.status.code(), Some(5));
    let reason = "node 4: not confirmed within 300 ms: no frame received";
    let stderr = String::from_utf8_lossy(&dead.stderr);
    assert!(stderr.contains(reason), "{stderr}");
}

#[test]
fn tool_fails_when_its_output_cannot_be_written() {
    let scratch = Scratch::new("full-output");
    let mut candump = Candump::start("vcan0");
    let onto_full = |words: &[&str]| {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut command = Command::new(crate::common::program());
        command.args(words).stdout(full).stderr(Stdio::piped()).spawn().unwrap()
    };
    let fails = |words: &[&str], ended: std::process::Output| {
        let stderr = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(4), "{words:?}: {stderr}");
        assert!(stderr.contains("frhc: stdout: No space left on device"), "{words:?}: {stderr}");
    };
    let sim = onto_full(&["sim", "--config", KRAFT]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    for words in [
        "scan --nodes 1-3 -i vcan0",
        "scan --json -i vcan0",
        "sdo read 3 1018:4 u32 -i vcan0",
        "nmt reset 3 --wait -i vcan0",
        "lss inquire --select 0xF8C,0x04020010,0x00010000,3 -i vcan0",
        "commission --config config/kraft_like.toml --prove -i vcan0",
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        fails(&words, onto_full(&words).wait_with_output().unwrap());
    }
    // The tool ends by itself at the first line that is lost.
    let watch = onto_full(&["nmt", "watch", "-i", "vcan0"]);
    scratch.frhc(&["nmt", "reset", "3", "--wait", "-i", "vcan0"]).wait().succeeds();
    scratch.frhc(&["nmt", "reset", "4", "--wait", "-i", "vcan0"]).wait().succeeds();
    fails(&["nmt", "watch"], watch.wait_with_output().unwrap());
    nix::sys::signal::kill(
        nix::unistd::Pid::from_raw(sim.id().try_into().unwrap()),
        Signal::SIGTERM,
    )
    .unwrap();
    fails(&["sim"], sim.wait_with_output().unwrap());
}

#[test]
fn simulated_drives_report_on_signal_and_at_the_end() {
    let scratch = Scratch::new("reports");
    let mut candump = Candump::start("vcan0");
    let (sim, mut reports) = scratch.frhc_and_stdout(&["sim", "--json", "--config", KRAFT]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let mut drives = || {
        let mut line = String::new();
        reports.read_line(&mut line).unwrap();
        let report: Value = serde_json::from_str(&line).unwrap();
        assert!(report["t_s"].as_f64().unwrap() >= 0.0, "{line}");
        let drives = report["drives"].as_array().unwrap().clone();
        assert_eq!(drives.len(), 6, "{line}");
        drives
    };
    sim.signal(Signal::SIGUSR1);
    let reported = drives();
    assert_eq!(reported[2]["name"], "elbow");
    assert_eq!(reported[2]["nmt"], "pre-operational");
    assert_eq!(reported[2]["state"], "switch on disabled");
    assert_eq!(reported[2]["last_error"], 0);
    Process::start("cansend", &["vcan0", "000#0103"]).wait().succeeds();
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x000));
    sim.signal(Signal::SIGQUIT);
    drives();
    sim.terminate().succeeds();
    assert_eq!(drives()[2]["nmt"], "operational");
}

#[test]
fn simulated_drives_end_when_their_interface_goes_down() {
    let scratch = Scratch::new("down");
    let words = ["sim", "--config", KRAFT, "-i", "vcan1"];
    let mut candump = Candump::start("vcan1");
    let sim = scratch.frhc(&words);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    Process::start("ip", &["link", "set", "vcan1", "down"]).wait().succeeds();
    let from_the_start = scratch.frhc(&words).wait();
    for outcome in [sim.wait(), from_the_start] {
        assert_eq!(outcome.code, Some(4), "{}", outcome.stderr);
        assert_eq!(
            outcome.stderr.matches("vcan1: interface down").count(),
            1,
            "{}",
            outcome.stderr
        );
    }
    Process::start("ip", &["link", "set", "vcan1", "up"]).wait().succeeds();
}
