//! Reception between two cycles, and in the window after a SYNC.

use crate::cause::Cause;
use crate::proof_test::Relation;
use crate::safety::causes;
use crate::schedule::Due;
use crate::{Node, lateness};
use bus::{Bus, BusEvent, ReceivedEvent};
use canopen::frame::Telegram;
use canopen::master::event::Event;
use canopen::object::Object;
use remote::Remote;
use units::time::Instant;

/// Maximum number of SYNC slots to skip in one cycle before one is sent late.
const MAX_MISSED_SYNCS: u64 = lateness::MAX_SKIPPED_CYCLES;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Receives until the next SYNC is due, and skips missed slots.
    pub(super) fn await_sync(&mut self) -> Due {
        let from = self.wire.read_clock();
        self.timing.readings.start(from);
        let mut due = self.timing.schedule.next(from);
        self.listen(due.at);
        for _ in 0..MAX_MISSED_SYNCS {
            if !self.timing.is_missed(due.at, self.wire.now()) {
                break;
            }
            self.watch_stall(due.at);
            let next = self.timing.schedule.next(self.wire.now());
            due = Due { at: next.at, skipped: due.skipped + 1 + next.skipped };
            self.listen(due.at);
        }
        (self.timing.readings.due, self.timing.readings.woken) = (due.at, self.wire.now());
        due
    }

    /// Receives until `until`. Reads a bounded number of frames after it, so that a flood cannot hold the cycle.
    pub(super) fn listen(&mut self, until: Instant) {
        let mut late = 0;
        while late < self.timing.max_late_frames
            && let Some(received) = self.wire.receive(until)
        {
            late += u64::from(self.wire.now() >= until);
            self.watch_stall(until);
            self.on_received(received);
            // The time that this took must not delay actions due at `until`.
            self.wire.read_clock();
        }
    }

    /// Receives the drives' TPDOs of the SYNC sent at `sync_at`, until all have arrived or the window ends. Sleeps until
    /// all but the last can be there. Each TPDO extends the window for the next one, because a SYNC that waited for the bus
    /// delays them all.
    pub(super) fn gather(&mut self, sync_at: Instant) {
        let mut answered = None;
        let from = self.timing.read_from(sync_at);
        while !self.samples.is_complete() {
            let until = self.timing.window_end(sync_at, answered);
            let Some(received) = self.wire.receive_from(from, until) else { break };
            let (at, before) = (received.at, self.samples.fresh());
            self.watch_stall(sync_at);
            self.on_received(received);
            if self.samples.fresh() != before {
                answered = answered.max(Some(at));
            }
        }
        if self.samples.is_complete() {
            self.timing.sample_times.observe(sync_at, &self.samples.received_at());
        }
    }

    /// Watches for a stall since `due`. Call it before reading queued frames: drives whose timers expired in the stall
    /// report that, and their reports must not be the first cause.
    pub(super) fn watch_stall(&mut self, due: Instant) {
        let (now, suspended) = (self.wire.now(), self.wire.suspended());
        let causes = self.timing.watch_stall(due, now, suspended);
        self.raise(now, causes);
    }

    /// Takes a frame or an error of a bus. Raises the cause of each at once, because their number is not bounded.
    pub(super) fn on_received(&mut self, received: ReceivedEvent) {
        let ReceivedEvent { at, channel, event } = received;
        let cause = match event {
            BusEvent::Frame(frame) => self.on_frame(at, &Telegram { channel, frame }),
            BusEvent::Error(error) => self.wire.on_bus_error(channel, error),
        };
        self.raise(at, [cause]);
    }

    /// Discards stale samples. Other messages stay valid.
    fn on_frame(&mut self, at: Instant, telegram: &Telegram) -> Option<Cause> {
        let is_stale = self.timing.lateness.is_stale(at, self.wire.now());
        if is_stale {
            self.samples.discard(telegram);
        } else if self.samples.on_frame(at, telegram) {
            return None;
        }
        let event = self.network.master.on_frame(at, telegram, &mut self.wire.out);
        self.send_queued();
        self.on_event(at, event?)
    }

    /// Runs the master's timers. Raises the cause of each event at once, because their number is not bounded. Requests of
    /// guarding wait until the targets are sent.
    pub(super) fn poll_master(&mut self, now: Instant) {
        while let Some(event) = self.network.master.on_time(now, &mut self.wire.out) {
            let cause = self.on_event(now, event);
            self.raise(now, [cause]);
        }
        self.network.guard_requests.take_from(&mut self.wire.out);
        self.send_queued();
    }

    /// Logs an event of the master; returns its cause, if it is a fault.
    fn on_event(&mut self, now: Instant, event: Event) -> Option<Cause> {
        if let Event::ReadBack { node, object: Object::TARGET_TORQUE, read } = event
            && let Some(joint) = node.joint()
        {
            return self.on_target_read(joint, read, event);
        }
        self.watch_zero_event(&event);
        self.trials.on_event(&event);
        if self.mode_check.on_event(&event) {
            return None;
        }
        let relation = self.proof_test.on_event(now, &event);
        let cause = match relation {
            Relation::Part => {
                self.log_tested(&event);
                return None;
            }
            Relation::Tolerated => None,
            Relation::Unrelated => causes::of_event(&event),
        };
        if let Some(Cause::Emergency { node, .. }) = cause
            && let Some(joint) = node.joint()
        {
            self.drives.power.keep_off(joint);
        }
        if let (Relation::Unrelated, &Event::Statusword { node, statusword }) = (relation, &event) {
            // Read to confirm power off, again and again: the steps are in the log.
            self.samples.set_statusword(node, statusword);
            return None;
        }
        self.log_event(event);
        cause
    }

    /// Logs an emergency that the proof test has caused, apart from the reset of its error.
    fn log_tested(&mut self, event: &Event) {
        if let &Event::Emergency { node, emergency } = event
            && !emergency.is_reset()
        {
            self.log_event(Event::Tested { node, emergency });
        }
    }

    /// Reports an event to the observer of the buses at once, or queues it for [`Node::next_event`].
    pub(super) fn log_event(&mut self, event: Event) {
        let now = self.wire.now();
        if let Some(event) = self.wire.bus.report(now, event) {
            self.network.queue_event(event);
        }
    }
}
