//! Benchmark of 1 MiB by SDO block transfer between the client and a simulated drive on the in-memory bus: time on the
//! wire at 1 Mbit/s, and computing time.
//!
//! `cargo bench --bench sdo`
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    clippy::disallowed_methods,
    dead_code,
    reason = "a benchmark prints, and cannot go on without what it needs"
)]

#[path = "../tests/common/drive.rs"]
mod drive;

use std::time::{Duration, Instant};

use drive::{carry, drive, node};

use bus::Bus;
use canopen::object::Object;
use canopen::sdo::{Block, SdoOptions, Transfer};
use memory_bus::Memory;

const SIZE: usize = 1 << 20;

fn main() {
    let timeout = Duration::from_secs(1);
    let block = SdoOptions::block(timeout, Block::default().every(Duration::ZERO));
    for (name, options) in [("block", block), ("segmented", SdoOptions::segmented(timeout))] {
        let mut bus = Memory::new(&[1_000_000], drive(), ());
        assert!(bus.receive(bus.now() + Duration::from_millis(1)).is_some(), "boot-up");
        let value: Vec<u8> = (0..SIZE).map(|place| place.to_le_bytes()[0]).collect();
        for is_read in [false, true] {
            let (begun, on_the_wire, mut out) = (Instant::now(), bus.now(), Vec::new());
            let (node, buffer) = (node(), Object::SAMPLE_BUFFER);
            let transfer = if is_read {
                Transfer::read_with(options, node, buffer, on_the_wire, &mut out)
            } else {
                let bytes = value.clone();
                Transfer::write_with(options, node, buffer, bytes, on_the_wire, &mut out).unwrap()
            };
            let content = carry(&mut bus, transfer, out).unwrap();
            assert!(!is_read || content.bytes() == value);
            let wire = bus.now().since(on_the_wire).as_secs_f64();
            let host = begun.elapsed().as_secs_f64();
            println!(
                "1 MiB {} by {name}: {wire:.2} s on the wire ({:.1} kB/s), {host:.3} s here: {:.0} times as fast",
                if is_read { "read" } else { "written" },
                f64::from(1 << 20) / 1e3 / wire,
                wire / host,
            );
        }
    }
}
