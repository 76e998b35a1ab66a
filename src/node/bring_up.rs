//! Bring-up, in the stages of docs/loop.md.
//!
//! | function         | stages                                                                     |
//! |------------------|----------------------------------------------------------------------------|
//! | `start_network`  | listen; boot of every node to NMT operational, without a cycle             |
//! | `become_ready`   | cycles at zero torque: modes of operation, enabling, proof test, `Ready`   |

use std::time::Duration;

use thiserror::Error;

use crate::Node;
use crate::boot_failures;
use crate::cause::Cause;
use crate::homing::HomingError;
use crate::mode_check::WrongMode;
use crate::proof_test::ProofTestFailure;
use crate::record::Mode;
use crate::shut_down::PowerOffError;
use bus::{Bus, BusError, BusEvent, ReceivedEvent, ReopenError};
use canopen::frame::{Channel, Telegram};
use canopen::master::boot_error::BootError;
use canopen::master::event::Event;
use remote::{Command, Remote};
use units::numbering::Joint;
use units::time::Instant;

/// Time before a boot in which the node sends nothing and looks for another master; frames in flight are
/// dropped. Not longer: a drive that is found enabled holds its torque until it is switched off after it. Nodes are
/// [reset later](crate::network).
const LISTEN_TIME: Duration = Duration::from_millis(20);

