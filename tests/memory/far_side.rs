//! A robot in another process, over a real socket in virtual time: the node, the link's thread, a network of its own between
//! the two ends, and the far side.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::cell::Cell;
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::Path;
use std::rc::Rc;
use std::time::Duration;

use contract::{Capability, FarEnd, Reason};
use nalgebra::Vector3;
use socket2::{Domain, SockAddr, Socket, Type};
use tempfile::TempDir;

use crate::common::bench::press_script;
use crate::common::linked::{LINK, linked};
use bus::Bus;
use config::Config;
use memory_bus::Memory;
use node::cause::Cause;
use node::record::{Mode, Record};
use node::{Node, Request};
use remote::link::{LinkSettings, LinkSide, LinkThread, link};
use remote::site::VirtualSite;
use remote::stated::{Misfit, Stated};
use remote::{Remote, Sensed, SideFault, messages};
use sim::random::SplitMix;
use sim::scenario::Scenario;
use sim::world::World;
use testbench::far_robot::as_stated;
use testbench::world;
use units::spatial::{Motion, Wrench};
use units::time::Instant;

/// Workspace of the far side, in m.
const WORKSPACE: [[f64; 3]; 2] = [[-1.0; 3], [1.0; 3]];

const MS: Duration = Duration::from_millis(1);

/// Shipped hand controllers.
const HANDS: [&str; 3] = ["kraft_like", "jpl_like", "sixr_spherical"];

fn parse(text: &str) -> Result<Config, config::Invalid> {
    Config::parse(Path::new("config/kraft_like.toml"), text)
}

#[test]
fn link_is_accepted_for_every_hand_controller() {
    for name in HANDS {
        let config = parse(&linked(name, LINK)).unwrap();
        let agreement = config.far_side.agreement.unwrap();
        assert_eq!((agreement.round_trip, agreement.stated.stiffest_contact), (MS * 5, 2_000.0));
        assert_eq!(agreement.stated.accommodation, [0.01, 0.01, 0.01, 0.5, 0.5, 0.5]);
    }
}

#[test]
fn round_trip_and_contact_of_a_link_count_for_stability() {
    let most = |keys: &str| {
        let findings = parse(&linked("kraft_like", keys)).unwrap().findings();
        let held = findings.iter().filter(|finding| finding.name == "rate reflection, held");
        held.map(|finding| finding.right.value).fold(f64::INFINITY, f64::min)
    };
    let softer = |ms: u32| format!("round_trip_ms = {ms}.0\nstiffest_contact_n_per_m = 500.0");
    let bounds = [5, 16].map(|ms| most(&softer(ms)));
    assert!(bounds[0] > bounds[1], "{bounds:?}");
    let stiff = "round_trip_ms = 5.0\nstiffest_contact_n_per_m = 200000.0";
    let refused = parse(&linked("kraft_like", stiff)).unwrap_err().to_string();
    assert!(refused.contains("controller."), "{refused}");
}

#[test]
fn keys_that_a_link_excludes_or_lacks_are_named() {
    for (keys, reason) in [
        ("round_trip_ms = 5.0", "remote.link.stiffest_contact_n_per_m: missing field"),
        ("stiffest_contact_n_per_m = 1e3", "remote.link.round_trip_ms: missing field"),
        ("round_trip_ms = 21.0\nstiffest_contact_n_per_m = 1e3", "at most the maximum age"),
        ("delay_ms = 2.0\nround_trip_ms = 5.0", "remote.link.delay_ms: describes a simulated link"),
        ("seed = 2\nround_trip_ms = 5.0", "remote.link.seed: describes a simulated link"),
        ("sensor_range_n = -5.0", "remote.link.sensor_range_n: must be within"),
        ("sample_period_ms = nan", "remote.link.sample_period_ms: must be within"),
        ("arm = 70000", "invalid value: integer `70000`"),
    ] {
        let refused = parse(&linked("kraft_like", keys)).unwrap_err().to_string();
        assert!(refused.contains(reason), "{reason}: {refused}");
    }
    let text = std::fs::read_to_string("config/kraft_like.toml").unwrap();
    let text = text.replacen("kind = \"virtual\"", "kind = \"link\"", 1);
    let refused = parse(&text).unwrap_err().to_string();
    for key in ["remote.wall: ", "remote.box: ", "remote.link.round_trip_ms: "] {
        assert!(refused.contains(key), "{key}: {refused}");
    }
}

/// A network between the two ends.
#[derive(Clone, Copy, Debug, Default)]
struct Network {
    delay: Duration,
    jitter: Duration,
    /// Share of the messages that are lost, and of those that arrive twice.
    loss: f64,
    duplicates: f64,
}

/// Messages under way in one direction; by their jitter they overtake each other.
struct Way {
    network: Network,
    random: SplitMix,
    under_way: VecDeque<(Instant, Vec<u8>)>,
}

