//! Thread of the link: sends the newest command once per period, and receives the far side's messages.

use std::time::Duration;

use triple_buffer::{Input, Output};

use super::{FarView, LatestLink, Lead, LinkSettings, LinkStatus};
use crate::stated::Misfit;
use crate::{Command, messages};
use contract::{Capability, NodeEnd, Sample};
use units::time::Instant;
use unix_socket::{Arrival, Door, Reception};

/// Maximum number of messages received in one period.
const MAX_MESSAGES: u32 = 16;

/// Maximum periods without a command of the cycle before the thread sends a hold, and the minimum of that time.
const MAX_SILENT_PERIODS: u32 = 3;
const MIN_SILENCE: Duration = Duration::from_millis(10);

/// Period of the evaluation of round trips, which sorts them.
const STATUS_EVERY: Duration = Duration::from_millis(100);

/// Minimum number of round trips for a 99th percentile that differs from the maximum.
const MIN_ROUND_TRIPS: usize = 100;

/// State of the link's thread.
#[derive(Debug)]
pub struct LinkThread {
    door: Door,
    end: NodeEnd,
    leads: Output<Lead>,
    views: Input<FarView>,
    period: Duration,
    round_trip: Duration,
    view: FarView,
    status: LinkStatus,
    latest: LatestLink,
    status_at: Instant,
    is_slow: bool,
    /// The log has a warning about foreign messages of this connection.
    is_foreign: bool,
    /// Refused connections since the last log line.
    refused: u64,
}

impl LinkThread {
    pub(super) fn new(
        door: Door,
        end: NodeEnd,
        settings: &LinkSettings,
        leads: Output<Lead>,
        views: Input<FarView>,
    ) -> Self {
        let LinkSettings { period, round_trip, .. } = *settings;
        Self {
            door,
            status: LinkStatus { session: end.session(), ..LinkStatus::default() },
            end,
            leads,
            views,
            period,
            round_trip,
            view: FarView::default(),
            latest: LatestLink::default(),
            status_at: Instant::ZERO,
            is_slow: false,
            is_foreign: false,
            refused: 0,
        }
    }

    /// Returns a handle to the status of the link.
    pub fn latest(&self) -> LatestLink {
        self.latest.clone()
    }

    /// Runs until `stopping` returns true. `clock` must be the clock of the cycle.
    pub fn run(mut self, clock: impl Fn() -> Instant, stopping: impl Fn() -> bool) {
        let (mut next, mut left) = (clock(), MAX_MESSAGES);
        while !stopping() {
            let now = clock();
            if next <= now {
                self.begin_period(now);
                // After a stall the thread does not catch up on missed periods.
                next = (next + self.period).max(now);
                left = MAX_MESSAGES;
            }
            self.door.wait(next.since(clock()), left > 0);
            left = self.take(&clock, left);
        }
    }

    /// Runs one period without blocking, for a simulation in virtual time.
    pub fn step(&mut self, now: Instant) {
        self.begin_period(now);
        self.receive(now);
    }

    /// Receives up to 16 pending messages.
    pub fn receive(&mut self, now: Instant) {
        self.take(&|| now, MAX_MESSAGES);
    }

    fn begin_period(&mut self, now: Instant) {
        self.send(now);
        self.report(now);
    }

    /// Sends the newest command, or a hold if it is too old.
    fn send(&mut self, now: Instant) {
        let Lead { at, order, epoch } = *self.leads.read();
        let silence = (self.period * MAX_SILENT_PERIODS).max(MIN_SILENCE);
        let order = if now.since(at) > silence { messages::order(&Command::HOLD) } else { order };
        while self.end.epoch() < epoch {
            self.end.begin_epoch();
        }
        let command = self.end.command(now, &order);
        if self.door.has_peer() && !self.door.send(&command) {
            self.status.dropped += 1;
        }
    }

