//! Before the first cycle and after the last: booting the network, and leaving it safe.

use std::time::Duration;

use thiserror::Error;

use crate::Node;
use crate::cause::Cause;
use crate::power;
use crate::proof::NotProven;
use crate::record::Mode;
use bus::Bus;
use bus::BusEvent;
use bus::BusFault;
use bus::Received;
use bus::ReopenError;
use canopen::frame::Channel;
use canopen::frame::Telegram;
use canopen::master::boot_error::BootError;
use canopen::master::event::Event;
use remote::Remote;
use units::numbering::Joint;
use units::spatial::Motion;

/// What is on its way when a boot begins, such as boot-up messages, is let pass.
const LISTEN_FIRST: Duration = Duration::from_millis(20);

/// Whoever may want to give up a boot is asked this often.
const ASK_EVERY: Duration = Duration::from_millis(50);

/// Cycles at zero torque before the drives are switched off.
const QUIET_CYCLES: u32 = 5;

/// The drives must confirm that they are off within this.
const CONFIRM_WITHIN: Duration = Duration::from_millis(500);

/// Why the network did not come up.
#[derive(Debug, Error)]
pub enum BringUpError {
    /// Nodes are missing, are other ones, or refused their configuration: one line each.
    #[error("{}", lines(.0))]
    Boot(Vec<BootError>),
    /// The bus failed while booting, or belongs to another master.
    #[error("{0}")]
    Bus(Cause),
    /// An interface that was opened again is not fit for torques.
    #[error("{0}")]
    Unfit(String),
    /// A drive did not reach `Operation enabled`.
    #[error("{0}")]
    NotEnabled(Cause),
    /// A drive goes on without its master: one line each.
    #[error("{}", lines(.0))]
    NotProven(Vec<NotProven>),
    /// Whoever started it gave it up.
    #[error("boot given up")]
    GivenUp,
    /// The same, while drives were being enabled; one of them did not confirm that it is off again.
    #[error("boot given up: {0}")]
    LeftOn(NotConfirmed),
}

/// Drives that did not confirm that they are off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("joint {joint}: drive did not confirm that it is off (6041h = {statusword:04X}h)")]
pub struct NotConfirmed {
    /// The first such joint.
    pub joint: Joint,
    /// Its last statusword.
    pub statusword: u16,
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Boots every node (identity, configuration written and read back, NMT start), then runs cycles
    /// at zero torque until every drive is enabled and has [proven](crate::proof) that it stops by
    /// itself.
    ///
    /// # Errors
    /// When a node, a drive or the bus fails, or `give_up` says so. Nothing is enabled then.
    pub fn bring_up(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        self.start_network(give_up)?;
        self.become_ready(give_up).map_err(|error| match (error, self.switch_off()) {
            (BringUpError::GivenUp, Err(left)) => BringUpError::LeftOn(left),
            // The first of what is wrong is told: that a drive is not off either follows from it.
            (error, _) => error,
        })
    }

    /// Boots every node, up to NMT operational; no drive is enabled.
    pub(super) fn start_network(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        self.reopen()?;
        self.network.restart();
        self.samples.restart();
        self.plausibility.restart();
        self.proof.restart();
        self.drives.rpdos.restart();
        self.listen_first()?;
        let booted = self.boot(give_up);
        if booted.is_err() {
            self.leave_pre_operational();
        }
        booted
    }

    /// Lets pass what is on its way when a boot begins. Nothing has been sent then.
    fn listen_first(&mut self) -> Result<(), BringUpError> {
        let quiet = self.wire.now() + LISTEN_FIRST;
        while let Some(Received { channel, event, .. }) = self.wire.receive(quiet) {
            match event {
                BusEvent::Frame(frame) => {
                    // A boot would reset the nodes of a master that runs.
                    if self.network.master.is_foreign(&Telegram { channel, frame }) {
                        return Err(BringUpError::Bus(Cause::ForeignMaster));
                    }
                }
                BusEvent::Fault(fault) => self.on_boot_fault(channel, fault)?,
            }
        }
        Ok(())
    }

    /// Draws the conclusions of a fault of the bus while nothing is enabled.
    fn on_boot_fault(&mut self, channel: Channel, fault: BusFault) -> Result<(), BringUpError> {
        let cause = self.wire.on_fault(channel, fault);
        cause.map_or(Ok(()), |cause| Err(BringUpError::Bus(cause)))
    }

    /// Fails where a frame was not taken: without it no node can be booted, whoever seems silent.
    fn all_was_taken(&self) -> Result<(), BringUpError> {
        let Some(Channel(channel)) = self.wire.transmission.closed() else { return Ok(()) };
        let cause = self.cause().unwrap_or(Cause::BusDown { channel });
        Err(BringUpError::Bus(cause))
    }