impl Way {
    fn send(&mut self, now: Instant, bytes: &[u8]) {
        if self.random.unit() < self.network.loss {
            return;
        }
        let count = 1 + u32::from(self.random.unit() < self.network.duplicates);
        for _ in 0..count {
            let late = self.network.jitter.mul_f64(self.random.unit());
            self.under_way.push_back((now + self.network.delay + late, bytes.to_vec()));
        }
    }

    fn arrived(&mut self, now: Instant) -> Vec<Vec<u8>> {
        let (mut due, rest): (Vec<_>, Vec<_>) =
            self.under_way.drain(..).partition(|(at, _)| *at <= now);
        self.under_way = rest.into();
        due.sort_by_key(|(at, _)| *at);
        due.into_iter().map(|(_, bytes)| bytes).collect()
    }
}

/// Faults of the far side that a test sets while the node runs.
#[derive(Default)]
struct Handle {
    hold: Cell<Option<Reason>>,
    is_stopped: Cell<bool>,
    is_cut: Cell<bool>,
    restarts: Cell<bool>,
    /// Force along x that the sensor reports in place of the contact's, by the time of the sample.
    writes_its_time: Cell<bool>,
}

/// The commanded side of a node: its link, and beyond the socket the network and the far side.
struct Linked {
    side: LinkSide,
    thread: LinkThread,
    folder: TempDir,
    socket: Socket,
    there: Way,
    back: Way,
    far: FarEnd,
    capability: Capability,
    site: VirtualSite,
    handle: Rc<Handle>,
    sessions: u64,
}

impl Linked {
    fn new(near: &Config, far: &Config, network: Network, handle: Rc<Handle>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("link.sock");
        let listener = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        listener.bind(&SockAddr::unix(&path).unwrap()).unwrap();
        listener.listen(4).unwrap();
        let agreement = near.far_side.agreement.unwrap();
        let settings = LinkSettings {
            arm: near.far_side.arm,
            session: 0x5eed,
            period: near.period,
            round_trip: agreement.round_trip,
            stated: agreement.stated,
        };
        let (side, thread) = link(listener, &settings).unwrap();
        let way = |seed| Way { network, random: SplitMix::new(seed), under_way: VecDeque::new() };
        Self {
            side,
            thread,
            socket: connected(&path),
            folder,
            there: way(1),
            back: way(2),
            far: FarEnd::new(near.far_side.arm, 0xface, MS * 100),
            capability: as_stated(
                &Stated { sample_period: 1e-3, hold_after: 0.1, ..agreement.stated },
                WORKSPACE,
            ),
            site: VirtualSite::new(&far.remote, far.period),
            handle,
            sessions: 0xface,
        }
    }

    /// Runs a cycle of the far side.
    fn run_far_side(&mut self, now: Instant) {
        if self.handle.restarts.take() {
            self.socket = connected(&self.folder.path().join("link.sock"));
            self.sessions += 1;
            self.far = FarEnd::new(1, self.sessions, MS * 100);
        }
        let mut buffer = [0; 512];
        while let Ok(length @ 1..) = (&self.socket).read(&mut buffer) {
            if !self.handle.is_cut.get() {
                self.there.send(now, &buffer[..length]);
            }
        }
        if self.handle.is_stopped.get() {
            return;
        }
        let before = self.far.leader();
        for message in self.there.arrived(now) {
            self.far.on_message(now, &message);
        }
        if self.far.leader() != before {
            self.site.begin_epoch();
        }
        if let Some(reason) = self.handle.hold.take() {
            self.far.hold(reason);
        }
        let motion = messages::motion(&self.far.motion(now));
        let mut sensed = self.site.exchange(now, &motion).unwrap();
        if self.handle.writes_its_time.get() {
            let force = Vector3::new(now.since(Instant::ZERO).as_secs_f64(), 0.0, 0.0);
            sensed.f_s = Wrench { force, ..Wrench::ZERO };
        }
        let feedback = self.far.feedback(now, &messages::measured(&sensed));
        let figures = self.far.capability(now, &self.capability);
        if !self.handle.is_cut.get() {
            self.back.send(now, &feedback);
            figures.iter().for_each(|figures| self.back.send(now, figures));
        }
        for message in self.back.arrived(now) {
            (&self.socket).write_all(&message).ok();
        }
    }
}

fn connected(path: &Path) -> Socket {
    let socket = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
    socket.connect(&SockAddr::unix(path).unwrap()).unwrap();
    socket.set_nonblocking(true).unwrap();
    socket
}

impl Remote for Linked {
    fn exchange(&mut self, now: Instant, command: &Motion) -> Option<Sensed> {
        self.thread.step(now);
        self.run_far_side(now);
        self.thread.receive(now);
        self.side.exchange(now, command)
    }

