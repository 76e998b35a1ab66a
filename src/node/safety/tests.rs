use proptest::prelude::*;

use super::*;
use crate::cause::ResetReason;
use crate::joint_reading::JointReading;
use crate::reaction::Initiator;
use canopen::object::Object;
use canopen::{NmtState, error_codes};
use config::NoSwitchBox;
use contract::Reason;
use controller::InvalidValue;
use controller::arm::JointKind;
use units::numbering::NodeIndex;

const TIMES: SafetyTimes = SafetyTimes {
    enable: EnableTimes {
        enable: Duration::from_secs(2),
        initialise: [
            Duration::from_secs(2),
            Duration::from_secs(1),
            Duration::from_secs(5),
            Duration::from_secs(2),
            Duration::from_secs(2),
            Duration::from_secs(2),
        ],
    },
    gravity: Duration::from_secs(1),
    reflection: Duration::from_millis(300),
};

/// Time in ms at which no earlier cause is active any more.
const LATER: u64 = 10_000;

fn at(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}

#[test]
fn drive_may_be_not_ready_for_its_boot_time_then_is_enabled() {
    let [short, long] = [Joint::of::<2>(), Joint::of::<3>()];
    let (not_ready, disabled) = (0x0600, 0x0650);
    let late = |joint, statusword| Some(Cause::EnableTimeout { joint, statusword });
    let mut safety = Safety::new(TIMES);
    safety.boot(at(1_000));
    // A shorter time than that to enable the drives makes no difference.
    assert_eq!(safety.watch_enabled(at(3_000), short, not_ready), None);
    assert_eq!(safety.watch_enabled(at(3_001), short, not_ready), late(short, not_ready));
    assert_eq!(safety.watch_enabled(at(6_000), long, not_ready), None);
    assert_eq!(safety.watch_enabled(at(6_001), long, not_ready), late(long, not_ready));

    let mut safety = Safety::new(TIMES);
    safety.boot(at(1_000));
    assert_eq!(safety.watch_enabled(at(5_500), long, not_ready), None);
    assert_eq!(safety.watch_enabled(at(7_500), long, disabled), None);
    assert_eq!(safety.watch_enabled(at(7_501), long, disabled), late(long, disabled));
    safety.boot(at(8_000));
    assert_eq!(safety.watch_enabled(at(10_000), long, disabled), None);
    assert_eq!(safety.watch_enabled(at(10_001), long, disabled), late(long, disabled));
}

fn armed() -> Safety {
    let mut safety = Safety::new(TIMES);
    safety.on_drives_enabled(at(0));
    safety.advance(at(0), false);
    safety.arm(at(0), Some(EnableState::Released)).unwrap();
    safety
}

/// Returns a graph in which the arm may move itself.
fn measuring() -> Safety {
    let mut safety = Safety::new(SafetyTimes { gravity: Duration::from_millis(1), ..TIMES });
    safety.on_drives_enabled(at(0));
    safety.arm(at(0), Some(EnableState::Released)).unwrap();
    let early = safety.measure(at(0), Some(EnableState::Released));
    assert_eq!(early, Err(Refusal::NotCarried(Mode::Armed)));
    safety.advance(at(1), false);
    safety.advance(at(2), false);
    assert_eq!(safety.measure(at(2), Some(EnableState::Held)), Err(Refusal::DeadmanClosed));
    assert_eq!(safety.measure(at(2), None), Err(NoSwitchBox.into()));
    safety.measure(at(2), Some(EnableState::Released)).unwrap();
    safety
}

#[test]
fn hazard_52_arm_may_move_itself_only_while_measuring_with_the_deadman_held() {
    let mut safety = measuring();
    for (millis, is_held) in [(3, false), (4, true), (5, false), (6, true)] {
        let permit = safety.advance(at(millis), is_held);
        assert_eq!((permit.hold, permit.engaged), (is_held, false), "at {millis} ms");
    }
    safety.raise(at(7), Cause::LinkLost);
    assert!(safety.advance(at(7), true).hold, "nothing is commanded and nothing felt");
    safety.disarm();
    assert!(!safety.advance(at(8), true).hold, "it ramps down");
    assert!(!engaged().advance(at(3), true).hold);
}

