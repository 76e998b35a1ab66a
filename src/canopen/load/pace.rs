//! How often a frame comes.
//!
//! Three figures, for three questions. *Planned*: what recurs by the clock (SYNC, event timers,
//! heartbeats); the load limit is for this, and leaves the rest of the bus to changes and chance.
//! *Busiest*: measured values, which may never stand still, as often as the inhibit time lets them. And
//! in a *window*: no more frames than so many, which response times are made of.

/// The share of time in which a joint moves and its measured values change.
pub const MOVING: f64 = 0.25;

/// The most changes in a row beyond what the event timer brings: as many as a drive's way from fault to
/// operation enabled has (CiA 402: fault reset, shutdown, switch on, enable operation).
const BURST: u64 = 4;

/// Microseconds in a second.
const SECOND_US: u32 = 1_000_000;

/// Nanoseconds in a microsecond.
const MICRO: u64 = 1_000;

/// How often a frame comes. Times are in µs; zero is taken as 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// By the clock.
    Clock {
        /// From one to the next.
        period_us: u32,
    },
    /// When something has changed.
    Change {
        /// The least time between two: the inhibit time.
        gap_us: u32,
        /// The longest time between two: the event timer.
        timer_us: Option<u32>,
        /// What changes.
        values: Values,
    },
    /// By chance: an emergency, a transfer somebody asks for. Not planned.
    Chance {
        /// The least time between two, as assumed.
        gap_us: u32,
    },
}

/// What makes a frame change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// States and switches: a change now and then, and at most four in a row.
    Rare,
    /// Measured values: new whenever one looks.
    Restless,
}

impl Pace {
    /// Frames in a second that are planned: those the clock sends. What measured values without an
    /// event timer send, nothing but the inhibit time says.
    pub fn planned_per_s(self) -> f64 {
        match self {
            Self::Clock { period_us } => per_s(period_us),
            Self::Change { gap_us, timer_us: None, values: Values::Restless } => per_s(gap_us),
            Self::Change { gap_us, timer_us, values: _ } => {
                timer_us.map_or(0.0, |timer_us| per_s(timer_us.max(gap_us)))
            }
            Self::Chance { .. } => 0.0,
        }
    }

    /// Frames in a second while the arm is used and nobody touches a switch.
    pub fn typical_per_s(self) -> f64 {
        let at_rest = self.planned_per_s();
        at_rest + MOVING * (self.busiest_per_s() - at_rest)
    }

    /// Frames in a second while everything that is measured changes all the time.
    pub fn busiest_per_s(self) -> f64 {
        match self {
            Self::Change { gap_us, values: Values::Restless, .. } => per_s(gap_us),
            Self::Clock { .. } | Self::Change { .. } | Self::Chance { .. } => self.planned_per_s(),
        }
    }

    /// Frames in a second as long as that may go on, chance included.
    pub fn sustained_per_s(self) -> f64 {
        match self {
            Self::Clock { period_us: gap_us }
            | Self::Chance { gap_us }
            | Self::Change { gap_us, values: Values::Restless, .. } => per_s(gap_us),
            Self::Change { gap_us, timer_us, values: Values::Rare } => {
                per_s(gap_us.max(timer_us.unwrap_or(SECOND_US)))
            }
        }
    }

    /// The most frames queued in any half-open window of `window_ns`, when each may be queued up to
    /// `jitter_ns` late: the smaller of ⌈(t + J) / T⌉ and, for rare changes, a burst of four more than the
    /// timer brings.
    pub fn most_in(self, window_ns: u64, jitter_ns: u64) -> u64 {
        let span = window_ns.saturating_add(jitter_ns);
        let (gap, burst) = self.buckets();
        let by_gap = span.div_ceil(gap);
        burst.map_or(by_gap, |timer| by_gap.min(BURST.saturating_add(span.div_ceil(timer))))
    }

    /// When, in ns after the first, frame number `instance` can be due at the earliest; the first is 0.
    pub fn earliest(self, instance: u64) -> u64 {
        let (gap, burst) = self.buckets();
        let by_gap = instance.saturating_mul(gap);
        burst.map_or(by_gap, |timer| {
            by_gap.max(instance.saturating_sub(BURST).saturating_mul(timer))
        })
    }

