//! Worst-case response time of every frame of a bus: Davis, Burns, Bril and Lukkien, "Controller Area Network
//! (CAN) schedulability analysis: Refuted, revisited and revised" (Real-Time Systems 35, 2007).
//!
//! Frame m has C bits and is released up to J late. It waits for at most one frame of lower priority, B, and for all
//! frames of higher priority. All its instances in the busy period count:
//!
//! ```text
//! t = B + E(t) + Σ η_k(t) C_k                    over k of m's priority and above: the busy period
//! w = B + E(w + C) + q C + Σ η_k(w + τ) C_k      over k above m: start of instance q
//! R = max J + w - δ(q) + C                       over all q released in the busy period
//! ```
//!
//! η_k(t) is the maximum number of frames in a window, ⌈(t + J_k) / T_k⌉ for a periodic one. δ(q) is the earliest
//! release of instance q, τ one bit. E(t) is the cost of errors: every T_err an error frame of at most 31 bits and the
//! longest frame again.
//!
//! Drivers are assumed to send by priority. The master, whose driver may send in order of queueing, queues
//! heartbeat and SDO after the RPDOs of a cycle.

use std::time::Duration;

use crate::load::pace::Pace;

/// Maximum bits of an error frame with its recovery.
const ERROR_BITS: u64 = 31;

/// Nanoseconds per second, and per microsecond.
const SECOND: u64 = 1_000_000_000;
const MICRO: u64 = 1_000;

/// Busy period taken as endless, in ns.
const HORIZON: u64 = 2 * SECOND;

/// Maximum iterations towards a fixed point.
const MAX_STEPS: u32 = 200_000;

/// Frame that takes part in arbitration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contender {
    /// Identifier; the lower one has the higher priority.
    pub cob_id: u16,
    /// Length, in bits.
    pub bits: u32,
    /// Frequency.
    pub pace: Pace,
    /// Queueing jitter, in µs.
    pub jitter_us: u32,
}

/// Worst-case response time of each contender, in their order; `None` if unbounded because the bus is
/// overloaded. `error_gap_us` is the minimum time between two bit errors, `None` for an error-free bus.
pub fn responses(
    contenders: &[Contender],
    bitrate: u32,
    error_gap_us: Option<u32>,
) -> Vec<Option<Duration>> {
    let bit_ns = SECOND / u64::from(bitrate.clamp(1, 1_000_000_000));
    let bound = |place: usize| Analysis::new(contenders, place, bit_ns, error_gap_us)?.bound();
    (0..contenders.len()).map(|place| bound(place).map(Duration::from_nanos)).collect()
}

/// Frame under analysis, and the frames that may delay it. Times in ns.
struct Analysis<'c> {
    frame: &'c Contender,
    length: u64,
    higher: Vec<&'c Contender>,
    blocking: u64,
    bit_ns: u64,
    error_gap: Option<u64>,
    retransmitted: u64,
}

impl<'c> Analysis<'c> {
    fn new(
        contenders: &'c [Contender],
        place: usize,
        bit_ns: u64,
        error_gap_us: Option<u32>,
    ) -> Option<Self> {
        let frame = contenders.get(place)?;
        let others = contenders.iter().enumerate().filter(|(other, _)| *other != place);
        let (higher, lower): (Vec<_>, Vec<_>) =
            others.map(|(_, other)| other).partition(|other| other.cob_id <= frame.cob_id);
        let time = |contender: &Contender| u64::from(contender.bits) * bit_ns;
        let longest = |of: &[&Contender]| of.iter().map(|other| time(other)).max().unwrap_or(0);
        Some(Self {
            frame,
            length: time(frame),
            blocking: longest(&lower),
            retransmitted: longest(&higher).max(time(frame)),
            higher,
            bit_ns,
            error_gap: error_gap_us.map(|us| u64::from(us.max(1)) * MICRO),
        })
    }

    /// Worst-case response time.
    fn bound(&self) -> Option<u64> {
        if self.share() >= 1.0 {
            return None;
        }
        let mut steps = MAX_STEPS;
        let busy = self.busy_period(&mut steps)?;
        let instances = max_instances(self.frame, busy);
        let mut start = self.blocking;
        let mut longest = 0;
        for instance in 0..instances {
            start = self.start(instance, start, &mut steps)?;
            let end = jitter(self.frame).saturating_add(start).saturating_add(self.length);
            let response = end.saturating_sub(self.frame.pace.earliest(instance));
            longest = longest.max(response);
        }
        Some(longest)
    }