fn engaged() -> Safety {
    let mut safety = armed();
    safety.advance(at(1), false);
    safety.advance(at(2), true);
    assert_eq!(safety.mode(), Mode::Engaged);
    safety
}

/// Returns a graph in `mode`. Stopped modes have a cause that requires no boot.
fn in_mode(mode: Mode) -> Safety {
    let mut safety = match mode {
        Mode::Boot | Mode::Ready => Safety::new(TIMES),
        Mode::Armed => armed(),
        Mode::Measuring => measuring(),
        Mode::Engaged | Mode::ReflectionOff | Mode::ZeroTorque | Mode::DrivesOff => engaged(),
    };
    match mode {
        Mode::Boot | Mode::Armed | Mode::Engaged | Mode::Measuring => {}
        Mode::Ready => safety.on_drives_enabled(at(0)),
        Mode::ReflectionOff => safety.raise(at(3), FIRST),
        Mode::ZeroTorque => safety.raise(at(3), Cause::GripOverspeed),
        Mode::DrivesOff => {
            safety.raise(at(3), Cause::GripOverspeed);
            safety.advance(at(103), false);
        }
    }
    assert_eq!(safety.mode(), mode);
    safety
}

const FIRST: Cause = Cause::TieDown;

/// Returns a cause of a kind.
fn sample(kind: CauseKind) -> Cause {
    let (joint, channel, statusword) = (Joint::of::<3>(), 0, 0x0218);
    let position = JointReading::new(0.2, JointKind::Revolute);
    let node = joint.into();
    match kind {
        CauseKind::SamplesMissing => Cause::SamplesMissing { joint, cycles: 3 },
        CauseKind::StatusMissing => Cause::StatusMissing { joint },
        CauseKind::SamplesRare => Cause::SamplesRare { joint, percent: 6 },
        CauseKind::SamplesOverdue => Cause::SamplesOverdue { joint, cycles: 11 },
        CauseKind::PositionFrozen => Cause::PositionFrozen { joint },
        CauseKind::PositionJumped => Cause::PositionJumped { joint },
        CauseKind::TorqueDiffers => Cause::TorqueDiffers { joint },
        CauseKind::TargetNotTaken => Cause::TargetNotTaken { joint },
        CauseKind::Overspeed => Cause::Overspeed { joint },
        CauseKind::GripOverspeed => Cause::GripOverspeed,
        CauseKind::BeyondLimit => {
            let at = JointReading::new(2.0, JointKind::Revolute);
            Cause::BeyondLimit { joint, position: at, limit: at }
        }
        CauseKind::NotFollowing => Cause::NotFollowing { joint, position },
        CauseKind::Blocked => Cause::Blocked { joint, position },
        CauseKind::UncommandedMotion => Cause::UncommandedMotion,
        CauseKind::Unstable => Cause::Unstable,
        CauseKind::LinkLost => Cause::LinkLost,
        CauseKind::FarSideHolds => Cause::FarSideHolds { reason: Reason::WrenchLimit },
        CauseKind::LinkSlow => Cause::LinkSlow { p99_us: 9_000, stated_us: 5_000 },
        CauseKind::ModelDiffers => Cause::ModelDiffers { micrometres: 21_000, millidegrees: 300 },
        CauseKind::GripperInputInvalid => {
            Cause::GripperInputInvalid { counts: -9_000, closed: 0, open: 9_000 }
        }
        CauseKind::DriveLeft => Cause::DriveLeft { joint, statusword },
        CauseKind::Emergency => Cause::Emergency { node, code: error_codes::OVER_VOLTAGE },
        CauseKind::HeartbeatLost => Cause::HeartbeatLost { node },
        CauseKind::Rebooted => Cause::Rebooted { node },
        CauseKind::LeftOperational => Cause::LeftOperational { node, state: NmtState::Stopped },
        CauseKind::Duplicate => Cause::Duplicate { node },
        CauseKind::ForeignMaster => Cause::ForeignMaster,
        CauseKind::SettingChanged => {
            let object = Object::rpdo_communication(1, 5);
            Cause::SettingChanged { node, object, expected: 5, found: 0 }
        }
        CauseKind::ControllerFault => {
            Cause::ControllerFault { invalid: InvalidValue::WrenchNotFinite }
        }
        CauseKind::QueueFull => Cause::QueueFull { channel },
        CauseKind::TransmitUnconfirmed => Cause::TransmitUnconfirmed { channel },
        CauseKind::BusPassive => Cause::BusPassive { channel },
        CauseKind::BusOff => Cause::BusOff { channel },
        CauseKind::BusDown => Cause::BusDown { channel },
        CauseKind::DeadmanDisagrees => Cause::DeadmanDisagrees,
        CauseKind::TieDown => Cause::TieDown,
        CauseKind::Overrun => Cause::Overrun { cycles: 6 },
        CauseKind::Late => Cause::Late,
        CauseKind::Suspended => Cause::Suspended,
        CauseKind::EnableTimeout => Cause::EnableTimeout { joint, statusword },
        CauseKind::NotOff => Cause::NotOff { joint, statusword },
        CauseKind::HomingFailed => Cause::HomingFailed { joint },
        CauseKind::ZeroUnknown => Cause::ZeroUnknown { joint },
        CauseKind::LimitReduced => Cause::LimitReduced { joint },
        CauseKind::AwaitsReset => Cause::AwaitsReset { reason: ResetReason::UncleanEnd },
    }
}

