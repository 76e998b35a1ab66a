//! SDO transfers between client and simulated drive: sizes, protocols, disturbances of the bus, and durations.

use proptest::prelude::*;

use crate::common::drive::{carry, drive, node};
use crate::common::golden::compare;
use crate::common::prelude::*;
use crate::lossy::{ErrorRates, Lossy};
use crate::sdo_queue::Task;
use bus::Tap;
use canopen::abort::AbortCode;
use canopen::sdo::{Block, Content, Outcome, SdoError, SdoOptions, Transfer};
use sim::drive::Drive;

const BUFFER: Object = Object::SAMPLE_BUFFER;
const TIMEOUT: Duration = Duration::from_secs(1);

/// Block without a pause between segments.
fn block(size: u8) -> Block {
    Block::new(size).unwrap().every(Duration::ZERO)
}

/// Pseudo-random bytes.
fn bytes(size: usize, seed: u64) -> Vec<u8> {
    let mut state = seed.wrapping_mul(2) | 1;
    std::iter::repeat_with(|| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state.to_be_bytes()[0]
    })
    .take(size)
    .collect()
}

/// Bus of 1 Mbit/s with one drive after its boot-up.
fn bus<T: Tap>(tap: T) -> Memory<Drive, T> {
    let mut bus = Memory::new(&[1_000_000], drive(), tap);
    assert!(bus.receive(bus.now() + Duration::from_millis(1)).is_some(), "boot-up");
    bus
}

fn read<T: Tap>(bus: &mut Memory<Drive, T>, object: Object, options: SdoOptions) -> Outcome {
    let mut out = Vec::new();
    let transfer = Transfer::read_with(options, node(), object, bus.now(), &mut out);
    carry(bus, transfer, out)
}

fn write<T: Tap>(
    bus: &mut Memory<Drive, T>,
    object: Object,
    bytes: &[u8],
    options: SdoOptions,
) -> Outcome {
    let mut out = Vec::new();
    let now = bus.now();
    let transfer =
        Transfer::write_with(options, node(), object, bytes.to_vec(), now, &mut out).unwrap();
    carry(bus, transfer, out)
}

fn every_protocol(block: Block) -> [SdoOptions; 4] {
    [
        SdoOptions::segmented(TIMEOUT),
        SdoOptions::best(TIMEOUT, block),
        SdoOptions::block(TIMEOUT, block),
        SdoOptions::block(TIMEOUT, block.without_crc()),
    ]
}

#[test]
fn values_of_every_size_pass_by_every_protocol() {
    let mut bus = bus(());
    for size in 0..=1000 {
        let value = bytes(size, 7);
        let block_size = u8::try_from(size % 127 + 1).unwrap();
        let options = every_protocol(block(block_size));
        for (down, up) in options.into_iter().zip(options.into_iter().cycle().skip(size % 4)) {
            assert_eq!(write(&mut bus, BUFFER, &value, down), Ok(Content::default()), "{size}");
            let content = read(&mut bus, BUFFER, up).unwrap();
            assert_eq!(content.bytes(), value, "{size}");
            assert!(content.has_size());
        }
    }
}

#[test]
fn every_protocol_gives_the_same_abort_codes() {
    let mut bus = bus(());
    let node = Object { index: BUFFER.index, sub: 9 };
    let nowhere = Object { index: BUFFER.index + 0xFFF, sub: 0 };
    for options in every_protocol(block(127)) {
        for (object, value, code) in [
            (node, 1, AbortCode::NO_SUB_INDEX),
            (nowhere, 1, AbortCode::NO_OBJECT),
            (Object::DEVICE_NAME, 30, AbortCode::READ_ONLY),
            (Object::TARGET_TORQUE, 3, AbortCode::LENGTH_TOO_HIGH),
            (Object::TARGET_TORQUE, 1, AbortCode::LENGTH_TOO_LOW),
            (Object::MODE_OF_OPERATION, 1, AbortCode::VALUE_TOO_HIGH),
        ] {
            let refused = write(&mut bus, object, &bytes(value, 1), options);
            assert_eq!(refused, Err(SdoError::AbortedByServer(code)), "{object} by {options:?}");
        }
        for (object, code) in [(node, AbortCode::NO_SUB_INDEX), (nowhere, AbortCode::NO_OBJECT)] {
            assert_eq!(read(&mut bus, object, options), Err(SdoError::AbortedByServer(code)));
        }
    }
}

