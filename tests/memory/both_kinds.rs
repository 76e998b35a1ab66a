//! Rate, pose, indexing, rate control that becomes force control in contact, and shared control: the same bodies with the
//! object in the node's own scene, and with a robot in another process behind a real socket.

use nalgebra::{Isometry3, Vector3};

use crate::common::linked::{LINK, linked_text};
use crate::common::prelude::*;
use crate::linked_node::{Handle, LinkedSide, Network};
use controller::switches::CommandMode;
use node::Node;
use remote::site::VirtualSite;
use remote::stated::Misfit;
use remote::{Command, Remote, RemoteSample, SideError};

/// Commanded side of either kind.
enum Side {
    Virtual(Box<VirtualSite>),
    Link(Box<LinkedSide>),
}

impl Side {
    /// Returns the object's true pose in {b}.
    const fn x_b_m(&self) -> &Isometry3<f64> {
        match self {
            Self::Virtual(site) => site.pose(),
            Self::Link(linked) => linked.site.pose(),
        }
    }

    fn as_remote(&mut self) -> &mut dyn Remote {
        match self {
            Self::Virtual(site) => site.as_mut(),
            Self::Link(linked) => linked.as_mut(),
        }
    }
}

impl Remote for Side {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        self.as_remote().exchange(now, command)
    }

    fn begin_epoch(&mut self) {
        self.as_remote().begin_epoch();
    }

    fn end_epoch(&mut self) {
        self.as_remote().end_epoch();
    }

    fn misfits(&mut self, now: Instant, mode: CommandMode) -> Vec<Misfit> {
        self.as_remote().misfits(now, mode)
    }

    fn mode_misfit(&mut self, mode: CommandMode) -> Option<Misfit> {
        self.as_remote().mode_misfit(mode)
    }

    fn error(&mut self) -> Option<SideError> {
        self.as_remote().error()
    }
}

/// A node of either kind, engaged, with the deadman pressed and reflection on.
struct Rig {
    kind: &'static str,
    node: Node<Memory<World, ()>, Side>,
    /// Pose of grip and object when the node engaged.
    start: [Isometry3<f64>; 2],
    last: Record,
}

impl Rig {
    /// Runs until `seconds` after the first SYNC; the node must not stop.
    fn until(&mut self, seconds: f64) -> Record {
        let end = self.zero() + Duration::from_secs_f64(seconds);
        while self.node.bus().now() < end {
            self.last = self.node.cycle();
            assert_eq!(self.last.cause, None, "{}", self.kind);
        }
        self.last
    }

    fn zero(&self) -> Instant {
        self.node.bus().stations().scenario_start().unwrap_or(Instant::ZERO)
    }

    fn grip(&self) -> Isometry3<f64> {
        *self.node.bus().stations().plant().x_0_g()
    }

    fn object(&self) -> Isometry3<f64> {
        *self.node.remote().x_b_m()
    }

    /// Returns how far grip and object have moved since the node engaged, each in its frame of then.
    fn moved(&self) -> [Vector3<f64>; 2] {
        let [grip, object] = self.start;
        let grip = (grip.inverse() * self.grip()).translation.vector;
        [grip, (object.inverse() * self.object()).translation.vector]
    }
}

/// Time at which a rig is engaged and its reference set, in s.
const ENGAGED: f64 = 1.8;

/// Runs `body` with both kinds: `changes` of kraft_like's text, the operator's `entries` from [`ENGAGED`] on, and a mode. What
/// `body` returns must be the same with both but for the cycles that messages take.
fn over_both(
    changes: &[(&str, &str)],
    entries: &str,
    mode: CommandMode,
    body: impl Fn(&mut Rig) -> Vector3<f64>,
) {
    let mut text = fs::read_to_string(KRAFT).unwrap();
    for (old, new) in changes {
        assert!(text.contains(old), "{old}");
        text = text.replacen(old, new, 1);
    }
    let far = parse(KRAFT, &text);
    let near = parse(KRAFT, &linked_text(&text, LINK));
    let linked = LinkedSide::new(&near, &far, Network::default(), Handle::default().into());
    let site = VirtualSite::new(&far.remote, far.period);
    let sides = [
        ("virtual", &far, Side::Virtual(Box::new(site))),
        ("link", &near, Side::Link(Box::new(linked))),
    ];
    let results = sides.map(|(kind, config, side)| {
        let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
        let world = world::build(config, Scenario::parse(&script(entries)).unwrap(), 1);
        let mut node = Node::new(config, Memory::new(&bitrates, world, ()), side);
        node.bring_up(&mut || false).unwrap();
        let last = node.cycle();
        let mut rig = Rig { kind, node, start: [Isometry3::identity(); 2], last };
        rig.until(1.0);
        let mut ask = |request| rig.node.request(request, &mut || false).unwrap();
        ask(Request::Command(mode));
        ask(Request::Arm);
        let record = rig.until(ENGAGED);
        assert_eq!(record.mode, Mode::Engaged, "{kind}");
        rig.start = [rig.grip(), rig.object()];
        body(&mut rig)
    });
    let apart = (results[0] - results[1]).norm();
    assert!(apart < 5e-4, "{apart} m apart: {results:?}");
}

