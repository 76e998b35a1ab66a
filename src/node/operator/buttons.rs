//! Reference and reflection switches and the buttons of adjustments, debounced.
//!
//! A level counts when it has lasted for the debounce time of the [deadman](crate::operator::deadman), so a bouncing
//! contact is one press. While inputs of the switch box are missing, the last levels stay: their return is no edge. A
//! switch closed at power-up or at that return counts as open until it was released.

use crate::operator::deadman::DEBOUNCE_TIME;
use config::switch_inputs::SwitchInputs;
use units::adjustment::Adjustment;
use units::time::Instant;

/// All switches but the deadman.
#[derive(Clone, Copy, Debug)]
pub(super) struct Buttons {
    reference: Button,
    reflection: Button,
    adjusting: [AdjustingButton; 4],
}

/// Button with an adjustment.
#[derive(Clone, Copy, Debug)]
struct AdjustingButton {
    button: Button,
    adjustment: Option<Adjustment>,
    /// Closed since this cycle.
    is_pressed: bool,
}

impl Buttons {
    /// Returns all switches open, before the first message of the switch box; its buttons have these adjustments.
    pub(super) fn new(adjustments: [Option<Adjustment>; 4]) -> Self {
        let adjusting = adjustments.map(|adjustment| AdjustingButton {
            button: Button::new(),
            adjustment,
            is_pressed: false,
        });
        Self { reference: Button::new(), reflection: Button::new(), adjusting }
    }

    /// Takes the levels of this cycle; `None` if those of the switch box are missing or stale.
    pub(super) fn read(&mut self, now: Instant, inputs: Option<SwitchInputs>) {
        self.reference.read(now, inputs.map(|inputs| inputs.reference));
        self.reflection.read(now, inputs.map(|inputs| inputs.reflection));
        for (place, AdjustingButton { button, is_pressed, .. }) in
            self.adjusting.iter_mut().enumerate()
        {
            let was_closed = button.is_closed;
            let level = inputs.and_then(|inputs| inputs.buttons.get(place).copied());
            button.read(now, level);
            *is_pressed = button.is_closed && !was_closed;
        }
    }

    /// Returns the adjustments of the buttons that were pressed in this cycle.
    pub(super) fn pressed(self) -> impl Iterator<Item = Adjustment> {
        let pressed = self.adjusting.into_iter().filter(|button| button.is_pressed);
        pressed.filter_map(|button| button.adjustment)
    }

    /// Returns whether the reference switch is closed.
    pub(super) const fn reference(&self) -> bool {
        self.reference.is_closed
    }

    /// Returns whether the reflection switch is closed.
    pub(super) const fn reflection(&self) -> bool {
        self.reflection.is_closed
    }
}

/// Debouncing of one switch.
#[derive(Clone, Copy, Debug)]
struct Button {
    /// Level of the contact; `None` while it is unknown.
    level: Option<bool>,
    /// Time of the last change of the level.
    since: Instant,
    /// Debounced level.
    is_closed: bool,
    /// Stably open since the level was last unknown, so that closing counts.
    may_close: bool,
}

impl Button {
    const fn new() -> Self {
        Self { level: None, since: Instant::ZERO, is_closed: false, may_close: false }
    }

    fn read(&mut self, now: Instant, level: Option<bool>) {
        if level != self.level {
            (self.level, self.since) = (level, now);
        }
        let is_stable = now.since(self.since) >= DEBOUNCE_TIME;
        match level {
            None => self.may_close = false,
            Some(_) if !is_stable => {}
            Some(false) => (self.is_closed, self.may_close) = (false, true),
            Some(true) => self.is_closed |= self.may_close,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Returns the debounced levels of given ones, 1 ms each.
    fn closed(levels: impl IntoIterator<Item = Option<bool>>) -> Vec<bool> {
        let mut button = Button::new();
        let mut read = |(millis, level): (u64, Option<bool>)| {
            button.read(Instant::from_micros(millis * 1_000), level);
            button.is_closed
        };
        (0..).zip(levels).map(&mut read).collect()
    }

    fn presses(closed: &[bool]) -> usize {
        closed.windows(2).filter(|pair| !pair[0] && pair[1]).count()
    }

    fn held(level: Option<bool>, millis: usize) -> Vec<Option<bool>> {
        vec![level; millis]
    }

    #[test]
    fn switch_closed_for_25_ms_counts_then_and_not_before() {
        let levels = [held(Some(false), 30), held(Some(true), 30)].concat();
        assert_eq!(closed(levels).iter().position(|closed| *closed), Some(55));
        let levels = [held(Some(false), 30), held(Some(true), 25), held(Some(false), 9)].concat();
        assert_eq!(presses(&closed(levels)), 0, "24 ms are no press");
    }

    #[test]
    fn silence_of_any_length_makes_no_press_and_no_release() {
        for silent in [1, 15, 25, 500] {
            for level in [true, false] {
                let before = [held(Some(false), 30), held(Some(level), 30)].concat();
                let levels = [before, held(None, silent), held(Some(level), 60)].concat();
                let closed = closed(levels);
                assert!(closed[56..].iter().all(|closed| *closed == level), "{silent} ms, {level}");
            }
        }
    }

    #[test]
    fn switch_found_closed_counts_after_its_release() {
        for before in [vec![], [held(Some(false), 30), held(None, 20)].concat()] {
            let levels =
                [before, held(Some(true), 300), held(Some(false), 26), held(Some(true), 26)];
            let closed = closed(levels.concat());
            assert_eq!(presses(&closed), 1);
            assert!(closed.last().is_some_and(|closed| *closed));
        }
    }

    proptest! {
        #[test]
        fn bounce_of_20_ms_is_one_press_and_one_release(
            closing in prop::collection::vec(any::<bool>(), 20),
            opening in prop::collection::vec(any::<bool>(), 20),
        ) {
            let bounce = |levels: Vec<bool>| levels.into_iter().map(Some).collect::<Vec<_>>();
            let levels = [
                held(Some(false), 30), bounce(closing), held(Some(true), 60),
                bounce(opening), held(Some(false), 60),
            ];
            let closed = closed(levels.concat());
            prop_assert_eq!(presses(&closed), 1);
            prop_assert!(closed[80] && !closed[189]);
        }
    }
}
