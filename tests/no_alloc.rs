//! No allocation in ten thousand cycles of node, controller, bus and simulation.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use common::bench::scenario;

use config::Config;
use lab::bench::Bench;

/// Counts allocations of the threads that set [`IS_COUNTED`]. The test harness has a thread of its own, which allocates
/// when a test takes longer than a minute.
struct CountingAllocator;

thread_local! {
    static IS_COUNTED: Cell<bool> = const { Cell::new(false) };
}
static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

#[expect(unsafe_code, reason = "a global allocator is unsafe by its trait; this one only counts")]
// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if IS_COUNTED.get() {
            ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        }
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise about `pointer` and `layout` is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Layers of the controller that are absent from the shipped configuration.
const MORE_LAYERS: &str = "[controller.tank]\ninitial_j = 0.1\nmin_j = 0.0\nlow_j = 0.02\nmax_j = 0.5\n\
    refill_ns_per_m_per_j = 100.0\n\n[controller.virtual_coupling]\n\
    stiffness_n_per_m = [400.0, 400.0, 400.0]\nstiffness_nm_per_rad = [2.0, 2.0, 2.0]\n\
    damping_ns_per_m = [2.0, 2.0, 2.0]\ndamping_nms_per_rad = [0.01, 0.01, 0.01]\n\n[remote]\n";

#[test]
fn ten_thousand_cycles_with_every_layer_never_allocate() {
    let text = include_str!("../config/kraft_like.toml").replacen("[remote]\n", MORE_LAYERS, 1);
    let config = Config::parse(Path::new("config/kraft_like.toml"), &text).unwrap();
    let mut bench = Bench::new(&config, scenario("contact_10s"), 1, false, ());
    bench.bring_up().unwrap();
    bench.run(200);
    IS_COUNTED.set(true);
    bench.run(10_000);
    IS_COUNTED.set(false);
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), 0);
}
