//! Timers by which a drive stops without its master: those of the configuration, and those proven by EMCY messages.

use std::time::Duration;

use canopen::error_codes;
use canopen::plan::NodePlan;
use canopen::watchdog::LifeSign;
use units::time::Instant;

/// Timers of one drive, from its plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct DriveTimers {
    rpdos: bool,
    master: Option<MasterTimer>,
}

/// Monitoring of the master by a drive. Both kinds report the same error code.
#[derive(Clone, Copy, Debug)]
enum MasterTimer {
    Heartbeat,
    /// Life guarding, with its life time.
    Guarding(Duration),
}

impl DriveTimers {
    pub(super) fn from_plan(plan: &NodePlan) -> Self {
        let guarding = plan
            .watchdog(LifeSign::Guarding)
            .map(|timer| MasterTimer::Guarding(Duration::from_millis(u64::from(timer.millis))));
        let heartbeat = plan.watchdog(LifeSign::Heartbeat).map(|_| MasterTimer::Heartbeat);
        Self { rpdos: plan.watchdog(LifeSign::Rpdo).is_some(), master: guarding.or(heartbeat) }
    }

    /// Returns whether the master polls the node by remote frames (node guarding).
    pub(super) const fn is_guarded(&self) -> bool {
        matches!(self.master, Some(MasterTimer::Guarding(_)))
    }
}

/// Timers proven by a drive since its boot.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Proof {
    rpdos: bool,
    master: bool,
    /// Time of the last remote frame to it.
    polled: Option<Instant>,
}

impl Proof {
    /// Takes a remote frame of node guarding.
    pub(super) const fn on_poll(&mut self, at: Instant) {
        self.polled = Some(at);
    }

    /// Takes an EMCY: the error code of a lost master proves the timer. Life guarding starts with the first remote frame,
    /// and expires a life time after the last.
    pub(super) fn on_emergency(&mut self, timers: &DriveTimers, at: Instant, code: u16) {
        match (code, timers.master) {
            (error_codes::RPDO_TIMEOUT, _) => self.rpdos = true,
            (error_codes::MASTER_LOST, Some(MasterTimer::Heartbeat)) => self.master = true,
            (error_codes::MASTER_LOST, Some(MasterTimer::Guarding(life_time))) => {
                self.master |= self.polled.is_some_and(|polled| at >= polled + life_time);
            }
            _ => {}
        }
    }

    /// Returns whether the drive has at least one timer, and has proven every one.
    pub(super) const fn covers(&self, timers: &DriveTimers) -> bool {
        let DriveTimers { rpdos, master } = *timers;
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
            proof.on_emergency(&DriveTimers { rpdos: false, master: None }, Instant::ZERO, code);
        }
        assert!(!proof.covers(&DriveTimers { rpdos: false, master: None }));
        assert!(proof.covers(&DriveTimers { rpdos: true, master: None }));
    }
}
