//! Tests of the decoder, frame by frame.

use std::time::Duration;

use proptest::prelude::*;

use crate::decode::bus_monitor::Timing;
use crate::decode::{Bus, Decoder};
use crate::signals::Member;
use crate::signals::tests::{grouped, per_drive};
use canopen::frame::Channel;
use units::time::Instant;

const TIMING: Timing = Timing {
    period: Duration::from_micros(1_000),
    window: Duration::from_micros(600),
    master: 127,
    master_lost: Duration::from_millis(22),
};

/// Decoder of one bus.
struct Probe {
    decoder: Decoder,
    bus: Bus,
}

impl Probe {
    fn new(members: Vec<Member>) -> Self {
        let mut decoder = Decoder::new(members, TIMING);
        let bus = decoder.listen(Some(Channel(0)));
        Self { decoder, bus }
    }

    /// Annotation of a frame at `micros`: name, content, remarks.
    fn decode(&mut self, micros: u64, cob_id: u16, data: &[u8]) -> String {
        let at = Some(Instant::from_micros(micros));
        let annotation = self.decoder.on_frame(self.bus, at, cob_id, data);
        let remarks: Vec<_> = annotation.remarks().map(|remark| remark.to_string()).collect();
        let line = format!("{}: {annotation}", annotation.name());
        if remarks.is_empty() { line } else { format!("{line} ! {}", remarks.join(", ")) }
    }
}

#[test]
fn pdos_of_a_drive_read_with_joint_and_si_values() {
    let mut bus = Probe::new(per_drive());
    assert_eq!(
        bus.decode(0, 0x182, &[0x37, 0x1A, 0xE8, 0x03, 0, 0, 0x9C, 0xFF]),
        "TPDO1_elbow: operation enabled     , internal limit    0.90000 rad   \
         -0.0100 N·m motor  -2.0000 N·m joint"
    );
    assert_eq!(
        bus.decode(0, 0x202, &[0x0F, 0, 0x32, 0]),
        "RPDO1_elbow: enable operation          0.0050 N·m motor   1.0000 N·m joint"
    );
    assert_eq!(bus.decode(0, 0x190, &[0b1001]), "TPDO1_switch_box: deadman pressed   reflection");
    assert_eq!(bus.decode(0, 0x190, &[0]), "TPDO1_switch_box: deadman disagreeing, A and B clear");
}

#[test]
fn shared_frame_lists_every_joint() {
    let mut bus = Probe::new(grouped());
    assert_eq!(
        bus.decode(0, 0x201, &[1, 0, 0xFE, 0xFF, 0, 0]),
        "RPDO1_group1: shoulder   0.0001 /  0.0200  elbow  -0.0002 / -0.0400  \
         wrist   0.0000 /  0.0000  N·m motor / joint"
    );
    assert_eq!(
        bus.decode(0, 0x282, &[8, 0, 0, 0]),
        "TPDO2_elbow: fault                     0.0000 N·m motor   0.0000 N·m joint"
    );
}

#[test]
fn short_pdo_reads_as_far_as_it_goes() {
    let mut bus = Probe::new(per_drive());
    let annotation = bus.decode(0, 0x182, &[0x50, 0x02, 1]);
    assert_eq!(annotation.trim_end(), "TPDO1_elbow: switch on disabled     ! 8 bytes are mapped");
}

#[test]
fn frames_outside_the_layout_read_by_the_predefined_set() {
    let mut bus = Probe::new(per_drive());
    assert_eq!(bus.decode(0, 0x282, &[1]), "TPDO2 elbow: off in this layout");
    assert_eq!(bus.decode(0, 0x185, &[1]), "TPDO1 node 5: ");
    assert_eq!(bus.decode(0, 0x085, &[0; 8]), "EMCY node 5: 0000h error reset");
    assert_eq!(bus.decode(0, 0x000, &[0x81, 2]), "NMT: reset node 2");
    assert_eq!(bus.decode(0, 0x000, &[0x81]), "malformed: not an NMT command and a node-id");
    assert_eq!(bus.decode(0, 0x7FF, &[]), "unknown: ");
    let noon = [0x00, 0x2E, 0x93, 0x02, 0xFF, 0x3B];
    assert_eq!(bus.decode(0, 0x100, &noon), "TIME: 2026-01-19 12:00:00.000");
}

#[test]
fn pdo_is_expected_after_its_first_frame() {
    let mut bus = Probe::new(per_drive());
    let sample = [0x37, 0x12, 0, 0, 0, 0, 0, 0];
    assert_eq!(bus.decode(0, 0x080, &[]), "SYNC: ");
    assert_eq!(bus.decode(1_000, 0x080, &[]), "SYNC: 1000 µs +0", "no PDO received yet");
    bus.decode(1_300, 0x182, &sample);
    assert_eq!(bus.decode(2_010, 0x080, &[]), "SYNC: 1010 µs +10");
    assert_eq!(bus.decode(3_000, 0x080, &[]), "SYNC: 990 µs -10 ! TPDO1_elbow missing");
    bus.decode(3_300, 0x182, &sample);
    assert_eq!(bus.decode(4_000, 0x080, &[]), "SYNC: 1000 µs +0");
    assert_eq!(bus.decode(4_500, 0x000, &[2, 2]), "NMT: stop node 2");
    assert_eq!(bus.decode(5_000, 0x080, &[]), "SYNC: 1000 µs +0");
}

