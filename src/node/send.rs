//! Sending: SYNC, what follows the RPDOs, and a frame now or never. The RPDOs are in [`targets`](crate::targets).

use crate::Node;
use crate::record::Mode;
use crate::wire::NotSent;
use bus::Bus;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use remote::Remote;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Sends SYNC, and returns when: what follows of it is as old as that.
    pub(super) fn send_sync(&mut self) -> Instant {
        let now = self.wire.now();
        self.samples.begin(now);
        let sync = self.network.sync.next().frame();
        self.send_on_every_bus(sync);
        now
    }

    /// Sends what must not delay the RPDOs: heartbeat, TIME, requests by SDO.
    pub(super) fn send_services(&mut self, now: Instant, sync_at: Instant) {
        // A loop that stood still over its samples is not alive.
        if !self.is_late(sync_at) {
            self.send_heartbeat(now);
        }
        self.send_time(now);
        self.recheck(now);
        self.send_request();
    }

    /// The node's own heartbeat: from the cycle itself, so that it stops with it.
    pub(super) fn send_heartbeat(&mut self, now: Instant) {
        if let Some(frame) = self.network.heartbeat.due(now) {
            self.send_on_every_bus(frame);
        }
    }

    /// TIME, for nodes that stamp what they log.
    fn send_time(&mut self, now: Instant) {
        let wall = self.wire.bus.wall();
        let clock = self.network.time_stamp.as_mut();
        if let Some(frame) = clock.and_then(|clock| clock.due(now, wall)) {
            self.send_on_every_bus(frame);
        }
    }

    /// One request of the master's by SDO at most, after everything that must not wait for it, and no more
    /// than the bus was planned for. Power off, for a drive that has fallen silent, comes before all others.
    pub(super) fn send_request(&mut self) {
        let now = self.wire.now();
        if self.power_off_silent()
            || self.mode() != Mode::Boot && !self.network.sdo_pacer.may_send(now)
        {
            return;
        }
        if let Some(telegram) = self.network.master.release() {
            self.network.sdo_pacer.on_sent(now);
            self.send(telegram);
        }
    }

    /// Requests a drive that has fallen silent to take its power off: one, in this cycle. Returns whether it did.
    fn power_off_silent(&mut self) -> bool {
        let is_stopped = self.safety.mode().is_stopped();
        let Some(joint) = self.drives.power.next_silent(self.samples.fresh(), is_stopped) else {
            return false;
        };
        let now = self.wire.now();
        self.network.master.power_off(now, joint.into(), &mut self.wire.out);
        self.post();
        true
    }

    pub(super) fn send_on_every_bus(&mut self, frame: Frame) {
        self.wire.queue_on_every_bus(frame);
        self.post();
    }

    /// Sends the queued frames.
    pub(super) fn post(&mut self) {
        let mut out = std::mem::take(&mut self.wire.out);
        for telegram in out.drain(..) {
            self.send(telegram);
        }
        self.wire.out = out;
    }

    /// Sends a frame now or never, and returns whether its bus has taken it. Raises here, so that no sender forgets to,
    /// and what is sent next is made in the mode that follows.
    pub(super) fn send(&mut self, telegram: Telegram) -> bool {
        match self.wire.send(telegram) {
            Ok(()) => true,
            Err(NotSent::Closed) => false,
            Err(NotSent::Refused(at, cause)) => {
                self.raise(at, [cause]);
                false
            }
        }
    }
}
