//! Laws of the reader.

use proptest::prelude::*;

use super::*;

const MS: Duration = Duration::from_millis(1);
/// Maximum time between two reads without a pause.
const MAX_WAIT: Duration = Duration::from_millis(3);
const STREAM: [Request; 1] = [Request::Stream];

fn sensor() -> SocketAddr {
    "192.168.1.1:49152".parse().unwrap()
}

/// Returns a record whose force along x is its number, in N.
fn record(sequence: u32) -> Record {
    let force = i32::try_from(sequence % 1_000).unwrap();
    Record {
        rdt_sequence: sequence,
        ft_sequence: sequence,
        status: 0,
        counts: [1_000_000 * force, 0, 0, 0, 0, 0],
    }
}

/// Reader that has requested records, and its time.
struct Cycles {
    reader: Reader,
    now: Instant,
}

impl Cycles {
    fn new() -> Self {
        let scale = Scale::new(1e6, 1e6).unwrap();
        let mut reader = Reader::new(sensor(), scale, MAX_WAIT, Instant::ZERO);
        assert!(reader.requests(Instant::ZERO).eq(STREAM));
        Self { reader, now: Instant::ZERO }
    }

    /// Reads these records after `span`, and finds the socket empty; returns the reading.
    fn read_after(&mut self, span: Duration, records: &[Record]) -> Reading {
        self.now = self.now + span;
        for record in records {
            self.reader.on_datagram(self.now, sensor(), &record.encode());
        }
        self.reader.on_empty(self.now);
        self.reader.reading()
    }

    /// Reads records with these RDT sequences in a cycle.
    fn read(&mut self, sequences: &[u32]) -> Reading {
        let records: Vec<_> = sequences.iter().copied().map(record).collect();
        self.read_after(MS, &records)
    }

    fn force(&self) -> Option<f64> {
        self.reader.reading().wrench.map(|wrench| wrench.force.x)
    }

    fn requests(&mut self) -> Vec<Request> {
        self.reader.requests(self.now).collect()
    }
}

#[test]
fn newest_record_of_a_read_is_the_reading() {
    let mut cycles = Cycles::new();
    assert_eq!(cycles.reader.reading(), Reading { number: 0, wrench: None });
    assert_eq!(cycles.read(&[1, 2, 3, 4, 5, 6, 7]).number, 6);
    assert_eq!(cycles.force(), Some(7.0));
    assert_eq!(cycles.read(&[]).number, 6, "nothing new");
    assert_eq!(cycles.read(&[8, 9]).number, 8);
    assert_eq!(cycles.force(), Some(9.0));
    let counts = Counts { records: 9, requests: 1, ..Counts::default() };
    assert_eq!(*cycles.reader.counts(), counts);
}

#[test]
fn sequence_wraps_around() {
    let mut cycles = Cycles::new();
    let number = cycles.read(&[u32::MAX - 2, u32::MAX - 1, u32::MAX]).number;
    assert_eq!(number, 2);
    assert_eq!(cycles.read(&[0, 1]).number, 4);
    assert_eq!(cycles.force(), Some(1.0));
    assert_eq!(cycles.read(&[u32::MAX, 0]).number, 4);
    let Counts { lost, overtaken, .. } = *cycles.reader.counts();
    assert_eq!((lost, overtaken), (0, 2));
}

#[test]
fn repeated_and_overtaken_records_have_no_effect() {
    let mut cycles = Cycles::new();
    cycles.read(&[1, 2, 3]);
    assert_eq!(cycles.read(&[3, 2, 1, 3]).number, 2);
    assert_eq!(cycles.force(), Some(3.0));
    assert_eq!(cycles.reader.counts().overtaken, 4);
}

#[test]
fn first_record_behind_a_gap_is_no_reading() {
    let mut cycles = Cycles::new();
    cycles.read(&[1, 2]);
    assert_eq!(cycles.read(&[5]).number, 1);
    assert_eq!(cycles.force(), Some(2.0));
    assert_eq!(cycles.read(&[6]).number, 2);
    assert_eq!((cycles.force(), cycles.reader.counts().lost), (Some(6.0), 2));
    // A stray number far ahead makes no reading either, and its successor does not come.
    cycles.read(&[1_000_000, 7, 8]);
    assert_eq!(cycles.force(), Some(6.0));
}

