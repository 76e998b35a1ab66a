//! Newest TPDO contents of the drives and the switch box, and their reception in the current cycle.

use std::time::Duration;

use crate::cause::{Cause, CauseKind};
use crate::plausibility::{FilterResult, SampleFilter, SampleSet};
use canopen::drive::Statusword;
use canopen::exchange::{TpdoMap, TpdoSample};
use canopen::frame::{Channel, Telegram};
use canopen::pdo::DriveSample;
use config::switch_inputs::SwitchInputs;
use units::drive::PerMille;
use units::numbering::{Joint, NodeIndex};
use units::time::Instant;

/// Maximum age of the switch inputs: three periods of 5 ms.
const SWITCH_INPUT_TIMEOUT: Duration = Duration::from_millis(15);

/// Maximum age of a statusword in a separate TPDO, in repetition periods of that TPDO.
const MAX_MISSED_STATUSWORDS: u32 = 3;

/// Newest TPDO contents of each drive and of the switch box.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    tpdos: TpdoMap,
    /// Filters of received positions.
    filters: [SampleFilter; 6],
    /// Cycles without a sample of a joint that are a fault.
    max_missed: u32,
    /// Bus of each joint.
    channels: [Channel; 6],
    /// Maximum age of a joint's statusword; `None` if it is in the TPDO of the position.
    status_timeout: [Option<Duration>; 6],
    latest: [DriveSample; 6],
    /// Time of each joint's last statusword.
    status_at: [Option<Instant>; 6],
    /// Joints with a statusword since the last restart, by TPDO or SDO.
    status_known: [bool; 6],
    /// Time of the last SYNC.
    sync_at: Instant,
    /// Reception of each joint's sample of this window.
    received_at: [Option<Instant>; 6],
    /// Joints whose actual torque was received since the last call of [`sampled`](Self::sampled).
    torques: [bool; 6],
    /// Torque demands received since the last call of [`sampled`](Self::sampled).
    demands: [Option<PerMille>; 6],
    /// Consecutive cycles without a sample of each joint.
    missing: [u32; 6],
    /// Cause of the first position that the filters rejected as a fault.
    implausible: Option<Cause>,
    /// Joints whose position has jumped in this window.
    jumped: [bool; 6],
    /// Joints whose drives take their position for home: their positions may step.
    homing: [bool; 6],
    inputs: Option<(Instant, SwitchInputs)>,
    /// Newest analogue input, which is in the same TPDO as those inputs.
    analogue: Option<i16>,
    malformed: u64,
}

impl Samples {
    /// Returns samples before the first frame. The nodes of `tpdos` are the joints, then the switch box. `max_missed`
    /// consecutive cycles without a sample of a joint are a fault.
    pub(super) fn new(
        tpdos: TpdoMap,
        filters: [SampleFilter; 6],
        channels: [Channel; 6],
        max_missed: u32,
    ) -> Self {
        let status_timeout =
            |joint: Joint| Some(tpdos.status_repeated(joint.into())? * MAX_MISSED_STATUSWORDS);
        Self {
            filters,
            max_missed,
            channels,
            status_timeout: Joint::ALL.map(status_timeout),
            latest: [DriveSample::default(); 6],
            status_at: [None; 6],
            status_known: [false; 6],
            sync_at: Instant::ZERO,
            received_at: [None; 6],
            torques: [false; 6],
            demands: [None; 6],
            missing: [0; 6],
            implausible: None,
            jumped: [false; 6],
            homing: [false; 6],
            inputs: None,
            analogue: None,
            malformed: 0,
            tpdos,
        }
    }

    /// Starts a SYNC window: TPDOs received from `now` on belong to it.
    pub(super) fn start_window(&mut self, now: Instant) {
        self.sync_at = now;
        self.filters.iter_mut().for_each(|filter| filter.start_window(now));
        self.received_at = [None; 6];
        self.jumped = [false; 6];
    }

    /// Takes a frame; returns false if it is not a TPDO of the exchange. One of the wrong length is dropped.
    pub(super) fn on_frame(&mut self, at: Instant, telegram: &Telegram) -> bool {
        match self.tpdos.read(telegram) {
            None => return false,
            Some(Ok(tpdo)) => self.take(at, tpdo),
            Some(Err(_)) => self.malformed += 1,
        }
        true
    }

