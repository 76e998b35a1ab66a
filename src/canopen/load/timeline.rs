//! Schedule of a cycle.
//!
//! ```text
//!  SYNC │ latency │ TPDO … TPDO │ host │ RPDO … RPDO │ free          │ SYNC
//! ```
//!
//! The schedule holds the frames governed by SYNC, back to back. Before SYNC, while the drives sample, and
//! while the host computes, one other frame may start: [`Timeline::blocked_us`] includes that. Further delays
//! are in [`response`](crate::load::response).

use crate::load::streams::{Role, Stream};

/// Number of moments in a cycle at which another frame may start.
const OPENINGS: f64 = 3.0;

/// Processing times, in µs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pauses {
    /// Time from the end of SYNC until the drives queue their TPDOs.
    pub drive_us: u32,
    /// Time from the last TPDO to the first RPDO: the host wakes, computes and sends.
    pub host_us: u32,
}

/// Part of a cycle, in the order of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CycleStage {
    /// Transmission of SYNC.
    Sync,
    /// Sampling by the drives.
    Drives,
    /// Transmission of the TPDO with this COB-ID.
    Tpdo(u16),
    /// Computation by the host.
    Host,
    /// Transmission of the RPDO with this COB-ID.
    Rpdo(u16),
}

/// Step of a cycle, in µs after the SYNC was due.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleStep {
    /// Transmission or pause that takes the time.
    pub stage: CycleStage,
    /// Start time.
    pub start_us: f64,
    /// End time.
    pub end_us: f64,
}

/// Schedule of a cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeline {
    /// Steps, in order.
    pub steps: Vec<CycleStep>,
    /// End of the last RPDO, in µs after the SYNC was due.
    pub done_us: f64,
    /// End of the last RPDO if the longest other frame uses each opening.
    pub blocked_us: f64,
}

impl Timeline {
    /// Builds the schedule of the `planned` frames, with `length` and the longest other frame `others_us` in
    /// µs.
    pub fn new(
        planned: &[Stream],
        length: impl Fn(&Stream) -> f64,
        others_us: f64,
        pauses: Pauses,
    ) -> Self {
        let mut steps = Vec::new();
        let mut now = 0.0;
        let mut then = |stage, span_us: f64| {
            steps.push(CycleStep { stage, start_us: now, end_us: now + span_us });
            now += span_us;
        };
        let of = |role: fn(Role) -> bool| {
            planned.iter().filter(move |stream| stream.is_cyclic() && role(stream.role))
        };
        of(|role| role == Role::Sync).for_each(|stream| then(CycleStage::Sync, length(stream)));
        then(CycleStage::Drives, f64::from(pauses.drive_us));
        of(|role| matches!(role, Role::Tpdo(_)))
            .for_each(|stream| then(CycleStage::Tpdo(stream.cob_id), length(stream)));
        then(CycleStage::Host, f64::from(pauses.host_us));
        of(|role| matches!(role, Role::Rpdo(_)))
            .for_each(|stream| then(CycleStage::Rpdo(stream.cob_id), length(stream)));
        Self { steps, done_us: now, blocked_us: now + OPENINGS * others_us }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::streams::streams;
    use crate::testing::networks::{drives, grouped, master, worst_timeline};

    #[test]
    fn cycle_consists_of_frames_and_pauses_in_order() {
        let timeline = worst_timeline(&streams(&grouped(), 1_000, master(), 5));
        let stages: Vec<_> = timeline.steps.iter().map(|step| step.stage).collect();
        let positions = (0x181..=0x186).map(CycleStage::Tpdo);
        let expected = [CycleStage::Sync, CycleStage::Drives].into_iter().chain(positions);
        let expected =
            expected.chain([CycleStage::Host, CycleStage::Rpdo(0x201), CycleStage::Rpdo(0x204)]);
        assert_eq!(stages, expected.collect::<Vec<_>>());
        assert_eq!(timeline.done_us.to_string(), (855 + 100 + 60).to_string());
        for pair in timeline.steps.windows(2) {
            assert_eq!(pair[0].end_us.to_string(), pair[1].start_us.to_string());
        }
    }

    #[test]
    fn three_other_frames_may_block_a_cycle() {
        // Three drives with 6-byte TPDOs, and 2-byte RPDOs or a shared one of 6 bytes: 1190 and 1080 µs, from an
        // independent program.
        let clock = |stream: &Stream, bytes| Stream { bytes, ..stream.clone() };
        let planned = streams(&drives(3), 1_000, master(), 5);
        let sized = |stream: &Stream| match stream.role {
            Role::Tpdo(_) => clock(stream, 6),
            Role::Rpdo(_) => clock(stream, 2),
            Role::Sync
            | Role::Heartbeat
            | Role::Emergency
            | Role::SdoRequest
            | Role::SdoResponse => stream.clone(),
        };
        let separate: Vec<Stream> = planned.iter().map(sized).collect();
        assert_eq!(worst_timeline(&separate).blocked_us.to_string(), "1190");
        let mut shared = separate.clone();
        shared.retain(|stream| !matches!(stream.cob_id, 0x202 | 0x203));
        let at = shared.iter().position(|stream| stream.cob_id == 0x201).unwrap();
        shared[at].bytes = 6;
        assert_eq!(worst_timeline(&shared).blocked_us.to_string(), "1080");
    }
}
