//! Watch of the zeros while the node runs: events and samples that make one unknown.

use crate::Node;
use crate::cause::Cause;
use crate::zero::{UnknownZero, ZeroState};
use bus::Bus;
use canopen::master::event::Event;
use remote::Remote;
use units::numbering::Joint;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Takes an event of the master: a zero may be lost, and the rest posture required again.
    pub(crate) fn watch_zero_event(&mut self, event: &Event) {
        self.homing.on_event(event);
        if let Some(joint) = self.zeros.on_event(event) {
            self.rest.require(joint);
        }
    }

    /// Watches the samples of this cycle.
    pub(crate) fn watch_zeros(&mut self, now: Instant) {
        let (latest, fresh) = (self.samples.latest(), self.samples.fresh());
        self.zeros.on_samples(now, latest, &fresh);
        let (silent, jumped) = (self.samples.silent(), self.samples.jumped());
        for joint in Joint::ALL {
            let why = match (*joint.entry(&silent), *joint.entry(&jumped)) {
                (_, true) => UnknownZero::Jumped,
                (true, false) => UnknownZero::SamplesMissing,
                (false, false) => continue,
            };
            self.zeros.lose(joint, why);
            self.rest.require(joint);
        }
    }

    /// Returns the cause of a zero that was lost while torque acts.
    pub(crate) fn unknown_zero(&self) -> Option<Cause> {
        if !self.mode().allows_torque() {
            return None;
        }
        let is_unknown = |state: &&ZeroState| **state != ZeroState::Known;
        let (joint, _) = Joint::each(self.zeros.states()).find(|(_, state)| is_unknown(state))?;
        Some(Cause::ZeroUnknown { joint })
    }
}