    /// Enables the drives at zero torque, lets them prove that they stop by themselves, and is ready.
    fn become_ready(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        self.enable(give_up)?;
        self.prove(give_up)?;
        while self.mode() == Mode::Boot {
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            self.cycle();
        }
        self.cause().map_or(Ok(()), |cause| Err(BringUpError::NotEnabled(cause)))
    }

    /// Runs cycles at zero torque until every drive is enabled. One that has missed its master is in a
    /// fault, by its own timers, which is reset.
    ///
    /// # Errors
    /// When one does not come, something else is wrong, or `give_up` says so.
    pub(super) fn enable(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        let now = self.wire.now();
        self.timing.restart(now);
        // While there were no cycles nobody was asked: what is known has aged.
        self.remote.exchange(now, &Motion::Hold);
        self.safety.boot(now);
        self.drives.power.reset_faults();
        loop {
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            self.cycle();
            if let Some(cause) = self.cause() {
                return Err(BringUpError::NotEnabled(cause));
            }
            if self.samples.is_complete() && self.not_enabled().is_none() {
                return Ok(());
            }
        }
    }

    /// A bus on which nothing may be sent any more begins anew, whatever interface is there now.
    fn reopen(&mut self) -> Result<(), BringUpError> {
        self.wire.reopen().map_err(|error| match error {
            ReopenError::Gone(Channel(channel)) => BringUpError::Bus(Cause::BusDown { channel }),
            ReopenError::Unfit(reason) => BringUpError::Unfit(reason),
        })
    }

    /// Runs the master's boot until all nodes are operational, or it is known which are not.
    fn boot(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        let mut failed = Vec::new();
        while self.network.master.is_booting() {
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            let event = self.network.master.on_time(self.wire.now(), &mut self.wire.out);
            self.post();
            self.all_was_taken()?;
            self.on_boot_event(event, &mut failed)?;
            if !self.network.master.is_booting() {
                break;
            }
            let ask = self.wire.now() + ASK_EVERY;
            let until = self.network.master.deadline().map_or(ask, |due| due.min(ask));
            let Some(received) = self.wire.receive(until) else { continue };
            let channel = received.channel;
            match received.event {
                BusEvent::Frame(frame) => {
                    let telegram = Telegram { channel, frame };
                    self.samples.on_frame(received.at, &telegram);
                    let event =
                        self.network.master.on_frame(received.at, &telegram, &mut self.wire.out);
                    self.post();
                    self.on_boot_event(event, &mut failed)?;
                }
                BusEvent::Fault(fault) => self.on_boot_fault(channel, fault)?,
            }
        }
        while let Some(event) = self.network.master.on_time(self.wire.now(), &mut self.wire.out) {
            self.on_boot_event(Some(event), &mut failed)?;
        }
        self.post();
        if failed.is_empty() { Ok(()) } else { Err(BringUpError::Boot(failed)) }
    }

    /// Keeps what the master says: failures for whoever started the boot, everything else for people.
    /// What another master commands or writes meanwhile ends the boot: nothing is known then.
    fn on_boot_event(
        &mut self,
        event: Option<Event>,
        failed: &mut Vec<BootError>,
    ) -> Result<(), BringUpError> {
        let Some(event) = event else { return Ok(()) };
        let is_foreign = matches!(event, Event::ForeignMaster { .. });
        if let Event::BootFailed(error) = event {
            failed.push(error);
        } else {
            self.network.note(event);
        }
        if is_foreign { Err(BringUpError::Bus(Cause::ForeignMaster)) } else { Ok(()) }
    }

    /// An orderly stop: torque to zero by a ramp, drives off, confirmed by their statuswords, then NMT
    /// pre-operational.
    ///
    /// # Errors
    /// When a drive does not confirm in time. It was told all the same, and its own timers remain.
    pub fn stop(&mut self) -> Result<(), NotConfirmed> {
        self.safety.disarm();
        while self.safety.may_push() {
            self.cycle();
        }
        for _ in 0..QUIET_CYCLES {
            self.cycle();
        }
        self.switch_off()
    }

    /// Voltage off, confirmed by the statuswords, then NMT pre-operational.
    fn switch_off(&mut self) -> Result<(), NotConfirmed> {
        self.safety.shut_down(self.wire.now());
        let until = self.wire.now() + CONFIRM_WITHIN;
        let mut on = self.first_on();
        while on.is_some() && self.wire.now() < until {
            self.cycle();
            on = self.first_on();
        }
        self.leave_pre_operational();
        match on {
            None => Ok(()),
            Some((joint, statusword)) => Err(NotConfirmed { joint, statusword }),
        }
    }

