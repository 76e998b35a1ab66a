//! LSS master (CiA 305): runs a [job](crate::lss::job) to its end.
//!
//! All slaves are switched to waiting after any failure and when abandoned; after a success, if the job
//! releases them.
//!
//! Slaves share one reply COB-ID, so simultaneous replies collide or merge. Unless the job selects by
//! identity, every reply window stays open and a second reply ends the job. A single reply may
//! still be several identical ones, merged.

use std::collections::VecDeque;

use canopen_rs::NodeId;

use crate::lss::fastscan::{Fastscan, FastscanOutcome};
use crate::lss::job::{Job, LssError, Report, Selection, Step, TO_WAITING, Timeouts};
use crate::procedure::Procedure;
use canopen::frame::Frame;
use canopen::heartbeat::is_boot_up;
use canopen_device::lss::codec::{Answer, Reply, Request};
use canopen_device::lss::node_of;
use units::time::Instant;

/// Event that the master waits for.
#[derive(Clone, Copy, Debug)]
enum Wait {
    Reply(Request, Option<Reply>),
    /// Result of a scan, which has deadlines of its own.
    Scan(Fastscan),
    Pause,
    BootUp(NodeId),
}

/// Job in progress.
#[derive(Clone, Debug)]
pub struct Master {
    job: Job,
    timeouts: Timeouts,
    steps: VecDeque<Step>,
    awaited: Option<Wait>,
    /// End of the wait.
    until: Instant,
    /// Request of the previous step: a late reply to it comes from another slave.
    before: Option<Request>,
    report: Report,
    failure: Option<LssError>,
}

impl Master {
    /// Sends the first requests of a job, up to the first reply that it waits for.
    pub fn start(job: Job, timeouts: Timeouts, now: Instant, out: &mut Vec<Frame>) -> Self {
        let mut master = Self {
            job,
            timeouts,
            steps: job.steps().into(),
            awaited: None,
            until: now,
            before: None,
            report: Report::default(),
            failure: None,
        };
        if let Selection::Address(address) = job.selection {
            master.report.address = Some(address);
        }
        master.proceed(now, out);
        master
    }

    /// Runs steps until one has to wait, or none is left.
    fn proceed(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.awaited = None;
        while let Some(step) = self.steps.pop_front() {
            let Timeouts { reply, store, probe } = self.timeouts;
            let (awaited, wait) = match step {
                Step::Send(request) => {
                    out.push(request.frame());
                    continue;
                }
                Step::Request(request) => {
                    out.push(request.frame());
                    let wait = if request == Request::Store { store } else { reply };
                    (Wait::Reply(request, None), wait)
                }
                Step::Scan => (Wait::Scan(Fastscan::start(probe, now, out)), probe),
                Step::Pause(span) => (Wait::Pause, span + reply),
                Step::BootUp(node) => (Wait::BootUp(node), store),
            };
            (self.awaited, self.until) = (Some(awaited), now + wait);
            return;
        }
    }

    /// Ends the job with an error after switching all slaves to waiting.
    fn fail(&mut self, why: LssError, now: Instant, out: &mut Vec<Frame>) {
        self.failure = Some(why);
        self.steps = VecDeque::from([Step::Send(TO_WAITING)]);
        self.proceed(now, out);
    }

    /// Handles the reply to a request, or its absence.
    fn conclude(
        &mut self,
        request: Request,
        reply: Option<Reply>,
        now: Instant,
        out: &mut Vec<Frame>,
    ) {
        let outcome = match reply {
            None => Err(self.no_reply(request)),
            Some(reply) => self.record(request, reply),
        };
        self.before = Some(request);
        match outcome {
            Ok(()) => self.proceed(now, out),
            Err(why) => self.fail(why, now, out),
        }
    }

    const fn no_reply(&self, request: Request) -> LssError {
        match (self.job.selection, request) {
            (Selection::Address(address), Request::Select(..)) => LssError::NoSuchSlave(address),
            _ => LssError::Timeout(request),
        }
    }

    /// Records the content of a reply.
    fn record(&mut self, request: Request, reply: Reply) -> Result<(), LssError> {
        match reply {
            Reply::Selected | Reply::Identified | Reply::NonConfigured => {}
            Reply::NodeIdConfigured(answer)
            | Reply::BitTimingConfigured(answer)
            | Reply::Stored(answer) => {
                if answer.error != Answer::DONE.error {
                    return Err(LssError::Refused { request, answer });
                }
            }
            Reply::Inquired(part, number) => {
                let known = self.report.address.unwrap_or_default();
                self.report.address = Some(known.with(part, number));
            }
            Reply::NodeId(byte) => {
                let node = node_of(byte).map_err(|_| LssError::NoNodeId(byte))?;
                self.report.node = Some(node);
                // An unconfigured slave takes its first node-id on the switch to waiting, and boots up with it.
                if let (None, Some(Some(first)), true) = (node, self.job.node, self.job.release) {
                    self.steps.push_back(Step::BootUp(first));
                }
            }
        }
        Ok(())
    }