    /// The least gap in ns, and where changes are rare, the time in ns after which a burst has one more.
    fn buckets(self) -> (u64, Option<u64>) {
        match self {
            Self::Clock { period_us: gap_us }
            | Self::Chance { gap_us }
            | Self::Change { gap_us, values: Values::Restless, .. } => (ns(gap_us), None),
            Self::Change { gap_us, timer_us, values: Values::Rare } => {
                (ns(gap_us), Some(ns(gap_us.max(timer_us.unwrap_or(SECOND_US)))))
            }
        }
    }
}

fn per_s(period_us: u32) -> f64 {
    f64::from(SECOND_US) / f64::from(period_us.max(1))
}

fn ns(us: u32) -> u64 {
    u64::from(us.max(1)) * MICRO
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SWITCH: Pace =
        Pace::Change { gap_us: 1_000, timer_us: Some(5_000), values: Values::Rare };
    const TORQUE: Pace =
        Pace::Change { gap_us: 10_000, timer_us: Some(50_000), values: Values::Restless };

    #[test]
    fn changes_are_planned_by_their_timer() {
        assert_eq!(SWITCH.planned_per_s().to_string(), "200");
        assert_eq!(TORQUE.planned_per_s().to_string(), "20");
        let controlword = Pace::Change { gap_us: 10_000, timer_us: None, values: Values::Rare };
        assert_eq!(controlword.planned_per_s().to_string(), "0");
        let untimed = Pace::Change { gap_us: 10_000, timer_us: None, values: Values::Restless };
        assert_eq!(untimed.planned_per_s().to_string(), "100");
    }

    #[test]
    fn measured_values_come_as_often_as_they_may_while_they_change() {
        assert_eq!(TORQUE.typical_per_s().to_string(), "40");
        assert_eq!(TORQUE.busiest_per_s().to_string(), "100");
        assert_eq!(SWITCH.busiest_per_s().to_string(), "200");
    }

    #[test]
    fn chance_is_not_planned_but_counts_in_a_window() {
        let emergency = Pace::Chance { gap_us: 100_000 };
        assert_eq!(emergency.planned_per_s().to_string(), "0");
        assert_eq!(emergency.most_in(1, 0), 1);
    }

    #[test]
    fn a_burst_ends() {
        // Five at 1 ms each, then as the timer says.
        let ms = |ms: u64| SWITCH.most_in(ms * 1_000_000, 0);
        assert_eq!([ms(1), ms(3), ms(5), ms(6), ms(10), ms(11)], [1, 3, 5, 6, 6, 7]);
        assert_eq!(SWITCH.earliest(4), 4_000_000);
        assert_eq!(SWITCH.earliest(6), 10_000_000);
    }

    fn pace() -> impl Strategy<Value = Pace> {
        let values = prop_oneof![Just(Values::Rare), Just(Values::Restless)];
        let timer = prop::option::of(0_u32..200_000);
        prop_oneof![
            any::<u32>().prop_map(|period_us| Pace::Clock { period_us }),
            any::<u32>().prop_map(|gap_us| Pace::Chance { gap_us }),
            (0_u32..50_000, timer, values).prop_map(|(gap_us, timer_us, values)| Pace::Change {
                gap_us,
                timer_us,
                values
            }),
        ]
    }

    proptest! {
        #[test]
        fn a_frame_is_due_when_the_window_has_room_for_it(pace in pace(), instance in 0_u64..500) {
            let due = pace.earliest(instance);
            prop_assert!(pace.most_in(due, 0) <= instance);
            prop_assert!(pace.most_in(due + 1, 0) > instance);
        }

        #[test]
        fn a_longer_window_holds_no_fewer(pace in pace(), window in any::<u32>(), more in any::<u32>()) {
            let window = u64::from(window);
            prop_assert!(pace.most_in(window, 0) <= pace.most_in(window, u64::from(more)));
        }

        #[test]
        fn what_is_planned_can_be_sustained(pace in pace()) {
            prop_assert!(pace.planned_per_s() <= pace.busiest_per_s());
            prop_assert!(pace.busiest_per_s() <= pace.sustained_per_s());
        }
    }
}
