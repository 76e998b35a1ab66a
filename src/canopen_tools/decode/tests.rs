//! What a listener says of a bus, frame by frame.

use std::time::Duration;

use proptest::prelude::*;

use crate::decode::Bus;
use crate::decode::Decoder;
use crate::decode::watch::Timing;
use crate::signals::Member;
use crate::signals::tests::grouped;
use crate::signals::tests::per_drive;
use canopen::frame::Channel;
use units::time::Instant;

const TIMING: Timing = Timing {
    period: Duration::from_micros(1_000),
    window: Duration::from_micros(600),
    master: 127,
    master_lost: Duration::from_millis(22),
};

/// A decoder on one bus, and what it says.
struct Ear {
    decoder: Decoder,
    bus: Bus,
}

impl Ear {
    fn of(members: Vec<Member>) -> Self {
        let mut decoder = Decoder::new(members, TIMING);
        let bus = decoder.listen(Some(Channel(0)));
        Self { decoder, bus }
    }

    /// A frame at so many µs: name, what it says, remarks.
    fn hears(&mut self, micros: u64, cob_id: u16, data: &[u8]) -> String {
        let at = Some(Instant::from_micros(micros));
        let said = self.decoder.on_frame(self.bus, at, cob_id, data);
        let remarks: Vec<_> = said.remarks().map(|remark| remark.to_string()).collect();
        let line = format!("{}: {said}", said.name());
        if remarks.is_empty() { line } else { format!("{line} ! {}", remarks.join(", ")) }
    }
}

#[test]
fn a_drive_s_pdos_are_told_by_joint_and_si_value() {
    let mut ear = Ear::of(per_drive());
    assert_eq!(
        ear.hears(0, 0x182, &[0x37, 0x1A, 0xE8, 0x03, 0, 0, 0x9C, 0xFF]),
        "TPDO1_elbow: operation enabled     , internal limit    0.90000 rad   \
         -0.0100 N·m motor  -2.0000 N·m joint"
    );
    assert_eq!(
        ear.hears(0, 0x202, &[0x0F, 0, 0x32, 0]),
        "RPDO1_elbow: enable operation          0.0050 N·m motor   1.0000 N·m joint"
    );
    assert_eq!(ear.hears(0, 0x190, &[0b1001]), "TPDO1_switch_box: deadman pressed   reflection");
    assert_eq!(ear.hears(0, 0x190, &[0]), "TPDO1_switch_box: deadman disagreeing, A and B clear");
}

#[test]
fn a_shared_frame_tells_every_joint() {
    let mut ear = Ear::of(grouped());
    assert_eq!(
        ear.hears(0, 0x201, &[1, 0, 0xFE, 0xFF, 0, 0]),
        "Torque_group1: shoulder   0.0001 /  0.0200  elbow  -0.0002 / -0.0400  \
         wrist   0.0000 /  0.0000  N·m motor / joint"
    );
    assert_eq!(
        ear.hears(0, 0x282, &[8, 0, 0, 0]),
        "TPDO2_elbow: fault                     0.0000 N·m motor   0.0000 N·m joint"
    );
}

#[test]
fn a_short_pdo_is_told_as_far_as_it_goes() {
    let mut ear = Ear::of(per_drive());
    let said = ear.hears(0, 0x182, &[0x50, 0x02, 1]);
    assert_eq!(said.trim_end(), "TPDO1_elbow: switch on disabled     ! 8 bytes are mapped");
}

#[test]
fn what_is_not_in_the_layout_is_told_by_the_predefined_set() {
    let mut ear = Ear::of(per_drive());
    assert_eq!(ear.hears(0, 0x282, &[1]), "TPDO2 elbow: off in this layout");
    assert_eq!(ear.hears(0, 0x185, &[1]), "TPDO1 node 5: ");
    assert_eq!(ear.hears(0, 0x085, &[0; 8]), "EMCY node 5: 0000h error reset");
    assert_eq!(ear.hears(0, 0x000, &[0x81, 2]), "NMT: reset node 2");
    assert_eq!(ear.hears(0, 0x000, &[0x81]), "malformed: not an NMT command and a node-id");
    assert_eq!(ear.hears(0, 0x7FF, &[]), "unknown: ");
    let noon = [0x00, 0x2E, 0x93, 0x02, 0xFF, 0x3B];
    assert_eq!(ear.hears(0, 0x100, &noon), "TIME: 2026-01-19 12:00:00.000");
}

