//! The master's side (CiA 305): carries a [job](crate::lss::job) to its end.
//!
//! Whatever goes wrong on the way, and wherever the job is abandoned, the last word is that all slaves go
//! to waiting: no slave is left in configuration, unless that is the job.
//!
//! Slaves answer on one identifier, so two of them at once destroy each other's answers, or look like
//! one. Where a job does not choose its slave by its identity, every answer therefore has its whole window,
//! and a second one ends the job; that none came does not prove that there is one slave only.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::NodeId;

use crate::frame::Frame;
use crate::heartbeat::is_boot_up;
use crate::lss::codec::Answer;
use crate::lss::codec::Reply;
use crate::lss::codec::Request;
use crate::lss::fastscan::Fastscan;
use crate::lss::fastscan::Found;
use crate::lss::job::Job;
use crate::lss::job::LssError;
use crate::lss::job::Patience;
use crate::lss::job::Report;
use crate::lss::job::Selection;
use crate::lss::job::Step;
use crate::lss::job::TO_WAITING;
use crate::lss::node_of;
use crate::procedure::Procedure;
use units::time::Instant;

/// What is waited for.
#[derive(Clone, Copy, Debug)]
enum Awaited {
    Reply { request: Request, reply: Option<Reply>, until: Instant },
    Scan(Fastscan),
    Pause { until: Instant },
    BootUp { node: NodeId, until: Instant },
}

/// A job under way.
#[derive(Clone, Debug)]
pub struct Master {
    job: Job,
    patience: Patience,
    steps: VecDeque<Step>,
    awaited: Option<Awaited>,
    /// What the step before asked for: a late answer comes from another slave.
    before: Option<Request>,
    report: Report,
    failure: Option<LssError>,
}

impl Master {
    /// Begins a job.
    pub fn begin(job: Job, patience: Patience, now: Instant, out: &mut Vec<Frame>) -> Self {
        let mut master = Self {
            job,
            patience,
            steps: job.steps().into(),
            awaited: None,
            before: None,
            report: Report::default(),
            failure: None,
        };
        if let Selection::Address(address) = job.selection {
            master.report.address = Some(address);
        }
        master.go_on(now, out);
        master
    }

    /// Takes steps until one has to be waited for, or none is left.
    fn go_on(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.awaited = None;
        while let Some(step) = self.steps.pop_front() {
            self.awaited = match step {
                Step::Say(request) => {
                    out.push(request.frame());
                    continue;
                }
                Step::Ask(request) => {
                    out.push(request.frame());
                    Some(Awaited::Reply { request, reply: None, until: now + self.window(request) })
                }
                Step::Scan => Some(Awaited::Scan(Fastscan::begin(self.patience.probe, now, out))),
                Step::Pause(span) => {
                    Some(Awaited::Pause { until: now + span + self.patience.reply })
                }
                Step::BootUp(node) => {
                    Some(Awaited::BootUp { node, until: now + self.patience.store })
                }
            };
            return;
        }
    }

    fn window(&self, request: Request) -> Duration {
        if request == Request::Store { self.patience.store } else { self.patience.reply }
    }

    /// Nothing further is done, but for the release.
    fn fail(&mut self, why: LssError, now: Instant, out: &mut Vec<Frame>) {
        self.failure = Some(why);
        self.steps = VecDeque::from([Step::Say(TO_WAITING)]);
        self.go_on(now, out);
    }

    /// The one answer to a request, or the lack of it, is in.
    fn conclude(
        &mut self,
        request: Request,
        reply: Option<Reply>,
        now: Instant,
        out: &mut Vec<Frame>,
    ) {
        let outcome = match reply {
            None => Err(self.nobody(request)),
            Some(reply) => self.note(request, reply),
        };
        self.before = Some(request);
        match outcome {
            Ok(()) => self.go_on(now, out),
            Err(why) => self.fail(why, now, out),
        }
    }

    const fn nobody(&self, request: Request) -> LssError {
        match (self.job.selection, request) {
            (Selection::Address(address), Request::Select(..)) => LssError::NoSuchSlave(address),
            _ => LssError::Silent(request),
        }
    }