    /// Returns whether the latest statusword of every drive says that its power stage is off.
    pub fn is_off(&self) -> bool {
        self.first_on().is_none()
    }

    /// The first joint whose drive still has its power stage on, and its statusword.
    fn first_on(&self) -> Option<(Joint, u16)> {
        let mut joints = Joint::each(self.samples.latest());
        let (joint, sample) = joints.find(|(_, sample)| power::may_push(sample.statusword))?;
        Some((joint, sample.statusword.0))
    }

    /// Nobody is left operational: no PDO of ours acts any more.
    fn leave_pre_operational(&mut self) {
        self.network.master.shut_down(&mut self.wire.out);
        self.post();
        let flushed = self.wire.now() + self.timing.period;
        while let Some(received) = self.wire.receive(flushed) {
            if matches!(received.event, BusEvent::Fault(_)) {
                self.on_received(received);
            }
        }
    }
}

/// One line for each.
fn lines(errors: &[impl ToString]) -> String {
    errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silent::node;

    /// NMT, and the requests of SDO: what a boot may send before any node has answered.
    fn is_of_a_boot(cob_id: u16) -> bool {
        cob_id == 0 || (0x600..0x680).contains(&cob_id) || cob_id == 0x77F
    }

    #[test]
    fn network_without_nodes_is_absent_and_nobody_is_enabled() {
        let mut node = node();
        let Err(BringUpError::Boot(errors)) = node.bring_up(&mut || false) else {
            panic!("nothing answers");
        };
        assert_eq!(errors.len(), 7, "{errors:?}");
        assert_eq!(node.mode(), Mode::Boot);
        let sent = node.bus_mut().identifiers();
        assert!(sent.iter().all(|cob_id| is_of_a_boot(*cob_id)), "{sent:03X?}");
    }

    #[test]
    fn boot_that_fails_leaves_all_nodes_pre_operational() {
        let mut node = node();
        assert!(node.bring_up(&mut || false).is_err());
        let sent = &node.bus().sent;
        let last_nmt = sent.iter().rev().find(|(_, telegram)| telegram.frame.cob_id == 0).unwrap();
        assert_eq!(last_nmt.1.frame.data().first(), Some(&0x80));
        let is_start = |(_, telegram): &&(_, Telegram)| {
            telegram.frame.cob_id == 0 && telegram.frame.data().first() == Some(&1)
        };
        assert_eq!(sent.iter().find(is_start), None);
    }

    #[test]
    fn boot_given_up_at_once_ends_within_a_moment() {
        let mut node = node();
        let given_up = node.bring_up(&mut || true);
        assert!(matches!(given_up, Err(BringUpError::GivenUp)), "{given_up:?}");
        let took = node.bus().now().since(units::time::Instant::ZERO);
        assert!(took < LISTEN_FIRST + ASK_EVERY, "{took:?}");
    }

    #[test]
    fn boot_listens_before_it_sends() {
        let mut node = node();
        assert!(node.bring_up(&mut || false).is_err());
        let (first, _) = node.bus().sent[0];
        assert!(first.since(units::time::Instant::ZERO) >= LISTEN_FIRST);
    }

    #[test]
    fn hazard_23_bus_fault_before_the_boot_ends_it_before_it_sends() {
        for (fault, stops) in
            [(BusFault::Warning, false), (BusFault::Passive, true), (BusFault::Off, true)]
        {
            let mut node = node();
            let at = node.bus().now() + LISTEN_FIRST / 2;
            node.bus_mut().fault = Some((at, fault));
            let error = node.bring_up(&mut || false).unwrap_err();
            assert_eq!(matches!(error, BringUpError::Bus(_)), stops, "{error}");
            assert_eq!(node.bus().sent.is_empty(), stops, "{fault:?}");
        }
    }

    #[test]
    fn hazard_23_bus_fault_behind_the_last_frame_of_a_boot_is_latched() {
        let mut healthy = node();
        assert!(healthy.bring_up(&mut || false).is_err());
        let (last, _) = *healthy.bus().sent.last().unwrap();
        let mut node = node();
        node.bus_mut().fault = Some((last + node.timing.period / 2, BusFault::Off));
        assert!(node.bring_up(&mut || false).is_err());
        assert_eq!(node.cause(), Some(Cause::BusOff { channel: 0 }));
        assert!(node.wire.transmission.is_shut());
    }

    #[test]
    fn stop_of_a_node_that_never_booted_is_over_at_once() {
        let mut node = node();
        let begun = node.bus().now();
        assert_eq!(node.stop(), Ok(()));
        let took = node.bus().now().since(begun);
        assert!(took < CONFIRM_WITHIN / 10, "{took:?}");
    }
}