#[test]
fn a_pdo_is_missed_from_the_sync_after_it_first_came_until_its_node_stops() {
    let mut ear = Ear::of(per_drive());
    let sample = [0x37, 0x12, 0, 0, 0, 0, 0, 0];
    assert_eq!(ear.hears(0, 0x080, &[]), "SYNC: ");
    assert_eq!(ear.hears(1_000, 0x080, &[]), "SYNC: 1000 µs +0", "nothing was ever heard");
    ear.hears(1_300, 0x182, &sample);
    assert_eq!(ear.hears(2_010, 0x080, &[]), "SYNC: 1010 µs +10");
    assert_eq!(ear.hears(3_000, 0x080, &[]), "SYNC: 990 µs -10 ! TPDO1_elbow missing");
    ear.hears(3_300, 0x182, &sample);
    assert_eq!(ear.hears(4_000, 0x080, &[]), "SYNC: 1000 µs +0");
    assert_eq!(ear.hears(4_500, 0x000, &[2, 2]), "NMT: stop node 2");
    assert_eq!(ear.hears(5_000, 0x080, &[]), "SYNC: 1000 µs +0");
}

#[test]
fn a_late_sample_and_a_gap_between_syncs_are_remarked() {
    let mut ear = Ear::of(per_drive());
    ear.hears(0, 0x080, &[]);
    assert!(!ear.hears(600, 0x182, &[0; 8]).contains('!'));
    assert!(ear.hears(601, 0x182, &[0; 8]).ends_with("! 601 µs after SYNC"));
    assert!(!ear.hears(700, 0x202, &[0; 4]).contains('!'), "a target may come later");
    assert_eq!(ear.hears(1_500, 0x080, &[]), "SYNC: 1500 µs +500");
    ear.hears(1_600, 0x182, &[0; 8]);
    ear.hears(1_700, 0x202, &[0; 4]);
    assert_eq!(ear.hears(4_600, 0x080, &[]), "SYNC: 3100 µs +2100 ! SYNC gap of 3 periods");
}

#[test]
fn heartbeats_say_what_is_new_and_their_silence_is_told_once() {
    let mut ear = Ear::of(per_drive());
    assert_eq!(ear.hears(0, 0x702, &[0]), "heartbeat elbow: boot-up");
    assert_eq!(
        ear.hears(20_000, 0x702, &[0x7F]),
        "heartbeat elbow: pre-operational, was initialising"
    );
    assert_eq!(ear.hears(40_000, 0x702, &[5]), "heartbeat elbow: operational, was pre-operational");
    assert_eq!(ear.hears(60_000, 0x702, &[5]), "heartbeat elbow: ");
    assert_eq!(ear.hears(100_000, 0x77F, &[5]), "heartbeat master: operational");
    assert_eq!(ear.hears(119_999, 0x080, &[]), "SYNC: ");
    assert_eq!(
        ear.hears(121_000, 0x080, &[]),
        "SYNC: 1001 µs +1 ! no heartbeat of elbow for 61 ms"
    );
    assert_eq!(
        ear.hears(122_001, 0x080, &[]),
        "SYNC: 1001 µs +1 ! no heartbeat of master for 22 ms"
    );
    assert_eq!(ear.hears(122_500, 0x701, &[5]), "heartbeat shoulder: operational");
    assert_eq!(ear.hears(160_000, 0x702, &[5]), "heartbeat elbow: operational, back after 100 ms");
}

#[test]
fn without_a_configuration_the_period_is_that_of_the_bus() {
    let mut decoder = Decoder::generic();
    let bus = decoder.listen(None);
    let mut hears = |micros| {
        let said = decoder.on_frame(bus, Some(Instant::from_micros(micros)), 0x080, &[]);
        (said.to_string(), said.remarks().count())
    };
    assert_eq!(hears(0), (String::new(), 0));
    assert_eq!(hears(2_000), ("2000 µs".to_owned(), 0));
    assert_eq!(hears(4_004), ("2004 µs +4".to_owned(), 0));
    assert_eq!(hears(9_000).1, 1);
}

#[test]
fn sdo_values_are_told_in_words() {
    let mut ear = Ear::of(per_drive());
    let mut hears = |cob_id, data: [u8; 8]| ear.hears(0, cob_id, &data);
    assert_eq!(
        hears(0x602, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]),
        "SDO elbow: → read 1000h device type"
    );
    assert_eq!(
        hears(0x582, [0x43, 0x00, 0x10, 0, 0x92, 1, 2, 0]),
        "SDO elbow: ← 1000h device type = 00020192h CiA 402"
    );
    assert_eq!(
        hears(0x582, [0x80, 0x18, 0x10, 9, 0x11, 0, 9, 6]),
        "SDO elbow: ← refused 1018h:9: 06090011h sub-index does not exist"
    );
    assert_eq!(
        hears(0x582, [0, 1, 2, 3, 4, 5, 6, 7]),
        "SDO elbow: ← of no transfer that was heard"
    );
}

proptest! {
    #[test]
    fn any_frames_are_told(
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
                let said = decoder.on_frame(bus, at, cob_id & 0x7FF, data);
                prop_assert!(!said.name().to_string().is_empty());
                let words = said.remarks().fold(said.to_string(), |all, one| all + &one.to_string());
                prop_assert!(!words.contains('\n'));
            }
            prop_assert!(decoder.buses.len() <= super::MOST_BUSES);
        }
    }
}
