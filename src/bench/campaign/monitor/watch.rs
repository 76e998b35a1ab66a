//! Timers by which a drive stops by itself: those of the configuration, and those that its emergency messages prove.

use std::time::Duration;

use canopen::error_codes;
use canopen::plan::NodePlan;
use canopen::watchdog::Awaited;
use units::time::Instant;

/// Timers of one drive by its plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watched {
    rpdos: bool,
    master: Option<MasterWatch>,
}

/// Sign of life of the master for which a drive waits. Both end in the same error code.
#[derive(Clone, Copy, Debug)]
enum MasterWatch {
    Heartbeat,
    /// Life guarding, with its life time.
    Guarding(Duration),
}

impl Watched {
    pub(super) fn of(plan: &NodePlan) -> Self {
        let guarding = plan
            .watchdog(Awaited::Guarding)
            .map(|timer| MasterWatch::Guarding(Duration::from_millis(u64::from(timer.millis))));
        let heartbeat = plan.watchdog(Awaited::Heartbeat).map(|_| MasterWatch::Heartbeat);
        Self { rpdos: plan.watchdog(Awaited::Rpdo).is_some(), master: guarding.or(heartbeat) }
    }

    /// Returns whether the master guards the node by remote frames.
    pub(super) const fn is_guarded(&self) -> bool {
        matches!(self.master, Some(MasterWatch::Guarding(_)))
    }
}

/// Timers that a drive has shown since it booted.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Proof {
    rpdos: bool,
    master: bool,
    /// Time of the last remote frame to it.
    polled: Option<Instant>,
}

impl Proof {
    /// Takes a remote frame by which the master guards it.
    pub(super) const fn on_poll(&mut self, at: Instant) {
        self.polled = Some(at);
    }

    /// Takes an emergency message: one because of a silent master proves the timer. Life guarding begins with the first
    /// remote frame, and ends a life time after the last.
    pub(super) fn on_emergency(&mut self, watched: &Watched, at: Instant, code: u16) {
        match (code, watched.master) {
            (error_codes::RPDO_TIMEOUT, _) => self.rpdos = true,
            (error_codes::MASTER_LOST, Some(MasterWatch::Heartbeat)) => self.master = true,
            (error_codes::MASTER_LOST, Some(MasterWatch::Guarding(life_time))) => {
                self.master |= self.polled.is_some_and(|polled| at >= polled + life_time);
            }
            _ => {}
        }
    }

    /// Returns whether it has at least one timer, and has shown every one.
    pub(super) const fn covers(&self, watched: &Watched) -> bool {
        let Watched { rpdos, master } = *watched;
        (rpdos || master.is_some()) && (!rpdos || self.rpdos) && (master.is_none() || self.master)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drive_without_a_timer_is_never_proven() {
        let mut proof = Proof::default();
        for code in [error_codes::RPDO_TIMEOUT, error_codes::MASTER_LOST] {
            proof.on_emergency(&Watched { rpdos: false, master: None }, Instant::ZERO, code);
        }
        assert!(!proof.covers(&Watched { rpdos: false, master: None }));
        assert!(proof.covers(&Watched { rpdos: true, master: None }));
    }
}
