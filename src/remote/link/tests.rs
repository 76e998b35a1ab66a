//! Tests of the link over a real socket, in virtual time.
#![allow(clippy::float_cmp, reason = "a force goes through the link as it is")]

use std::io::{Read, Write};
use std::path::PathBuf;

use nalgebra::{Isometry3, Vector3};
use socket2::{Domain, SockAddr, Type};
use tempfile::TempDir;

use super::*;
use contract::{Capability, FarEnd, Gripper, Reason, Reject};
use robot::interaction::Interaction;
use robot::object::Servo;
use units::spatial::CommandMode::Rate;
use units::spatial::{Motion, Twist, Wrench};

const MS: Duration = Duration::from_millis(1);
const HOLD_AFTER: Duration = Duration::from_millis(100);
const RATE: Motion = Motion::Rate(Twist { linear: Vector3::new(0.1, 0.0, 0.0), ..Twist::ZERO });

fn stated() -> StatedCapability {
    let servo = Servo::new(0.01, 0.5, 2.0).unwrap();
    StatedCapability {
        stiffest_contact: 5_000.0,
        ..StatedCapability::from_interaction(&Interaction::default(), &servo)
    }
}

/// Returns a capability with the configured figures, and better ones where none is configured.
fn capability() -> Capability {
    let stated = StatedCapability {
        sample_period: 1e-3,
        hold_after: HOLD_AFTER.as_secs_f64(),
        sensor_range: [200.0, 20.0],
        ..stated()
    };
    stated.capability([[-1.0; 3], [1.0; 3]])
}

/// Far side with its connection.
struct Far {
    end: FarEnd,
    capability: Capability,
    socket: Socket,
    motion: contract::Motion,
}

impl Far {
    fn at(path: &PathBuf, session: u64) -> Self {
        let socket = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        socket.connect(&SockAddr::unix(path).unwrap()).unwrap();
        socket.set_nonblocking(true).unwrap();
        let end = FarEnd::new(7, session, HOLD_AFTER);
        Self { end, capability: capability(), socket, motion: contract::Motion::Hold }
    }

    /// Runs a cycle that measures `force` along x, in N.
    fn step(&mut self, now: Instant, force: f64) {
        self.take(now);
        self.answer(now, force);
    }

    fn take(&mut self, now: Instant) {
        let mut buffer = [0; 512];
        while let Ok(length @ 1..) = (&self.socket).read(&mut buffer) {
            self.end.on_message(now, &buffer[..length]);
        }
    }

    fn answer(&mut self, now: Instant, force: f64) {
        self.motion = self.end.motion(now);
        let f_s = Wrench { force: Vector3::new(force, 0.0, 0.0), ..Wrench::ZERO };
        let x_b_m = Isometry3::identity();
        let sensed = RemoteSample { at: now, f_s, x_b_m, gripper: self.end.gripper() };
        let feedback = self.end.feedback(now, &messages::measured(&sensed));
        (&self.socket).write_all(&feedback).ok();
        if let Some(figures) = self.end.capability(now, &self.capability) {
            (&self.socket).write_all(&figures).ok();
        }
    }
}

/// Link of a node at a separate socket.
struct Rig {
    path: PathBuf,
    _folder: TempDir,
    side: LinkSide,
    thread: LinkThread,
    now: Instant,
    /// Command to the gripper.
    gripper: Option<Gripper>,
}