/// Maximum time between two calls of `give_up` in a boot.
const GIVE_UP_POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Reason why bring-up failed.
#[derive(Debug, Error)]
pub enum BringUpError {
    /// Nodes are missing, have another identity, or refused their configuration: one line each.
    #[error("{}", boot_failures::lines(.0))]
    Boot(Vec<BootError>),
    /// The bus failed during the boot, or has another master.
    #[error("{0}")]
    Bus(Cause),
    /// A reopened interface is not fit for torques.
    #[error("{0}")]
    Unfit(String),
    /// A drive did not reach `Operation enabled`.
    #[error("{0}")]
    NotEnabled(Cause),
    /// A drive does not display its mode when enabled.
    #[error(transparent)]
    Mode(#[from] WrongMode),
    /// A drive was not homed, or moved.
    #[error(transparent)]
    Homing(#[from] HomingError),
    /// Drives failed the proof test: one line each.
    #[error("{}", boot_failures::grouped(.0.iter().map(|it| (it.name.as_str(), it.node, it.reason.to_string()))))]
    ProofTest(Vec<ProofTestFailure>),
    /// `give_up` returned true.
    #[error("boot given up")]
    GivenUp,
    /// `give_up` returned true while drives were enabled, and one of them did not confirm that it is off.
    #[error("boot given up: {0}")]
    LeftOn(PowerOffError),
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Boots every node (identity, configuration written and read back, NMT start), enables the drives at zero torque,
    /// and runs their [proof test](crate::proof_test). Ends in `Ready`.
    ///
    /// # Errors
    /// When a node, a drive or the bus fails, or `give_up` returns true. The drives are then switched off.
    pub fn bring_up(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        self.start_network(give_up)?;
        self.become_ready(give_up).map_err(|error| match (error, self.switch_off(&mut || false)) {
            (BringUpError::GivenUp, Err(unconfirmed)) => BringUpError::LeftOn(unconfirmed),
            // The first fault is reported: a drive that is not off follows from it.
            (error, _) => error,
        })
    }

    /// Boots every node to NMT operational. Enables no drive.
    pub(super) fn start_network(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        // A drive may have lost its power while the node did not receive its frames.
        let is_watching = !self.network.is_silent() && !self.wire.transmission.is_shut();
        self.zeros.on_boot(is_watching);
        self.reopen()?;
        self.network.restart(self.wire.read_clock());
        self.samples.restart();
        self.timing.sample_times.restart();
        self.plausibility.restart();
        self.proof_test.restart();
        self.drives.rpdos.restart();
        self.power_off.restart();
        self.rest.restart();
        self.trials.restart();
        self.mode_check.enable_all();
        self.listen_before_boot()?;
        let booted = self.boot(give_up);
        match &booted {
            // The nodes are another master's.
            Ok(()) | Err(BringUpError::Bus(Cause::ForeignMaster)) => {}
            Err(_) => self.enter_pre_operational(),
        }
        booted
    }

    /// Receives for [`LISTEN_TIME`] before the first frame is sent, and fails if another master is on the bus.
    fn listen_before_boot(&mut self) -> Result<(), BringUpError> {
        let until = self.wire.read_clock() + LISTEN_TIME;
        while let Some(ReceivedEvent { channel, event, .. }) = self.wire.receive(until) {
            match event {
                BusEvent::Frame(frame) => {
                    self.zeros.on_boot_frame(&Telegram { channel, frame });
                    // A boot would reset the nodes of a running master.
                    if self.network.master.is_of_other_master(&Telegram { channel, frame }) {
                        return Err(BringUpError::Bus(Cause::ForeignMaster));
                    }
                }
                BusEvent::Error(error) => self.on_boot_bus_error(channel, error)?,
            }
        }
        Ok(())
    }

    /// Ends the boot on a bus error that is a cause.
    fn on_boot_bus_error(&mut self, channel: Channel, error: BusError) -> Result<(), BringUpError> {
        let cause = self.wire.on_bus_error(channel, error);
        cause.map_or(Ok(()), |cause| Err(BringUpError::Bus(cause)))
    }

    /// Fails if a bus did not accept a frame, because the nodes would otherwise be reported as missing.
    fn check_all_accepted(&self) -> Result<(), BringUpError> {
        let Some(Channel(channel)) = self.wire.transmission.first_closed() else { return Ok(()) };
        let cause = self.cause().unwrap_or(Cause::BusDown { channel });
        Err(BringUpError::Bus(cause))
    }

    /// Enables the drives at zero torque and runs the proof test, until the mode is `Ready`.
    pub(super) fn become_ready(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        self.check_modes(give_up)?;
        self.enable(give_up)?;
        self.run_proof_test(give_up)?;
        while self.mode() == Mode::Boot {
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            self.cycle();
        }
        self.cause().map_or(Ok(()), |cause| Err(BringUpError::NotEnabled(cause)))
    }

    /// Runs cycles at zero torque until every drive is enabled, or the one whose mode is being checked. Resets a fault of
    /// each drive once, as after a test of its watchdogs. Returns the time of the last SYNC.
    ///
    /// # Errors
    /// When a drive is not enabled in time, another cause is raised, or `give_up` returns true.
    pub(super) fn enable(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Instant, BringUpError> {
        let now = self.wire.read_clock();
        self.timing.restart(now);
        // No sample was requested during the boot: the newest one is stale.
        self.remote_side.exchange(now, &Command::HOLD, Mode::Boot);
        self.safety.boot(now);
        self.drives.power.allow_enabling();
        for joint in Joint::ALL.into_iter().filter(|joint| !self.mode_check.is_enabling(*joint)) {
            self.drives.power.keep_off(joint);
        }
        loop {
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            let sync_at = self.cycle().at;
            if let Some(cause) = self.cause() {
                return Err(BringUpError::NotEnabled(cause));
            }
            if self.samples.is_complete() && self.not_enabled().is_none() {
                return Ok(sync_at);
            }
        }
    }

    /// Reopens buses that are shut; the interface of the same name may be another device now.
    fn reopen(&mut self) -> Result<(), BringUpError> {
        self.wire.reopen().map_err(|error| match error {
            ReopenError::Gone(Channel(channel)) => BringUpError::Bus(Cause::BusDown { channel }),
            ReopenError::Unfit(reason) => BringUpError::Unfit(reason),
        })
    }

    /// Runs the master's boot until every node is operational or has failed.
    fn boot(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        let mut failed = Vec::new();
        while self.network.master.is_booting() {
            if give_up() {
                return Err(BringUpError::GivenUp);
            }
            let event = self.network.master.on_time(self.wire.read_clock(), &mut self.wire.out);
            self.send_queued();
            self.check_all_accepted()?;
            self.on_boot_event(event, &mut failed)?;
            if !self.network.master.is_booting() {
                break;
            }
            let next_poll = self.wire.read_clock() + GIVE_UP_POLL_INTERVAL;
            let until = self.network.master.deadline().map_or(next_poll, |due| due.min(next_poll));
            let Some(received) = self.wire.receive(until) else { continue };
            let channel = received.channel;
            match received.event {
                BusEvent::Frame(frame) => {
                    let telegram = Telegram { channel, frame };
                    self.zeros.on_boot_frame(&telegram);
                    self.samples.on_frame(received.at, &telegram);
                    let event =
                        self.network.master.on_frame(received.at, &telegram, &mut self.wire.out);
                    self.send_queued();
                    self.on_boot_event(event, &mut failed)?;
                }
                BusEvent::Error(error) => self.on_boot_bus_error(channel, error)?,
            }
        }
        while let Some(event) =
            self.network.master.on_time(self.wire.read_clock(), &mut self.wire.out)
        {
            self.on_boot_event(Some(event), &mut failed)?;
        }
        self.send_queued();
        self.expected_drives.name_swapped(&self.network.master, &mut failed);
        if failed.is_empty() { Ok(()) } else { Err(BringUpError::Boot(failed)) }
    }

    /// Collects boot failures for the caller, and logs all other events. A command or download of another master ends the
    /// boot, because the state of the nodes is unknown after it.
    fn on_boot_event(
        &mut self,
        event: Option<Event>,
        failed: &mut Vec<BootError>,
    ) -> Result<(), BringUpError> {
        let Some(event) = event else { return Ok(()) };
        self.watch_zero_event(&event);
        let is_foreign = matches!(event, Event::ForeignMaster { .. });
        if let Event::BootFailed(error) = event {
            failed.push(error);
        } else {
            self.log_event(event);
        }
        if is_foreign { Err(BringUpError::Bus(Cause::ForeignMaster)) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silent_bus::node;
    use canopen::frame::Frame;
    use units::time::Instant;

    /// Returns whether a boot may send this COB-ID before a node has answered: NMT, SDO requests, own heartbeat.
    fn is_of_a_boot(cob_id: u16) -> bool {
        cob_id == 0 || (0x600..0x680).contains(&cob_id) || cob_id == 0x77F
    }

    #[test]
    fn boot_without_nodes_names_all_as_missing_and_enables_none() {
        let mut node = node();
        let Err(BringUpError::Boot(errors)) = node.bring_up(&mut || false) else {
            panic!("booted without nodes");
        };
        assert_eq!(errors.len(), 7, "{errors:?}");
        assert_eq!(node.mode(), Mode::Boot);
        let sent = node.bus_mut().identifiers();
        assert!(sent.iter().all(|cob_id| is_of_a_boot(*cob_id)), "{sent:03X?}");
    }

    #[test]
    fn failed_boot_leaves_all_nodes_pre_operational() {
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
    fn boot_given_up_at_once_ends_within_70_ms() {
        let mut node = node();
        let given_up = node.bring_up(&mut || true);
        assert!(matches!(given_up, Err(BringUpError::GivenUp)), "{given_up:?}");
        let elapsed = node.bus().now().since(Instant::ZERO);
        assert!(elapsed < LISTEN_TIME + GIVE_UP_POLL_INTERVAL, "{elapsed:?}");
    }

    #[test]
    fn hazard_26_frame_of_another_master_prevents_the_boot() {
        let others = [Frame::new(0x080, []), Frame::new(0x201, [0; 6]), Frame::new(0x000, [1, 0])];
        for frame in others.into_iter().chain([Frame::new(0x77F, [5])]) {
            let mut node = node();
            let at = Instant::ZERO + LISTEN_TIME - Duration::from_millis(1);
            node.bus_mut().received = vec![(at, Telegram { channel: Channel(0), frame })];
            let outcome = node.bring_up(&mut || false);
            assert!(matches!(outcome, Err(BringUpError::Bus(Cause::ForeignMaster))), "{frame}");
            assert_eq!((node.bus().now(), node.bus().sent.len()), (at, 0), "{frame}");
        }
    }

    #[test]
    fn hazard_26_slow_master_found_in_the_boot_keeps_its_nodes() {
        let mut node = node();
        let at = Instant::ZERO + Duration::from_millis(90);
        let sync = Telegram { channel: Channel(0), frame: Frame::new(0x080, []) };
        node.bus_mut().received = vec![(at, sync)];
        let outcome = node.bring_up(&mut || false);
        assert!(matches!(outcome, Err(BringUpError::Bus(Cause::ForeignMaster))), "{outcome:?}");
        assert!(!node.bus_mut().identifiers().contains(&0x000), "no NMT command");
    }

    #[test]
    fn heartbeat_of_a_drive_before_the_boot_is_no_master() {
        let mut node = node();
        let beat = Telegram { channel: Channel(0), frame: Frame::new(0x703, [5]) };
        node.bus_mut().received = vec![(Instant::ZERO + LISTEN_TIME / 2, beat)];
        let outcome = node.bring_up(&mut || false);
        assert!(matches!(outcome, Err(BringUpError::Boot(_))), "{outcome:?}");
    }

    #[test]
    fn boot_listens_before_it_sends() {
        let mut node = node();
        assert!(node.bring_up(&mut || false).is_err());
        let (first, _) = node.bus().sent[0];
        assert!(first.since(Instant::ZERO) >= LISTEN_TIME);
    }

    #[test]
    fn hazard_23_bus_fault_before_the_boot_ends_it_without_a_frame() {
        for (error, stops) in
            [(BusError::Warning, false), (BusError::Passive, true), (BusError::Off, true)]
        {
            let mut node = node();
            let at = node.bus().now() + LISTEN_TIME / 2;
            node.bus_mut().error = Some((at, error));
            let error = node.bring_up(&mut || false).unwrap_err();
            assert_eq!(matches!(error, BringUpError::Bus(_)), stops, "{error}");
            assert_eq!(node.bus().sent.is_empty(), stops, "{error:?}");
        }
    }

    #[test]
    fn hazard_23_bus_fault_after_the_last_boot_frame_is_latched() {
        let mut healthy = node();
        assert!(healthy.bring_up(&mut || false).is_err());
        let (last, _) = *healthy.bus().sent.last().unwrap();
        let mut node = node();
        node.bus_mut().error = Some((last + node.timing.period / 2, BusError::Off));
        assert!(node.bring_up(&mut || false).is_err());
        assert_eq!(node.cause(), Some(Cause::BusOff { channel: 0 }));
        assert!(node.wire.transmission.is_shut());
    }
}
