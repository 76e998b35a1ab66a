//! Reads inputs, as docs/sessions.md describes them. Any bytes are safe.

use std::fmt;
use std::io::{self, BufRead, Read};
use std::time::Duration;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use thiserror::Error;

use bus::{BusError, BusEvent, ReceivedEvent, ReopenError, SendError, Wake};
use canopen::frame::{Channel, Frame};
use contract::{Gripper, Reason};
use controller::switches::CommandMode;
use inputs::intermediates::{COUNT, Digest};
use inputs::table::{self, FORMAT, FORMAT_OF_ONE_PART, MAGIC};
use inputs::{Call, HAS_GRIPPER, Input, Last, NUMBERS};
use node::Request;
use node::cause::ResetReason;
use node::trial::TrialRequest;
use remote::{RemoteSample, SideError};
use units::adjustment::InvalidAdjustment;
use units::numbering::Joint;
use units::spatial::Wrench;
use units::time::Instant;

/// Maximum length of a text, and maximum number of texts in an entry.
const MAX_TEXT: u64 = 4_096;

/// Reader of a file of inputs.
pub struct InputReader<R> {
    from: R,
    last: Last,
    /// Bytes read so far.
    place: u64,
    part: u32,
    /// Entries read so far, those of earlier parts included.
    entries: u64,
}

impl<R> fmt::Debug for InputReader<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("InputReader").field("place", &self.place).finish_non_exhaustive()
    }
}