#[test]
fn status_other_than_zero_makes_the_reading_invalid() {
    let mut cycles = Cycles::new();
    cycles.read(&[1, 2]);
    let invalid = Record { status: 0x8001_0000, ..record(3) };
    let reading = cycles.read_after(MS, &[invalid]);
    assert_eq!(reading, Reading { number: 2, wrench: None });
    assert_eq!(cycles.reader.condition(cycles.now), Condition::Invalid(0x8001_0000));
    assert_eq!(cycles.reader.condition(cycles.now).to_string(), "status 80010000h");
    assert_eq!(cycles.read(&[4]).number, 3);
    assert_eq!((cycles.force(), cycles.reader.counts().invalid), (Some(4.0), 1));
}

#[test]
fn record_without_a_new_measurement_is_no_reading() {
    let mut cycles = Cycles::new();
    cycles.read(&[1, 2]);
    let frozen = |sequence| Record { ft_sequence: 2, ..record(sequence) };
    assert_eq!(cycles.read_after(MS, &[frozen(3), frozen(4)]).number, 1);
    assert_eq!((cycles.force(), cycles.reader.counts().frozen), (Some(2.0), 2));
    assert_eq!(cycles.read(&[5]).number, 2);
}

#[test]
fn datagrams_of_others_are_dropped_and_counted() {
    let mut cycles = Cycles::new();
    cycles.read(&[1, 2]);
    for source in ["192.168.1.1:49153", "192.168.1.2:49152", "[::1]:49152"] {
        let source = source.parse().unwrap();
        cycles.reader.on_datagram(cycles.now, source, &record(3).encode());
        assert_eq!(cycles.reader.foreign(), Some(source));
    }
    assert_eq!((cycles.force(), cycles.reader.counts().foreign), (Some(2.0), 3));
    assert_eq!(cycles.read(&[3]).number, 2, "the sequence is as before");
}

/// Reads as a stopped process does: first the oldest records of its pause, as a full socket drops the newer ones.
#[test]
fn records_that_waited_for_a_stopped_process_are_no_reading() {
    let mut cycles = Cycles::new();
    cycles.read(&[1, 2]);
    let backlog: Vec<_> = (3..250).map(record).collect();
    assert_eq!(cycles.read_after(MS * 3_000, &backlog).number, 1);
    assert_eq!((cycles.force(), cycles.reader.counts().waited), (Some(2.0), 247));
    assert_eq!(cycles.reader.condition(cycles.now), Condition::Silent);
    assert_eq!(cycles.read(&[21_000, 21_001]).number, 2, "and those behind them are");
    let mut late = Cycles::new();
    late.read(&[1, 2]);
    assert_eq!(late.read_after(MAX_WAIT, &[record(3)]).number, 2, "just in time");
    assert_eq!(late.read_after(MAX_WAIT + Duration::from_micros(1), &[record(4)]).number, 2);
}

#[test]
fn records_behind_a_flood_are_no_reading() {
    let mut cycles = Cycles::new();
    cycles.read(&[1, 2]);
    // The socket is never found empty.
    for cycle in 1..=3_u32 {
        cycles.now = cycles.now + MS;
        cycles.reader.on_datagram(cycles.now, sensor(), &record(2 + cycle).encode());
    }
    assert_eq!(cycles.force(), Some(5.0));
    cycles.now = cycles.now + MS;
    cycles.reader.on_datagram(cycles.now, sensor(), &record(6).encode());
    assert_eq!((cycles.force(), cycles.reader.counts().waited), (Some(5.0), 1));
}

#[test]
fn silent_sensor_is_requested_every_100_ms() {
    let mut cycles = Cycles::new();
    let mut asked = Vec::new();
    for milli in 1..=350_u64 {
        cycles.read(&[]);
        assert_eq!(cycles.reader.condition(cycles.now), Condition::Silent);
        asked.extend(cycles.requests().iter().map(|_| milli));
    }
    assert_eq!(asked, [100, 200, 300]);
    // Started again, it counts anew, and is not mistaken for one that was overtaken.
    cycles.read(&[9_000, 9_001]);
    for _ in 0..99 {
        cycles.read(&[]);
        assert_eq!(cycles.requests(), []);
    }
    cycles.read(&[]);
    assert_eq!(cycles.requests(), STREAM);
    cycles.read(&[1, 2]);
    assert_eq!(cycles.force(), Some(2.0));
    let Counts { lost, overtaken, requests, .. } = *cycles.reader.counts();
    assert_eq!((lost, overtaken, requests), (0, 0, 5));
}

#[test]
fn sensor_that_streams_is_not_requested_again() {
    let mut cycles = Cycles::new();
    for sequence in 1..2_000 {
        cycles.read(&[sequence]);
        assert_eq!(cycles.requests(), []);
    }
    assert_eq!(cycles.reader.condition(cycles.now), Condition::Valid);
    cycles.read_after(MAX_WAIT, &[]);
    assert_eq!(cycles.reader.condition(cycles.now), Condition::Silent);
}