/// Every kind in every mode.
fn everywhere() -> impl Iterator<Item = (CauseKind, Mode)> {
    CauseKind::ALL.into_iter().flat_map(|kind| Mode::ALL.map(|mode| (kind, mode)))
}

#[test]
fn each_cause_in_each_mode_leads_to_the_mode_of_the_table() {
    for (kind, mode) in everywhere() {
        let mut safety = in_mode(mode);
        safety.raise(at(60), sample(kind));
        let after = table::reaction(kind, mode).mode().unwrap_or(mode);
        assert_eq!(safety.mode(), after, "{kind:?} in {mode}");
        let permit = safety.advance(at(60), true);
        assert_eq!(permit.drives_on, after != Mode::DrivesOff, "{kind:?} in {mode}");
        if after.is_stopped() {
            assert!(!safety.allows_torque(), "{kind:?} in {mode}");
            assert_eq!((permit.gravity_share, permit.reflection_share), (0.0, 0.0));
        }
        if after == Mode::ReflectionOff {
            assert!(safety.allows_torque() && !permit.engaged && permit.reflection_share == 0.0);
        }
    }
}

#[test]
fn first_cause_is_kept_in_every_mode() {
    for (kind, mode) in everywhere() {
        let mut safety = in_mode(mode);
        let before = safety.cause();
        assert_eq!(before.is_some(), mode.is_latched());
        safety.raise(at(60), sample(kind));
        let after = if safety.mode().is_latched() { before.or(Some(sample(kind))) } else { None };
        assert_eq!(safety.cause(), after, "{kind:?} in {mode}");
    }
}

#[test]
fn active_cause_refuses_a_reset_unless_the_reset_clears_it() {
    for kind in CauseKind::ALL {
        let mut safety = in_mode(Mode::ZeroTorque);
        let cause = sample(kind);
        safety.raise(at(LATER), cause);
        let row = kind.row();
        let answer = safety.reset(at(LATER + 20));
        if row.reset_boots || row.initiator == Initiator::Drive {
            assert_eq!(answer.map(|stop| stop.must_boot), Ok(row.reset_boots), "{kind:?}");
        } else {
            assert_eq!(answer, Err(Refusal::CauseActive(cause)), "{kind:?}");
            assert!(safety.reset(at(LATER + 21)).is_ok(), "{kind:?}: gone");
        }
    }
}

#[test]
fn active_cause_refuses_arming_and_is_named() {
    for kind in CauseKind::ALL.into_iter().filter(|kind| kind.row().unarmed == Reaction::NoStop) {
        let mut safety = in_mode(Mode::Ready);
        let cause = sample(kind);
        safety.raise(at(LATER), cause);
        assert_eq!((safety.mode(), safety.cause()), (Mode::Ready, None));
        let answer = safety.arm(at(LATER + 1), Some(EnableState::Released));
        assert_eq!(answer, Err(Refusal::CauseActive(cause)));
        assert_eq!(answer.unwrap_err().to_string(), format!("still active: {cause}"));
        assert_eq!(safety.arm(at(LATER + 21), Some(EnableState::Released)), Ok(()));
    }
}