impl Rig {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("link.sock");
        let listener = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        listener.bind(&SockAddr::unix(&path).unwrap()).unwrap();
        listener.listen(4).unwrap();
        let settings = LinkSettings {
            arm: 7,
            session: 0x5eed_5eed,
            period: MS,
            round_trip: MS * 5,
            stated: stated(),
        };
        let (side, thread) = link(listener, &settings).unwrap();
        Self { path, _folder: folder, side, thread, now: Instant::ZERO + MS * 1_000, gripper: None }
    }

    /// Runs a cycle of the node and of its link; returns the sample.
    fn cycle(&mut self, command: &Motion) -> Option<RemoteSample> {
        self.now = self.now + MS;
        self.thread.step(self.now);
        self.side.exchange(self.now, &Command { motion: *command, gripper: self.gripper })
    }

    /// Runs cycles of both ends.
    fn cycles(&mut self, count: usize, command: &Motion, far: &mut Far) -> Option<RemoteSample> {
        (0..count).fold(None, |_, _| {
            let sensed = self.cycle(command);
            far.step(self.now, 2.0);
            sensed
        })
    }

    /// Returns the rig with a far side that has sent its capability.
    fn connected() -> (Self, Far) {
        let mut rig = Self::new();
        let mut far = Far::at(&rig.path, 0xface_face);
        rig.cycles(10, &Motion::Hold, &mut far);
        assert_eq!(rig.side.misfits(rig.now, Rate), []);
        (rig, far)
    }

    fn status(&mut self) -> LinkStatus {
        self.now = self.now + MS * 100;
        self.thread.step(self.now);
        self.thread.latest().get()
    }
}

#[test]
fn command_acts_from_the_first_epoch_on() {
    let (mut rig, mut far) = Rig::connected();
    rig.cycles(5, &RATE, &mut far);
    assert_eq!((far.motion, far.end.reason()), (contract::Motion::Hold, Reason::NotArmed));
    rig.side.begin_epoch();
    let sensed = rig.cycles(3, &RATE, &mut far).unwrap();
    assert_eq!(far.motion, messages::order(&RATE.into()).motion);
    assert_eq!((sensed.f_s.force.x, rig.side.error()), (2.0, None));
    // The answer to command k, of cycle k, is received in the next one.
    assert!(rig.now.since(sensed.at) <= MS * 3, "{:?}", rig.now.since(sensed.at));
}

#[test]
fn far_side_is_compared_before_arming() {
    let mut rig = Rig::new();
    assert_eq!(rig.side.misfits(rig.now, Rate), [Misfit::Absent]);
    let mut far = Far::at(&rig.path, 0xface_face);
    far.capability.servo_lag = 0.5;
    far.capability.senses_wrench = false;
    rig.cycles(10, &Motion::Hold, &mut far);
    let key = "remote.servo_time_constant_s";
    let worse = Misfit::Worse { key, stated: 0.01, found: 0.5 };
    assert_eq!(
        rig.side.misfits(rig.now, Rate),
        [Misfit::Lacks("has no force/torque sensor"), worse]
    );
    rig.now = rig.now + MS * 200;
    assert_eq!(rig.side.misfits(rig.now, Rate), [Misfit::Absent], "silent");
}

#[test]
fn figure_that_is_nan_is_worse_than_any_other() {
    let misfits = |change: fn(&mut Capability)| {
        let mut has = capability();
        change(&mut has);
        stated().misfits(&has, Rate, None)
    };
    let changes: [fn(&mut Capability); 4] = [
        |has| has.hold_after = f64::NAN,
        |has| has.sensor_range[0] = f64::NAN,
        |has| has.accommodation[4] = f64::NAN,
        |has| has.sample_period = f64::NAN,
    ];
    for change in changes {
        let found = misfits(change);
        assert!(matches!(found[..], [Misfit::Worse { found, .. }] if found.is_nan()), "{found:?}");
    }
    assert_eq!(misfits(|_| {}), []);
}