#[test]
fn bias_is_sent_on_command_alone_once_and_to_a_valid_sensor() {
    let mut plain = Cycles::new();
    for sequence in 1..500 {
        plain.read(&[sequence]);
        assert_eq!(plain.requests(), []);
    }
    let mut cycles = Cycles::new();
    cycles.reader.bias();
    cycles.read(&[]);
    assert_eq!(cycles.requests(), [], "no sensor yet");
    let invalid = |sequence| Record { status: 1, ..record(sequence) };
    cycles.read_after(MS, &[invalid(1), invalid(2)]);
    assert_eq!(cycles.requests(), []);
    cycles.read(&[3]);
    assert_eq!(cycles.requests(), [Request::Bias, Request::Stream]);
    for sequence in 1..500 {
        cycles.read(&[sequence]);
        assert_eq!(cycles.requests(), []);
    }
}

/// Generates datagrams of a defective sensor: any bytes, or a record with any numbers.
fn datagram() -> impl Strategy<Value = Vec<u8>> {
    let numbers = (0..40_u32, 0..40_u32, 0..3_u32, any::<[i32; 6]>());
    let record = numbers.prop_map(|(rdt_sequence, ft_sequence, status, counts)| {
        let rdt_sequence = rdt_sequence.wrapping_sub(20);
        Record { rdt_sequence, ft_sequence, status, counts }.encode().to_vec()
    });
    prop_oneof![3 => record, 1 => prop::collection::vec(any::<u8>(), 0..50)]
}

proptest! {
    #[test]
    fn reading_is_always_a_record_just_behind_its_predecessor(
        reads in prop::collection::vec((0..5_000_u64, prop::collection::vec(datagram(), 0..9), any::<bool>()), 1..60),
    ) {
        let mut cycles = Cycles::new();
        let mut datagrams = 0;
        let mut before: Option<Record> = None;
        for (micros, read, is_emptied) in reads {
            cycles.now = cycles.now + Duration::from_micros(micros);
            for bytes in read {
                let number = cycles.reader.reading().number;
                cycles.reader.on_datagram(cycles.now, sensor(), &bytes);
                datagrams += 1;
                let reading = cycles.reader.reading();
                prop_assert!((number..=number + 1).contains(&reading.number));
                if reading.number > number {
                    let record = Record::decode(&bytes).unwrap();
                    let before = before.unwrap();
                    prop_assert_eq!(record.rdt_sequence, before.rdt_sequence.wrapping_add(1));
                    prop_assert_ne!(record.ft_sequence, before.ft_sequence);
                    prop_assert_eq!(reading.wrench.is_some(), record.status == 0);
                }
                before = cycles.reader.newest;
            }
            if is_emptied {
                cycles.reader.on_empty(cycles.now);
            }
            if cycles.reader.requests(cycles.now).count() > 0 {
                before = None;
            }
        }
        let Counts { records, malformed, .. } = *cycles.reader.counts();
        prop_assert_eq!(records + malformed, datagrams);
    }

    /// Network that loses, repeats and reorders: each reading is newer than the one before, and every record is
    /// accounted for.
    #[test]
    fn readings_ascend_whatever_the_network_does(
        start in any::<u32>(),
        fates in prop::collection::vec((0..10_u32, any::<bool>()), 1..400),
    ) {
        let mut cycles = Cycles::new();
        let mut sent: Vec<u32> = Vec::new();
        for (place, (fate, is_swapped)) in (0..).zip(&fates) {
            let sequence = start.wrapping_add(place);
            match fate {
                0 => {}
                1 => sent.extend([sequence, sequence]),
                _ => sent.push(sequence),
            }
            if *is_swapped && *fate == 2 && sent.len() > 1 {
                let last = sent.len() - 1;
                sent.swap(last - 1, last);
            }
        }
        let mut newest: Option<u32> = None;
        for sequence in sent {
            let number = cycles.reader.reading().number;
            if cycles.read(&[sequence]).number > number {
                let ahead = newest.map_or(1, |newest| sequence.wrapping_sub(newest));
                prop_assert!((1..400).contains(&ahead));
                newest = Some(sequence);
            }
        }
        let Counts { records, lost, overtaken, .. } = *cycles.reader.counts();
        let span = cycles.reader.newest.map_or(0, |last| u64::from(last.rdt_sequence.wrapping_sub(start)));
        prop_assert!(records - overtaken + lost <= span + 1);
    }
}
