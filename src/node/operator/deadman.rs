//! Deadman switch: two antivalent contacts, debounced.
//!
//! Opening of either contact releases at once. Closing counts when both contacts have been stable, after both were stably
//! open. A bouncing contact, a deadman closed at power-up and one that returns after a loss of its messages enable
//! nothing.

use std::time::Duration;

use crate::cause::Cause;
use config::switch_inputs::Contacts;
use units::time::Instant;

/// Time for which contacts must be stable to count: they bounce for 5 to 20 ms.
pub(super) const DEBOUNCE_TIME: Duration = Duration::from_millis(25);

/// Maximum discrepancy time of the two contacts (ISO 13849-1): they switch one after the other.
const MAX_DISCREPANCY_TIME: Duration = Duration::from_millis(50);

/// State of the deadman.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnableState {
    /// Inputs of the switch box missing or stale.
    Silent,
    /// Contacts bounce or disagree: not stable for 25 ms yet.
    Unsettled,
    /// Stably open.
    Released,
    /// Stably closed, without a stable release before: enables nothing.
    ClosedWithoutRelease,
    /// Stably closed after a release: the only state that enables.
    Held,
}

/// Debouncing of the contacts.
#[derive(Clone, Copy, Debug)]
pub struct Deadman {
    contacts: Option<Contacts>,
    /// Time of the last change of the contacts.
    since: Instant,
    enable_state: EnableState,
    /// Released since it was last held, so that closing counts.
    may_close: bool,
}

impl Deadman {
    /// Returns the deadman before the first message of the switch box.
    pub const fn silent() -> Self {
        Self {
            contacts: None,
            since: Instant::ZERO,
            enable_state: EnableState::Silent,
            may_close: false,
        }
    }

    /// Takes the contacts of this cycle; `None` if those of the switch box are missing or stale.
    pub fn read(&mut self, now: Instant, contacts: Option<Contacts>) {
        if contacts != self.contacts {
            (self.contacts, self.since) = (contacts, now);
        }
        let is_stable = now.since(self.since) >= DEBOUNCE_TIME;
        self.enable_state = match contacts {
            None => EnableState::Silent,
            Some(Contacts::Disagreeing) => EnableState::Unsettled,
            Some(Contacts::Released) if is_stable => EnableState::Released,
            Some(Contacts::Pressed) if self.enable_state == EnableState::Held => EnableState::Held,
            Some(Contacts::Pressed) if is_stable && self.may_close => EnableState::Held,
            Some(Contacts::Pressed) if is_stable => EnableState::ClosedWithoutRelease,
            Some(Contacts::Released | Contacts::Pressed) => EnableState::Unsettled,
        };
        self.may_close = match self.enable_state {
            EnableState::Released => true,
            EnableState::Silent | EnableState::ClosedWithoutRelease | EnableState::Held => false,
            EnableState::Unsettled => self.may_close,
        };
    }

    /// Returns the debounced state.
    pub const fn enable_state(&self) -> EnableState {
        self.enable_state
    }

    /// Returns the cause of a stop if the contacts disagree for too long: one of them sticks.
    pub fn check_discrepancy(&self, now: Instant) -> Option<Cause> {
        let is_too_long = now.since(self.since) > MAX_DISCREPANCY_TIME;
        let disagrees = self.contacts == Some(Contacts::Disagreeing) && is_too_long;
        disagrees.then_some(Cause::DeadmanDisagrees)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const OPEN: Option<Contacts> = Some(Contacts::Released);
    const CLOSED: Option<Contacts> = Some(Contacts::Pressed);
    const DISAGREEING: Option<Contacts> = Some(Contacts::Disagreeing);

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    /// Reads the contacts in every millisecond of `span`.
    fn read(
        deadman: &mut Deadman,
        span: std::ops::RangeInclusive<u64>,
        contacts: Option<Contacts>,
    ) {
        span.for_each(|millis| deadman.read(at(millis), contacts));
    }

    fn held() -> Deadman {
        let mut deadman = Deadman::silent();
        read(&mut deadman, 0..=25, OPEN);
        read(&mut deadman, 26..=51, CLOSED);
        assert_eq!(deadman.enable_state(), EnableState::Held);
        deadman
    }

    #[test]
    fn hazard_39_deadman_closed_at_power_up_counts_once_released() {
        let mut deadman = Deadman::silent();
        read(&mut deadman, 0..=1_000, CLOSED);
        assert_eq!(deadman.enable_state(), EnableState::ClosedWithoutRelease);
        read(&mut deadman, 1_001..=1_020, OPEN);
        read(&mut deadman, 1_021..=2_000, CLOSED);
        assert_eq!(
            deadman.enable_state(),
            EnableState::ClosedWithoutRelease,
            "20 ms are no release"
        );
        read(&mut deadman, 2_001..=2_026, OPEN);
        read(&mut deadman, 2_027..=2_052, CLOSED);
        assert_eq!(deadman.enable_state(), EnableState::Held);
    }

    #[test]
    fn hazard_39_contacts_that_disagree_for_50_ms_are_a_fault() {
        let mut deadman = held();
        read(&mut deadman, 100..=150, DISAGREEING);
        assert_eq!(deadman.check_discrepancy(at(150)), None);
        deadman.read(at(151), DISAGREEING);
        assert_eq!(deadman.check_discrepancy(at(151)), Some(Cause::DeadmanDisagrees));
        deadman.read(at(152), OPEN);
        assert_eq!(deadman.check_discrepancy(at(152)), None);
    }

    proptest! {
        #[test]
        fn hazard_38_deadman_not_closed_by_both_contacts_is_not_held(
            inputs in prop::collection::vec((0..4_u8, 1..40_u64), 1..60)
        ) {
            let mut deadman = Deadman::silent();
            let mut millis = 0;
            let (mut open_for, mut closed_for, mut may_close) = (0, 0, false);
            for (contacts, span) in inputs {
                let contacts = [None, OPEN, CLOSED, DISAGREEING][usize::from(contacts)];
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
    fn hazard_39_bounce_releases_until_the_next_release_and_press() {
        for bounce in [OPEN, DISAGREEING, None] {
            let mut deadman = held();
            deadman.read(at(60), bounce);
            assert_ne!(deadman.enable_state(), EnableState::Held);
            read(&mut deadman, 61..=500, CLOSED);
            assert_ne!(deadman.enable_state(), EnableState::Held, "after {bounce:?}");
        }
    }
}
