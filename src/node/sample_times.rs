//! When the samples of a cycle come. The process sleeps until all of them but the last are there, and is woken once for them.
//!
//! The plan of the bus knows the wire, but not how long a drive takes from SYNC to its TPDO. So the times are those of the
//! last complete cycles: the earliest, so that a drive that is a little early delays no target (ADR 51).

use std::time::Duration;

use canopen::frame::Channel;
use units::time::Instant;

/// Cycles of a block. The earliest of the current block and of the one before counts.
const BLOCK: u32 = 128;

/// Earliest time at which all samples of a bus but its last were received.
#[derive(Clone, Debug)]
pub(super) struct SampleTimes {
    /// Bus of each joint.
    channels: [Channel; 6],
    /// Each of these buses once.
    buses: Vec<Channel>,
    /// Earliest time since SYNC, on the slowest bus, in this block and the one before.
    earliest: [Option<Duration>; 2],
    /// Cycles observed in this block.
    observed: u32,
}

impl SampleTimes {
    /// Knows nothing yet of the joints on these buses.
    pub(super) fn new(channels: [Channel; 6]) -> Self {
        let mut buses = channels.to_vec();
        buses.sort_unstable();
        buses.dedup();
        Self { channels, buses, earliest: [None; 2], observed: 0 }
    }

    /// Forgets what was observed, before a boot of the network.
    pub(super) const fn restart(&mut self) {
        (self.earliest, self.observed) = ([None; 2], 0);
    }

    /// Observes a cycle in which every sample was received.
    pub(super) fn observe(&mut self, sync_at: Instant, received_at: &[Option<Instant>; 6]) {
        let slowest =
            self.buses.iter().filter_map(|bus| self.last_but_one(*bus, received_at)).max();
        let Some(after) = slowest.map(|at| at.since(sync_at)) else { return };
        if self.observed == BLOCK {
            let [current, _] = self.earliest;
            (self.earliest, self.observed) = ([None, current], 0);
        }
        let [current, _] = &mut self.earliest;
        *current = Some(current.map_or(after, |earliest| earliest.min(after)));
        self.observed += 1;
    }

    /// Returns the time of the last but one sample of a bus, or of its only one.
    fn last_but_one(&self, bus: Channel, received_at: &[Option<Instant>; 6]) -> Option<Instant> {
        let (mut before, mut last) = (None, None);
        let of_bus = self.channels.iter().zip(received_at).filter(|(on, _)| **on == bus);
        for (_, at) in of_bus {
            if *at >= last {
                (before, last) = (last, *at);
            } else {
                before = before.max(*at);
            }
        }
        before.or(last)
    }

    /// Returns the time until which the samples of the SYNC sent at `sync_at` are not read.
    pub(super) fn read_from(&self, sync_at: Instant) -> Instant {
        sync_at + self.earliest.iter().flatten().min().copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SYNC: Instant = Instant::from_micros(5_000);

    fn received(after: [u64; 6]) -> [Option<Instant>; 6] {
        after.map(|micros| Some(SYNC + Duration::from_micros(micros)))
    }

    fn read_from(channels: [u8; 6], cycles: &[[u64; 6]]) -> u64 {
        let mut times = SampleTimes::new(channels.map(Channel));
        for after in cycles {
            times.observe(SYNC, &received(*after));
        }
        u64::try_from(times.read_from(SYNC).since(SYNC).as_micros()).unwrap()
    }

    #[test]
    fn last_but_one_sample_of_the_slowest_bus_counts() {
        assert_eq!(read_from([0; 6], &[[100, 200, 300, 400, 500, 600]]), 500);
        assert_eq!(read_from([0; 6], &[[600, 100, 500, 300, 400, 200]]), 500, "in any order");
        assert_eq!(read_from([0; 6], &[[300; 6]]), 300, "in one batch");
        assert_eq!(read_from([0, 1, 0, 1, 0, 1], &[[100, 150, 200, 350, 300, 450]]), 350);
        assert_eq!(read_from([0, 0, 0, 0, 0, 1], &[[100, 200, 300, 400, 500, 90]]), 400);
        assert_eq!(read_from([0, 0, 0, 0, 0, 1], &[[10, 20, 30, 40, 50, 90]]), 90, "one alone");
    }

    #[test]
    fn earliest_of_the_last_cycles_counts_until_the_next_boot() {
        let cycles = [[100, 200, 300, 400, 500, 600], [90, 180, 270, 360, 450, 540], [200; 6]];
        assert_eq!(read_from([0; 6], &cycles[..2]), 450);
        assert_eq!(read_from([0; 6], &cycles), 200);
        let (early, late) = (vec![[200; 6]], vec![[500; 6]; 2 * 128]);
        assert_eq!(read_from([0; 6], &[&early[..], &late[1..]].concat()), 200, "still remembered");
        assert_eq!(read_from([0; 6], &[&early[..], &late[..], &late[..1]].concat()), 500);
        let mut times = SampleTimes::new([Channel(0); 6]);
        assert_eq!(times.read_from(SYNC), SYNC, "nothing is known");
        times.observe(SYNC, &received(cycles[0]));
        times.restart();
        assert_eq!(times.read_from(SYNC), SYNC);
    }

    #[test]
    fn sample_before_its_sync_never_reads_late() {
        let mut times = SampleTimes::new([Channel(0); 6]);
        times.observe(SYNC, &[Some(Instant::ZERO); 6]);
        assert_eq!(times.read_from(SYNC), SYNC);
    }
}