/// Frames on the bus during `talk`, in candump format.
fn transcript(talk: impl FnOnce(&mut Memory<Drive, Wire>)) -> String {
    let wire = Wire::default();
    let mut bus = bus(wire.clone());
    wire.clear();
    talk(&mut bus);
    wire.transcript(0)
}

#[test]
fn golden_expedited() {
    let options = SdoOptions::segmented(TIMEOUT);
    let text = transcript(|bus| {
        read(bus, Object::DEVICE_TYPE, options).unwrap();
        read(bus, Object::ERROR_REGISTER, options).unwrap();
        write(bus, Object::TARGET_TORQUE, &[0xE8, 0x03], options).unwrap();
        write(bus, BUFFER, &[1, 2, 3], options).unwrap();
        read(bus, Object { index: BUFFER.index, sub: 1 }, options).unwrap_err();
        write(bus, Object::DEVICE_TYPE, &[0; 4], options).unwrap_err();
    });
    compare("sdo_expedited.log", &text);
}

#[test]
fn golden_segmented() {
    let options = SdoOptions::segmented(TIMEOUT);
    let text = transcript(|bus| {
        read(bus, Object::DEVICE_NAME, options).unwrap();
        write(bus, BUFFER, &(1..=21).collect::<Vec<_>>(), options).unwrap();
        read(bus, BUFFER, options).unwrap();
        write(bus, BUFFER, &[], options).unwrap();
        read(bus, BUFFER, options).unwrap();
    });
    compare("sdo_segmented.log", &text);
}

#[test]
fn golden_block_upload() {
    let text = transcript(|bus| {
        write(bus, BUFFER, &(1..=60).collect::<Vec<_>>(), SdoOptions::block(TIMEOUT, block(127)))
            .unwrap();
        read(bus, BUFFER, SdoOptions::block(TIMEOUT, block(4))).unwrap();
        read(bus, BUFFER, SdoOptions::block(TIMEOUT, block(127).without_crc())).unwrap();
        read(bus, Object::DEVICE_NAME, SdoOptions::best(TIMEOUT, block(127))).unwrap();
        read(bus, Object::DEVICE_TYPE, SdoOptions::best(TIMEOUT, block(127))).unwrap();
    });
    compare("sdo_block_upload.log", &text);
}

#[test]
fn golden_block_download() {
    let text = transcript(|bus| {
        write(bus, BUFFER, &(1..=60).collect::<Vec<_>>(), SdoOptions::block(TIMEOUT, block(127)))
            .unwrap();
        let more = bytes(1_000, 3);
        write(bus, BUFFER, &more, SdoOptions::best(TIMEOUT, block(127).without_crc())).unwrap();
        write(bus, Object::TARGET_TORQUE, &[0xE8, 0x03], SdoOptions::block(TIMEOUT, block(1)))
            .unwrap();
        let refused = SdoOptions::block(TIMEOUT, block(127));
        write(bus, Object::DEVICE_NAME, &[0; 30], refused).unwrap_err();
    });
    compare("sdo_block_download.log", &text);
}

/// Minimum duration of a block transfer at 1 Mbit/s: 111 bits per segment of 7 bytes, no stuffing.
fn least(size: usize) -> Duration {
    Duration::from_micros(111 * u64::try_from(size.div_ceil(7)).unwrap())
}

#[test]
fn block_transfer_of_a_mebibyte_is_limited_by_the_bit_rate() {
    let mut bus = bus(());
    let value = bytes(1 << 20, 11);
    let mut timed = |is_read: bool| {
        let (start, before) = (bus.now(), bus.carried().next().unwrap().1);
        let options = SdoOptions::block(TIMEOUT, block(127));
        if is_read {
            assert!(read(&mut bus, BUFFER, options).unwrap().bytes() == value);
        } else {
            write(&mut bus, BUFFER, &value, options).unwrap();
        }
        let bits = bus.carried().next().unwrap().1 - before;
        (bus.now().since(start), Duration::from_micros(bits))
    };
    for is_read in [false, true] {
        let (took, on_the_wire) = timed(is_read);
        assert!(took < on_the_wire.mul_f64(1.01), "{took:?} for {on_the_wire:?} of bits");
        assert!(took < least(value.len()).mul_f64(1.10), "{took:?}: stuffing and answers");
    }
}