    /// Takes a reply to the current request, or a late one to the request before.
    fn on_reply(&mut self, reply: Reply, now: Instant, out: &mut Vec<Frame>) {
        let Some(Wait::Reply(request, first)) = self.awaited else { return };
        if !reply.answers(request) {
            if let Some(before) = self.before.filter(|before| reply.answers(*before)) {
                self.fail(LssError::Several(before), now, out);
            }
        } else if first.is_some() {
            self.fail(LssError::Several(request), now, out);
        } else if self.job.selection.is_one() {
            self.conclude(request, Some(reply), now, out);
        } else {
            self.awaited = Some(Wait::Reply(request, Some(reply)));
        }
    }

    fn outcome(&self) -> Option<Result<Report, LssError>> {
        if self.awaited.is_some() {
            return None;
        }
        Some(self.failure.map_or(Ok(self.report), Err))
    }
}

impl Procedure for Master {
    type Outcome = Result<Report, LssError>;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Self::Outcome> {
        match &mut self.awaited {
            Some(Wait::Reply(..)) => {
                let reply = Reply::decode(frame)?;
                self.on_reply(reply, now, out);
            }
            Some(Wait::Scan(scan)) => scan.on_frame(frame),
            Some(Wait::BootUp(node)) => {
                if is_boot_up(frame, *node) {
                    self.report.is_booted = true;
                    self.proceed(now, out);
                }
            }
            Some(Wait::Pause) | None => {}
        }
        self.outcome()
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Self::Outcome> {
        match &mut self.awaited {
            Some(Wait::Scan(scan)) => match scan.on_time(now, out) {
                None => {}
                Some(FastscanOutcome::One(address)) => {
                    self.report.address = Some(address);
                    self.proceed(now, out);
                }
                Some(FastscanOutcome::None) => self.fail(LssError::NoneUnconfigured, now, out),
                Some(FastscanOutcome::Lost(part)) => self.fail(LssError::Lost(part), now, out),
            },
            Some(_) | None if now < self.until => {}
            Some(Wait::Reply(request, reply)) => {
                let (request, reply) = (*request, *reply);
                self.conclude(request, reply, now, out);
            }
            Some(Wait::Pause | Wait::BootUp(_)) => self.proceed(now, out),
            None => {}
        }
        self.outcome()
    }

    fn deadline(&self) -> Option<Instant> {
        match &self.awaited {
            Some(Wait::Reply(..) | Wait::Pause | Wait::BootUp(_)) => Some(self.until),
            Some(Wait::Scan(scan)) => scan.deadline(),
            // No step has to wait: the outcome is ready.
            None => Some(Instant::ZERO),
        }
    }

    fn abandon(&mut self, _now: Instant, out: &mut Vec<Frame>) {
        out.push(TO_WAITING.frame());
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use canopen_device::lss::codec::LssState;
    use canopen_device::lss::slave::{Effect, Slave};
    use canopen_device::lss::{Address, BitRate, Part, REPLY_COB_ID, REQUEST_COB_ID};

    const ADDRESS: Address = Address { vendor: 1, product: 2, revision: 3, serial: 4 };
    const TIMEOUTS: Timeouts = Timeouts {
        reply: Duration::from_millis(50),
        store: Duration::from_secs(1),
        probe: Duration::from_millis(10),
    };

    fn node(raw: u8) -> NodeId {
        NodeId::new(raw).unwrap()
    }

    /// Runs a job to its end with slaves that reply at once. Also returns the master's frames.
    fn carry(job: Job, slaves: &mut [Slave]) -> (Result<Report, LssError>, Vec<Frame>) {
        let (mut now, mut out, mut sent) = (Instant::ZERO, Vec::new(), Vec::new());
        let mut master = Master::start(job, TIMEOUTS, now, &mut out);
        let mut outcome = None;
        loop {
            let replies: Vec<Frame> = out.iter().flat_map(|frame| deliver(slaves, frame)).collect();
            sent.append(&mut out);
            if let Some(outcome) = outcome {
                return (outcome, sent);
            }
            outcome = replies.iter().find_map(|reply| master.on_frame(now, reply, &mut out));
            if outcome.is_none() && out.is_empty() {
                now = now.max(master.deadline().unwrap());
                outcome = master.on_time(now, &mut out);
            }
        }
    }

    /// Replies of the slaves; a slave with its first node-id boots up.
    fn deliver(slaves: &mut [Slave], frame: &Frame) -> Vec<Frame> {
        let mut replies = Vec::new();
        for slave in slaves {
            if slave.on_frame(frame, &mut replies) == Some(Effect::Reset) {
                slave.reset();
                let cob_id = 0x700 + u16::from(slave.node().unwrap().raw());
                replies.push(Frame::new(cob_id, [0]));
            }
        }
        replies
    }

    fn configure(selection: Selection, raw: u8) -> Job {
        Job { inquire: true, node: Some(Some(node(raw))), store: true, ..Job::new(selection) }
    }

    #[test]
    fn only_the_addressed_slave_is_configured() {
        let other = Address { serial: 5, ..ADDRESS };
        let mut slaves = [Slave::new(ADDRESS, None), Slave::new(other, None)];
        let (outcome, sent) = carry(configure(Selection::Address(ADDRESS), 9), &mut slaves);
        let report = Report { address: Some(ADDRESS), node: Some(None), is_booted: true };
        assert_eq!(outcome, Ok(report));
        assert_eq!(slaves.each_ref().map(Slave::node), [Some(node(9)), None]);
        assert_eq!(sent.first(), Some(&TO_WAITING.frame()));
        assert_eq!(sent.last(), Some(&TO_WAITING.frame()));
    }

    #[test]
    fn fastscans_configure_one_slave_after_another() {
        let other = Address { serial: 5, ..ADDRESS };
        let mut slaves = [Slave::new(other, None), Slave::new(ADDRESS, None)];
        for (raw, address) in [(9, ADDRESS), (10, other)] {
            let (outcome, _) = carry(configure(Selection::Fastscan, raw), &mut slaves);
            assert_eq!(outcome.unwrap().address, Some(address));
        }
        assert_eq!(slaves.each_ref().map(Slave::node), [Some(node(10)), Some(node(9))]);
        let (outcome, sent) = carry(configure(Selection::Fastscan, 11), &mut slaves);
        assert_eq!(outcome, Err(LssError::NoneUnconfigured));
        assert_eq!(sent.last(), Some(&TO_WAITING.frame()));
    }

    #[test]
    fn single_slave_needs_no_address() {
        let mut slaves = [Slave::new(ADDRESS, Some(node(5)))];
        let job = Job { inquire: true, ..Job::new(Selection::All) };
        let report = Report { address: Some(ADDRESS), node: Some(Some(node(5))), is_booted: false };
        assert_eq!(carry(job, &mut slaves).0, Ok(report));
        assert_eq!(slaves[0].state(), LssState::Waiting);
    }

    #[test]
    fn two_replies_prevent_configuration() {
        let other = Address { serial: 5, ..ADDRESS };
        let mut slaves = [Slave::new(ADDRESS, None), Slave::new(other, None)];
        let (outcome, sent) = carry(configure(Selection::All, 9), &mut slaves);
        assert_eq!(outcome, Err(LssError::Several(Request::Inquire(Part::Vendor))));
        assert!(!sent.contains(&Request::ConfigureNodeId(9).frame()));
        assert!(slaves.iter().all(|slave| slave.state() == LssState::Waiting));
    }

    #[test]
    fn two_slaves_of_one_address_are_detected() {
        let mut slaves = [Slave::new(ADDRESS, None), Slave::new(ADDRESS, None)];
        let (outcome, _) = carry(configure(Selection::Address(ADDRESS), 9), &mut slaves);
        assert!(matches!(outcome, Err(LssError::Several(_))), "{outcome:?}");
        assert!(slaves.iter().all(|slave| slave.node().is_none()));
    }

    #[test]
    fn absent_address_is_reported() {
        let (outcome, _) = carry(Job::new(Selection::Address(ADDRESS)), &mut []);
        let text = outcome.unwrap_err().to_string();
        assert_eq!(text, "no slave has the address 00000001h 00000002h 00000003h 00000004h");
        let (outcome, _) = carry(configure(Selection::Selected, 9), &mut []);
        assert_eq!(outcome.unwrap_err().to_string(), "inquire vendor-ID: no slave answers");
    }

    #[test]
    fn selected_slave_stays_selected_until_released() {
        let mut slaves = [Slave::new(ADDRESS, Some(node(5)))];
        let select = Job { release: false, ..Job::new(Selection::Address(ADDRESS)) };
        carry(select, &mut slaves).0.unwrap();
        assert_eq!(slaves[0].state(), LssState::Configuration);
        let job = Job {
            node: Some(Some(node(7))),
            bit_rate: BitRate::of_kilobits(500),
            release: false,
            ..Job::new(Selection::Selected)
        };
        carry(job, &mut slaves).0.unwrap();
        assert_eq!(slaves[0].state(), LssState::Configuration);
        carry(Job::new(Selection::Selected), &mut slaves).0.unwrap();
        assert_eq!(slaves[0].state(), LssState::Waiting);
    }

    #[test]
    fn every_refusal_is_named_and_ends_the_job() {
        let job = Job {
            bit_rate: BitRate::of_kilobits(500),
            ..configure(Selection::Address(ADDRESS), 9)
        };
        let job = Job { inquire: false, ..job };
        let refusals = [
            (0x11, 1, "configure node-id refused: 1 node-id out of range"),
            (0x13, 1, "configure bit timing refused: 1 bit timing not supported"),
            (0x17, 1, "store configuration refused: 1 storing is not supported"),
            (0x17, 2, "store configuration refused: 2 storage media access error"),
            (0x17, 255, "store configuration refused: 255 manufacturer-specific error, code 77"),
            (0x17, 3, "store configuration refused: 3 reserved error code"),
        ];
        for (command, error, text) in refusals {
            let mut out = Vec::new();
            let mut master = Master::start(job, TIMEOUTS, Instant::ZERO, &mut out);
            let outcome = [0x44, 0x11, 0x13, 0x17].into_iter().find_map(|answer| {
                let error = if answer == command { error } else { 0 };
                let frame = Frame::new(REPLY_COB_ID, [answer, error, 77, 0, 0, 0, 0, 0]);
                master.on_frame(Instant::ZERO, &frame, &mut out)
            });
            assert_eq!(outcome.unwrap().unwrap_err().to_string(), text);
            assert_eq!(out.last(), Some(&TO_WAITING.frame()));
        }
    }

    #[test]
    fn abandoned_job_releases_all_slaves() {
        let mut out = Vec::new();
        let select = Job { release: false, ..Job::new(Selection::Fastscan) };
        let mut master = Master::start(select, TIMEOUTS, Instant::ZERO, &mut out);
        master.abandon(Instant::ZERO, &mut out);
        assert_eq!(out.last(), Some(&TO_WAITING.frame()));
    }

    proptest! {
        #[test]
        fn any_frames_end_in_time_and_in_waiting(
            kind in 0_usize..4,
            frames in proptest::collection::vec(
                (
                    0_u64..30_000,
                    prop::sample::select(vec![REPLY_COB_ID, REPLY_COB_ID, REQUEST_COB_ID, 0x709]),
                    prop::sample::select(vec![0x11_u8, 0x13, 0x17, 0x44, 0x4F, 0x5A, 0x5B, 0x5C, 0x5D, 0x5E, 0]),
                    any::<[u8; 7]>(),
                    1_usize..9,
                ),
                0..100,
            ),
        ) {
            let selection = [
                Selection::Selected,
                Selection::All,
                Selection::Address(ADDRESS),
                Selection::Fastscan,
            ][kind];
            let job = Job {
                bit_rate: BitRate::of_kilobits(500),
                activate: Some(10),
                ..configure(selection, 9)
            };
            let (mut now, mut out) = (Instant::ZERO, Vec::new());
            let mut master = Master::start(job, TIMEOUTS, now, &mut out);
            let mut outcome = None;
            for (step, cob_id, command, [a, b, c, d, e, f, g], length) in frames {
                let bytes = [command, a, b, c, d, e, f, g];
                let frame = Frame::from_slice(cob_id, &bytes[..length]).unwrap();
                now = now + Duration::from_micros(step);
                outcome = master.on_frame(now, &frame, &mut out).or_else(|| master.on_time(now, &mut out));
                if outcome.is_some() {
                    break;
                }
                prop_assert!(master.deadline().is_some());
            }
            let latest = now + TIMEOUTS.probe * (4 * 33 + 2) + TIMEOUTS.reply * 9 + TIMEOUTS.store * 2;
            while outcome.is_none() {
                now = master.deadline().unwrap().max(now);
                prop_assert!(now <= latest);
                outcome = master.on_time(now, &mut out);
            }
            prop_assert_eq!(out.last(), Some(&TO_WAITING.frame()));
        }
    }
}
