//! Engagement by the deadman: both contacts settled open, then settled closed. Part of I3.

use std::time::Duration;

use crate::monitor::invariant::{Invariant, Moment};
use crate::monitor::mode_class::ModeClass;
use crate::monitor::sheet::Sheet;
use canopen::exchange::TpdoSample;
use config::switch_inputs::{Contacts, SwitchInputs};
use units::time::Instant;

/// Time for which both contacts must agree before they count: a contact bounces for 5 to 20 ms.
const SETTLING_TIME: Duration = Duration::from_millis(25);

/// Returns the least settling time that a node can measure, which reads the contacts once a cycle at both ends.
fn min_settling_time(sheet: &Sheet) -> Duration {
    SETTLING_TIME.saturating_sub(sheet.period * 2)
}

/// Contacts of the deadman as reported by the switch box, and their settling.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Grip {
    reported: Option<Contacts>,
    /// State of the contacts at the end of a cycle, and the time of its last change.
    contacts: Option<(Contacts, Instant)>,
    /// Set if the deadman has settled open, and has not engaged since.
    has_released: bool,
    is_engaged: bool,
}

impl Grip {
    /// Takes a report of the switch box.
    pub(super) fn on_tpdo(&mut self, sample: &TpdoSample) {
        self.reported =
            sample.inputs.map(|bits| SwitchInputs::from_bits(bits).deadman()).or(self.reported);
    }

    /// Takes the mode after a cycle.
    pub(super) fn on_mode(&mut self, moment: &mut Moment<'_>, mode: ModeClass) {
        let (sheet, at) = (moment.sheet, moment.at);
        let was_engaged = std::mem::replace(&mut self.is_engaged, mode == ModeClass::Engaged);
        if self.is_engaged && !was_engaged {
            self.check(moment);
        }
        let before = self.contacts.filter(|(contacts, _)| Some(*contacts) == self.reported);
        if before.is_none() {
            let was_open = self.contacts.filter(|(contacts, _)| *contacts == Contacts::Released);
            self.has_released |=
                was_open.is_some_and(|(_, since)| at.since(since) >= min_settling_time(sheet));
            self.contacts = self.reported.map(|contacts| (contacts, at));
        }
    }

    /// Checks an engagement.
    fn check(&mut self, moment: &mut Moment<'_>) {
        let pressed = match self.contacts {
            Some((Contacts::Pressed, since)) => moment.at.since(since),
            Some((Contacts::Released | Contacts::Disagreeing, _)) | None => Duration::ZERO,
        };
        if !std::mem::take(&mut self.has_released) {
            let what = "engaged by a deadman that was not released for 25 ms before";
            moment.violates(Invariant::Permitted, what);
        } else if pressed < min_settling_time(moment.sheet) {
            let millis = pressed.as_secs_f64() * 1e3;
            let what = format!("engaged {millis:.3} ms after the deadman's contacts closed");
            moment.violates(Invariant::Permitted, what);
        }
    }
}