proptest! {
    /// Lost, repeated and reordered frames.
    #[test]
    fn block_transfer_with_crc_detects_every_corruption(
        seed in any::<u64>(),
        size in 0_usize..3_000,
        block_size in 1_u8..=127,
        is_read in any::<bool>(),
        (loss, repeated, delayed) in (0_u32..200, 0_u32..200, 0_u32..200),
    ) {
        let rates = ErrorRates { loss, repeated, delayed, nth: None };
        let options = SdoOptions::block(TIMEOUT, block(block_size).every(Duration::from_micros(100)));
        assert_transfer(seed, size, options, is_read, rates)?;
    }

    /// Lost frames.
    #[test]
    fn block_transfer_without_crc_survives_losses(
        seed in any::<u64>(),
        size in 0_usize..3_000,
        block_size in 1_u8..=127,
        is_read in any::<bool>(),
        loss in 0_u32..200,
    ) {
        let rates = ErrorRates { loss, ..ErrorRates::default() };
        let block = block(block_size).every(Duration::from_micros(100)).without_crc();
        assert_transfer(seed, size, SdoOptions::best(TIMEOUT, block), is_read, rates)?;
    }

    /// Lost frames, and frames repeated back to back, as on CAN.
    #[test]
    fn repeated_segments_do_not_corrupt_the_value(
        seed in any::<u64>(),
        size in 0_usize..300,
        is_read in any::<bool>(),
        (loss, repeated) in (0_u32..50, 0_u32..50),
    ) {
        let rates = ErrorRates { loss, repeated, ..ErrorRates::default() };
        assert_transfer(seed, size, SdoOptions::segmented(TIMEOUT), is_read, rates)?;
    }
}

/// A disturbed transfer ends in time, with the correct value or an error.
fn assert_transfer(
    seed: u64,
    size: usize,
    options: SdoOptions,
    is_read: bool,
    rates: ErrorRates,
) -> Result<(), TestCaseError> {
    let (old, new) = (bytes(size / 2, seed ^ 1), bytes(size, seed));
    let before = if is_read { &new } else { &old };
    let task = if is_read { Task::Read } else { Task::Write(new.clone()) };
    let mut lossy = Lossy::new(seed, before);
    let outcome = lossy.carry(task, options, rates);
    let buffer = lossy.buffer();
    match (&outcome, is_read) {
        (Ok(content), true) => prop_assert_eq!(content.bytes(), new),
        (Ok(_), false) => prop_assert_eq!(buffer, new),
        (Err(_), true) => prop_assert_eq!(buffer, new),
        (Err(_), false) => prop_assert!(buffer == old || buffer == new),
    }
    Ok(())
}

#[test]
fn block_transfer_survives_any_lost_frame_but_first_and_last() {
    let options = SdoOptions::block(TIMEOUT, block(5).every(Duration::from_micros(100)));
    let value = bytes(100, 1);
    for task in [Task::Read, Task::Write(value.clone())] {
        let mut lossy = Lossy::new(1, &value);
        lossy.carry(task.clone(), options, ErrorRates::default()).unwrap();
        let frames = lossy.sent();
        // The end of an upload is not confirmed, so its loss has no effect.
        let last = if task == Task::Read { frames } else { frames - 1 };
        for lost in 0..frames {
            let mut lossy = Lossy::new(1, &value);
            let outcome = lossy.carry(
                task.clone(),
                options,
                ErrorRates { nth: Some(lost), ..ErrorRates::default() },
            );
            let is_vital = lost < 2 || lost >= last;
            let expected = if is_vital { Err(SdoError::Timeout) } else { Ok(()) };
            assert_eq!(outcome.map(|_| ()), expected, "frame {lost} of {frames} lost: {task:?}");
            assert_eq!(lossy.buffer(), value);
        }
    }
}
