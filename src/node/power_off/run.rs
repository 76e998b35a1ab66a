//! Confirmation of power off as the node runs it in each cycle.

use crate::Node;
use crate::cause::Cause;
use crate::power_off::{Action, PowerOffState, Stage, View};
use bus::Bus;
use canopen::drive::Statusword;
use canopen::master::event::{Event, PowerOffStep};
use remote::Remote;
use units::numbering::Joint;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Returns the drives that did not confirm power off, with their last statuswords.
    pub(crate) fn unconfirmed(&self) -> PowerOffState {
        let statuswords = self.samples.latest().each_ref().map(|sample| sample.statusword);
        PowerOffState { stages: self.power_off.stages, statuswords }
    }

    /// Restores them after a boot that has failed, unless they have sent a statusword since. Its boot over, a node that
    /// failed is not read again: the next reset does that.
    pub(crate) fn restore_unconfirmed(&mut self, before: &PowerOffState) {
        for (joint, (stage, statusword)) in
            Joint::each(before.stages.iter().zip(&before.statuswords))
        {
            if matches!(stage, Stage::Taken(..)) && !self.samples.is_status_known(joint) {
                self.samples.restore_statusword(joint, *statusword);
                self.drives.power.keep_off(joint);
                *joint.entry_mut(&mut self.power_off.stages) = *stage;
            }
        }
    }

    /// Takes at most one step towards a drive that does not confirm power off; returns whether it sent a frame.
    pub(crate) fn confirm_power_off(&mut self, sync_at: Instant) -> bool {
        let now = self.wire.now();
        let fresh = self.samples.fresh();
        let must_be_off = self.drives.power.must_be_off();
        let latest = self.samples.latest();
        let views = Joint::ALL.map(|joint| View {
            must_be_off: *joint.entry(&must_be_off),
            statusword: joint.entry(latest).statusword,
            is_fresh: *joint.entry(&fresh),
        });
        if let Some((joint, step)) = self.power_off.confirmed(&views) {
            self.log_event(Event::PowerOffConfirmed { node: joint.into(), step });
        }
        let is_stopped = self.mode().is_stopped();
        let Some((joint, action)) = self.power_off.advance(now, sync_at, &views, is_stopped) else {
            return false;
        };
        match action {
            Action::ReadStatusword => {
                let out = &mut self.wire.out;
                self.network.master.read_statusword_at_once(now, joint.into(), out);
            }
            Action::Take(step) => self.take_step(now, joint, joint.entry(&views).statusword, step),
        }
        self.send_queued();
        true
    }

    /// Queues the frames of a step, and raises a cause from the second one on: the drive does not obey.
    fn take_step(
        &mut self,
        now: Instant,
        joint: Joint,
        statusword: Statusword,
        step: PowerOffStep,
    ) {
        let node = joint.into();
        self.log_event(Event::StillOn { node, statusword, step });
        let (master, out) = (&mut self.network.master, &mut self.wire.out);
        match step {
            PowerOffStep::Download => {
                self.drives.power.keep_off(joint);
                return master.power_off(now, node, out);
            }
            PowerOffStep::NmtStop => master.stop_node(node, out),
            PowerOffStep::PreOperational => {
                master.set_pre_operational(node, out);
                master.read_statusword_at_once(now, node, out);
            }
            PowerOffStep::NoErrorControl => self.network.end_error_control(),
        }
        let Statusword(statusword) = statusword;
        self.raise(now, [Some(Cause::NotOff { joint, statusword })]);
    }
}