    /// Share of bus time for this frame, those above it, and errors.
    fn share(&self) -> f64 {
        let bit_s = Duration::from_nanos(self.bit_ns).as_secs_f64();
        let frames = self.higher.iter().copied().chain([self.frame]);
        let of = |other: &Contender| f64::from(other.bits) * bit_s * other.pace.sustained_per_s();
        let errors = self.error_gap.map_or(0.0, |gap| {
            let each = Duration::from_nanos(ERROR_BITS * self.bit_ns + self.retransmitted);
            each.as_secs_f64() / Duration::from_nanos(gap).as_secs_f64()
        });
        frames.map(of).sum::<f64>() + errors
    }

    /// Maximum uninterrupted busy period of this priority and above.
    fn busy_period(&self, steps: &mut u32) -> Option<u64> {
        fixed_point(self.length, steps, |busy| {
            let own = max_instances(self.frame, busy).saturating_mul(self.length);
            let others = self.interference(busy);
            self.blocking
                .saturating_add(self.errors(busy))
                .saturating_add(own.saturating_add(others))
        })
    }

    /// Latest start of `instance` in the busy period; not before `from`.
    fn start(&self, instance: u64, from: u64, steps: &mut u32) -> Option<u64> {
        let own = instance.saturating_mul(self.length);
        fixed_point(from, steps, |start| {
            let others = self.interference(start.saturating_add(self.bit_ns));
            let errors = self.errors(start.saturating_add(self.length));
            self.blocking.saturating_add(errors).saturating_add(own.saturating_add(others))
        })
    }

    /// Time of higher priorities in a window.
    fn interference(&self, window: u64) -> u64 {
        let time = |other: &&Contender| {
            max_instances(other, window).saturating_mul(u64::from(other.bits) * self.bit_ns)
        };
        self.higher.iter().map(time).fold(0, u64::saturating_add)
    }

    /// Time of errors in a window.
    fn errors(&self, window: u64) -> u64 {
        let each = ERROR_BITS * self.bit_ns + self.retransmitted;
        self.error_gap.map_or(0, |gap| window.div_ceil(gap).saturating_mul(each))
    }
}

/// Maximum instances of `contender` in a window.
fn max_instances(contender: &Contender, window: u64) -> u64 {
    contender.pace.max_in(window, jitter(contender))
}

fn jitter(contender: &Contender) -> u64 {
    u64::from(contender.jitter_us) * MICRO
}