    /// Drops a stale frame. Its position counts as late, not as lost. Its statusword is taken: frames keep their order, and
    /// one that is sent on change comes once.
    pub(super) fn discard(&mut self, telegram: &Telegram) {
        let Some(Ok(tpdo)) = self.tpdos.read(telegram) else { return };
        if let Some(statusword) = tpdo.statusword {
            self.set_statusword(tpdo.node, statusword);
        }
        if let (Some(_), Some(joint)) = (tpdo.position, tpdo.node.joint()) {
            joint.entry_mut(&mut self.filters).discard();
        }
    }

    fn take(&mut self, at: Instant, tpdo: TpdoSample) {
        if let Some(inputs) = tpdo.inputs {
            self.inputs = Some((at, SwitchInputs::from_bits(inputs)));
        }
        self.analogue = tpdo.analogue.or(self.analogue);
        let Some(joint) = tpdo.node.joint() else { return };
        let sample = joint.entry_mut(&mut self.latest);
        if let Some(torque) = tpdo.torque {
            sample.torque = torque;
            *joint.entry_mut(&mut self.torques) = true;
        }
        if tpdo.demand.is_some() {
            *joint.entry_mut(&mut self.demands) = tpdo.demand;
        }
        if let Some(word) = tpdo.statusword {
            sample.statusword = word;
            *joint.entry_mut(&mut self.status_at) = Some(at);
            *joint.entry_mut(&mut self.status_known) = true;
        }
        if let Some(position) = tpdo.position {
            if *joint.entry(&self.homing) {
                joint.entry_mut(&mut self.filters).accept_step();
            }
            match joint.entry_mut(&mut self.filters).on_position(position) {
                FilterResult::Sample => {
                    sample.position = position;
                    *joint.entry_mut(&mut self.received_at) = Some(at);
                }
                FilterResult::Ignored => {}
                FilterResult::Fault(cause) => {
                    self.implausible = self.implausible.or(Some(cause));
                    *joint.entry_mut(&mut self.jumped) |= cause.kind() == CauseKind::PositionJumped;
                }
            }
        }
    }

    /// Takes a statusword that was read by SDO.
    pub(super) fn set_statusword(&mut self, node: NodeIndex, statusword: Statusword) {
        if let Some(joint) = node.joint() {
            joint.entry_mut(&mut self.latest).statusword = statusword;
            *joint.entry_mut(&mut self.status_known) = true;
        }
    }

    /// Sets the last statusword from before a restart again.
    pub(super) fn restore_statusword(&mut self, joint: Joint, statusword: Statusword) {
        joint.entry_mut(&mut self.latest).statusword = statusword;
    }

    /// Returns whether a statusword of `joint` was received since the last [`restart`](Self::restart).
    pub(super) fn is_status_known(&self, joint: Joint) -> bool {
        *joint.entry(&self.status_known)
    }

    /// Returns whether a sample of every joint was received in this window.
    pub(super) fn is_complete(&self) -> bool {
        self.received_at.iter().all(Option::is_some)
    }

    /// Ends the SYNC window and counts missing samples. Returns the cause of implausible, missing or overdue samples, or of
    /// a missing statusword.
    pub(super) fn end_window(&mut self, now: Instant) -> Option<Cause> {
        let mut cause = self.implausible.take();
        for (joint, (missing, received)) in
            Joint::each(self.missing.iter_mut().zip(&self.received_at))
        {
            *missing = if received.is_some() { 0 } else { missing.saturating_add(1) };
            if *missing >= self.max_missed {
                cause = cause.or(Some(Cause::SamplesMissing { joint, cycles: *missing }));
            }
        }
        if let Some(Cause::SamplesMissing { joint, cycles }) = cause {
            cause = self.bus_silent(joint, cycles).or(cause);
        }
        let overdue = || self.filters.iter().find_map(SampleFilter::overdue);
        cause.or_else(overdue).or_else(|| self.status_missing(now))
    }