/// Returns a script whose operator presses the deadman, and switches reflection on and the reference, before `entries`.
fn script(entries: &str) -> String {
    let pressed = |at: f64, switch: &str| {
        format!("{}{}", switch_at(at, switch, true), switch_at(at + 0.05, switch, false))
    };
    let switches =
        [switch_at(1.2, "deadman", true), pressed(1.3, "reflection"), pressed(1.5, "reference")];
    format!("seconds = 20.0\n[hand]\ntremor_mm = 0.0\n{}{entries}", switches.concat())
}

fn switch_at(at: f64, switch: &str, is_pressed: bool) -> String {
    format!("[[switch]]\nat_s = {at:?}\n{switch} = {is_pressed}\n")
}

fn move_at(at: f64, to: [f64; 3]) -> String {
    format!("[[move]]\nat_s = {at:?}\nduration_s = 0.5\nto_m = {to:?}\n")
}

#[test]
fn rate_follows_the_hand_and_ends_with_it() {
    let entries = move_at(2.0, [-0.03, 0.0, 0.0]) + &move_at(4.0, [0.0; 3]);
    over_both(&[], &entries, CommandMode::Rate, |rig| {
        let Motion::Rate(v_m) = rig.until(3.0).output.command else { panic!("{}", rig.kind) };
        assert!(v_m.linear.norm() > 0.02, "{}: {v_m:?}", rig.kind);
        let [_, before] = rig.moved();
        rig.until(3.5);
        let [_, after] = rig.moved();
        let off = (after - before) / 0.5 - v_m.linear;
        assert!(off.norm() < 0.03 * v_m.linear.norm(), "{}: {off:?} m/s", rig.kind);
        rig.until(5.0);
        let [_, before] = rig.moved();
        rig.until(6.0);
        let [_, after] = rig.moved();
        assert!((after - before).norm() < 1e-4, "{}: {before} {after}", rig.kind);
        after
    });
}

#[test]
fn pose_follows_the_hand() {
    let entries = move_at(2.0, [-0.03, 0.02, 0.01]);
    over_both(&[], &entries, CommandMode::Pose, |rig| {
        rig.until(5.0);
        let [grip, object] = rig.moved();
        assert!(grip.norm() > 0.02, "{}: {grip}", rig.kind);
        assert!((grip - object).norm() < 1e-3, "{}: {grip} {object}", rig.kind);
        object
    });
}

#[test]
fn index_button_leads_further_than_the_hand_reaches() {
    let stroke = [-0.04, 0.0, 0.0];
    let entries = [
        move_at(2.0, stroke),
        switch_at(3.0, "reference", true),
        move_at(3.2, [0.0; 3]),
        switch_at(4.2, "reference", false),
        move_at(4.4, stroke),
    ];
    over_both(&[], &entries.concat(), CommandMode::Pose, |rig| {
        rig.until(3.15);
        let [stroke, before] = rig.moved();
        rig.until(4.15);
        let [grip, kept] = rig.moved();
        assert!(grip.norm() < 0.3 * stroke.norm(), "{}: the hand is back: {grip}", rig.kind);
        assert!((kept - before).norm() < 5e-4, "{}: {before} {kept}", rig.kind);
        rig.until(6.0);
        let [_, after] = rig.moved();
        let strokes = after.norm() / stroke.norm();
        assert!((1.7..2.1).contains(&strokes), "{}: {strokes} strokes", rig.kind);
        after
    });
}

#[test]
fn rate_control_becomes_force_control_in_contact() {
    let entries = move_at(2.0, [0.045, 0.0, 0.0]) + &move_at(9.0, [0.0; 3]);
    over_both(&[], &entries, CommandMode::Rate, |rig| {
        let record = rig.until(8.8);
        let Motion::Rate(v_m) = record.output.command else { panic!("{}", rig.kind) };
        // K_FA of kraft_like, in m/(s N).
        let (law, pressed) = (v_m.linear.z / 0.01, -record.f_s.force.z);
        assert!(pressed > 2.0, "{}: {pressed} N", rig.kind);
        assert!((pressed / law - 1.0).abs() < 0.03, "{}: {pressed} N, law {law} N", rig.kind);
        let rest = -rig.until(12.0).f_s.force.z;
        assert!(rest.abs() < 0.2, "{}: {rest} N at neutral", rig.kind);
        rig.moved()[1]
    });
}

#[test]
fn shared_control_locks_an_axis_and_leads_another() {
    // {MRF} z is the approach, to the wall; x and y are across it.
    let shared = "[remote.shared_control]\noperator = [1.0, 1.0, 0.0, 1.0, 1.0, 1.0]\n\
        auto_m_per_s = [0.0, 0.0, -0.01]\n\n[remote.wall]";
    let entries = move_at(2.0, [-0.04, 0.03, 0.0]);
    over_both(&[("[remote.wall]", shared)], &entries, CommandMode::Rate, |rig| {
        rig.until(3.0);
        let [_, before] = rig.moved();
        rig.until(5.0);
        let [_, after] = rig.moved();
        let travel = after - before;
        assert!((travel.z + 0.02).abs() < 1e-3, "{}: {travel}", rig.kind);
        assert!(travel.xy().norm() > 0.03, "{}: {travel}", rig.kind);
        after
    });
}
