//! Who stays away, and what is listened to meanwhile.

use std::time::Duration;

use crate::BringUpError;
use crate::Node;
use bus::Bus;
use canopen::watchdog::Awaited;
use remote::Remote;
use units::drive::PerMille;

/// While nothing of ours is on the bus, that is looked after at least so often.
const LISTEN: Duration = Duration::from_millis(1);

/// Emergencies of six drives, one after the other, take no longer.
const SETTLE: Duration = Duration::from_millis(10);

impl<B: Bus, R: Remote> Node<B, R> {
    /// Lets every timer of every drive run out, once, and enables the drives again after each. They are
    /// enabled at zero torque when it begins and when it ends.
    ///
    /// # Errors
    /// When a drive goes on without its master, or something else is wrong meanwhile.
    pub(crate) fn prove(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        self.proof.begin(&self.network.master);
        let untimed = if self.proof.is_wanted { self.proof.untimed() } else { Vec::new() };
        if !untimed.is_empty() {
            return Err(BringUpError::NotProven(untimed));
        }
        if self.proof.is_wanted {
            // What it is asked would stand in the way of its statusword.
            self.network.master.set_reads_error_history(false);
            let proven = self.prove_each(give_up);
            self.network.master.set_reads_error_history(true);
            proven?;
        }
        self.proof.finish();
        Ok(())
    }

    fn prove_each(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        for awaited in [Awaited::Rpdo, Awaited::Heartbeat] {
            match awaited {
                Awaited::Rpdo => self.withhold_rpdos(give_up)?,
                Awaited::Heartbeat => self.withhold_heartbeats(give_up)?,
            }
            let refused = self.proof.end_trial();
            if let Some(cause) = self.cause() {
                return Err(BringUpError::NotEnabled(cause));
            }
            if !refused.is_empty() {
                return Err(BringUpError::NotProven(refused));
            }
            // What is still on its way passes; then a drive that has left operational (1029h) is started again.
            let quiet = self.wire.now() + SETTLE.max(self.timing.period * 5);
            self.listen(quiet);
            self.network.master.start_nodes(&mut self.wire.out);
            self.samples.start_again();
            self.post();
            self.enable(give_up)?;
        }
        Ok(())
    }

    /// SYNC and RPDOs stay away; the heartbeat goes on.
    fn withhold_rpdos(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        self.proof.try_timer(Awaited::Rpdo, self.wire.now());
        loop {
            let now = self.wire.now();
            self.send_heartbeat(now);
            self.poll_master(now);
            while let Some(joint) = self.proof.asks(now) {
                self.network.master.read_statusword(now, joint.into(), &mut self.wire.out);
            }
            self.post();
            while let Some(telegram) = self.network.master.release() {
                self.send(telegram);
            }
            let Some(due) = self.proof.deadline(now) else { return Ok(()) };
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            let until = due.min(now + LISTEN);
            if let Some(received) = self.wire.receive(until) {
                self.on_received(received);
                self.proof.look(received.at, self.samples.latest());
            }
        }
    }

    /// The heartbeat stays away, after a last one; SYNC and RPDOs at zero torque go on.
    fn withhold_heartbeats(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        self.send_last_heartbeat();
        self.proof.try_timer(Awaited::Heartbeat, self.wire.now());
        while self.proof.deadline(self.wire.now()).is_some() {
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            let due = self.timing.schedule.next(self.wire.now());
            self.listen(due.at);
            let sync_at = self.send_sync();
            self.gather(sync_at);
            let now = self.wire.now();
            self.poll_master(now);
            self.proof.look(now, self.samples.latest());
            if let Some(joint) = self.proof.asks(now) {
                self.network.master.read_statusword(now, joint.into(), &mut self.wire.out);
                self.post();
            }
            self.send_targets(sync_at, &[PerMille(0); 6], true);
            self.send_request();
        }
        Ok(())
    }

    /// A heartbeat now, whether one is due or not.
    fn send_last_heartbeat(&mut self) {
        let beat = self.network.heartbeat.beat(self.wire.now());
        self.send_on_every_bus(beat);
    }
}