    fn begin_epoch(&mut self) {
        self.side.begin_epoch();
    }

    fn end_epoch(&mut self) {
        self.side.end_epoch();
    }

    fn misfits(&mut self, now: Instant) -> Vec<Misfit> {
        self.side.misfits(now)
    }

    fn fault(&mut self) -> Option<SideFault> {
        self.side.fault()
    }
}

type Wired = Node<Memory<World, ()>, Linked>;

/// Boots a node whose operator presses towards the wall of the far side, 0.1 mm away.
fn booted(hand: &str, keys: &str, network: Network) -> (Wired, Rc<Handle>) {
    let near = parse(&linked(hand, keys)).unwrap();
    let text = std::fs::read_to_string(format!("config/{hand}.toml")).unwrap();
    let far = parse(&text.replace("start_m = [0.4,", "start_m = [0.4499,")).unwrap();
    let bitrates: Vec<u32> = near.buses.iter().map(|bus| bus.bitrate).collect();
    let world = world::build(&near, Scenario::parse(&press_script(1.2)).unwrap(), 1);
    let handle = Rc::new(Handle::default());
    let remote = Linked::new(&near, &far, network, Rc::clone(&handle));
    let mut node = Node::new(&near, Memory::new(&bitrates, world, ()), remote);
    node.bring_up(&mut || false).unwrap();
    while node.cycle().inputs.is_none() || node.bus().now() < Instant::ZERO + MS * 1_000 {}
    (node, handle)
}

fn ask(node: &mut Wired, request: Request) -> Result<Mode, String> {
    node.request(request, &mut || false).map_err(|error| error.to_string())
}

/// Arms the node, and runs it until the hand presses.
fn engage(node: &mut Wired) -> Record {
    let armed = ask(node, Request::Arm);
    assert_eq!(armed, Ok(Mode::Armed), "{:?}", node.remote().there.network);
    let engaged = (0..3_000).find(|_| node.cycle().mode == Mode::Engaged);
    assert!(engaged.is_some(), "{:?}: {:?}", node.cause(), node.remote().there.network);
    cycles(node, 500)
}

fn cycles(node: &mut Wired, count: usize) -> Record {
    (0..count).map(|_| node.cycle()).last().unwrap()
}

#[test]
fn contact_is_felt_through_the_socket_with_every_hand() {
    for hand in HANDS {
        let (mut node, _) = booted(hand, LINK, Network::default());
        assert_eq!(ask(&mut node, Request::Arm), Ok(Mode::Armed), "{hand}");
        let felt = (0..2_000).map(|_| node.cycle().output.f_g_task.force.norm());
        let most = felt.fold(0.0, f64::max);
        assert_eq!(node.cause(), None, "{hand}");
        assert!(most > 1.0, "{hand}: {most} N");
    }
}

/// The far side writes the time of each sample into its force: whatever the network does, none that is older acts.
#[test]
fn hazard_36_no_sample_older_than_its_limit_acts_on_any_network() {
    // At 8 ms a sample acts at an age of 19 ms: jitter of 1 ms or one lost message is too much.
    let half = MS / 2;
    for (delay, max_age, jitter, loss) in [
        (0, 20, half, 0.01),
        (2, 20, half, 0.01),
        (5, 20, half, 0.01),
        (8, 20, Duration::ZERO, 0.0),
        (20, 100, MS * 2, 0.01),
        (40, 100, MS * 4, 0.01),
    ] {
        let keys = format!(
            "round_trip_ms = {max_age}.0\nmax_age_ms = {max_age}.0\nstiffest_contact_n_per_m = 20.0"
        );
        let network = Network { delay: MS * delay, jitter, loss, duplicates: 0.05 };
        let (mut node, handle) = booted("kraft_like", &keys, network);
        handle.writes_its_time.set(true);
        engage(&mut node);
        let (mut acted, mut oldest) = (0, 0.0_f64);
        for _ in 0..1_500 {
            let record = node.cycle();
            if record.mode == Mode::Engaged {
                let age = record.at.since(Instant::ZERO).as_secs_f64() - record.f_s.force.x;
                oldest = oldest.max(age);
                acted += 1;
            }
        }
        assert_eq!(node.cause(), None, "{delay} ms");
        let most = f64::from(max_age) * 1e-3 + 2e-3;
        assert!(acted > 1_000 && oldest <= most, "{delay} ms: {oldest} s in {acted} cycles");
    }
}