    /// Returns a cause if the bus of `joint` has several drives, and the samples of all are missing.
    fn bus_silent(&self, joint: Joint, cycles: u32) -> Option<Cause> {
        let channel = joint.entry(&self.channels);
        let drives = || self.channels.iter().zip(&self.missing).filter(|(of, _)| *of == channel);
        // Drives whose sample arrived in the cycle in which the bus failed have missed one cycle less.
        let is_silent = |missing: u32| missing > 0 && missing + 1 >= self.max_missed;
        let are_silent = drives().all(|(_, missing)| is_silent(*missing));
        let channel = channel.0;
        (are_silent && drives().count() > 1).then_some(Cause::BusSilent { channel, cycles })
    }

    /// Returns a cause for the first joint with a stale statusword. Before its first one the joint counts as not enabled.
    fn status_missing(&self, now: Instant) -> Option<Cause> {
        let joints = Joint::each(self.status_at.iter().zip(&self.status_timeout));
        let mut stale = joints.filter_map(|(joint, (at, timeout))| {
            let age = now.since((*at)?);
            (age > (*timeout)?).then_some(Cause::StatusMissing { joint })
        });
        stale.next()
    }

    /// Accepts steps of a position, because its drive takes it for home, until [`end_homing`](Self::end_homing).
    pub(super) const fn start_homing(&mut self, joint: Joint) {
        *joint.entry_mut(&mut self.homing) = true;
    }

    /// Accepts no more steps of positions.
    pub(super) const fn end_homing(&mut self) {
        self.homing = [false; 6];
    }

    /// Clears the counts of missing samples, before drives that had left operational are started again.
    pub(super) fn clear_missing(&mut self) {
        self.missing = [0; 6];
        self.implausible = None;
        self.filters.iter_mut().for_each(SampleFilter::restart);
    }

    /// Clears everything except positions and torques, before a boot of the network.
    pub(super) fn restart(&mut self) {
        self.clear_missing();
        self.received_at = [None; 6];
        self.torques = [false; 6];
        self.demands = [None; 6];
        self.status_at = [None; 6];
        self.status_known = [false; 6];
        self.latest.iter_mut().for_each(|sample| sample.statusword = Statusword::default());
        self.inputs = None;
    }

    /// Returns the joints whose position has jumped in this window.
    pub(super) const fn jumped(&self) -> [bool; 6] {
        self.jumped
    }

    /// Returns the joints without a sample for as many cycles as are a fault.
    pub(super) fn silent(&self) -> [bool; 6] {
        self.missing.map(|missing| missing >= self.max_missed)
    }

    /// Returns the newest sample of each joint.
    pub(super) fn latest(&self) -> &[DriveSample; 6] {
        &self.latest
    }