#[test]
fn late_sample_and_sync_gap_are_remarked() {
    let mut bus = Probe::new(per_drive());
    bus.decode(0, 0x080, &[]);
    assert!(!bus.decode(600, 0x182, &[0; 8]).contains('!'));
    assert!(bus.decode(601, 0x182, &[0; 8]).ends_with("! 601 µs after SYNC"));
    assert!(!bus.decode(700, 0x202, &[0; 4]).contains('!'), "a target may come later");
    assert_eq!(bus.decode(1_500, 0x080, &[]), "SYNC: 1500 µs +500");
    bus.decode(1_600, 0x182, &[0; 8]);
    bus.decode(1_700, 0x202, &[0; 4]);
    assert_eq!(bus.decode(4_600, 0x080, &[]), "SYNC: 3100 µs +2100 ! SYNC gap of 3 periods");
}

#[test]
fn heartbeat_changes_are_shown_and_loss_is_remarked_once() {
    let mut bus = Probe::new(per_drive());
    assert_eq!(bus.decode(0, 0x702, &[0]), "heartbeat elbow: boot-up");
    assert_eq!(
        bus.decode(20_000, 0x702, &[0x7F]),
        "heartbeat elbow: pre-operational, was initialising"
    );
    assert_eq!(
        bus.decode(40_000, 0x702, &[5]),
        "heartbeat elbow: operational, was pre-operational"
    );
    assert_eq!(bus.decode(60_000, 0x702, &[5]), "heartbeat elbow: ");
    assert_eq!(bus.decode(100_000, 0x77F, &[5]), "heartbeat master: operational");
    assert_eq!(bus.decode(119_999, 0x080, &[]), "SYNC: ");
    assert_eq!(
        bus.decode(121_000, 0x080, &[]),
        "SYNC: 1001 µs +1 ! no heartbeat of elbow for 61 ms"
    );
    assert_eq!(
        bus.decode(122_001, 0x080, &[]),
        "SYNC: 1001 µs +1 ! no heartbeat of master for 22 ms"
    );
    assert_eq!(bus.decode(122_500, 0x701, &[5]), "heartbeat shoulder: operational");
    assert_eq!(bus.decode(160_000, 0x702, &[5]), "heartbeat elbow: operational, back after 100 ms");
}

#[test]
fn unconfigured_period_is_measured() {
    let mut decoder = Decoder::generic();
    let bus = decoder.listen(None);
    let mut decode = |micros| {
        let annotation = decoder.on_frame(bus, Some(Instant::from_micros(micros)), 0x080, &[]);
        (annotation.to_string(), annotation.remarks().count())
    };
    assert_eq!(decode(0), (String::new(), 0));
    assert_eq!(decode(2_000), ("2000 µs".to_owned(), 0));
    assert_eq!(decode(4_004), ("2004 µs +4".to_owned(), 0));
    assert_eq!(decode(9_000).1, 1);
}

#[test]
fn sdo_values_have_their_text() {
    let mut bus = Probe::new(per_drive());
    let mut decode = |cob_id, data: [u8; 8]| bus.decode(0, cob_id, &data);
    assert_eq!(
        decode(0x602, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]),
        "SDO elbow: → read 1000h device type"
    );
    assert_eq!(
        decode(0x582, [0x43, 0x00, 0x10, 0, 0x92, 1, 2, 0]),
        "SDO elbow: ← 1000h device type = 00020192h CiA 402"
    );
    assert_eq!(
        decode(0x582, [0x80, 0x18, 0x10, 9, 0x11, 0, 9, 6]),
        "SDO elbow: ← refused 1018h:9: 06090011h sub-index does not exist"
    );
    assert_eq!(decode(0x582, [0, 1, 2, 3, 4, 5, 6, 7]), "SDO elbow: ← of an unknown transfer");
}

proptest! {
    #[test]
    fn any_frames_are_decoded(
        frames in proptest::collection::vec(
            (
                any::<u8>(),
                proptest::option::of(any::<u64>()),
                any::<u16>(),
                proptest::collection::vec(any::<u8>(), 0..12),
            ),
            0..200,
        ),
    ) {
        for mut decoder in [
            Decoder::generic(),
            Decoder::new(per_drive(), TIMING),
            Decoder::new(grouped(), TIMING),
        ] {
            let mut buses = Vec::new();
            for (bus, at, cob_id, data) in &frames {
                if buses.len() < 200 {
                    buses.push(decoder.listen(bus.is_multiple_of(2).then_some(Channel(*bus))));
                }
                let bus = buses[usize::from(*bus) % buses.len()];
                let at = at.map(Instant::from_micros);
                let annotation = decoder.on_frame(bus, at, cob_id & 0x7FF, data);
                prop_assert!(!annotation.name().to_string().is_empty());
                let text = annotation.remarks().fold(annotation.to_string(), |all, one| all + &one.to_string());
                prop_assert!(!text.contains('\n'));
            }
            prop_assert!(decoder.buses.len() <= super::MAX_BUSES);
        }
    }
}
