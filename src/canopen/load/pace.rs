//! Frequency of a frame.
//!
//! Three figures answer three questions. *Planned* counts periodic frames (SYNC, event timers, heartbeats); the load
//! limit applies to them. *Busiest* adds measured values at their inhibit time. The maximum count in a *window* serves
//! the response time analysis.

/// Share of time in which a joint moves and its measured values change.
pub const MOVING: f64 = 0.25;

/// Maximum burst beyond the event timer: the transitions of a drive from fault to operation enabled (CiA 402:
/// fault reset, shutdown, switch on, enable operation).
const BURST: u64 = 4;

/// Microseconds per second.
const SECOND_US: u32 = 1_000_000;

/// Nanoseconds per microsecond.
const MICRO: u64 = 1_000;

/// Frequency of a frame. Times are in µs; zero counts as 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Periodic.
    Clock {
        /// Time between two frames.
        period_us: u32,
    },
    /// Sent on change of a mapped value.
    Change {
        /// Inhibit time: minimum time between two frames.
        gap_us: u32,
        /// Event timer: maximum time between two frames.
        timer_us: Option<u32>,
        /// Kind of values.
        values: Values,
    },
    /// Sporadic: an emergency, or a requested transfer. Not planned.
    Chance {
        /// Assumed minimum time between two frames.
        gap_us: u32,
    },
}

/// Kind of values in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// States and switches: rare changes, in bursts of at most four.
    Rare,
    /// Measured values: different at every sample.
    Varying,
}

impl Pace {
    /// Planned frames per second: periodic ones. Measured values without an event timer count at their inhibit
    /// time.
    pub fn planned_per_s(self) -> f64 {
        match self {
            Self::Clock { period_us } => per_s(period_us),
            Self::Change { gap_us, timer_us: None, values: Values::Varying } => per_s(gap_us),
            Self::Change { gap_us, timer_us, values: _ } => {
                timer_us.map_or(0.0, |timer_us| per_s(timer_us.max(gap_us)))
            }
            Self::Chance { .. } => 0.0,
        }
    }

    /// Frames per second while the arm is used and no switch is pressed.
    pub fn typical_per_s(self) -> f64 {
        let at_rest = self.planned_per_s();
        at_rest + MOVING * (self.busiest_per_s() - at_rest)
    }

    /// Frames per second while all measured values change permanently.
    pub fn busiest_per_s(self) -> f64 {
        match self {
            Self::Change { gap_us, values: Values::Varying, .. } => per_s(gap_us),
            Self::Clock { .. } | Self::Change { .. } | Self::Chance { .. } => self.planned_per_s(),
        }
    }

    /// Maximum sustained frames per second, sporadic ones included.
    pub fn sustained_per_s(self) -> f64 {
        match self {
            Self::Clock { period_us: gap_us }
            | Self::Chance { gap_us }
            | Self::Change { gap_us, values: Values::Varying, .. } => per_s(gap_us),
            Self::Change { gap_us, timer_us, values: Values::Rare } => {
                per_s(gap_us.max(timer_us.unwrap_or(SECOND_US)))
            }
        }
    }

    /// Maximum number of frames queued in a half-open window of `window_ns`, each up to `jitter_ns` late. It is
    /// ⌈(t + J) / T⌉; for rare changes at most the count of the event timer plus a burst of four.
    pub fn max_in(self, window_ns: u64, jitter_ns: u64) -> u64 {
        let span = window_ns.saturating_add(jitter_ns);
        let (gap, burst) = self.buckets();
        let by_gap = span.div_ceil(gap);
        burst.map_or(by_gap, |timer| by_gap.min(BURST.saturating_add(span.div_ceil(timer))))
    }

    /// Earliest release of frame `instance`, in ns after frame 0.
    pub fn earliest(self, instance: u64) -> u64 {
        let (gap, burst) = self.buckets();
        let by_gap = instance.saturating_mul(gap);
        burst.map_or(by_gap, |timer| {
            by_gap.max(instance.saturating_sub(BURST).saturating_mul(timer))
        })
    }

    /// Minimum gap in ns, and for rare changes the time in ns after which a burst gains one frame.
    fn buckets(self) -> (u64, Option<u64>) {
        match self {
            Self::Clock { period_us: gap_us }
            | Self::Chance { gap_us }
            | Self::Change { gap_us, values: Values::Varying, .. } => (ns(gap_us), None),
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
        Pace::Change { gap_us: 10_000, timer_us: Some(50_000), values: Values::Varying };

    #[test]
    fn changes_are_planned_by_their_timer() {
        assert_eq!(SWITCH.planned_per_s().to_string(), "200");
        assert_eq!(TORQUE.planned_per_s().to_string(), "20");
        let controlword = Pace::Change { gap_us: 10_000, timer_us: None, values: Values::Rare };
        assert_eq!(controlword.planned_per_s().to_string(), "0");
        let untimed = Pace::Change { gap_us: 10_000, timer_us: None, values: Values::Varying };
        assert_eq!(untimed.planned_per_s().to_string(), "100");
    }

    #[test]
    fn changing_measured_values_come_at_their_inhibit_time() {
        assert_eq!(TORQUE.typical_per_s().to_string(), "40");
        assert_eq!(TORQUE.busiest_per_s().to_string(), "100");
        assert_eq!(SWITCH.busiest_per_s().to_string(), "200");
    }

    #[test]
    fn sporadic_frames_are_not_planned_but_count_in_a_window() {
        let emergency = Pace::Chance { gap_us: 100_000 };
        assert_eq!(emergency.planned_per_s().to_string(), "0");
        assert_eq!(emergency.max_in(1, 0), 1);
    }

    #[test]
    fn burst_is_limited() {
        // Five frames at 1 ms each, then at the event timer.
        let ms = |ms: u64| SWITCH.max_in(ms * 1_000_000, 0);
        assert_eq!([ms(1), ms(3), ms(5), ms(6), ms(10), ms(11)], [1, 3, 5, 6, 6, 7]);
        assert_eq!(SWITCH.earliest(4), 4_000_000);
        assert_eq!(SWITCH.earliest(6), 10_000_000);
    }

    fn pace() -> impl Strategy<Value = Pace> {
        let values = prop_oneof![Just(Values::Rare), Just(Values::Varying)];
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
        fn frame_is_due_when_the_window_admits_it(pace in pace(), instance in 0_u64..500) {
            let due = pace.earliest(instance);
            prop_assert!(pace.max_in(due, 0) <= instance);
            prop_assert!(pace.max_in(due + 1, 0) > instance);
        }

        #[test]
        fn longer_window_holds_no_fewer(pace in pace(), window in any::<u32>(), more in any::<u32>()) {
            let window = u64::from(window);
            prop_assert!(pace.max_in(window, 0) <= pace.max_in(window, u64::from(more)));
        }

        #[test]
        fn planned_rate_is_sustainable(pace in pace()) {
            prop_assert!(pace.planned_per_s() <= pace.busiest_per_s());
            prop_assert!(pace.busiest_per_s() <= pace.sustained_per_s());
        }
    }
}