    fn accept(&mut self) {
        match self.door.accept() {
            Some(Arrival::Peer(who)) => {
                self.is_foreign = false;
                tracing::info!(uid = who.uid(), pid = who.pid(), "far side connected");
            }
            Some(Arrival::Second(who)) => {
                // Logged once per evaluation of the status.
                if self.refused == 0 {
                    let (uid, pid) = (who.uid(), who.pid());
                    tracing::warn!(uid, pid, "second far side refused: one is connected");
                }
                self.refused += 1;
            }
            None => {}
        }
        self.status.is_connected = self.door.has_peer();
    }

    /// Receives up to `left` messages, then accepts a connection. Returns the number of messages left in this period.
    fn take(&mut self, clock: &impl Fn() -> Instant, mut left: u32) -> u32 {
        // One byte more than the longest message, to detect longer ones.
        let mut buffer = [0; Capability::LENGTH + 1];
        while left > 0 {
            match self.door.receive(&mut buffer) {
                Reception::Message(length) => {
                    // The clock is read after the reception, since this process may be stopped in between.
                    self.on_message(clock(), buffer.get(..length).unwrap_or(&buffer));
                }
                Reception::Nothing => break,
                Reception::Closed => {
                    tracing::warn!("far side disconnected");
                    self.view = FarView { p99: self.view.p99, ..FarView::default() };
                }
            }
            left -= 1;
        }
        self.views.write(self.view);
        // After a closed connection, so that a restarted far side is not refused as a second one.
        self.accept();
        left
    }

    fn on_message(&mut self, now: Instant, message: &[u8]) {
        if let Some(sample) = self.end.on_message(now, message) {
            let Sample { at, feedback } = sample;
            self.view.sensed = messages::sensed(&sample).or(self.view.sensed);
            (self.view.feedback, self.view.sample_at) = (Some(feedback), Some(at));
        }
        self.view.capability = self.end.capability().copied();
        let invalid = self.end.invalid_capability();
        if let Some(invalid) = invalid.filter(|_| self.view.invalid_capability.is_none()) {
            tracing::warn!("{}", Misfit::Rejected(invalid));
        }
        self.view.invalid_capability = invalid;
        let foreign = self.end.rejected().filter(|reject| reject.is_foreign());
        self.view.foreign = foreign.filter(|_| self.view.feedback.is_none());
        if let Some(reject) = self.view.foreign.filter(|_| !self.is_foreign) {
            tracing::warn!("{}", Misfit::Foreign(reject));
            self.is_foreign = true;
        }
    }

    /// Updates the status.
    fn report(&mut self, now: Instant) {
        if now.since(self.status_at) >= STATUS_EVERY {
            self.status_at = now;
            self.judge_round_trips();
            self.refused = 0;
        }
        let Self { status, view, end, .. } = self;
        let feedback = view.feedback.as_ref();
        status.far_session = end.far_session();
        status.leader = feedback.map_or(0, |feedback| feedback.obeyed_session);
        status.reason = feedback.map(|feedback| feedback.reason);
        status.invalid_capability = view.invalid_capability;
        status.lost = end.lost();
        status.rejects.clear();
        status.rejects.extend(end.rejects().iter());
        self.latest.offer(&self.status);
    }

    /// Computes the percentiles of the round trips; logs a 99th percentile above the configured maximum.
    fn judge_round_trips(&mut self) {
        let round_trips = self.end.round_trips();
        let is_known = round_trips.count() >= MIN_ROUND_TRIPS;
        let [p50, p99] = [50, 99].map(|percent| round_trips.percentile(percent));
        self.status.round_trips = p50.zip(p99).filter(|_| is_known).map(|(p50, p99)| [p50, p99]);
        self.view.p99 = p99.filter(|_| is_known);
        let slow = self.view.p99.filter(|p99| *p99 > self.round_trip);
        if let Some(p99) = slow.filter(|_| !self.is_slow) {
            tracing::warn!(
                "1 % of the round trips to the far side take {:.1} ms or more, remote.link.round_trip_ms is {:.1}",
                p99.as_secs_f64() * 1e3,
                self.round_trip.as_secs_f64() * 1e3
            );
        }
        self.is_slow = slow.is_some();
    }
}