/// Fixed point of `next`; `None` beyond the horizon or after too many steps. `next` is monotonic and `from` not
/// above the fixed point.
fn fixed_point(from: u64, steps: &mut u32, next: impl Fn(u64) -> u64) -> Option<u64> {
    let mut now = from;
    loop {
        let then = next(now);
        if then <= now {
            return Some(now);
        }
        *steps = steps.checked_sub(1)?;
        if then > HORIZON {
            return None;
        }
        now = then;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::bits;
    use crate::load::pace::Values;

    const MBIT: u32 = 1_000_000;

    fn clock(cob_id: u16, bytes: u32, period_us: u32, jitter_us: u32) -> Contender {
        let pace = Pace::Clock { period_us };
        Contender { cob_id, bits: bits::worst_case(bytes), pace, jitter_us }
    }

    fn micros(contenders: &[Contender]) -> Vec<Option<u128>> {
        let bounds = responses(contenders, MBIT, None);
        bounds.into_iter().map(|bound| bound.map(|bound| bound.as_micros())).collect()
    }

    /// Streams of SYNC, and of TPDOs and RPDOs with this size and number at every SYNC. TPDOs are up to 100 µs late. Each
    /// node adds an EMCY message and a heartbeat every 100 ms. An SDO request and its reply are sent every 10 ms.
    fn layout(
        period_us: u32,
        [tpdo, nodes]: [u16; 2],
        [rpdo, rpdos]: [u16; 2],
        emergencies: u16,
    ) -> Vec<Contender> {
        let (tpdo, rpdo) = (u32::from(tpdo), u32::from(rpdo));
        let mut all = vec![clock(0x80, 0, period_us, 0)];
        all.extend((1..=nodes).map(|node| clock(0x180 + node, tpdo, period_us, 100)));
        all.extend((1..=nodes).map(|node| clock(emergencies + node, 8, 100_000, 0)));
        all.extend((1..=nodes).map(|node| clock(0x700 + node, 1, 100_000, 0)));
        all.extend([0x581, 0x601].map(|id| clock(id, 8, 10_000, 0)));
        all.extend((1..=rpdos).map(|place| clock(0x200 + place, rpdo, period_us, 0)));
        all
    }

    #[test]
    fn responses_match_an_independent_program() {
        // Response of the last RPDO, in µs, with EMCY at 80h + node and at 680h + node. Rows differ in period, and in
        // size and number of the PDOs.
        for (period_us, [tpdo, nodes], [rpdo, rpdos], expected) in [
            (2_000, [6, 6], [2, 6], [3_260, 1_330]),
            (1_250, [4, 6], [2, 6], [6_020, 1_210]),
            (1_000, [4, 6], [6, 2], [4_760, 990]),
            (1_000, [8, 3], [8, 3], [2_865, 1_000]),
            (1_000, [6, 3], [4, 3], [1_815, 820]),
            (1_000, [6, 3], [2, 3], [1_715, 760]),
            (1_000, [6, 3], [6, 1], [1_455, 650]),
        ] {
            let last = [0x80, 0x680].map(|emergencies| {
                let frames = layout(period_us, [tpdo, nodes], [rpdo, rpdos], emergencies);
                *micros(&frames).last().unwrap()
            });
            assert_eq!(last, expected.map(Some), "{nodes} of {tpdo}, {rpdos} of {rpdo}");
        }
    }

    #[test]
    fn second_instance_may_be_the_worst() {
        // Example of Davis et al. against the earlier analysis: three frames of 125 bits at 125 kbit/s, 1 ms each,
        // with periods of 2.5, 3.5 and 3.5 ms. The third takes 3.5 ms in its second instance, 3.0 ms in its first.
        let frame = |cob_id, period_us| Contender {
            cob_id,
            bits: 125,
            pace: Pace::Clock { period_us },
            jitter_us: 0,
        };
        let bounds = responses(&[frame(1, 2_500), frame(2, 3_500), frame(3, 3_500)], 125_000, None);
        let expected = [2_000, 3_000, 3_500].map(|us| Some(Duration::from_micros(us)));
        assert_eq!(bounds, expected);
    }

    #[test]
    fn overload_is_unbounded_and_frames_above_are_bounded() {
        let bounds = micros(&[
            clock(1, 8, 400, 0),
            clock(2, 8, 400, 0),
            clock(3, 8, 400, 0),
            clock(4, 8, 400, 0),
        ]);
        assert_eq!(bounds, [Some(270), Some(405), None, None]);
    }

    #[test]
    fn error_costs_its_frame_and_the_longest_frame() {
        let frames = [clock(1, 8, 10_000, 0), clock(2, 0, 10_000, 0)];
        let with = responses(&frames, MBIT, Some(100_000));
        let without = responses(&frames, MBIT, None);
        let cost = Duration::from_micros(31 + 135);
        let later = without.iter().map(|bound| bound.map(|bound| bound + cost));
        assert_eq!(with, later.collect::<Vec<_>>());
    }

    #[test]
    fn permanent_errors_leave_no_bound() {
        assert_eq!(responses(&[clock(1, 8, 10_000, 0)], MBIT, Some(100)), [None]);
    }

    fn pace() -> impl Strategy<Value = Pace> {
        let values = prop_oneof![Just(Values::Rare), Just(Values::Varying)];
        let timer = prop::option::of(1_000_u32..50_000);
        prop_oneof![
            (500_u32..20_000).prop_map(|period_us| Pace::Clock { period_us }),
            (500_u32..20_000).prop_map(|gap_us| Pace::Chance { gap_us }),
            (500_u32..5_000, timer, values).prop_map(|(gap_us, timer_us, values)| Pace::Change {
                gap_us,
                timer_us,
                values
            }),
        ]
    }

    /// Up to a dozen frames with different identifiers.
    fn frames() -> impl Strategy<Value = Vec<Contender>> {
        let frame = (0_u32..=8, pace(), 0_u32..400);
        prop::collection::btree_map(1_u16..0x7FF, frame, 1..12).prop_map(|frames| {
            let frame = |(cob_id, (bytes, pace, jitter_us))| Contender {
                cob_id,
                bits: bits::worst_case(bytes),
                pace,
                jitter_us,
            };
            frames.into_iter().map(frame).collect()
        })
    }

    /// Simulates a bus of 1 Mbit/s: frames are queued as `released` states, the lowest identifier wins, without
    /// interruption. Returns the longest responses, in µs.
    fn simulated(contenders: &[Contender], released: &[Vec<(u64, u64)>]) -> Vec<u64> {
        let mut waiting: Vec<_> = released.iter().map(|times| times.iter().peekable()).collect();
        let mut longest = vec![0; contenders.len()];
        let mut now = 0;
        loop {
            let queued = |place: usize| waiting[place].clone().next().map(|(_, queued)| *queued);
            let ready = (0..contenders.len()).filter(|place| queued(*place) <= Some(now));
            let mut ready = ready.filter(|place| queued(*place).is_some());
            // Contenders are sorted by identifier.
            if let Some(next) = ready.next() {
                let (due, _) = waiting[next].next().unwrap();
                now += u64::from(contenders[next].bits);
                longest[next] = longest[next].max(now - due);
            } else {
                let coming = (0..contenders.len()).filter_map(queued).min();
                let Some(coming) = coming else { return longest };
                now = coming;
            }
        }
    }

    /// Release and queueing times of `contender` in µs, at its maximum frequency from `first` on; `late` selects the
    /// jitter of each.
    fn releases(contender: &Contender, first: u64, late: &[u32]) -> Vec<(u64, u64)> {
        let mut queued = 0;
        let release = |(instance, late): (u64, &u32)| {
            let due = first + contender.pace.earliest(instance) / MICRO;
            // A station sends its own frames in order.
            queued = u64::max(queued, due + u64::from(late % (contender.jitter_us + 1)));
            (due, queued)
        };
        (0..).zip(late).map(release).collect()
    }

    proptest! {
        #[test]
        fn no_simulated_response_exceeds_the_bound(
            frames in frames(),
            firsts in prop::collection::vec(0_u64..3_000, 12),
            late in prop::collection::vec(any::<u32>(), 60),
            is_at_once in any::<bool>(),
        ) {
            let released: Vec<_> = frames
                .iter()
                .zip(&firsts)
                .map(|(frame, first)| releases(frame, if is_at_once { 0 } else { *first }, &late))
                .collect();
            let bounds = responses(&frames, MBIT, None);
            for (bound, longest) in bounds.iter().zip(simulated(&frames, &released)) {
                if let Some(bound) = bound {
                    prop_assert!(u128::from(longest) <= bound.as_micros(), "{longest} > {bound:?}");
                }
            }
        }

        #[test]
        fn another_frame_never_shortens_a_response(frames in frames(), place in 0_usize..12) {
            let bounds = responses(&frames, MBIT, None);
            let mut fewer = frames.clone();
            let removed = place % frames.len();
            fewer.remove(removed);
            let mut rest = bounds;
            rest.remove(removed);
            for (fewer, more) in responses(&fewer, MBIT, None).into_iter().zip(rest) {
                prop_assert!(more.is_none_or(|more| fewer.is_some_and(|fewer| fewer <= more)));
            }
        }

        #[test]
        fn analysis_ends_for_any_input(
            frames in prop::collection::vec((any::<u16>(), 0_u32..200, any::<u32>(), any::<u32>()), 0..8),
            bitrate in prop_oneof![Just(0_u32), Just(10_000), Just(MBIT), any::<u32>()],
            errors in prop::option::of(any::<u32>()),
        ) {
            let frame = |(cob_id, bits, period_us, jitter_us)| Contender {
                cob_id,
                bits,
                pace: Pace::Clock { period_us },
                jitter_us,
            };
            let frames: Vec<_> = frames.into_iter().map(frame).collect();
            prop_assert_eq!(responses(&frames, bitrate, errors).len(), frames.len());
        }
    }
}
