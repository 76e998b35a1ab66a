//! Arbitrary input from a bus or a file causes no panic and stays within limits of time and memory.
//!
//! Runs the fuzz targets (`fuzz/src/lib.rs`) with arbitrary bytes and damaged files on every `cargo test`.
#![allow(
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

#[path = "../fuzz/src/lib.rs"]
#[allow(unreachable_pub, reason = "in its own package it is a library")]
mod targets;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};
use proptest::prelude::*;

/// Limit on the processor time of this thread for one input.
const MAX_TIME: Duration = Duration::from_millis(if cfg!(debug_assertions) { 1_000 } else { 100 });

/// Limit on the memory allocated at once for one input.
const MAX_MEMORY: usize = 16 << 20;

/// Maximum length of an input.
const MAX_LENGTH: usize = 4_096;

/// Counts the bytes allocated by each thread.
struct CountingAllocator;

thread_local! {
    static HELD: Cell<usize> = const { Cell::new(0) };
    static PEAK: Cell<usize> = const { Cell::new(0) };
}

#[expect(unsafe_code, reason = "a global allocator is unsafe by its trait; this one only counts")]
// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let held = HELD.get().saturating_add(layout.size());
        HELD.set(held);
        PEAK.set(PEAK.get().max(held));
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.set(HELD.get().saturating_sub(layout.size()));
        // SAFETY: the caller's promise about `pointer` and `layout` is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Runs a target on one input and checks time and memory.
fn assert_within_limits(target: fn(&[u8]), bytes: &[u8]) {
    // Lazy initialisation is not counted.
    target(&[]);
    PEAK.set(HELD.get());
    let (held, began) = (HELD.get(), processor_time());
    target(bytes);
    let (took, memory) = (processor_time() - began, PEAK.get() - held);
    assert!(took < MAX_TIME, "{took:?} for {} bytes", bytes.len());
    assert!(memory < MAX_MEMORY, "{memory} bytes for {} bytes", bytes.len());
}

/// Processor time of this thread, independent of the load of the machine.
fn processor_time() -> Duration {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).unwrap().into()
}

fn any_bytes() -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec(any::<u8>(), 0..MAX_LENGTH)
}

/// File with changed bytes, possibly truncated.
fn damaged(file: &'static str) -> impl Strategy<Value = Vec<u8>> {
    let change = (any::<prop::sample::Index>(), any::<u8>());
    let changes = proptest::collection::vec(change, 0..8);
    (changes, any::<prop::sample::Index>(), any::<bool>()).prop_map(move |(changes, end, cut)| {
        let mut bytes = file.as_bytes().to_vec();
        for (place, byte) in changes {
            *place.get_mut(&mut bytes) = byte;
        }
        if cut {
            bytes.truncate(end.index(file.len()));
        }
        bytes
    })
}

/// File with lines removed, repeated or moved.
fn shuffled(file: &'static str) -> impl Strategy<Value = Vec<u8>> {
    let lines: Vec<&str> = file.lines().collect();
    let swap = (any::<prop::sample::Index>(), any::<prop::sample::Index>());
    proptest::collection::vec(swap, 0..8).prop_map(move |swaps| {
        let mut lines = lines.clone();
        for (from, to) in swaps {
            *to.get_mut(&mut lines) = *from.get(&lines.clone());
        }
        lines.join("\n").into_bytes()
    })
}

fn text(file: &'static str) -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![any_bytes(), damaged(file), shuffled(file)]
}

const LOG: &str = include_str!("golden/boot.log");
const EDS: &str = include_str!("../eds/frhc_drive.eds");
const CONFIG: &str = include_str!("../config/kraft_like_500hz.toml");
const SCENARIO: &str = include_str!("../config/scenarios/teleoperation.toml");
const TORQUES: &str = "joint,direction,per_mille,torque_nm\nazimuth,up,120,0.883\nazimuth,down,120,0.851\n2,up,200,1.5\n";

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_frames_keep_master_and_drives_within_limits(bytes in any_bytes()) {
        assert_within_limits(targets::frames, &bytes);
    }

    #[test]
    fn any_reply_keeps_a_transfer_within_limits(bytes in any_bytes()) {
        assert_within_limits(targets::sdo_client, &bytes);
    }

    #[test]
    fn any_request_keeps_a_server_within_limits(bytes in any_bytes()) {
        assert_within_limits(targets::sdo_server, &bytes);
    }

    #[test]
    fn any_eds_is_parsed_or_refused(bytes in text(EDS)) {
        assert_within_limits(targets::eds, &bytes);
    }

    #[test]
    fn any_log_is_parsed_or_refused(bytes in text(LOG)) {
        assert_within_limits(targets::candump, &bytes);
    }

    #[test]
    fn any_configuration_is_parsed_or_refused(bytes in text(CONFIG)) {
        assert_within_limits(targets::config, &bytes);
    }

    #[test]
    fn any_scenario_is_parsed_or_refused(bytes in text(SCENARIO)) {
        assert_within_limits(targets::config, &bytes);
    }

    #[test]
    fn any_measured_torques_are_parsed_or_refused(bytes in text(TORQUES)) {
        assert_within_limits(targets::torque_data, &bytes);
    }
}
