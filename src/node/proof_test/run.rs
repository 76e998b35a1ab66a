//! Execution of the proof test in a bring-up: withholding of RPDOs, then of the heartbeat, then of node guarding.

use std::time::Duration;

use crate::proof_test::ProofTestFailure;
use crate::{BringUpError, Node};
use bus::Bus;
use canopen::watchdog::LifeSign;
use remote::Remote;
use units::drive::PerMille;
use units::numbering::Joint;
use units::time::Instant;

/// Maximum time of one wait for a frame while RPDOs are withheld.
const MAX_RECEIVE_WAIT: Duration = Duration::from_millis(1);

/// Time after a watchdog test in which the drives' emergencies arrive.
const SETTLE_TIME: Duration = Duration::from_millis(10);

impl<B: Bus, R: Remote> Node<B, R> {
    /// Lets every watchdog of every drive expire once, and enables the drives again after each test. The drives are enabled at
    /// zero torque before and after it.
    ///
    /// # Errors
    /// When a drive fails the test, a cause is raised, or `give_up` returns true.
    pub(crate) fn run_proof_test(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        self.proof_test.start(&self.network.master);
        let without_watchdog = if self.proof_test.is_enabled {
            self.proof_test.without_watchdog()
        } else {
            Vec::new()
        };
        if !without_watchdog.is_empty() {
            return Err(BringUpError::ProofTest(without_watchdog));
        }
        if self.proof_test.is_enabled {
            // Reading the error history (1003h) would delay the reading of statuswords.
            self.network.master.set_reads_error_history(false);
            let tested = self.run_watchdog_tests(give_up);
            self.network.master.set_reads_error_history(true);
            tested?;
        }
        self.proof_test.finish();
        Ok(())
    }

    fn run_watchdog_tests(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        for awaited in LifeSign::ALL {
            if !self.proof_test.has_any(awaited) {
                continue;
            }
            let mut failures = self.run_watchdog_test(awaited, give_up)?;
            if !failures.is_empty() && failures.iter().all(|it| it.reason.is_unanswered()) {
                // A lost answer shows nothing: the test is repeated, once.
                self.recover(give_up)?;
                failures = self.run_watchdog_test(awaited, give_up)?;
            }
            if !failures.is_empty() {
                return Err(BringUpError::ProofTest(failures));
            }
            self.recover(give_up)?;
        }
        Ok(())
    }