    /// Learns from an answer.
    fn note(&mut self, request: Request, reply: Reply) -> Result<(), LssError> {
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
                // A first node-id is the slave's own at once, and it boots up with it.
                if let (None, Some(Some(first)), true) = (node, self.job.node, self.job.release) {
                    self.steps.push_back(Step::BootUp(first));
                }
            }
        }
        Ok(())
    }

    /// An answer to what was asked, or to what had been.
    fn on_reply(&mut self, reply: Reply, now: Instant, out: &mut Vec<Frame>) {
        let Some(Awaited::Reply { request, reply: first, until }) = self.awaited else { return };
        if !reply.answers(request) {
            if let Some(before) = self.before.filter(|before| reply.answers(*before)) {
                self.fail(LssError::Several(before), now, out);
            }
        } else if first.is_some() {
            self.fail(LssError::Several(request), now, out);
        } else if self.job.selection.is_one() {
            self.conclude(request, Some(reply), now, out);
        } else {
            self.awaited = Some(Awaited::Reply { request, reply: Some(reply), until });
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
            Some(Awaited::Reply { .. }) => {
                let reply = Reply::decode(frame)?;
                self.on_reply(reply, now, out);
            }
            Some(Awaited::Scan(scan)) => scan.on_frame(frame),
            Some(Awaited::BootUp { node, .. }) => {
                if is_boot_up(frame, *node) {
                    self.report.is_booted = true;
                    self.go_on(now, out);
                }
            }
            Some(Awaited::Pause { .. }) | None => {}
        }
        self.outcome()
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Self::Outcome> {
        match &mut self.awaited {
            Some(Awaited::Reply { request, reply, until }) if *until <= now => {
                let (request, reply) = (*request, *reply);
                self.conclude(request, reply, now, out);
            }
            Some(Awaited::Scan(scan)) => match scan.on_time(now, out) {
                None => {}
                Some(Found::One(address)) => {
                    self.report.address = Some(address);
                    self.go_on(now, out);
                }
                Some(Found::Nobody) => self.fail(LssError::NobodyUnconfigured, now, out),
                Some(Found::Lost(part)) => self.fail(LssError::Lost(part), now, out),
            },
            Some(Awaited::Pause { until } | Awaited::BootUp { until, .. }) if *until <= now => {
                self.go_on(now, out);
            }
            Some(Awaited::Reply { .. } | Awaited::Pause { .. } | Awaited::BootUp { .. }) | None => {
            }
        }
        self.outcome()
    }

    fn deadline(&self) -> Option<Instant> {
        match &self.awaited {
            Some(
                Awaited::Reply { until, .. }
                | Awaited::Pause { until }
                | Awaited::BootUp { until, .. },
            ) => Some(*until),
            Some(Awaited::Scan(scan)) => scan.deadline(),
            // Nothing had to be waited for: there is an outcome.
            None => Some(Instant::ZERO),
        }
    }

    fn abandon(&mut self, _now: Instant, out: &mut Vec<Frame>) {
        out.push(TO_WAITING.frame());
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::lss::Address;
    use crate::lss::BitRate;
    use crate::lss::Part;
    use crate::lss::REPLY_COB_ID;
    use crate::lss::REQUEST_COB_ID;
    use crate::lss::codec::Mode;
    use crate::lss::slave::Effect;
    use crate::lss::slave::Slave;

    const ADDRESS: Address = Address { vendor: 1, product: 2, revision: 3, serial: 4 };
    const PATIENCE: Patience = Patience {
        reply: Duration::from_millis(50),
        store: Duration::from_secs(1),
        probe: Duration::from_millis(10),
    };

    fn node(raw: u8) -> NodeId {
        NodeId::new(raw).unwrap()
    }

    /// Carries a job to its end, the slaves answering at once; also what the master said.
    fn carry(job: Job, slaves: &mut [Slave]) -> (Result<Report, LssError>, Vec<Frame>) {
        let (mut now, mut out, mut said) = (Instant::ZERO, Vec::new(), Vec::new());
        let mut master = Master::begin(job, PATIENCE, now, &mut out);
        let mut outcome = None;
        loop {
            let replies: Vec<Frame> = out.iter().flat_map(|frame| tell(slaves, frame)).collect();
            said.append(&mut out);
            if let Some(outcome) = outcome {
                return (outcome, said);
            }
            outcome = replies.iter().find_map(|reply| master.on_frame(now, reply, &mut out));
            if outcome.is_none() && out.is_empty() {
                now = now.max(master.deadline().unwrap());
                outcome = master.on_time(now, &mut out);
            }
        }
    }

    /// What slaves answer; who gets its first node-id boots up.
    fn tell(slaves: &mut [Slave], frame: &Frame) -> Vec<Frame> {
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
    fn the_slave_of_an_address_gets_its_node_id_and_no_other() {
        let other = Address { serial: 5, ..ADDRESS };
        let mut slaves = [Slave::new(ADDRESS, None), Slave::new(other, None)];
        let (outcome, said) = carry(configure(Selection::Address(ADDRESS), 9), &mut slaves);
        let report = Report { address: Some(ADDRESS), node: Some(None), is_booted: true };
        assert_eq!(outcome, Ok(report));
        assert_eq!(slaves.each_ref().map(Slave::node), [Some(node(9)), None]);
        assert_eq!(said.first(), Some(&TO_WAITING.frame()));
        assert_eq!(said.last(), Some(&TO_WAITING.frame()));
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
        let (outcome, said) = carry(configure(Selection::Fastscan, 11), &mut slaves);
        assert_eq!(outcome, Err(LssError::NobodyUnconfigured));
        assert_eq!(said.last(), Some(&TO_WAITING.frame()));
    }

    #[test]
    fn one_slave_alone_needs_no_address() {
        let mut slaves = [Slave::new(ADDRESS, Some(node(5)))];
        let job = Job { inquire: true, ..Job::new(Selection::Everybody) };
        let report = Report { address: Some(ADDRESS), node: Some(Some(node(5))), is_booted: false };
        assert_eq!(carry(job, &mut slaves).0, Ok(report));
        assert_eq!(slaves[0].mode(), Mode::Waiting);
    }

    #[test]
    fn nothing_is_configured_where_two_answer() {
        let other = Address { serial: 5, ..ADDRESS };
        let mut slaves = [Slave::new(ADDRESS, None), Slave::new(other, None)];
        let (outcome, said) = carry(configure(Selection::Everybody, 9), &mut slaves);
        assert_eq!(outcome, Err(LssError::Several(Request::Inquire(Part::Vendor))));
        assert!(!said.contains(&Request::ConfigureNodeId(9).frame()));
        assert!(slaves.iter().all(|slave| slave.mode() == Mode::Waiting));
    }

    #[test]
    fn two_of_one_address_are_found_out_by_their_answers() {
        let mut slaves = [Slave::new(ADDRESS, None), Slave::new(ADDRESS, None)];
        let (outcome, _) = carry(configure(Selection::Address(ADDRESS), 9), &mut slaves);
        assert!(matches!(outcome, Err(LssError::Several(_))), "{outcome:?}");
        assert!(slaves.iter().all(|slave| slave.node().is_none()));
    }

    #[test]
    fn an_address_nobody_has_is_told() {
        let (outcome, _) = carry(Job::new(Selection::Address(ADDRESS)), &mut []);
        let words = outcome.unwrap_err().to_string();
        assert_eq!(words, "no slave has the address 00000001h 00000002h 00000003h 00000004h");
        let (outcome, _) = carry(configure(Selection::Selected, 9), &mut []);
        assert_eq!(outcome.unwrap_err().to_string(), "inquire vendor-ID: no slave answers");
    }

    #[test]
    fn a_selected_slave_stays_so_until_it_is_released() {
        let mut slaves = [Slave::new(ADDRESS, Some(node(5)))];
        let select = Job { release: false, ..Job::new(Selection::Address(ADDRESS)) };
        carry(select, &mut slaves).0.unwrap();
        assert_eq!(slaves[0].mode(), Mode::Configuration);
        let job = Job {
            node: Some(Some(node(7))),
            bit_rate: BitRate::of_kilobits(500),
            release: false,
            ..Job::new(Selection::Selected)
        };
        carry(job, &mut slaves).0.unwrap();
        assert_eq!(slaves[0].mode(), Mode::Configuration);
        carry(Job::new(Selection::Selected), &mut slaves).0.unwrap();
        assert_eq!(slaves[0].mode(), Mode::Waiting);
    }

    #[test]
    fn every_refusal_is_told_in_words_and_ends_the_job() {
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
            (
                0x17,
                255,
                "store configuration refused: 255 error of the manufacturer's own, number 77",
            ),
            (0x17, 3, "store configuration refused: 3 reserved error code"),
        ];
        for (command, error, words) in refusals {
            let mut out = Vec::new();
            let mut master = Master::begin(job, PATIENCE, Instant::ZERO, &mut out);
            let outcome = [0x44, 0x11, 0x13, 0x17].into_iter().find_map(|answer| {
                let error = if answer == command { error } else { 0 };
                let frame = Frame::new(REPLY_COB_ID, [answer, error, 77, 0, 0, 0, 0, 0]);
                master.on_frame(Instant::ZERO, &frame, &mut out)
            });
            assert_eq!(outcome.unwrap().unwrap_err().to_string(), words);
            assert_eq!(out.last(), Some(&TO_WAITING.frame()));
        }
    }

    #[test]
    fn a_job_that_is_abandoned_releases_all() {
        let mut out = Vec::new();
        let select = Job { release: false, ..Job::new(Selection::Fastscan) };
        let mut master = Master::begin(select, PATIENCE, Instant::ZERO, &mut out);
        master.abandon(Instant::ZERO, &mut out);
        assert_eq!(out.last(), Some(&TO_WAITING.frame()));
    }

    proptest! {
        #[test]
        fn any_frames_at_any_time_end_in_bounds_and_in_waiting(
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
                Selection::Everybody,
                Selection::Address(ADDRESS),
                Selection::Fastscan,
            ][kind];
            let job = Job {
                bit_rate: BitRate::of_kilobits(500),
                activate: Some(10),
                ..configure(selection, 9)
            };
            let (mut now, mut out) = (Instant::ZERO, Vec::new());
            let mut master = Master::begin(job, PATIENCE, now, &mut out);
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
            let latest = now + PATIENCE.probe * (4 * 33 + 2) + PATIENCE.reply * 9 + PATIENCE.store * 2;
            while outcome.is_none() {
                now = master.deadline().unwrap().max(now);
                prop_assert!(now <= latest);
                outcome = master.on_time(now, &mut out);
            }
            prop_assert_eq!(out.last(), Some(&TO_WAITING.frame()));
        }
    }
}