#[test]
fn far_side_of_another_arm_version_or_contract_is_named() {
    let named = |change: fn(&mut Vec<u8>)| {
        let mut rig = Rig::new();
        let mut far = Far::at(&rig.path, 0xface_face);
        for _ in 0..5 {
            rig.cycle(&Motion::Hold);
            far.take(rig.now);
            let mut message =
                far.end.feedback(rig.now, &contract::Measurements::default()).to_vec();
            change(&mut message);
            (&far.socket).write_all(&message).unwrap();
        }
        rig.cycle(&Motion::Hold);
        let misfits = rig.side.misfits(rig.now, Rate);
        let text: Vec<_> = misfits.iter().map(Misfit::to_string).collect();
        text.join("; ").split_once(": ").unwrap().1.to_owned()
    };
    let arm = named(|message| message[4 + 2] = 9);
    assert_eq!(arm, "another arm than remote.link.arm: correct the key, or the far side");
    let version = named(|message| message[4 + 1] = 2);
    assert_eq!(version, "another version of the contract than 1: update the older end");
    assert_eq!(
        named(|message| message.truncate(60)),
        "length; docs/link.md has those that have one"
    );
    assert_eq!(named(|message| message[0] = 1), "foreign; docs/link.md has those that have one");
}

#[test]
fn far_side_reached_too_late_follows_no_node() {
    let mut rig = Rig::new();
    let mut far = Far::at(&rig.path, 0xface_face);
    far.end = FarEnd::new(7, 0xface_face, MS * 5);
    for _ in 0..10 {
        far.answer(rig.now, 2.0);
        (0..6).for_each(|_| _ = rig.cycle(&Motion::Hold));
        far.take(rig.now);
    }
    assert_eq!(rig.side.misfits(rig.now, Rate), [Misfit::Unled]);
}

#[test]
fn hazard_34_killed_far_side_ages_and_another_one_is_not_felt() {
    let (mut rig, mut far) = Rig::connected();
    rig.side.begin_epoch();
    let last = rig.cycles(5, &RATE, &mut far).unwrap();
    drop(far);
    rig.cycle(&RATE);
    assert_eq!(rig.cycle(&RATE), None);
    let mut other = Far::at(&rig.path, 0xf00d_f00d);
    assert_eq!(rig.cycles(150, &RATE, &mut other), None, "not compared; the last was {last:?}");
    assert_eq!((other.motion, other.end.reason()), (contract::Motion::Hold, Reason::NotArmed));
    // The stop ends the epoch; the reset compares the capability, and begins a new epoch.
    rig.side.end_epoch();
    assert!(rig.cycle(&Motion::Hold).is_some());
    assert_eq!(rig.side.misfits(rig.now, Rate), []);
    rig.side.begin_epoch();
    rig.cycles(3, &RATE, &mut other);
    assert_eq!(other.motion, messages::order(&RATE.into()).motion);
}

#[test]
fn stalled_cycle_holds_the_far_side() {
    let (mut rig, mut far) = Rig::connected();
    rig.side.begin_epoch();
    rig.cycles(5, &RATE, &mut far);
    let stalled_at = rig.now;
    while far.motion != contract::Motion::Hold {
        rig.now = rig.now + MS;
        rig.thread.step(rig.now);
        far.step(rig.now, 2.0);
        assert!(rig.now.since(stalled_at) <= MS * 12, "it moves on");
    }
    assert_eq!(far.end.reason(), Reason::None, "held by the node, not by itself");
    rig.cycles(2, &RATE, &mut far);
    assert_eq!(far.motion, messages::order(&RATE.into()).motion);
}

#[test]
fn hazard_37_second_far_side_is_refused_and_the_first_goes_on() {
    let (mut rig, mut far) = Rig::connected();
    let mut second = Far::at(&rig.path, 0xf00d_f00d);
    rig.side.begin_epoch();
    rig.cycles(3, &RATE, &mut far);
    let mut buffer = [0; 512];
    assert_eq!((&second.socket).read(&mut buffer).unwrap(), 0, "closed");
    second.step(rig.now, 9.0);
    assert_eq!(rig.cycles(1, &RATE, &mut far).unwrap().f_s.force.x, 2.0);
}

