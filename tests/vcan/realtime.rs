//! Timing of the cycles, and real-time settings that the kernel grants or refuses.

use std::io::Read;

use crate::common::prelude::*;
use crate::common::rig::seconds;
use canopen_tools::candump::Line;

#[test]
fn timing_of_the_cycles_is_in_status_summary_and_at_the_end() {
    let scratch = Scratch::new("timing");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT]);
    let run = scratch.frhc(&["run", "--config", KRAFT, "--record", &scratch.path("session")]);
    let is_sync = |line: &Line<'_>| line.canopen().is_some_and(|(id, _)| id == 0x80);
    let first = candump.until(is_sync).nanos;
    candump.until(|line| line.nanos > first + seconds(2.0));
    let (status, mut text) = scratch.frhc_and_stdout(&["ctl", "status", "--json"]);
    let mut line = String::new();
    text.read_to_string(&mut line).unwrap();
    status.wait().succeeds();
    let answer: Value = serde_json::from_str(&line).unwrap();
    let timing = &answer["status"]["timing"];
    let of = |name: &str, value: &str| timing[name][value].as_u64().unwrap();
    for name in ["wake_up_late_us", "sync_to_last_sample_us", "step_us", "sync_to_last_target_us"] {
        assert!(of(name, "count") > 1_000, "{name}: {timing:#}");
        // In virtual time computing takes none: what remains is what the bus and the timers take.
        assert!(of(name, "max") < 1_000, "{name}: {timing:#}");
    }
    assert!(of("sync_to_confirmation_us", "count") > 1_000, "{timing:#}");
    assert_eq!(timing["sync_to_sample_us"]["p50"].as_array().unwrap().len(), 6, "{timing:#}");
    let outcome = run.terminate();
    outcome.succeeds();
    sim.terminate().succeeds();
    for name in
        ["wake-up late      ", "SYNC to samples   ", "controller step   ", "SYNC to targets   "]
    {
        assert!(outcome.stderr.contains(name), "{}", outcome.stderr);
    }
    let folder = fs::read_dir(scratch.path("session")).unwrap().next().unwrap().unwrap().path();
    let summary = fs::read_to_string(folder.join("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert!(summary["timing"]["step_us"]["count"].as_u64().unwrap() > 1_000, "{summary:#}");
}

#[test]
fn locked_memory_is_what_the_node_uses() {
    let scratch = Scratch::new("locked");
    let sim = scratch.frhc(&["sim", "--config", KRAFT]);
    let run = scratch.frhc(&["run", "--config", KRAFT]);
    scratch.ctl("--wait arm").succeeds();
    let [locked, resident] = ["VmLck", "VmRSS"].map(|name| run.memory_kb(name));
    // Without one arena for all threads some hundred MB are locked.
    assert!(locked < resident + 20_000, "{locked} kB locked, {resident} kB resident");
    run.terminate().succeeds();
    sim.terminate().succeeds();
}

#[test]
fn threads_of_the_node_have_no_page_fault_in_contact() {
    let scratch = Scratch::new("page-faults");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT, "--scenario", "contact_10s"]);
    let run = scratch.frhc(&["run", "--config", KRAFT]);
    scratch.ctl("--wait arm").succeeds();
    let armed = candump.mark().nanos;
    // The object is pressed against the wall from 3.5 s on.
    candump.until(|line| line.nanos > armed + seconds(5.0));
    let before = run.page_faults();
    candump.until(|line| line.nanos > armed + seconds(7.0));
    let after = run.page_faults();
    for thread in ["frhc-cycle", "frhc-recorder", "frhc-faults"] {
        assert!(before[thread] > 0, "{thread}: those of its start are counted");
        assert_eq!(after[thread], before[thread], "{thread}");
    }
    run.terminate().succeeds();
    sim.terminate().succeeds();
    candump.finish();
}

#[test]
fn refused_setting_is_said_and_ends_the_run_only_where_required() {
    let scratch = Scratch::new("realtime");
    // No processor of this kernel is isolated.
    let words = ["run", "--config", KRAFT, "--cpu", "0", "--cpu-latency", "0"];
    let required = scratch.frhc(&[&words[..], &["--require-realtime"]].concat()).wait();
    assert_eq!(required.code, Some(4), "{}", required.stderr);
    let reason = "CPU 0 alone refused: shared, as it is not in isolcpus";
    assert!(required.stderr.contains("real-time settings refused"), "{}", required.stderr);
    assert!(required.stderr.contains(reason), "{}", required.stderr);
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT]);
    let run = scratch.frhc(&words);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x80));
    let outcome = run.terminate();
    outcome.succeeds();
    assert!(outcome.stderr.contains("warning: real-time settings refused"), "{}", outcome.stderr);
    sim.terminate().succeeds();
    candump.finish();
}
