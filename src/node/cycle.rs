//! One cycle, from SYNC to torque.
//!
//! ```text
//!  SYNC k                                                                  SYNC k+1
//!    │  TPDO 1 … TPDO 6         step           RPDOs                         │
//!    ├───────────────────────►├──────►├──────────────────────────────►       │
//!    │ drives sampled         │ pure  │ held by the drives until ────────────┤ torques act
//!    │ their positions        │       │                                      │
//!    └ gather until complete ─┘       └ record (its owner's queue)           │
//! ```

use crate::Node;
use crate::cause::Cause;
use crate::proof::Relation;
use crate::record::Mode;
use crate::record::Record;
use crate::safety::Permit;
use crate::safety::causes;
use crate::schedule::Due;
use crate::timing;
use bus::Bus;
use bus::Heard;
use bus::Received;
use canopen::drive::State;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use canopen::master::event::Event;
use controller::Input;
use controller::calibration::Counts;
use remote::Remote;
use units::time::Instant;

/// So often the turn of a SYNC may be missed in one cycle before it is sent whatever the time.
const MISSED: u64 = timing::OVERRUN;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Runs one cycle: waits for its time, samples, steps, commands. Never fails: what is wrong is in
    /// the record, and the torques are then zero.
    pub fn cycle(&mut self) -> Record {
        let due = self.await_turn();
        self.keep_time(due.skipped);

        let sync_at = self.send_sync();
        self.gather(sync_at);

        let now = self.bus.now();
        self.judge(now, sync_at);
        let permit = self.safety.permit(now, self.operator.is_held());
        let input = self.input(&permit, due.skipped);

        let output = self.controller.step(&input);
        self.heed(now, output.fault.as_ref().and_then(causes::of_controller));
        let moves = self.operator.watch(now, &permit, &output, input.restart);
        self.heed(now, moves);
        let is_carried = permit.takes_up || permit.gravity_share >= 1.0;
        let odd = self.plausibility.judge(&self.samples.sampled(), &output, is_carried);
        self.heed(now, odd);

        let targets = self.gate.pass(self.safety.may_push(), &output.tau, &output.targets);
        let was_sent = self.send_targets(sync_at, &targets, permit.drives_on);
        let targets = self.gate.take_back(was_sent);
        self.plausibility.tell(&targets);
        // A loop that stood still over its samples is not alive.
        if !self.is_late(sync_at) {
            self.send_heartbeat(now);
        }
        self.send_time(now);
        self.recheck(now);
        self.send_request();
        self.exchange(now, &output.command);

        self.cycle += 1;
        Record {
            cycle: self.cycle,
            at: sync_at,
            mode: self.safety.mode(),
            cause: self.safety.cause(),
            overruns: self.timing.overruns(),
            sampled: self.samples.fresh(),
            inputs: self.samples.inputs(now).map(|inputs| inputs.bits()),
            f_s: input.f_s,
            x_b_m: input.x_b_m,
            output,
            targets,
            others: self.others(),
        }
    }

    /// Waits for the turn of the next SYNC; one whose turn is missed is skipped.
    fn await_turn(&mut self) -> Due {
        let mut due = self.schedule.next(self.bus.now());
        self.listen(due.at);
        for _ in 0..MISSED {
            if !self.schedule.is_missed(due.at, self.bus.now()) {
                break;
            }
            self.check_standstill(due.at);
            let next = self.schedule.next(self.bus.now());
            due = Due { at: next.at, skipped: due.skipped + 1 + next.skipped };
            self.listen(due.at);
        }
        due
    }

    /// Hears what comes between two cycles. However much more has come by then, it ends.
    pub(super) fn listen(&mut self, until: Instant) {
        let mut late = 0;
        while late < self.most_late
            && let Some(received) = self.bus.receive(until)
        {
            late += u64::from(self.bus.now() >= until);
            self.check_standstill(until);
            self.hear(received);
        }
    }

    /// Draws the conclusions of time itself, and of whether the last cycle's frames got out.
    fn keep_time(&mut self, skipped: u64) {
        let now = self.bus.now();
        let resumed = self.timing.resumed(self.bus.suspended());
        let late = if self.cycle > 0 { self.timing.begins(now, skipped) } else { None };
        let unseen = self.transmission.begin(|channel| self.bus.echoed(channel));
        [resumed, late, unseen].into_iter().for_each(|cause| self.heed(now, cause));
    }

    /// Hears the drives' answers to this SYNC, until all have answered or the window is over. While
    /// answers come it stays open for the next one: a SYNC that had to wait for the bus moves them all.
    pub(super) fn gather(&mut self, sync_at: Instant) {
        let (mut until, end) = (sync_at + self.window, sync_at + self.period);
        while !self.samples.is_complete() {
            let Some(received) = self.bus.receive(until.min(end)) else { break };
            let (at, before) = (received.at, self.samples.fresh());
            self.check_standstill(sync_at);
            self.hear(received);
            if self.samples.fresh() != before {
                until = until.max(at + self.next_answer);
            }
        }
    }

    /// Stops if the loop stood still since `due`. Comes before what waited meanwhile is read: drives that miss
    /// their master report it, and their reports are not the first cause.
    fn check_standstill(&mut self, due: Instant) {
        let now = self.bus.now();
        let resumed = self.timing.resumed(self.bus.suspended());
        let stood_still = self.timing.gathered(due, now);
        [resumed, stood_still].into_iter().for_each(|cause| self.heed(now, cause));
    }

    pub(super) fn hear(&mut self, received: Received) {
        let Received { at, channel, heard } = received;
        match heard {
            Heard::Frame(frame) => {
                let telegram = Telegram { channel, frame };
                // An old sample is none; what else is told is true however late it is read.
                let is_stale = self.timing.is_stale(at, self.bus.now());
                if is_stale {
                    self.samples.discard(&telegram);
                }
                if is_stale || !self.samples.on_frame(at, &telegram) {
                    let event = self.master.on_frame(at, &telegram, &mut self.out);
                    self.post();
                    event.into_iter().for_each(|event| self.on_event(at, event));
                }
            }
            Heard::Fault(fault) => {
                self.transmission.heard(channel, fault);
                self.heed(at, causes::of_bus(channel, fault));
            }
        }
    }

    /// Keeps what the master says for people, and stops if it is a cause to.
    fn on_event(&mut self, now: Instant, event: Event) {
        match self.proof.takes(now, &event) {
            Relation::Part => return,
            Relation::Tolerated => return self.note(event),
            Relation::Unrelated => {}
        }
        let cause = causes::of_event(&event);
        if let Some(Cause::Emergency { node, .. }) = cause {
            self.power.drop_drive(node);
        }
        self.heed(now, cause);
        self.note(event);
    }

    /// Stops if there is a cause to.
    pub(super) fn heed(&mut self, now: Instant, cause: Option<Cause>) {
        if let Some(cause) = cause {
            self.safety.stop(now, cause);
        }
    }

    /// Draws the conclusions of this cycle's samples.
    fn judge(&mut self, now: Instant, sync_at: Instant) {
        let before = self.cause();
        self.tend_master(now);
        self.check_standstill(sync_at);
        let missing = self.samples.end(now);
        self.heed(now, missing);
        let contradiction = self.operator.feel(now, self.samples.inputs(now));
        self.heed(now, contradiction);
        self.heed(now, self.link.lost(now));
        match self.not_enabled() {
            Some(drive) => self.safety.not_enabled(now, drive),
            None if self.samples.is_complete() && self.proof.is_over() => {
                self.safety.drives_are_enabled(now);
            }
            None => {}
        }
        if before != self.cause() {
            self.ask_why(now);
        }
    }

    /// Lets the master do what is due.
    pub(super) fn tend_master(&mut self, now: Instant) {
        while let Some(event) = self.master.on_time(now, &mut self.out) {
            self.on_event(now, event);
        }
        self.post();
    }

    /// A drive that stopped the node by its statusword alone is asked for its errors.
    fn ask_why(&mut self, now: Instant) {
        if let Some(Cause::DriveLeft { joint, .. } | Cause::EnableTimeout { joint, .. }) =
            self.cause()
        {
            self.master.read_history(now, joint.saturating_sub(1), &mut self.out);
        }
    }

    /// The first joint whose drive is not enabled, and its statusword.
    pub(super) fn not_enabled(&self) -> Option<(usize, u16)> {
        let mut joints = (1..).zip(self.samples.latest());
        let (joint, sample) = joints
            .find(|(_, sample)| sample.statusword.state() != Some(State::OperationEnabled))?;
        Some((joint, sample.statusword.0))
    }

    fn input(&self, permit: &Permit, skipped: u64) -> Input {
        Input {
            counts: self.samples.latest().map(|sample| Counts(sample.position.0)),
            f_s: self.link.f_s(),
            x_b_m: self.link.x_b_m(),
            switches: self.operator.switches(permit.engaged),
            mode: self.command_mode,
            gravity_share: permit.gravity_share,
            reflection_share: permit.reflection_share,
            restart: skipped > 0 || self.cycle == 0,
        }
    }

    /// Sends SYNC, and returns when: what follows of it is as old as that.
    pub(super) fn send_sync(&mut self) -> Instant {
        let now = self.bus.now();
        self.samples.begin(now);
        let sync = self.sync.next().frame();
        self.send_on_every_bus(sync);
        now
    }

    /// The node's own heartbeat: from the cycle itself, so that it stops with it.
    pub(super) fn send_heartbeat(&mut self, now: Instant) {
        if let Some(frame) = self.heartbeat.due(now) {
            self.send_on_every_bus(frame);
        }
    }

    /// One request of the master's by SDO at most, after everything that must not wait for it, and no more
    /// than the bus was planned for. Power off, for a drive that has fallen silent, comes before all others.
    pub(super) fn send_request(&mut self) {
        let now = self.bus.now();
        if self.power_off_silent() || self.mode() != Mode::Boot && !self.asking.may(now) {
            return;
        }
        if let Some(telegram) = self.master.release() {
            self.asking.asked(now);
            self.send(telegram);
        }
    }

    /// What the clock on the wall shows, for nodes that stamp what they log.
    fn send_time(&mut self, now: Instant) {
        let wall = self.bus.wall();
        if let Some(frame) = self.clock.as_mut().and_then(|clock| clock.due(now, wall)) {
            self.send_on_every_bus(frame);
        }
    }

    pub(super) fn send_on_every_bus(&mut self, frame: Frame) {
        self.out.extend(self.channels.iter().map(|&channel| Telegram { channel, frame }));
        self.post();
    }

    /// Sends what has been collected to be sent.
    pub(super) fn post(&mut self) {
        let mut out = std::mem::take(&mut self.out);
        for telegram in out.drain(..) {
            self.send(telegram);
        }
        self.out = out;
    }

    /// Sends a frame now or never, and returns whether its bus has taken it.
    pub(super) fn send(&mut self, telegram: Telegram) -> bool {
        if !self.transmission.may(telegram.channel) {
            return false;
        }
        let now = self.bus.now();
        let outcome = self.bus.send(telegram);
        let cause = self.transmission.offered(now, &telegram, outcome);
        self.heed(now, cause);
        outcome.is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cause::Kind;
    use crate::silent::node;
    use bus::SendError;

    #[test]
    fn sync_comes_first_and_once_a_period() {
        let mut node = node();
        let mut syncs = Vec::new();
        for _ in 0..20 {
            let from = node.bus().sent.len();
            let record = node.cycle();
            let (at, first) = node.bus().sent[from];
            assert_eq!((first.frame.cob_id, at), (0x80, record.at));
            syncs.push(at);
        }
        let apart = |pair: &[Instant]| pair[1].since(pair[0]);
        assert!(syncs.windows(2).all(|pair| apart(pair) == node.period), "{syncs:?}");
        let count = node.bus_mut().identifiers().into_iter().filter(|cob_id| *cob_id == 0x80);
        assert_eq!(count.count(), 20);
    }

    #[test]
    fn node_that_is_not_armed_sends_zero_torque_behind_each_sync() {
        let mut node = node();
        for _ in 0..10 {
            let record = node.cycle();
            assert_eq!(record.targets, [0; 6]);
            let sent: Vec<_> = node.bus_mut().sent.drain(..).collect();
            for cob_id in [0x201, 0x204] {
                let frames = sent.iter().filter(|(_, telegram)| telegram.frame.cob_id == cob_id);
                let data: Vec<_> = frames.map(|(_, telegram)| telegram.frame.data()).collect();
                assert_eq!(data, [[0; 6]], "{cob_id:03X}h");
            }
        }
    }

    #[test]
    fn samples_that_never_come_stop_it_in_the_third_cycle() {
        let mut node = node();
        let causes: Vec<_> = (0..4).map(|_| node.cycle().cause.map(|cause| cause.kind())).collect();
        let missing = Some(Kind::SamplesMissing);
        assert_eq!(causes, [None, None, missing, missing]);
    }

    #[test]
    fn window_leaves_time_for_the_targets() {
        let mut node = node();
        let record = node.cycle();
        let targets = node.bus().sent.iter().find(|(_, telegram)| telegram.frame.cob_id == 0x201);
        let after = targets.unwrap().0.since(record.at);
        // Two frames of six bytes behind it, 115 bits each at 1 Mbit/s.
        assert!(after + std::time::Duration::from_micros(230) <= node.period, "{after:?}");
    }

    #[test]
    fn process_that_stands_still_is_an_overrun_whatever_waits_to_be_read() {
        let mut node = node();
        node.cycle();
        node.bus_mut().stands_still = node.period * 8;
        let record = node.cycle();
        assert_eq!(record.cause.map(|cause| cause.kind()), Some(Kind::Overrun));
    }

    #[test]
    fn process_that_stands_still_over_its_samples_stops_in_the_same_cycle() {
        let mut node = node();
        node.cycle();
        node.bus_mut().stands_still_over_samples = node.period * 8;
        let record = node.cycle();
        assert_eq!(record.cause.map(|cause| cause.kind()), Some(Kind::Overrun));
    }

    #[test]
    fn heartbeat_comes_from_the_cycle() {
        let mut node = node();
        (0..50).for_each(|_| _ = node.cycle());
        assert!(node.bus_mut().identifiers().contains(&0x77F));
    }

    #[test]
    fn frame_that_is_not_taken_stops_it_and_a_second_cycle_gives_the_bus_up() {
        let mut node = node();
        node.bus_mut().refuses = Some(SendError::Full);
        let first = node.cycle();
        assert_eq!(first.cause.map(|cause| cause.kind()), Some(Kind::QueueFull));
        node.cycle();
        node.bus_mut().refuses = None;
        let last = node.cycle();
        assert_eq!((last.mode, node.bus().sent.len()), (Mode::DrivesOff, 0));
    }
}