    /// Withholds one frame until the test of its watchdogs has ended; returns the failures.
    fn run_watchdog_test(
        &mut self,
        awaited: LifeSign,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<ProofTestFailure>, BringUpError> {
        match awaited {
            LifeSign::Rpdo => self.withhold_rpdos(give_up)?,
            LifeSign::Heartbeat => {
                self.send_last_heartbeat();
                self.withhold_error_control(awaited, give_up)?;
            }
            LifeSign::Guarding => {
                self.network.pause_guarding();
                let tested = self.withhold_error_control(awaited, give_up);
                self.network.master.resume_guarding(self.wire.read_clock());
                tested?;
            }
        }
        let failures = self.proof_test.end_watchdog_test();
        self.cause().map_or(Ok(failures), |cause| Err(BringUpError::NotEnabled(cause)))
    }

    /// Enables the drives again after a test. Emergencies arrive first; then drives that have left operational (1029h) are
    /// started again.
    fn recover(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        let until = self.wire.read_clock() + SETTLE_TIME.max(self.timing.period * 5);
        self.listen(until);
        self.network.master.start_nodes(&mut self.wire.out);
        self.samples.clear_missing();
        self.send_queued();
        self.enable(give_up).map(|_| ())
    }

    /// Requests the statusword (6041h) of a drive, unless another request to it is pending.
    fn read_tested_statusword(&mut self, now: Instant, joint: Joint) {
        if self.network.master.read_statusword(now, joint.into(), &mut self.wire.out) {
            self.proof_test.on_requested(now, joint);
        }
    }

    /// Tests the RPDO timers: withholds SYNC and RPDOs, and sends the heartbeat.
    fn withhold_rpdos(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        self.proof_test.start_watchdog_test(LifeSign::Rpdo, self.wire.read_clock());
        loop {
            let now = self.wire.read_clock();
            self.send_heartbeat(now);
            self.poll_master(now);
            while let Some(joint) = self.proof_test.next_to_read(now) {
                self.read_tested_statusword(now, joint);
            }
            self.send_queued();
            self.send_guard_requests();
            while let Some(telegram) = self.network.master.release() {
                self.send(telegram);
            }
            let Some(due) = self.proof_test.deadline(now) else { return Ok(()) };
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            let until = due.min(now + MAX_RECEIVE_WAIT);
            if let Some(received) = self.wire.receive(until) {
                self.on_received(received);
                self.proof_test.on_samples(received.at, self.samples.latest());
            }
        }
    }

    /// Tests the heartbeat consumers, or life guarding: withholds the heartbeat or the remote frames, and sends SYNC and
    /// RPDOs at zero torque.
    fn withhold_error_control(
        &mut self,
        awaited: LifeSign,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        self.proof_test.start_watchdog_test(awaited, self.wire.read_clock());
        while self.proof_test.deadline(self.wire.read_clock()).is_some() {
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            let due = self.timing.schedule.next(self.wire.read_clock());
            self.listen(due.at);
            let sync_at = self.send_sync(due.at);
            self.gather(sync_at);
            let now = self.wire.read_clock();
            if awaited != LifeSign::Heartbeat {
                self.send_heartbeat(now);
            }
            self.poll_master(now);
            self.proof_test.on_samples(now, self.samples.latest());
            if let Some(joint) = self.proof_test.next_to_read(now) {
                self.read_tested_statusword(now, joint);
                self.send_queued();
            }
            self.send_targets(sync_at, &[PerMille(0); 6], true);
            self.send_guard_requests();
            self.send_request(sync_at);
        }
        Ok(())
    }

    /// Sends a heartbeat at once.
    fn send_last_heartbeat(&mut self) {
        let beat = self.network.heartbeat.beat(self.wire.read_clock());
        self.send_on_every_bus(beat);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cause::Cause;
    use crate::silent_bus::{NoRemote, SilentBus, node};
    use bus::{BusEvent, ReceivedEvent};
    use canopen::frame::{Channel, Frame};
    use canopen::master::event::Event;

    /// Receives an emergency of the drive of joint 3, and returns its event.
    fn emergency(node: &mut Node<SilentBus, NoRemote>, code: u16) -> Option<Event> {
        let [low, high] = code.to_le_bytes();
        let frame = Frame::new(0x83, [low, high, 0x10, 0, 0, 0, 0, 0]);
        let at = node.wire.read_clock();
        node.on_received(ReceivedEvent { at, channel: Channel(0), event: BusEvent::Frame(frame) });
        node.next_event()
    }

    #[test]
    fn emergencies_of_the_test_are_logged_as_its_part() {
        let mut node = node();
        node.proof_test.start(&node.network.master);
        node.proof_test.start_watchdog_test(LifeSign::Rpdo, Instant::ZERO);
        let event = emergency(&mut node, 0x8250);
        assert!(matches!(event, Some(Event::Tested { .. })), "{event:?}");
        assert_eq!(emergency(&mut node, 0x0000), None, "the error is reset");
        assert_eq!(node.cause(), None);
    }

    #[test]
    fn unexpected_emergency_in_the_test_is_a_warning_and_ends_it() {
        let mut node = node();
        node.proof_test.start(&node.network.master);
        node.proof_test.start_watchdog_test(LifeSign::Rpdo, Instant::ZERO);
        let event = emergency(&mut node, 0x3210);
        assert!(matches!(event, Some(Event::Emergency { .. })), "{event:?}");
        assert!(matches!(node.cause(), Some(Cause::Emergency { .. })), "{:?}", node.cause());
    }
}
