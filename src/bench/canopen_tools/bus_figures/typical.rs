//! Typical frame lengths: mean exact length, with stuff bits and CRC, over typical values.
//!
//! Stuffing depends on the values: small positive numbers are long runs of zero bits. A joint rests at home for three
//! quarters of the time, and else moves near it, with torques around that of gravity. A fixed pseudo-random sequence gives
//! the samples, so that a plan always has the same figures.

use canopen::frame::Frame;
use canopen::load::pace::MOVING;
use canopen::load::streams::{Role, Slot, Stream};
use canopen::object::Object;
use canopen::{NodeId, bits, drive};

/// Number of sampled frames per mean.
const SAMPLES: u32 = 512;

/// Statusword of an enabled drive: operation enabled, voltage on, remote (CiA 402).
const STATUS: i64 = 0x1237;

/// Heartbeat in operational (CiA 301, 7.2.8.3.2.2).
const OPERATIONAL: u8 = 5;

/// Digital inputs with the deadman held: contact A closed, the antivalent contact B open.
const INPUTS: i64 = 0b0001;

/// Typical values of a drive, in its own units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Signals {
    /// Position actual value (6064h) at home, in counts.
    pub home: i32,
    /// Maximum distance from home, in counts.
    pub travel: u32,
    /// Torque (6071h, 6077h) that holds the arm at home, in per mille of rated torque.
    pub holding: i16,
    /// Maximum deviation from that torque.
    pub effort: u16,
}

/// Typical values by node.
pub type SignalLookup<'a> = &'a dyn Fn(NodeId) -> Signals;

/// Typical length of a frame, in bits.
pub fn typical_bits(stream: &Stream, known: SignalLookup<'_>) -> f64 {
    let mut random = Random::new(stream.cob_id);
    let mut sum = 0;
    for place in 0..SAMPLES {
        random.is_at_rest = f64::from(place) >= MOVING * f64::from(SAMPLES);
        let bytes = content(stream, known, &mut random);
        sum += Frame::from_slice(stream.cob_id, &bytes)
            .map_or_else(|| stream.worst_bits(), |frame| bits::exact(&frame));
    }
    f64::from(sum) / f64::from(SAMPLES)
}

/// Bytes of one sampled frame.
fn content(stream: &Stream, known: SignalLookup<'_>, random: &mut Random) -> Vec<u8> {
    match stream.role {
        Role::Sync => Vec::new(),
        Role::Heartbeat => vec![OPERATIONAL],
        Role::Tpdo(_) | Role::Rpdo(_) => {
            let mut bytes = Vec::new();
            for slot in &stream.slots {
                let value = value(slot, known, random).to_le_bytes();
                let size = usize::from(slot.mapped.bits.div_ceil(8));
                bytes.extend(value.into_iter().take(size));
            }
            bytes
        }
        Role::Emergency | Role::SdoRequest | Role::SdoResponse => {
            random.next().to_le_bytes().to_vec()
        }
    }
}

/// Sampled value of a slot.
fn value(slot: &Slot, known: SignalLookup<'_>, random: &mut Random) -> i64 {
    let signals = known(slot.node);
    match slot.mapped.object {
        Object::STATUSWORD => STATUS,
        Object::CONTROLWORD => i64::from(drive::Controlword::ENABLE_OPERATION.0),
        Object::DIGITAL_INPUTS => INPUTS,
        Object::MODE_DISPLAY => i64::from(drive::CYCLIC_SYNCHRONOUS_TORQUE),
        Object::POSITION_ACTUAL => random.about(signals.home.into(), signals.travel),
        Object::TARGET_TORQUE | Object::TORQUE_DEMAND | Object::TORQUE_ACTUAL => {
            random.about(signals.holding.into(), signals.effort.into())
        }
        _ => i64::from_le_bytes(random.next().to_le_bytes()),
    }
}

/// Fixed pseudo-random sequence (64-bit xorshift with multiplier, Vigna 2016).
#[derive(Clone, Copy, Debug)]
struct Random {
    state: u64,
    is_at_rest: bool,
}

impl Random {
    fn new(seed: u16) -> Self {
        Self { state: 0x9E37_79B9_7F4A_7C15 ^ u64::from(seed), is_at_rest: true }
    }

    fn next(&mut self) -> u64 {
        self.state ^= self.state >> 12;
        self.state ^= self.state << 25;
        self.state ^= self.state >> 27;
        self.state.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// Returns `centre` at rest, else a uniformly distributed number within `reach` of it.
    fn about(&mut self, centre: i64, reach: u32) -> i64 {
        if self.is_at_rest {
            return centre;
        }
        let choices = 2 * u64::from(reach) + 1;
        let offset = i64::try_from(self.next() % choices).unwrap_or(0);
        centre.saturating_add(offset - i64::from(reach))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::load::streams::streams;
    use canopen::testing::networks::{drives, grouped, master};

    fn moving(_: NodeId) -> Signals {
        Signals { home: 20_000, travel: 60_000, holding: 100, effort: 200 }
    }

    #[test]
    fn constant_frames_have_their_exact_length() {
        let streams = streams(&drives(1), 1_000, master(), 5);
        let exact = |cob_id, data: &[u8]| {
            let frame = Frame::from_slice(cob_id, data).unwrap();
            let stream = streams.iter().find(|stream| stream.cob_id == cob_id).unwrap();
            assert_eq!(
                typical_bits(stream, &moving).to_string(),
                f64::from(bits::exact(&frame)).to_string()
            );
        };
        exact(0x080, &[]);
        exact(0x77F, &[5]);
        exact(0x701, &[5]);
    }

    #[test]
    fn typical_lengths_match_measured_traffic() {
        // Means over traffic of a moving arm, measured independently: 8 bytes 119 to 123 bits, 6 bytes 100, 4 bytes
        // 84.
        for stream in streams(&drives(6), 1_000, master(), 5) {
            let bits = typical_bits(&stream, &moving);
            match stream.bytes {
                8 => assert!((117.0..123.0).contains(&bits), "{bits}"),
                4 => assert!((82.0..88.0).contains(&bits), "{bits}"),
                _ => {}
            }
        }
        for stream in streams(&grouped(), 1_000, master(), 5) {
            let bits = typical_bits(&stream, &moving);
            if stream.bytes == 6 {
                assert!((98.0..104.0).contains(&bits), "{bits}");
            }
        }
    }

    proptest! {
        #[test]
        fn typical_length_is_within_the_bounds(
            home in any::<i32>(),
            travel in any::<u32>(),
            holding in any::<i16>(),
            effort in any::<u16>(),
        ) {
            let known = |_| Signals { home, travel, holding, effort };
            for stream in streams(&drives(1), 1_000, master(), 5) {
                let bits = typical_bits(&stream, &known);
                prop_assert!(f64::from(stream.least_bits()) <= bits);
                prop_assert!(bits <= f64::from(stream.worst_bits()));
            }
        }
    }
}
