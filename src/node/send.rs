//! Sending of SYNC, heartbeat, TIME and SDO requests. [`targets`](crate::targets) sends the RPDOs.

use crate::Node;
use crate::record::Mode;
use crate::wire::SendRefusal;
use bus::Bus;
use canopen::frame::{Frame, Telegram};
use remote::Remote;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Sends the SYNC that was due at `due`, and returns its time, from which the age of samples and targets counts. If the
    /// process stalls between two buses for half a period, the other buses get no SYNC, because the next would follow too
    /// closely.
    pub(super) fn send_sync(&mut self, due: Instant) -> Instant {
        let now = self.wire.now();
        self.samples.start_window(now);
        let frame = self.network.sync.next().frame();
        for place in 0..self.wire.channels().len() {
            if place > 0 {
                let now = self.wire.read_clock();
                if self.timing.is_missed(due, now) {
                    break;
                }
            }
            if let Some(&channel) = self.wire.channels().get(place) {
                self.send(Telegram { channel, frame });
            }
        }
        now
    }

    /// Sends heartbeat, TIME and SDO requests, after the RPDOs so that they do not delay them.
    pub(super) fn send_services(&mut self, now: Instant, sync_at: Instant) {
        // Neither after a stall: the drives' heartbeat consumers and life guarding must see it.
        if !self.timing.lateness.is_stale(sync_at, self.wire.now()) {
            self.send_heartbeat(now);
            self.send_guard_requests();
        }
        self.send_time(now);
        self.recheck(now);
        self.read_target(now);
        self.send_request(sync_at);
    }

    /// Sends the node's heartbeat if due. No other thread sends it, so it stops when the loop stalls.
    pub(super) fn send_heartbeat(&mut self, now: Instant) {
        if let Some(frame) = self.network.heartbeat(now) {
            self.send_on_every_bus(frame);
        }
    }

    /// Sends the requests of guarding of one cycle.
    pub(super) fn send_guard_requests(&mut self) {
        self.wire.out.extend(self.network.guard_requests.of_cycle());
        self.send_queued();
    }

    /// Sends TIME if due, for devices that log.
    fn send_time(&mut self, now: Instant) {
        let wall = self.wire.bus.wall();
        let clock = self.network.time_stamp.as_mut();
        if let Some(frame) = clock.and_then(|clock| clock.due(now, wall)) {
            self.send_on_every_bus(frame);
        }
    }

    /// Sends at most one SDO request, at the rate assumed in the bus load. A step towards a drive that does not confirm
    /// power off comes first.
    pub(super) fn send_request(&mut self, sync_at: Instant) {
        let now = self.wire.now();
        if self.confirm_power_off(sync_at)
            || self.is_paced() && !self.network.sdo_pacer.may_send(now)
        {
            return;
        }
        if let Some(telegram) = self.network.master.release() {
            self.network.sdo_pacer.on_sent(now);
            self.send(telegram);
        }
    }

    /// Returns whether SDO requests keep the rate assumed in the bus load: not in a boot, but in a homing, where samples are
    /// watched while each drive gets many.
    fn is_paced(&self) -> bool {
        self.mode() != Mode::Boot || self.homing.is_running()
    }

    pub(super) fn send_on_every_bus(&mut self, frame: Frame) {
        self.wire.queue_on_every_bus(frame);
        self.send_queued();
    }

    /// Sends the queued frames.
    pub(super) fn send_queued(&mut self) {
        let mut out = std::mem::take(&mut self.wire.out);
        for telegram in out.drain(..) {
            self.send(telegram);
        }
        self.wire.out = out;
    }

    /// Sends a frame at once or drops it; returns whether its bus accepted it. Raises a failure before the next frame is
    /// sent, so that it is made in the mode that follows.
    pub(super) fn send(&mut self, telegram: Telegram) -> bool {
        match self.wire.send(telegram) {
            Ok(()) => true,
            Err(SendRefusal::Closed) => false,
            Err(SendRefusal::NotAccepted(at, cause)) => {
                self.raise(at, [cause]);
                false
            }
        }
    }
}
