//! The deadman: two antivalent contacts, and what they say once they have come to rest.
//!
//! An opening counts at once, whichever contact tells of it. A closing counts when both contacts have said
//! so for a while, after both have said for a while that it was open: a contact that bounces, a deadman
//! that is closed when the power comes, and one that was lost from hearing engage nothing.

use std::time::Duration;

use crate::cause::Cause;
use config::switch_inputs::Deadman as Contacts;
use units::time::Instant;

/// For so long both contacts must say the same before it is believed: a contact bounces for 5 to 20 ms.
pub(super) const SETTLED_AFTER: Duration = Duration::from_millis(25);

/// Two antivalent contacts may disagree for so long while a finger moves.
const DISAGREEMENT: Duration = Duration::from_millis(50);

/// What the operator's hand does with the deadman.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnableState {
    /// The switch box is not heard.
    Silent,
    /// The contacts have not come to rest, or contradict each other.
    Moving,
    /// Open, for a while.
    Released,
    /// Closed, but not since it was seen open.
    Closed,
    /// Pressed by a hand that had released it before.
    Held,
}

/// The contacts, and since when they say what they say.
#[derive(Clone, Copy, Debug)]
pub struct Deadman {
    contacts: Option<Contacts>,
    since: Instant,
    enable_state: EnableState,
    /// It has been released, and not been held since: a closing counts.
    may_close: bool,
}

impl Deadman {
    /// Not heard yet.
    pub const fn unheard() -> Self {
        Self {
            contacts: None,
            since: Instant::ZERO,
            enable_state: EnableState::Silent,
            may_close: false,
        }
    }

    /// Takes what the contacts say now; `None` while the switch box is silent.
    pub fn read(&mut self, now: Instant, contacts: Option<Contacts>) {
        if contacts != self.contacts {
            (self.contacts, self.since) = (contacts, now);
        }
        let is_settled = now.since(self.since) >= SETTLED_AFTER;
        self.enable_state = match contacts {
            None => EnableState::Silent,
            Some(Contacts::Disagreeing) => EnableState::Moving,
            Some(Contacts::Released) if is_settled => EnableState::Released,
            Some(Contacts::Pressed) if self.enable_state == EnableState::Held => EnableState::Held,
            Some(Contacts::Pressed) if is_settled && self.may_close => EnableState::Held,
            Some(Contacts::Pressed) if is_settled => EnableState::Closed,
            Some(Contacts::Released | Contacts::Pressed) => EnableState::Moving,
        };
        self.may_close = match self.enable_state {
            EnableState::Released => true,
            EnableState::Silent | EnableState::Closed | EnableState::Held => false,
            EnableState::Moving => self.may_close,
        };
    }

    /// What the hand does with it.
    pub const fn enable_state(&self) -> EnableState {
        self.enable_state
    }

    /// A contact that sticks shows as two that contradict each other for longer than a finger takes.
    pub fn disagrees(&self, now: Instant) -> Option<Cause> {
        let is_for_long = now.since(self.since) > DISAGREEMENT;
        let disagrees = self.contacts == Some(Contacts::Disagreeing) && is_for_long;
        disagrees.then_some(Cause::DeadmanDisagrees)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const OPEN: Option<Contacts> = Some(Contacts::Released);
    const CLOSED: Option<Contacts> = Some(Contacts::Pressed);
    const TORN: Option<Contacts> = Some(Contacts::Disagreeing);

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    /// Reads the contacts every millisecond of a span.
    fn read(
        deadman: &mut Deadman,
        span: std::ops::RangeInclusive<u64>,
        contacts: Option<Contacts>,
    ) {
        span.for_each(|millis| deadman.read(at(millis), contacts));
    }

    fn held() -> Deadman {
        let mut deadman = Deadman::unheard();
        read(&mut deadman, 0..=25, OPEN);
        read(&mut deadman, 26..=51, CLOSED);
        assert_eq!(deadman.enable_state(), EnableState::Held);
        deadman
    }

    #[test]
    fn hazard_39_a_deadman_that_is_closed_at_power_up_is_not_held_before_it_was_released() {
        let mut deadman = Deadman::unheard();
        read(&mut deadman, 0..=1_000, CLOSED);
        assert_eq!(deadman.enable_state(), EnableState::Closed);
        read(&mut deadman, 1_001..=1_020, OPEN);
        read(&mut deadman, 1_021..=2_000, CLOSED);
        assert_eq!(deadman.enable_state(), EnableState::Closed, "20 ms are no release");
        read(&mut deadman, 2_001..=2_026, OPEN);
        read(&mut deadman, 2_027..=2_052, CLOSED);
        assert_eq!(deadman.enable_state(), EnableState::Held);
    }

    #[test]
    fn hazard_39_contacts_that_contradict_each_other_are_a_fault_after_fifty_milliseconds() {
        let mut deadman = held();
        read(&mut deadman, 100..=150, TORN);
        assert_eq!(deadman.disagrees(at(150)), None);
        deadman.read(at(151), TORN);
        assert_eq!(deadman.disagrees(at(151)), Some(Cause::DeadmanDisagrees));
        deadman.read(at(152), OPEN);
        assert_eq!(deadman.disagrees(at(152)), None);
    }

    proptest! {
        #[test]
        fn hazard_38_whatever_is_not_pressed_by_both_contacts_is_not_held(
            says in prop::collection::vec((0..4_u8, 1..40_u64), 1..60)
        ) {
            let mut deadman = Deadman::unheard();
            let mut millis = 0;
            let (mut open_for, mut closed_for, mut may_close) = (0, 0, false);
            for (contacts, span) in says {
                let contacts = [None, OPEN, CLOSED, TORN][usize::from(contacts)];
                for _ in 0..span {
                    millis += 1;
                    deadman.read(at(millis), contacts);
                    open_for = if contacts == OPEN { open_for + 1 } else { 0 };
                    closed_for = if contacts == CLOSED { closed_for + 1 } else { 0 };
                    may_close |= open_for > 25;
                    if deadman.enable_state() == EnableState::Held {
                        prop_assert!(may_close && closed_for > 25);
                    }
                }
            }
        }
    }

    #[test]
    fn hazard_39_a_contact_that_bounces_releases_at_once_and_holds_nothing_until_it_was_released() {
        for bounce in [OPEN, TORN, None] {
            let mut deadman = held();
            deadman.read(at(60), bounce);
            assert_ne!(deadman.enable_state(), EnableState::Held);
            read(&mut deadman, 61..=500, CLOSED);
            assert_ne!(deadman.enable_state(), EnableState::Held, "after {bounce:?}");
        }
    }
}