#[test]
fn hazard_39_only_a_new_press_engages_after_any_stop() {
    for kind in CauseKind::ALL {
        let mut safety = engaged();
        safety.raise(at(10), sample(kind));
        assert!(!safety.advance(at(11), true).engaged);
        let answer = safety.reset(at(LATER));
        assert!(answer.is_ok());
        if safety.mode() == Mode::Boot {
            safety.on_drives_enabled(at(LATER));
            let refused = safety.arm(at(LATER), Some(EnableState::Held));
            assert_eq!(refused, Err(Refusal::DeadmanClosed), "{kind:?}");
            safety.advance(at(LATER), false);
            safety.arm(at(LATER), Some(EnableState::Released)).unwrap();
        } else {
            assert!(!safety.advance(at(LATER), true).engaged, "{kind:?}: still closed");
            safety.advance(at(LATER + 1), false);
        }
        assert!(safety.advance(at(LATER + 2), true).engaged, "{kind:?}");
    }
}

proptest! {
    #[test]
    fn property_15_any_order_of_causes_ends_in_the_strictest_mode(
        kinds in prop::collection::vec(prop::sample::select(CauseKind::ALL.to_vec()), 1..12),
        mode in prop::sample::select(vec![Mode::Boot, Mode::Ready, Mode::Armed, Mode::Engaged])
    ) {
        let mut safety = in_mode(mode);
        let worst = kinds.iter().map(|kind| table::reaction(*kind, mode)).max().unwrap();
        let is_cause = |kind: &&CauseKind| table::reaction(**kind, mode) > Reaction::NoStop;
        let first = kinds.iter().find(is_cause).map(|kind| sample(*kind));
        let must_boot = kinds.iter().filter(is_cause).any(|kind| kind.row().reset_boots);
        kinds.iter().for_each(|kind| safety.raise(at(10), sample(*kind)));
        prop_assert_eq!(safety.mode(), worst.mode().unwrap_or(mode));
        prop_assert_eq!(safety.cause(), first);
        if safety.mode().is_latched() {
            prop_assert_eq!(safety.reset(at(LATER)).map(|stop| stop.must_boot), Ok(must_boot));
        }
    }
}

#[test]
fn torque_is_zero_before_arming() {
    let mut safety = Safety::new(TIMES);
    for is_held in [false, true] {
        let permit = safety.advance(at(1), is_held);
        assert_eq!((permit.gravity_share, permit.reflection_share), (0.0, 0.0));
        assert!(!permit.engaged && !safety.allows_torque());
    }
    assert_eq!(safety.arm(at(2), Some(EnableState::Released)), Err(Refusal::NotReady(Mode::Boot)));
}

#[test]
fn hazard_39_arming_needs_a_deadman_known_to_be_released() {
    let mut safety = in_mode(Mode::Ready);
    for (enable_state, refusal) in [
        (EnableState::Held, Refusal::DeadmanClosed),
        (EnableState::ClosedWithoutRelease, Refusal::DeadmanClosed),
        (EnableState::Unsettled, Refusal::DeadmanNotSettled),
        (EnableState::Silent, Refusal::SwitchBoxSilent),
    ] {
        assert_eq!(safety.arm(at(1), Some(enable_state)), Err(refusal));
    }
    assert_eq!(safety.arm(at(1), None), Err(Refusal::NoSwitchBox(NoSwitchBox)));
    safety.arm(at(2), Some(EnableState::Released)).unwrap();
    assert!(!safety.advance(at(3), false).engaged);
    assert!(safety.advance(at(4), true).engaged);
}

#[test]
fn hazard_38_deadman_release_disengages_in_the_same_cycle() {
    let mut safety = engaged();
    let permit = safety.advance(at(11), false);
    assert_eq!((permit.mode, permit.reflection_share), (Mode::Armed, 0.0));
}