/// Reasons why an input cannot be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// File that does not begin as a file of inputs.
    #[error("not a file of inputs")]
    Foreign,
    /// File of another version of the format.
    #[error("inputs of format {0}; this program reads format {FORMAT}")]
    Version(u16),
    /// End of the file inside the entry at this byte.
    #[error("the inputs end inside the entry at byte {0}")]
    Cut(u64),
    /// Bytes that are not an entry: their place, and the reason.
    #[error("no entry at byte {0}: {1}")]
    Malformed(u64, &'static str),
    /// File that cannot be read.
    #[error(transparent)]
    Failed(#[from] io::Error),
}

impl<R: BufRead> InputReader<R> {
    /// Begins to read a file.
    ///
    /// # Errors
    /// Returns an error if it is not a file of inputs of this version.
    pub fn begin(from: R) -> Result<Self, ReadError> {
        let mut reader = Self { from, last: Last::default(), place: 0, part: 1, entries: 0 };
        if reader.bytes::<6>().ok() != Some(MAGIC) {
            return Err(ReadError::Foreign);
        }
        match u16::from_le_bytes(reader.bytes()?) {
            FORMAT_OF_ONE_PART => {}
            FORMAT => {
                reader.part = u32::from_le_bytes(reader.bytes()?);
                reader.entries = u64::from_le_bytes(reader.bytes()?);
            }
            version => return Err(ReadError::Version(version)),
        }
        Ok(reader)
    }

    /// Returns the number of this part, from 1.
    pub const fn part(&self) -> u32 {
        self.part
    }

    /// Returns the number of entries in front of the next one, those of earlier parts included.
    pub const fn entries(&self) -> u64 {
        self.entries
    }

    /// Reads the next input; `None` at the end of the file.
    ///
    /// # Errors
    /// Returns an error if the file ends inside an entry, or its bytes are not an entry.
    pub fn read(&mut self) -> Result<Option<Input>, ReadError> {
        if self.from.fill_buf()?.is_empty() {
            return Ok(None);
        }
        let begun = self.place;
        let entry = self.entry();
        self.entries += u64::from(entry.is_ok());
        entry.map(Some).map_err(|error| match error {
            ReadError::Cut(_) => ReadError::Cut(begun),
            ReadError::Malformed(_, reason) => ReadError::Malformed(begun, reason),
            ReadError::Foreign | ReadError::Version(_) | ReadError::Failed(_) => error,
        })
    }

    fn entry(&mut self) -> Result<Input, ReadError> {
        let tag = self.byte()?;
        match tag {
            table::NEW..=table::TRIAL => self.call(tag).map(Input::Call),
            table::RETURNED => Ok(Input::Returned(u32::from_le_bytes(self.bytes()?))),
            table::INTERMEDIATES => {
                let cycle = self.varint()?;
                Ok(Input::Intermediates(cycle, Digest(self.bytes::<COUNT>()?)))
            }
            table::NOT_SENSED..=table::MISFITS => self.of_commanded_side(tag),
            table::GO_ON => Ok(Input::Polled(false)),
            table::END => Ok(Input::Polled(true)),
            table::LOST => Ok(Input::Lost(self.varint()?)),
            _ => self.of_bus(tag),
        }
    }

    /// Reads a call of the owner.
    fn call(&mut self, tag: u8) -> Result<Call, ReadError> {
        Ok(match tag {
            table::NEW => Call::New,
            table::BRING_UP => Call::BringUp,
            table::BRING_UP_UNPOWERED => Call::BringUpUnpowered(match self.byte()? {
                0 => ResetReason::UncleanEnd,
                1 => ResetReason::NoLatch,
                _ => return self.malformed("unknown reason of a reset"),
            }),
            table::ARM => Call::Request(Request::Arm),
            table::DISARM => Call::Request(Request::Disarm),
            table::RESET => Call::Request(Request::Reset),
            table::COMMAND_RATE => Call::Request(Request::Command(CommandMode::Rate)),
            table::COMMAND_POSE => Call::Request(Request::Command(CommandMode::Pose)),
            table::PARK => Call::Request(Request::Park),
            table::TRIAL => match Joint::new(self.byte()?) {
                Some(joint) => {
                    let share = u16::from_le_bytes(self.bytes()?);
                    Call::Request(Request::Trial(TrialRequest { joint, share }))
                }
                None => return self.malformed("unknown joint"),
            },
            table::CYCLE => Call::Cycle,
            table::STOP => Call::Stop,
            table::ZERO => Call::Request(Request::Zero(match self.byte()? {
                0 => None,
                number => match Joint::new(number) {
                    Some(joint) => Some(joint),
                    None => return self.malformed("unknown joint"),
                },
            })),
            table::ADJUST => match self.text()?.parse() {
                Ok(adjustment) => Call::Request(Request::Adjust(adjustment)),
                Err(InvalidAdjustment(_)) => return self.malformed("unknown adjustment"),
            },
            _ => return self.malformed("unknown call"),
        })
    }

    /// Reads an answer of the bus.
    fn of_bus(&mut self, tag: u8) -> Result<Input, ReadError> {
        Ok(match tag {
            table::NOW_AGAIN => Input::Now(Instant::from_micros(self.last.now)),
            table::NOW => Input::Now(self.reading()?),
            table::WALL => Input::Wall(self.duration()?),
            table::SUSPENDED_AGAIN => Input::Suspended(self.last.suspended),
            table::SUSPENDED => {
                self.last.suspended = self.duration()?;
                Input::Suspended(self.last.suspended)
            }
            table::UNCONFIRMED => Input::Confirmed(self.channel()?, None),
            table::CONFIRMED => Input::Confirmed(self.channel()?, Some(self.time()?)),
            table::QUEUE_FULL => Input::NotSent(self.number()?, SendError::Full),
            table::BUS_DOWN => Input::NotSent(self.number()?, SendError::Down),
            table::WOKEN => Input::Woken(Wake { now: self.reading()?, received: None }),
            table::FRAME => self.received(|reader| reader.frame().map(BusEvent::Frame))?,
            table::BUS_FAULT => self.received(|reader| reader.bus_error().map(BusEvent::Error))?,
            table::REOPENED => Input::Reopened(Ok(())),
            table::NOT_REOPENED_GONE => Input::Reopened(Err(ReopenError::Gone(self.channel()?))),
            table::NOT_REOPENED_UNFIT => Input::Reopened(Err(ReopenError::Unfit(self.text()?))),
            _ => return self.malformed("unknown tag"),
        })
    }

    /// Reads an answer of the commanded side.
    fn of_commanded_side(&mut self, tag: u8) -> Result<Input, ReadError> {
        Ok(match tag {
            table::NOT_SENSED => Input::Sensed(None),
            table::SENSED_AGAIN => Input::Sensed(Some(self.last_sensed())),
            table::SENSED => self.sensed()?,
            table::NO_SIDE_FAULT => Input::SideError(None),
            table::SIDE_HOLDS => match Reason::from_code(self.byte()?) {
                Some(reason) => Input::SideError(Some(SideError::Holds(reason))),
                None => return self.malformed("unknown reason to hold"),
            },
            table::SIDE_SLOW => {
                let p99_us = u32::from_le_bytes(self.bytes()?);
                let stated_us = u32::from_le_bytes(self.bytes()?);
                Input::SideError(Some(SideError::Slow { p99_us, stated_us }))
            }
            table::MISFITS => {
                let count = self.varint()?;
                if count > MAX_TEXT {
                    return self.malformed("too many reasons");
                }
                Input::Misfits((0..count).map(|_| self.text()).collect::<Result<_, _>>()?)
            }
            _ => return self.malformed("unknown tag"),
        })
    }

    /// Reads a wait that ended with an event: bus, clock, receive time, event.
    fn received(
        &mut self,
        event: impl FnOnce(&mut Self) -> Result<BusEvent, ReadError>,
    ) -> Result<Input, ReadError> {
        let channel = self.channel()?;
        let now = self.reading()?;
        let at = self.time()?;
        let received = Some(ReceivedEvent { at, channel, event: event(self)? });
        Ok(Input::Woken(Wake { now, received }))
    }

    fn frame(&mut self) -> Result<Frame, ReadError> {
        let head = u16::from_le_bytes(self.bytes()?);
        let length = u8::try_from(head >> 12).unwrap_or(u8::MAX);
        let cob_id = head & 0x7FF;
        if length > 8 {
            return self.malformed("a frame of more than 8 bytes");
        }
        if head & 0x800 != 0 {
            return Ok(Frame::remote(cob_id, length));
        }
        let mut data = [0; 8];
        let used = data.get_mut(..usize::from(length)).unwrap_or_default();
        read_exact(&mut self.from, used, &mut self.place)?;
        match Frame::from_slice(cob_id, used) {
            Some(frame) => Ok(frame),
            None => self.malformed("not a frame"),
        }
    }

    fn bus_error(&mut self) -> Result<BusError, ReadError> {
        match self.byte()? {
            0 => Ok(BusError::Warning),
            1 => Ok(BusError::Overrun),
            2 => Ok(BusError::Passive),
            3 => Ok(BusError::Off),
            4 => Ok(BusError::Down),
            _ => self.malformed("unknown fault of a bus"),
        }
    }

    fn sensed(&mut self) -> Result<Input, ReadError> {
        let at = self.time()?;
        let mask = u16::from_le_bytes(self.bytes()?);
        for place in 0..NUMBERS {
            if mask >> place & 1 == 1 {
                let number = u64::from_le_bytes(self.bytes()?);
                self.last.sensed.1.iter_mut().skip(place).take(1).for_each(|it| *it = number);
            }
        }
        (self.last.sensed.0, self.last.sensed.2) = (at.as_micros(), mask & HAS_GRIPPER != 0);
        Ok(Input::Sensed(Some(self.last_sensed())))
    }

    fn last_sensed(&self) -> RemoteSample {
        let (at, numbers, has_gripper) = self.last.sensed;
        let [f0, f1, f2, m0, m1, m2, x, y, z, i, j, k, w, position, force] =
            numbers.map(f64::from_bits);
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        RemoteSample {
            at: Instant::from_micros(at),
            f_s: Wrench::from_components([f0, f1, f2, m0, m1, m2]),
            x_b_m: Isometry3::from_parts(Translation3::new(x, y, z), rotation),
            gripper: has_gripper.then_some(Gripper { position, force }),
        }
    }

    fn reading(&mut self) -> Result<Instant, ReadError> {
        let now = self.time()?;
        self.last.now = now.as_micros();
        Ok(now)
    }

    fn time(&mut self) -> Result<Instant, ReadError> {
        let value = self.varint()?;
        let difference = (value >> 1).cast_signed() ^ -(value & 1).cast_signed();
        Ok(Instant::from_micros(self.last.now.wrapping_add_signed(difference)))
    }

    fn duration(&mut self) -> Result<Duration, ReadError> {
        let seconds = self.varint()?;
        match u32::try_from(self.varint()?) {
            Ok(nanos) if nanos < 1_000_000_000 => Ok(Duration::new(seconds, nanos)),
            Ok(_) | Err(_) => self.malformed("a second has 10⁹ nanoseconds"),
        }
    }

    fn text(&mut self) -> Result<String, ReadError> {
        let length = self.varint()?;
        if length > MAX_TEXT {
            return self.malformed("a text of more than 4,096 bytes");
        }
        let mut bytes = Vec::new();
        self.from.by_ref().take(length).read_to_end(&mut bytes)?;
        let found = u64::try_from(bytes.len()).unwrap_or(u64::MAX);
        self.place += found;
        if found < length {
            return Err(ReadError::Cut(self.place));
        }
        String::from_utf8(bytes).or_else(|_| self.malformed("a text that is not UTF-8"))
    }

    fn varint(&mut self) -> Result<u64, ReadError> {
        let mut value = 0_u64;
        for shift in (0..u64::BITS).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        self.malformed("a number of more than 64 bits")
    }

    fn number(&mut self) -> Result<u32, ReadError> {
        let number = u32::try_from(self.varint()?);
        number.or_else(|_| self.malformed("a number of more than 32 bits"))
    }

    fn channel(&mut self) -> Result<Channel, ReadError> {
        self.byte().map(Channel)
    }

    fn byte(&mut self) -> Result<u8, ReadError> {
        let [byte] = self.bytes()?;
        Ok(byte)
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let mut bytes = [0; N];
        read_exact(&mut self.from, &mut bytes, &mut self.place)?;
        Ok(bytes)
    }

    fn malformed<T>(&self, reason: &'static str) -> Result<T, ReadError> {
        Err(ReadError::Malformed(self.place, reason))
    }
}

/// Fills `bytes`, and counts them.
fn read_exact(from: &mut impl Read, bytes: &mut [u8], place: &mut u64) -> Result<(), ReadError> {
    from.read_exact(bytes).map_err(|error| {
        let is_end = error.kind() == io::ErrorKind::UnexpectedEof;
        if is_end { ReadError::Cut(*place) } else { ReadError::Failed(error) }
    })?;
    *place += u64::try_from(bytes.len()).unwrap_or(u64::MAX);
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use inputs::InputWriter;
    use units::adjustment::{Adjustment, LockAxis, Quantity};

    fn written(inputs: &[Input]) -> Vec<u8> {
        let mut file = Vec::new();
        let mut writer = InputWriter::begin(&mut file).unwrap();
        inputs.iter().for_each(|input| writer.write(input).unwrap());
        file
    }

    fn read(file: &[u8]) -> (Vec<Input>, Option<ReadError>) {
        let mut reader = InputReader::begin(file).unwrap();
        let mut inputs = Vec::new();
        loop {
            match reader.read() {
                Ok(Some(input)) => inputs.push(input),
                Ok(None) => return (inputs, None),
                Err(error) => return (inputs, Some(error)),
            }
        }
    }

    fn time() -> impl Strategy<Value = Instant> {
        prop_oneof![0..1_000_000_u64, any::<u64>()].prop_map(Instant::from_micros)
    }

    fn frame() -> impl Strategy<Value = Frame> {
        (0..0x800_u16, prop::collection::vec(any::<u8>(), 0..=8), any::<bool>()).prop_map(
            |(cob_id, data, is_remote)| match is_remote {
                true => Frame::remote(cob_id, u8::try_from(data.len()).unwrap()),
                false => Frame::from_slice(cob_id, &data).unwrap(),
            },
        )
    }

    fn sensed() -> impl Strategy<Value = RemoteSample> {
        // Invalid rotations as well: the node judges them.
        let numbers = prop::collection::vec(prop_oneof![Just(0.0), -1e3..1e3_f64], NUMBERS);
        (time(), numbers, any::<bool>()).prop_map(|(at, n, has_gripper)| RemoteSample {
            at,
            f_s: Wrench::from_components([n[0], n[1], n[2], n[3], n[4], n[5]]),
            x_b_m: Isometry3::from_parts(
                Translation3::new(n[6], n[7], n[8]),
                UnitQuaternion::new_unchecked(Quaternion::new(n[9], n[10], n[11], n[12])),
            ),
            gripper: has_gripper.then_some(Gripper { position: n[13], force: n[14] }),
        })
    }

    fn adjustment() -> impl Strategy<Value = Adjustment> {
        let (quantities, axes) = (Quantity::ALL.to_vec(), LockAxis::ALL.to_vec());
        let scale = (prop::sample::select(quantities), -1e6..1e6_f64);
        let lock = (prop::sample::select(axes), any::<bool>());
        prop_oneof![
            scale.prop_map(|(quantity, factor)| Adjustment::Scale(quantity, factor)),
            lock.prop_map(|(axis, is_locked)| Adjustment::Lock(axis, is_locked)),
            Just(Adjustment::Align),
        ]
    }

    fn call() -> impl Strategy<Value = Call> {
        prop_oneof![
            Just(Call::New),
            Just(Call::BringUp),
            Just(Call::BringUpUnpowered(ResetReason::UncleanEnd)),
            Just(Call::BringUpUnpowered(ResetReason::NoLatch)),
            Just(Call::Request(Request::Arm)),
            Just(Call::Request(Request::Disarm)),
            Just(Call::Request(Request::Zero(None))),
            Just(Call::Request(Request::Park)),
            (1..=6_u8, any::<u16>()).prop_map(|(number, share)| {
                let joint = Joint::new(number).unwrap();
                Call::Request(Request::Trial(TrialRequest { joint, share }))
            }),
            Just(Call::Request(Request::Zero(Some(Joint::of::<6>())))),
            Just(Call::Request(Request::Reset)),
            Just(Call::Request(Request::Command(CommandMode::Rate))),
            Just(Call::Request(Request::Command(CommandMode::Pose))),
            adjustment().prop_map(|adjustment| Call::Request(Request::Adjust(adjustment))),
            Just(Call::Cycle),
            Just(Call::Stop),
        ]
    }

    fn received() -> impl Strategy<Value = ReceivedEvent> {
        let error = prop::sample::select(vec![
            BusError::Warning,
            BusError::Overrun,
            BusError::Passive,
            BusError::Off,
            BusError::Down,
        ]);
        let event = prop_oneof![frame().prop_map(BusEvent::Frame), error.prop_map(BusEvent::Error)];
        (time(), 0..8_u8, event).prop_map(|(at, channel, event)| ReceivedEvent {
            at,
            channel: Channel(channel),
            event,
        })
    }

    fn input() -> impl Strategy<Value = Input> {
        let duration =
            || (any::<u64>(), 0..1_000_000_000_u32).prop_map(|(s, ns)| Duration::new(s, ns));
        let digest = any::<[u8; COUNT]>().prop_map(Digest);
        let reopened = prop_oneof![
            Just(Ok(())),
            (0..8_u8).prop_map(|channel| Err(ReopenError::Gone(Channel(channel)))),
            ".{0,40}".prop_map(|reason| Err(ReopenError::Unfit(reason))),
        ];
        let side_error = prop_oneof![
            prop::sample::select(Reason::ALL.to_vec()).prop_map(SideError::Holds),
            any::<(u32, u32)>()
                .prop_map(|(p99_us, stated_us)| SideError::Slow { p99_us, stated_us }),
        ];
        prop_oneof![
            call().prop_map(Input::Call),
            any::<u32>().prop_map(Input::Returned),
            (any::<u64>(), digest).prop_map(|(cycle, digest)| Input::Intermediates(cycle, digest)),
            time().prop_map(Input::Now),
            duration().prop_map(Input::Wall),
            duration().prop_map(Input::Suspended),
            (0..8_u8, prop::option::of(time()))
                .prop_map(|(bus, at)| Input::Confirmed(Channel(bus), at)),
            (any::<u32>(), prop_oneof![Just(SendError::Full), Just(SendError::Down)])
                .prop_map(|(number, error)| Input::NotSent(number, error)),
            (time(), prop::option::of(received()))
                .prop_map(|(now, received)| Input::Woken(Wake { now, received })),
            reopened.prop_map(Input::Reopened),
            prop::option::of(sensed()).prop_map(Input::Sensed),
            prop::option::of(side_error).prop_map(Input::SideError),
            prop::collection::vec(".{0,40}", 0..4).prop_map(Input::Misfits),
            any::<bool>().prop_map(Input::Polled),
            any::<u64>().prop_map(Input::Lost),
        ]
    }

    #[test]
    fn tags_are_unique() {
        let mut tags: Vec<_> = table::ALL.iter().map(|(tag, _)| tag).collect();
        tags.sort_unstable();
        tags.dedup();
        assert_eq!(tags.len(), table::ALL.len());
    }

    #[test]
    fn file_of_another_kind_or_version_is_refused() {
        assert!(matches!(InputReader::begin(&b""[..]), Err(ReadError::Foreign)));
        assert!(matches!(InputReader::begin(&b"(0.1) can0"[..]), Err(ReadError::Foreign)));
        let mut file = written(&[]);
        file[6] += 1;
        assert!(matches!(InputReader::begin(&file[..]), Err(ReadError::Version(3))));
    }

    proptest! {
        #[test]
        fn inputs_are_read_as_they_were_written(
            inputs in prop::collection::vec(input(), 0..60),
        ) {
            let (found, error) = read(&written(&inputs));
            prop_assert!(error.is_none(), "{error:?}");
            prop_assert_eq!(found, inputs);
        }

        #[test]
        fn file_that_ends_anywhere_keeps_its_whole_entries(
            inputs in prop::collection::vec(input(), 1..20),
            part in any::<prop::sample::Index>(),
        ) {
            let file = written(&inputs);
            let end = part.index(file.len()).max(20);
            let (found, error) = read(&file[..end]);
            prop_assert_eq!(&found[..], &inputs[..found.len()]);
            prop_assert!(matches!(error, None | Some(ReadError::Cut(_))), "{:?}", error);
        }

        #[test]
        fn any_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let mut file = written(&[]);
            file.extend(bytes);
            read(&file);
        }
    }
}
