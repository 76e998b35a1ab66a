//! The rings between cycle and recorder, on the in-memory bus: a recorder that hangs or is gone changes no torque.

use crate::common::prelude::*;
use bus::Tap;
use run::rings::rings;

fn bench<T: Tap>(tap: T) -> Bench<T> {
    let text = "seconds = 2\n[[console]]\nat_s = 0.05\nrequest = \"arm\"\n";
    Bench::new(&config(KRAFT), script(text), 1, tap)
}

/// Returns the torques of this many cycles with the arm held by gravity compensation.
fn torques(tap: impl Tap, cycles: usize) -> Vec<(Instant, [i16; 6])> {
    let mut bench = bench(tap);
    bench.bring_up().unwrap();
    (0..cycles).map(|_| bench.cycle()).map(|record| (record.at, record.targets)).collect()
}

#[test]
fn promise_13_hung_or_dropped_recorder_changes_no_torque() {
    let alone = torques((), 10_000);
    assert!(alone.iter().any(|(_, targets)| targets.iter().any(|target| *target != 0)));
    let (hanging, consumer, lost) = rings();
    assert_eq!(torques(hanging, 10_000), alone);
    assert!(lost.snapshot().frames > 0, "the ring was full");
    drop(consumer);
    let (orphan, consumer, _) = rings();
    drop(consumer);
    assert_eq!(torques(orphan, 300), alone[..300]);
}