/// Runs the node up to engagement, then `cut`; returns the time for which reflection still acted.
fn reflected_after(node: &mut Wired, cut: impl FnOnce()) -> Duration {
    let record = engage(node);
    assert_eq!((record.mode, record.cause), (Mode::Engaged, None));
    cut();
    let (from, mut felt_for) = (record.at, Duration::ZERO);
    for _ in 0..400 {
        let record = node.cycle();
        if (record.output.tau - record.output.ledger.gravity).amax() > 1e-9 {
            felt_for = record.at.since(from);
        }
    }
    assert_eq!(node.mode(), Mode::ReflectionOff);
    felt_for
}

#[test]
fn hazard_34_cut_link_ends_reflection_until_a_reset() {
    let (mut node, handle) = booted("kraft_like", LINK, Network::default());
    let felt_for = reflected_after(&mut node, || handle.is_cut.set(true));
    assert!(felt_for <= MS * 70, "{felt_for:?}");
    assert_eq!(node.cause(), Some(Cause::LinkLost));
    let refused = ask(&mut node, Request::Reset).unwrap_err();
    assert_eq!(refused, "the far side does not answer: connect it to the link's socket");
    handle.is_cut.set(false);
    cycles(&mut node, 50);
    assert_eq!(node.remote().far.reason(), Reason::Silence, "it goes on in no old epoch");
    assert_eq!(ask(&mut node, Request::Reset), Ok(Mode::Armed));
    cycles(&mut node, 10);
    assert_eq!((node.cause(), node.remote().far.reason()), (None, Reason::None));
}

#[test]
fn hazard_47_reason_of_a_hold_is_the_cause_and_a_reset_ends_it() {
    let (mut node, handle) = booted("jpl_like", LINK, Network::default());
    let held = Some(Reason::SensorSaturated);
    let felt_for = reflected_after(&mut node, || handle.hold.set(held));
    assert!(felt_for <= MS * 70, "{felt_for:?}");
    assert_eq!(node.cause(), Some(Cause::FarSideHolds { reason: Reason::SensorSaturated }));
    assert_eq!(ask(&mut node, Request::Reset), Ok(Mode::Armed));
    cycles(&mut node, 10);
    assert_eq!((node.cause(), node.remote().far.reason()), (None, Reason::None));
}

#[test]
fn restarted_far_side_is_felt_after_a_reset_alone() {
    let (mut node, handle) = booted("kraft_like", LINK, Network::default());
    let felt_for = reflected_after(&mut node, || handle.restarts.set(true));
    assert!(felt_for <= MS * 70, "{felt_for:?}");
    assert_eq!(node.cause(), Some(Cause::LinkLost));
    assert_eq!(node.remote().far.reason(), Reason::NotArmed);
    assert_eq!(ask(&mut node, Request::Reset), Ok(Mode::Armed));
    cycles(&mut node, 10);
    assert_eq!((node.cause(), node.remote().far.reason()), (None, Reason::None));
}

#[test]
fn stopped_far_side_acts_on_nothing_of_its_backlog() {
    let (mut node, handle) = booted("kraft_like", LINK, Network::default());
    reflected_after(&mut node, || handle.is_stopped.set(true));
    let before = *node.remote().site.pose();
    cycles(&mut node, 2_000);
    handle.is_stopped.set(false);
    cycles(&mut node, 200);
    let moved = (before.inverse() * node.remote().site.pose()).translation.vector.norm();
    assert!(moved < 1e-3, "{moved} m");
    assert_eq!(node.remote().far.reason(), Reason::Silence);
}

#[test]
fn hazard_48_slow_link_stops_while_engaged_and_names_both_times() {
    let keys = "round_trip_ms = 5.0\nmax_age_ms = 20.0\nstiffest_contact_n_per_m = 2000.0";
    let network = Network { delay: MS * 4, ..Network::default() };
    let (mut node, _) = booted("kraft_like", keys, network);
    assert_eq!(ask(&mut node, Request::Arm), Ok(Mode::Armed));
    cycles(&mut node, 2_000);
    let cause = node.cause().unwrap();
    assert!(matches!(cause, Cause::LinkSlow { p99_us: 8_000.., stated_us: 5_000 }), "{cause}");
    assert_eq!(node.mode(), Mode::ReflectionOff);
}

#[test]
fn arming_names_every_figure_that_is_worse_than_stated() {
    let (mut node, _) = booted("kraft_like", LINK, Network::default());
    node.remote_mut().capability.servo_lag = 0.05;
    node.remote_mut().capability.stiffest_contact = 9_000.0;
    // The figures of a far side that starts again are asked for anew.
    node.remote_mut().handle.restarts.set(true);
    cycles(&mut node, 300);
    assert_eq!(
        ask(&mut node, Request::Arm).unwrap_err(),
        "remote.servo_time_constant_s is 0.01, and the far side has 0.05: correct the key, or the far side; \
         remote.link.stiffest_contact_n_per_m is 2000, and the far side has 9000: correct the key, or the far side"
    );
    assert_eq!(node.mode(), Mode::Ready);
}
