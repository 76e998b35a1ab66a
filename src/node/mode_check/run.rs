//! Execution of the mode check in a boot.

use crate::mode_check::{Enabling, LOOK_TIME, POWER_OFF_TIMEOUT, RAISE_TIMEOUT};
use crate::{BringUpError, Node};
use bus::Bus;
use canopen::master::read_back::ObjectRead;
use canopen::object::Object;
use remote::Remote;
use units::numbering::Joint;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Enables each drive that displays its mode only then, alone and under its reduced torque limit, and disables it
    /// again. Then its planned torque limit is written.
    ///
    /// # Errors
    /// When a drive displays another mode or none, refuses its limit, a cause is raised, or `give_up` returns true.
    pub(crate) fn check_modes(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        let joints = self.mode_check.joints();
        self.mode_check.refused.clear();
        let checked = joints.iter().try_for_each(|joint| {
            self.mode_check.enabling = Enabling::Only(*joint);
            self.check_mode(*joint, give_up)
        });
        self.mode_check.enabling = Enabling::None;
        let raised = checked.and_then(|()| self.raise_limits(&joints, give_up));
        self.mode_check.enabling = Enabling::All;
        raised
    }

    /// Enables one drive, and disables it as soon as it has displayed its mode.
    fn check_mode(
        &mut self,
        joint: Joint,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        (self.mode_check.shown, self.mode_check.is_asked) = (None, false);
        let mut sync_at = self.enable(give_up)?;
        // It may have been enabled since the SYNC before.
        let until = sync_at + LOOK_TIME.saturating_sub(self.timing.period);
        loop {
            self.ask_mode(joint);
            let is_last = sync_at + self.timing.period * 2 >= until;
            if is_last {
                self.listen(until);
            } else {
                sync_at = self.cycle().at;
            }
            let is_right = self.mode_check.is_right(joint);
            if is_right || is_last || self.cause().is_some() {
                self.drives.power.keep_off(joint);
                self.network.master.power_off(
                    self.wire.read_clock(),
                    joint.into(),
                    &mut self.wire.out,
                );
                self.send_queued();
            }
            if let Some(cause) = self.cause() {
                return Err(BringUpError::NotEnabled(cause));
            }
            if is_right {
                return Ok(());
            }
            if is_last {
                return Err(self.mode_check.wrong(joint).map_or(BringUpError::GivenUp, Into::into));
            }
        }
    }

    /// Reads 6061h at once, unless an answer is awaited.
    fn ask_mode(&mut self, joint: Joint) {
        if self.mode_check.is_asked {
            return;
        }
        let (now, setting) = (self.wire.read_clock(), ObjectRead::unknown(Object::MODE_DISPLAY, 1));
        let master = &mut self.network.master;
        self.mode_check.is_asked = master.read_back(now, joint.into(), setting, &mut self.wire.out);
        self.send_queued();
        while let Some(telegram) = self.network.master.release() {
            self.send(telegram);
        }
    }

    /// Awaits that all drives are off, then writes the planned torque limits of these joints.
    fn raise_limits(
        &mut self,
        joints: &[Joint],
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        if joints.is_empty() {
            return Ok(());
        }
        let until = self.wire.read_clock() + POWER_OFF_TIMEOUT;
        while !self.is_off() && self.wire.read_clock() < until {
            self.cycle();
        }
        if !self.is_off() {
            return Err(BringUpError::GivenUp);
        }
        self.mode_check.raised = [false; 6];
        let until = self.wire.read_clock() + RAISE_TIMEOUT;
        loop {
            let now = self.wire.read_clock();
            // Refused while its last request is pending.
            for joint in joints.iter().filter(|joint| !*joint.entry(&self.mode_check.raised)) {
                self.network.master.raise_limits(now, (*joint).into(), &mut self.wire.out);
            }
            self.send_queued();
            if give_up() || now >= until {
                return Err(BringUpError::GivenUp);
            }
            self.cycle();
            if let Some(cause) = self.cause() {
                return Err(BringUpError::NotEnabled(cause));
            }
            if !self.mode_check.refused.is_empty() {
                return Err(BringUpError::Boot(std::mem::take(&mut self.mode_check.refused)));
            }
            if joints.iter().all(|joint| *joint.entry(&self.mode_check.raised)) {
                return Ok(());
            }
        }
    }
}
