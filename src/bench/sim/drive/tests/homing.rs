//! Homing mode on the bus: position, statusword, torque limit, and when its result is lost.

use super::*;
use canopen::error_codes;

/// Statusword bits 13, 12 and 10 in homing mode: error, attained, target reached.
const BITS: u16 = 1 << 13 | 1 << 12 | 1 << 10;
const ATTAINED: u16 = 1 << 12 | 1 << 10;
/// Controlword that starts homing (bit 4) in operation enabled.
const START: Controlword = Controlword(0x1F);
const HOME: i32 = 4_321;

impl Wire {
    /// Prepares homing mode with this method, and waits for standstill.
    fn prepare_homing(&mut self, method: u8) {
        self.set_mode(6);
        self.send(Frame::new(0x603, [0x2F, 0x98, 0x60, 0, method, 0, 0, 0]));
        self.command(Object::HOME_OFFSET, HOME);
        self.run(50, Controlword::ENABLE_OPERATION);
    }

    /// Homes an enabled drive here.
    fn home(&mut self) {
        self.prepare_homing(37);
        self.run(50, START);
        assert_eq!(self.statusword().0 & BITS, ATTAINED);
    }

    fn position(&self) -> i32 {
        self.signed(Object::POSITION_ACTUAL)
    }
}

#[test]
fn methods_35_and_37_set_the_home_offset_here() {
    for method in [35, 37] {
        let mut wire = Wire::enabled_with(0);
        wire.prepare_homing(method);
        assert_eq!((wire.statusword().0 & BITS, wire.position()), (1 << 10, 1_200), "not started");
        wire.run(50, START);
        assert_eq!((wire.statusword().0 & BITS, wire.position()), (ATTAINED, HOME), "{method}");
        assert_eq!(wire.sample.statusword.0 & BITS, ATTAINED, "in the TPDO");
        wire.set_mode(10);
        wire.run(10, Controlword::ENABLE_OPERATION);
        assert_eq!(wire.position(), HOME, "in other modes as well");
    }
}

#[test]
fn unsupported_homing_method_sets_bit_13() {
    let mut wire = Wire::enabled_with(0);
    wire.prepare_homing(17);
    wire.run(50, START);
    assert_eq!((wire.statusword().0 & BITS, wire.position()), (1 << 13 | 1 << 10, 1_200));
}

#[test]
fn home_survives_communication_reset_only() {
    for (command, kept) in [(0x82, HOME), (0x81, 1_200)] {
        let mut wire = Wire::enabled_with(0);
        wire.home();
        wire.send(Frame::new(0, [command, 3]));
        wire.step();
        assert_eq!(wire.position(), kept, "{command:02X}h");
    }
    let mut wire = Wire::enabled_with(0);
    wire.home();
    wire.drive.switch_off();
    wire.drive.switch_on(wire.now);
    wire.step();
    assert_eq!(wire.position(), 1_200, "power cycle");
}

#[test]
fn moving_homing_stays_within_max_torque() {
    let mut wire = Wire::with_drive(drive_with(EncoderKind::Absolute, &["homing-moves"]));
    wire = wire.boot().enable(0);
    wire.write(Object::MAX_TORQUE, 50_u16.to_le_bytes());
    // Faster than 50 ‰ allow.
    wire.command(Object::HOMING_SPEED_ZERO, 50_000);
    wire.command(Object::HOMING_ACCELERATION, 100_000_000);
    wire.prepare_homing(37);
    let start = wire.motor.position;
    let mut most = 0.0_f64;
    for _ in 0..3_000 {
        wire.run(1, START);
        most = most.max(wire.drive.demand().abs());
    }
    assert!((49.9..=50.0).contains(&most), "{most} ‰");
    assert_eq!(wire.statusword().0 & BITS, ATTAINED);
    assert!(wire.motor.position < start, "the gear turns it against the increments");
}

/// Returns whether `bit` of the statusword is set.
fn has(wire: &Wire, bit: u16) -> bool {
    wire.statusword().has(1 << bit)
}

/// Returns an enabled drive with `quirk`, homed.
fn homed(quirk: &str) -> Wire {
    let mut wire = Wire::with_drive(drive_with(EncoderKind::Absolute, &[quirk])).boot().enable(0);
    assert!([8, 14, 15].iter().all(|bit| !has(&wire, *bit)), "before the homing");
    wire.home();
    wire
}

#[test]
fn referenced_bit_is_set_in_every_mode_after_homing() {
    for (quirk, bit) in [("referenced-bit", 15), ("referenced-bit:14", 14), ("referenced-bit:8", 8)]
    {
        let mut wire = homed(quirk);
        for mode in [6, 1, 10] {
            wire.set_mode(mode);
            wire.run(2, Controlword::ENABLE_OPERATION);
            assert!(has(&wire, bit), "mode {mode}");
        }
        wire.run(2, Controlword::DISABLE_VOLTAGE);
        assert!(has(&wire, bit) && wire.drive.state() == State::SwitchOnDisabled);
        let others = [8, 14, 15].into_iter().filter(|other| *other != bit);
        assert!(others.clone().all(|other| !has(&wire, other)), "{quirk}");
    }
    assert!([8, 14, 15].iter().all(|bit| !has(&homed("incremental"), *bit)), "no quirk, no bit");
}

#[test]
fn referenced_bit_needs_a_completed_homing() {
    let drive = drive_with(EncoderKind::Absolute, &["referenced-bit"]);
    let mut wire = Wire::with_drive(drive).boot().enable(0);
    wire.prepare_homing(17);
    wire.run(50, START);
    assert!(!has(&wire, 15), "homing error");
    wire.run(2, Controlword::ENABLE_OPERATION);
    wire.prepare_homing(34);
    wire.run(5, START);
    assert!(!has(&wire, 15), "in progress");
}

#[test]
fn referenced_bit_is_lost_at_power_up_and_feedback_faults() {
    let mut wire = homed("referenced-bit");
    wire.send(Frame::new(0, [0x82, 3]));
    wire.step();
    assert!(has(&wire, 15), "82h keeps it");
    wire.send(Frame::new(0, [0x81, 3]));
    assert!(!has(&wire, 15), "81h");
    let mut wire = homed("referenced-bit");
    wire.drive.switch_off();
    wire.drive.switch_on(wire.now);
    assert!(!has(&wire, 15), "power cycle");
    for code in error_codes::OF_DRIVES {
        let mut wire = homed("referenced-bit");
        wire.drive.fail_with(code);
        assert_eq!(has(&wire, 15), code >> 8 != 0x73, "{code:04X}h");
        assert_eq!(wire.position(), HOME, "{code:04X}h");
    }
}
