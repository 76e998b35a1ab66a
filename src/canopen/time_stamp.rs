//! TIME (CiA 301, 7.2.6): time of day for every node.
//!
//! The caller supplies the time. Disabled unless a [`Producer`] is used.
//!
//! | bytes | meaning                                                        |
//! |-------|----------------------------------------------------------------|
//! | 0–3   | milliseconds since midnight, 28 bits; four bits reserved, zero |
//! | 4–5   | days since 1 January 1984                                      |

use std::time::Duration;

use canopen_rs::time as codec;

use crate::frame::{COB_ID_MAX, Frame};
use units::time::Instant;

/// COB-ID of the predefined connection set.
pub const COB_ID: u16 = codec::TIME_COB_ID;

/// Time from 1 January 1970 to 1 January 1984: 14 years, three of them leap years.
const UNIX_TO_CANOPEN: Duration = Duration::from_secs((14 * 365 + 3) * SECONDS_PER_DAY);
const SECONDS_PER_DAY: u64 = 86_400;
const MILLIS_PER_DAY: u128 = 86_400_000;

/// Days since 1984 and milliseconds since midnight: TIME_OF_DAY (CiA 301, 7.4.7.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TimeOfDay {
    /// Days since 1 January 1984.
    pub days: u16,
    /// Milliseconds since midnight, below 86,400,000; up to 28 bits after a leap second or from another node.
    pub millis: u32,
}

impl TimeOfDay {
    /// Converts a UTC time since 1 January 1970, rounded down to milliseconds. Returns `None` before 1984 and after
    /// 6 June 2163, the last day that fits 16 bits.
    pub fn from_unix(since_1970: Duration) -> Option<Self> {
        let millis = since_1970.checked_sub(UNIX_TO_CANOPEN)?.as_millis();
        let days = u16::try_from(millis / MILLIS_PER_DAY).ok()?;
        Some(Self { days, millis: u32::try_from(millis % MILLIS_PER_DAY).ok()? })
    }

    /// Time since 1 January 1970.
    pub fn since_1970(self) -> Duration {
        let days = Duration::from_secs(u64::from(self.days) * SECONDS_PER_DAY);
        UNIX_TO_CANOPEN + days + Duration::from_millis(u64::from(self.millis))
    }

    /// Encodes the six bytes.
    pub fn bytes(self) -> [u8; 6] {
        codec::TimeOfDay::new(self.millis, self.days).encode()
    }

    /// Decodes six bytes; `None` for another length.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let bytes: [u8; 6] = bytes.try_into().ok()?;
        let codec::TimeOfDay { milliseconds, days } = codec::TimeOfDay::decode(&bytes).ok()?;
        Some(Self { days, millis: milliseconds })
    }
}

const CONSUMES: u32 = 1 << 31;
const EXTENDED: u32 = 1 << 29;

/// COB-ID of a TIME consumer, by object 1012h: bit 31 enables it, bit 29 marks a 29-bit identifier, which is not supported.
pub fn consumed(cob_id_time: u32) -> Option<u16> {
    if cob_id_time & (CONSUMES | EXTENDED) != CONSUMES {
        return None;
    }
    let identifier = cob_id_time & (EXTENDED - 1);
    u16::try_from(identifier).ok().filter(|identifier| *identifier <= COB_ID_MAX)
}

/// Producer of TIME messages.
#[derive(Clone, Debug)]
pub struct Producer {
    cob_id: u16,
    period: Duration,
    next: Instant,
}

impl Producer {
    /// Returns a producer whose first message is due at once, then every `period`, at least 1 ms.
    pub fn new(cob_id: u16, period: Duration) -> Self {
        Self { cob_id, period: period.max(Duration::from_millis(1)), next: Instant::ZERO }
    }

    /// Returns the message if it is due, for a clock at `since_1970`. Missed ones are skipped; nothing is sent
    /// before the clock is set.
    pub fn due(&mut self, now: Instant, since_1970: Duration) -> Option<Frame> {
        if now < self.next {
            return None;
        }
        let on_beat = self.next + self.period;
        self.next = if on_beat > now { on_beat } else { now + self.period };
        Some(Frame::new(self.cob_id, TimeOfDay::from_unix(since_1970)?.bytes()))
    }

    /// Time of the next message.
    pub const fn deadline(&self) -> Instant {
        self.next
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn days_count_from_1984() {
        // `date -u -d 1984-01-01 +%s`, `date -u -d 2026-11-21T08:40:38.123 +%s`, `date -u -d 2163-06-06 +%s`
        for (seconds, days, millis) in
            [(441_763_200, 0, 0), (1_795_250_438, 15_665, 31_238_000), (6_103_987_200, 65_535, 0)]
        {
            let time = TimeOfDay::from_unix(Duration::from_secs(seconds)).unwrap();
            assert_eq!((time.days, time.millis), (days, millis));
        }
        assert_eq!(TimeOfDay::from_unix(Duration::from_secs(441_763_199)), None);
        assert_eq!(TimeOfDay::from_unix(Duration::from_secs(6_103_987_200 + 86_400)), None);
    }

    #[test]
    fn frame_is_that_of_the_standard() {
        let mut producer = Producer::new(COB_ID, 1_000 * MS);
        let noon = UNIX_TO_CANOPEN + Duration::from_secs(86_400 + 43_200);
        let frame = producer.due(at(0), noon).unwrap();
        assert_eq!(frame, Frame::new(0x100, [0x00, 0x2E, 0x93, 0x02, 1, 0]));
        assert_eq!(TimeOfDay::decode(frame.data()), TimeOfDay::from_unix(noon));
        assert_eq!(TimeOfDay::decode(&[0; 5]), None);
        assert_eq!(TimeOfDay::decode(&[0; 7]), None);
    }

    #[test]
    fn time_is_sent_once_per_period() {
        let mut producer = Producer::new(COB_ID, 5 * MS);
        let is_sent = |ms: &u64| producer.due(at(*ms), UNIX_TO_CANOPEN).is_some();
        let sent: Vec<u64> = [0, 1, 4, 5, 9, 33, 34, 37, 38].into_iter().filter(is_sent).collect();
        assert_eq!(sent, [0, 5, 33, 38]);
        assert_eq!(producer.deadline(), at(43));
    }

    #[test]
    fn unset_clock_sends_no_time() {
        let mut producer = Producer::new(COB_ID, 5 * MS);
        assert_eq!(producer.due(at(0), Duration::ZERO), None);
        assert!(producer.due(at(5), UNIX_TO_CANOPEN).is_some());
    }

    #[test]
    fn object_1012h_enables_a_consumer() {
        let cases = [
            (0x4000_0100, None),
            (0xC000_0101, Some(0x101)),
            (0x8000_0100, Some(0x100)),
            (0x0000_0100, None),
            (0xE000_0100, None),
            (0xC000_0800, None),
        ];
        for (raw, takes) in cases {
            assert_eq!(consumed(raw), takes, "{raw:08X}h");
        }
    }

    proptest! {
        #[test]
        fn time_of_day_round_trips_to_the_millisecond(days: u16, millis in 0_u32..86_400_000) {
            let time = TimeOfDay { days, millis };
            prop_assert_eq!(TimeOfDay::from_unix(time.since_1970()), Some(time));
            prop_assert_eq!(TimeOfDay::decode(&time.bytes()), Some(time));
        }
    }
}