#[test]
fn hazard_37_wrong_messages_have_no_effect_and_are_counted() {
    let (mut rig, mut far) = Rig::connected();
    rig.side.begin_epoch();
    rig.cycles(5, &RATE, &mut far);
    let now = rig.now;
    let mut stranger = FarEnd::new(7, 0xbad_face, HOLD_AFTER);
    let mut other_arm = FarEnd::new(8, 0xface_face, HOLD_AFTER);
    let huge =
        contract::Measurements { wrench: Some([9.0; 6]), ..contract::Measurements::default() };
    let nan = contract::Measurements { wrench: Some([f64::NAN; 6]), ..huge };
    let own = far.end.feedback(now, &nan);
    let long = [0; 600];
    let wrong: [&[u8]; 6] = [
        &[],
        &[0; 7],
        &long,
        &stranger.feedback(now, &huge),
        &other_arm.feedback(now, &huge),
        &own,
    ];
    for message in wrong {
        // The repetition of a message has no effect.
        (0..2).for_each(|_| _ = far.socket.send(message).unwrap());
        let sensed = rig.cycles(1, &RATE, &mut far).unwrap();
        assert_eq!(sensed.f_s.force.x, 2.0);
    }
    let rejects = rig.status().rejects;
    let of = |reject| rejects.iter().find(|(one, _)| *one == reject).map_or(0, |(_, count)| *count);
    assert_eq!((of(Reject::NotLeader), of(Reject::Arm)), (2, 2), "{rejects:?}");
    assert_eq!(of(Reject::Length) + of(Reject::Foreign), 6, "{rejects:?}");
    assert_eq!(of(Reject::Impossible), 2, "{rejects:?}");
}

#[test]
fn far_side_that_reads_nothing_meets_no_backlog() {
    let (mut rig, mut far) = Rig::connected();
    rig.side.begin_epoch();
    rig.cycles(5, &RATE, &mut far);
    // The far side is stopped for 3 s.
    (0..3_000).for_each(|_| _ = rig.cycle(&RATE));
    let dropped = rig.status().dropped;
    assert!(dropped > 2_900, "{dropped}");
    far.step(rig.now, 2.0);
    assert_eq!((far.motion, far.end.reason()), (contract::Motion::Hold, Reason::Silence));
    rig.cycles(50, &RATE, &mut far);
    assert_eq!(far.motion, contract::Motion::Hold, "until a new epoch");
}

#[test]
fn hazard_48_slow_round_trips_are_a_fault() {
    let (mut rig, mut far) = Rig::connected();
    rig.side.begin_epoch();
    rig.cycles(300, &RATE, &mut far);
    assert_eq!(rig.side.error(), None);
    // The far side answers 6 ms later.
    for _ in 0..200 {
        far.take(rig.now);
        (0..6).for_each(|_| _ = rig.cycle(&RATE));
        far.answer(rig.now, 2.0);
    }
    let error = rig.side.error();
    assert!(
        matches!(error, Some(SideError::Slow { p99_us: 5_001.., stated_us: 5_000 })),
        "{error:?}"
    );
    let [p50, p99] = rig.status().round_trips.unwrap();
    assert!(p50 <= p99 && p99 > MS * 5, "{p50:?} {p99:?}");
}

#[test]
fn gripper_goes_there_and_comes_back_and_stays_during_a_hold() {
    let (mut rig, mut far) = Rig::connected();
    let grips = Gripper { position: 0.02, force: 15.0 };
    rig.gripper = Some(grips);
    let sensed = rig.cycles(10, &RATE, &mut far).unwrap();
    assert_eq!((far.end.gripper(), sensed.gripper), (None, None), "before the first arming");
    rig.side.begin_epoch();
    let sensed = rig.cycles(10, &RATE, &mut far).unwrap();
    assert_eq!((far.end.gripper(), sensed.gripper), (Some(grips), Some(grips)));
    rig.gripper = None;
    rig.cycles(10, &RATE, &mut far);
    far.end.hold(Reason::Robot);
    rig.gripper = Some(Gripper { position: 0.08, ..grips });
    rig.cycles(10, &RATE, &mut far);
    assert_eq!(far.end.gripper(), Some(grips), "a hold drops nothing");
}