    /// Returns the samples of this window, with the torques received since the last call.
    pub(super) fn sampled(&mut self) -> SampleSet<'_> {
        let torques = std::mem::take(&mut self.torques);
        let demands = std::mem::take(&mut self.demands);
        SampleSet { at: self.sync_at, latest: &self.latest, fresh: self.fresh(), torques, demands }
    }

    /// Returns the joints whose sample was received in this window.
    pub(super) fn fresh(&self) -> [bool; 6] {
        self.received_at.map(|at| at.is_some())
    }

    /// Returns the time of reception of each joint's sample of this window.
    pub(super) fn received_at(&self) -> [Option<Instant>; 6] {
        self.received_at
    }

    /// Returns the inputs of the switch box, or `None` if they are stale.
    pub(super) fn inputs(&self, now: Instant) -> Option<SwitchInputs> {
        self.inputs
            .filter(|(at, _)| now.since(*at) <= SWITCH_INPUT_TIMEOUT)
            .map(|(_, inputs)| inputs)
    }

    /// Returns the analogue input of the switch box, in counts; `None` without one, or if the inputs are stale.
    pub(super) fn analogue(&self, now: Instant) -> Option<i16> {
        self.analogue.filter(|_| self.inputs(now).is_some())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::plausibility;
    use canopen::frame::{Channel, Frame};
    use config::Config;
    use units::drive::Counts;

    /// Returns samples of `config/{name}.toml`. `kraft_like_500hz` has one TPDO per drive; `kraft_like` sends the statusword
    /// in a separate TPDO.
    fn samples(name: &str) -> Samples {
        let config = Config::load(Path::new(&format!("config/{name}.toml"))).unwrap();
        Samples::new(
            config.exchange().tpdos.clone(),
            plausibility::sample_filters(&config),
            [Channel(0); 6],
            3,
        )
    }

    fn receive(samples: &mut Samples, at: u64, cob_id: u16, data: &[u8]) -> bool {
        let frame = Frame::from_slice(cob_id, data).unwrap();
        samples.on_frame(Instant::from_micros(at), &Telegram { channel: Channel(0), frame })
    }

    fn answer(samples: &mut Samples, joint: u16) {
        assert!(receive(samples, 0, 0x180 + joint, &[0x37, 0x02, 7, 0, 0, 0, 0, 0]));
    }

    #[test]
    fn window_is_complete_with_a_sample_of_every_joint() {
        let mut samples = samples("kraft_like_500hz");
        samples.start_window(Instant::ZERO);
        (1..=5).for_each(|joint| answer(&mut samples, joint));
        assert!(!samples.is_complete());
        answer(&mut samples, 6);
        assert!(samples.is_complete());
        assert_eq!(samples.latest()[5].position, Counts(7));
        samples.start_window(Instant::ZERO);
        assert!(!samples.is_complete(), "the next window is empty");
    }

    #[test]
    fn third_missing_sample_in_a_row_names_the_joint() {
        let mut samples = samples("kraft_like_500hz");
        let mut cycle = |answering: &[u16]| {
            samples.start_window(Instant::ZERO);
            answering.iter().for_each(|joint| answer(&mut samples, *joint));
            samples.end_window(Instant::ZERO)
        };
        let (all, without_two) = ([1, 2, 3, 4, 5, 6], [1, 3, 4, 5, 6]);
        assert_eq!([cycle(&without_two), cycle(&without_two), cycle(&all)], [None; 3]);
        assert_eq!([cycle(&without_two), cycle(&without_two)], [None; 2]);
        let cause = Cause::SamplesMissing { joint: Joint::of::<2>(), cycles: 3 };
        assert_eq!(cycle(&without_two), Some(cause));
    }

    #[test]
    fn tpdos_of_wrong_length_or_on_another_bus_are_no_samples() {
        let mut samples = samples("kraft_like_500hz");
        samples.start_window(Instant::ZERO);
        assert!(receive(&mut samples, 0, 0x181, &[0x37, 0x02]));
        let frame = Frame::new(0x182, [0; 8]);
        assert!(!samples.on_frame(Instant::ZERO, &Telegram { channel: Channel(1), frame }));
        assert_eq!(samples.fresh(), [false; 6]);
    }

    #[test]
    fn switch_inputs_older_than_15_ms_are_stale() {
        let mut samples = samples("kraft_like");
        assert!(receive(&mut samples, 1_000, 0x190, &[0b0001]));
        assert!(samples.inputs(Instant::from_micros(16_000)).is_some());
        assert!(samples.inputs(Instant::from_micros(16_001)).is_none());
    }

    #[test]
    fn statusword_tpdo_is_not_a_sample_of_its_window() {
        let mut samples = samples("kraft_like");
        samples.start_window(Instant::ZERO);
        assert!(receive(&mut samples, 0, 0x281, &[0x37, 0x02]));
        assert_eq!(samples.fresh(), [false; 6]);
        assert!(receive(&mut samples, 0, 0x181, &[7, 0, 0, 0]));
        assert_eq!(samples.fresh(), [true, false, false, false, false, false]);
        let sample = samples.latest()[0];
        assert_eq!((sample.statusword.0, sample.position), (0x0237, Counts(7)));
    }

    #[test]
    fn stale_statusword_is_a_fault_although_positions_arrive() {
        let mut samples = samples("kraft_like");
        receive(&mut samples, 1_000, 0x283, &[0x37, 0x02]);
        samples.start_window(Instant::ZERO);
        (1..=6).for_each(|joint| assert!(receive(&mut samples, 1_000, 0x180 + joint, &[0; 4])));
        assert_eq!(samples.end_window(Instant::from_micros(151_000)), None);
        let cause = Some(Cause::StatusMissing { joint: Joint::of::<3>() });
        assert_eq!(samples.end_window(Instant::from_micros(151_001)), cause);
        samples.restart();
        assert_eq!(samples.latest()[2].statusword, Statusword::default());
        assert_eq!(samples.end_window(Instant::from_micros(151_002)), None);
    }
}