#[test]
fn hazard_41_gravity_compensation_and_reflection_ramp_up() {
    let mut safety = armed();
    let permit = safety.advance(at(500), false);
    assert!((permit.gravity_share - 0.5).abs() < 1e-12 && permit.gravity_ramps_up);
    assert!(safety.advance(at(2_000), true).reflection_share < 1e-12);
    let permit = safety.advance(at(2_150), true);
    assert!((permit.reflection_share - 0.5).abs() < 1e-12);
    assert!((permit.gravity_share - 1.0).abs() < 1e-12 && !permit.gravity_ramps_up);
    safety.advance(at(2_151), false);
    assert!(safety.advance(at(2_152), true).reflection_share < 1e-12, "from zero again");
}

#[test]
fn hazard_30_disarming_ramps_torque_to_zero_within_50_ms() {
    for (mode, after) in [
        (Mode::Armed, Mode::Ready),
        (Mode::Engaged, Mode::Ready),
        (Mode::ReflectionOff, Mode::ZeroTorque),
    ] {
        let mut safety = in_mode(mode);
        safety.advance(at(2_000), mode == Mode::Engaged);
        safety.disarm();
        let shares: Vec<f64> = (2_001..2_050)
            .map(|millis| {
                let permit = safety.advance(at(millis), true);
                assert!(
                    safety.allows_torque() && !permit.engaged && permit.reflection_share == 0.0
                );
                assert!(!permit.gravity_ramps_up);
                permit.gravity_share
            })
            .collect();
        let steps = shares.windows(2).map(|pair| pair[0] - pair[1]);
        assert!(steps.into_iter().all(|by| (by - 0.02).abs() < 1e-9), "{shares:?}");
        safety.advance(at(2_051), true);
        assert_eq!(safety.mode(), after);
        assert!(!safety.allows_torque());
    }
    for mode in [Mode::Boot, Mode::Ready, Mode::ZeroTorque, Mode::DrivesOff] {
        let mut safety = in_mode(mode);
        safety.disarm();
        assert_eq!(safety.mode(), mode, "no torque, no ramp");
    }
}

#[test]
fn fault_during_the_ramp_down_ends_torque_at_once() {
    let mut safety = engaged();
    safety.advance(at(2_000), true);
    safety.disarm();
    safety.advance(at(2_010), true);
    safety.raise(at(2_011), Cause::GripOverspeed);
    assert!(!safety.allows_torque());
    assert!(safety.advance(at(2_012), true).gravity_share == 0.0);
}

#[test]
fn zero_torque_becomes_drives_off_after_100_ms() {
    let mut safety = in_mode(Mode::ZeroTorque);
    assert!(safety.advance(at(102), false).drives_on);
    assert!(!safety.advance(at(103), false).drives_on);
}

#[test]
fn reflection_off_keeps_gravity_compensation_until_a_reset() {
    let mut safety = engaged();
    safety.advance(at(2_000), true);
    safety.raise(at(2_001), Cause::LinkLost);
    let permit = safety.advance(at(2_002), true);
    assert_eq!((permit.mode, permit.engaged), (Mode::ReflectionOff, false));
    assert!((permit.gravity_share - 1.0).abs() < 1e-12 && permit.reflection_share == 0.0);
    assert!(safety.reset(at(3_000)).is_ok());
    assert_eq!(safety.mode(), Mode::Armed);
    assert!((safety.advance(at(3_001), true).gravity_share - 1.0).abs() < 1e-12, "no new ramp");
}

#[test]
fn failed_boot_returns_to_the_stop_with_its_first_cause() {
    let mut safety = engaged();
    safety.raise(at(10), Cause::LinkLost);
    safety.raise(at(11), Cause::HeartbeatLost { node: NodeIndex(2) });
    let stop = safety.reset(at(LATER)).unwrap();
    assert_eq!((safety.mode(), stop.must_boot), (Mode::Boot, true));
    safety.restore(at(LATER + 1), stop);
    assert_eq!((safety.mode(), safety.cause()), (Mode::DrivesOff, Some(Cause::LinkLost)));
    assert_eq!(safety.reset(at(2 * LATER)), Ok(stop), "requires a boot again");
}

#[test]
fn reset_without_a_stop_is_refused() {
    for mode in [Mode::Boot, Mode::Ready, Mode::Armed, Mode::Engaged] {
        assert_eq!(in_mode(mode).reset(at(LATER)), Err(Refusal::NotStopped(mode)));
    }
}
