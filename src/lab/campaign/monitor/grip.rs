//! When the deadman may engage: both contacts settled open, then settled closed. Part of I3.

use std::time::Duration;

use crate::campaign::monitor::law::Breaches;
use crate::campaign::monitor::law::Law;
use crate::campaign::monitor::sheet::Sheet;
use canopen::exchange::Told as Heard;
use config::switch_inputs::Deadman;
use config::switch_inputs::SwitchInputs;
use node::record::Mode;
use units::time::Instant;

/// Time both contacts must say the same before they count: a contact bounces for 5 to 20 ms.
const SETTLING: Duration = Duration::from_millis(25);

/// The same as a node can see it: it reads the contacts once a cycle, at both ends.
fn least(sheet: &Sheet) -> Duration {
    SETTLING.saturating_sub(sheet.period * 2)
}

/// The deadman's contacts as the switch box reports them, and the mode they led to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Grip {
    reported: Option<Deadman>,
    /// What they said at the end of a cycle, and since when.
    contacts: Option<(Deadman, Instant)>,
    /// It has been open for as long as contacts settle, and was not held since.
    has_released: bool,
    is_engaged: bool,
}

impl Grip {
    /// Takes a report of the switch box.
    pub(super) fn on_tpdo(&mut self, heard: &Heard) {
        self.reported =
            heard.inputs.map(|bits| SwitchInputs::from_bits(bits).deadman()).or(self.reported);
    }

    /// Takes the mode after a cycle.
    pub(super) fn told(&mut self, sheet: &Sheet, at: Instant, mode: Mode, breaches: &mut Breaches) {
        let was_engaged = std::mem::replace(&mut self.is_engaged, mode == Mode::Engaged);
        if self.is_engaged && !was_engaged {
            self.judge(sheet, at, breaches);
        }
        let before = self.contacts.filter(|(contacts, _)| Some(*contacts) == self.reported);
        if before.is_none() {
            let was_open = self.contacts.filter(|(contacts, _)| *contacts == Deadman::Released);
            self.has_released |= was_open.is_some_and(|(_, since)| at.since(since) >= least(sheet));
            self.contacts = self.reported.map(|contacts| (contacts, at));
        }
    }

    /// The node has just engaged.
    fn judge(&mut self, sheet: &Sheet, at: Instant, breaches: &mut Breaches) {
        let pressed = match self.contacts {
            Some((Deadman::Pressed, since)) => at.since(since),
            Some((Deadman::Released | Deadman::Disagreeing, _)) | None => Duration::ZERO,
        };
        if !std::mem::take(&mut self.has_released) {
            let what = "engaged by a deadman that was not released for 25 ms before".to_owned();
            breaches.add(Law::Permitted, at, what);
        } else if pressed < least(sheet) {
            let millis = pressed.as_secs_f64() * 1e3;
            let what = format!("engaged {millis:.3} ms after the deadman's contacts closed");
            breaches.add(Law::Permitted, at, what);
        }
    }
}
