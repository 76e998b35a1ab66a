//! Reads a candump log of kraft_like.toml: six drives in two groups of three.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::time::Duration;

use canopen_tools::candump::Line;

/// Node-ids of the drives of [`KRAFT`](super::shipped::KRAFT).
pub(crate) const NODES: RangeInclusive<u16> = 1..=6;

/// COB-IDs of the grouped target torques of nodes 1 to 3 and 4 to 6.
pub(crate) const GROUPS: [u16; 2] = [0x201, 0x204];

/// Returns the COB-ID of a node's target torque.
fn group_of(node: u16) -> u16 {
    GROUPS[usize::from((node - 1) / 3)]
}

/// One CANopen frame of a log.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) nanos: u64,
    pub(crate) id: u16,
    pub(crate) data: Vec<u8>,
}

/// The CANopen frames of a log, in order.
#[derive(Debug)]
pub(crate) struct Log(Vec<Entry>);

impl Log {
    pub(crate) fn parse<S: AsRef<str>>(lines: &[S]) -> Self {
        let entry = |line: &S| {
            let line = Line::parse(line.as_ref()).unwrap();
            let (id, data) = line.canopen()?;
            Some(Entry { nanos: line.nanos, id, data: data.to_vec() })
        };
        Self(lines.iter().filter_map(entry).collect())
    }

    /// Returns all frames.
    pub(crate) fn entries(&self) -> &[Entry] {
        &self.0
    }

    /// Asserts one SYNC per period between `from` and `to`, in s after the first SYNC, and within each period one position
    /// of each drive and one frame of target torques for each group.
    pub(crate) fn has_one_exchange_a_period(
        &self,
        from: f64,
        to: f64,
        period: Duration,
        nodes: RangeInclusive<u16>,
    ) {
        let first = self.0.iter().find(|entry| entry.id == 0x80).unwrap().nanos;
        let after = |entry: &Entry| Duration::from_nanos(entry.nanos - first).as_secs_f64();
        let syncs: Vec<usize> = (0..self.0.len()).filter(|&at| self.0[at].id == 0x80).collect();
        let mut cycles = 0;
        for pair in syncs.windows(2) {
            let (this, next) = (&self.0[pair[0]], &self.0[pair[1]]);
            if after(this) < from || after(next) > to {
                continue;
            }
            let apart = Duration::from_nanos(next.nanos - this.nanos);
            let error = apart.abs_diff(period);
            assert!(
                error < Duration::from_micros(20),
                "SYNCs {apart:?} apart at {:.3} s",
                after(this)
            );
            let mut count: HashMap<u16, u32> = HashMap::new();
            for entry in &self.0[pair[0]..pair[1]] {
                *count.entry(entry.id).or_default() += 1;
            }
            for id in nodes.clone().map(|node| 0x180 + node).chain(GROUPS) {
                let times = count.get(&id).copied().unwrap_or(0);
                assert_eq!(times, 1, "{id:03X} came {times} times after {:.3} s", after(this));
            }
            cycles += 1;
        }
        let expected = (to - from) / period.as_secs_f64();
        assert!(f64::from(cycles) > 0.98 * expected, "{cycles} cycles of {expected}");
    }

    /// Asserts that the last target of every drive is zero, its last controlword Disable voltage, and its last state
    /// Switch on disabled.
    pub(crate) fn ends_with_every_drive_off(&self, nodes: RangeInclusive<u16>) {
        let last = |id| self.0.iter().rev().find(|entry| entry.id == id).unwrap();
        for group in GROUPS {
            assert_eq!(last(group).data, [0; 6], "{group:03X}");
        }
        for node in nodes {
            assert_eq!(last(0x300 + node).data, [0, 0], "node {node}");
            assert_eq!(last(0x280 + node).data[0] & 0x6F, 0x40, "node {node}: switch on disabled");
        }
    }

    /// Returns the last target torque of a drive, in ‰ of its rated torque.
    pub(crate) fn torque_sent_to(&self, node: u16) -> i16 {
        let last = self.0.iter().rev().find(|entry| entry.id == group_of(node)).unwrap();
        let slot = usize::from((node - 1) % 3);
        i16::from_le_bytes([last.data[2 * slot], last.data[2 * slot + 1]])
    }

    /// Returns the time from the last target to the drive's report that it is torque-free: emergency 8250h, whose
    /// manufacturer-specific bytes begin with actual torque and statusword.
    pub(crate) fn torque_free_after(&self, node: u16) -> Option<Duration> {
        let last = self.0.iter().rposition(|entry| entry.id == group_of(node))?;
        let emergency = self.0[last..]
            .iter()
            .find(|entry| entry.id == 0x680 + node && entry.data.starts_with(&[0x50, 0x82]))?;
        let &[_, _, _, t0, t1, s0, ..] = emergency.data.as_slice() else { return None };
        let is_off = i16::from_le_bytes([t0, t1]) == 0 && s0 & 0x04 == 0;
        is_off.then(|| Duration::from_nanos(emergency.nanos - self.0[last].nanos))
    }
}
