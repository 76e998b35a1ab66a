//! A node whose commanded side is in another process: its link over a real socket in virtual time, a network of its own
//! between the two ends, and the far side.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::io::Read;
use std::rc::Rc;

use contract::{Capability, FarEnd, Reason};
use nalgebra::Vector3;
use socket2::{Domain, SockAddr, Socket, Type};
use tempfile::TempDir;

use crate::common::bench::press_script;
use crate::common::linked::linked;
use crate::common::prelude::*;
use bus::Tap;
use controller::switches::CommandMode;
use node::Node;
use remote::link::{LinkSettings, LinkSide, LinkThread, link};
use remote::site::VirtualSite;
use remote::stated::{Misfit, StatedCapability};
use remote::{Command, Remote, RemoteSample, SideError, messages};
use sim::random::SplitMix;

/// Workspace of the far side, in m.
const WORKSPACE: [[f64; 3]; 2] = [[-1.0; 3], [1.0; 3]];

/// Parses a text in place of the shipped file of a hand controller, such as `drives/elmo_gold`.
pub(crate) fn parse_as(hand: &str, text: &str) -> Config {
    parse(&format!("config/{hand}.toml"), text)
}

/// A network between the two ends.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Network {
    pub(crate) delay: Duration,
    pub(crate) jitter: Duration,
    /// Share of the messages that are lost, and of those that arrive twice.
    pub(crate) loss: f64,
    pub(crate) duplicates: f64,
}

/// Messages in transit in one direction; jitter can change their order.
pub(crate) struct Way {
    pub(crate) network: Network,
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

/// Sender that replaces the far side: returns the messages for the node's socket in a cycle, from those of the far side
/// that have arrived.
pub(crate) type Peer = Box<dyn FnMut(Instant, &mut FarEnd, Vec<Vec<u8>>) -> Vec<Vec<u8>>>;

/// Faults of the far side that a test sets while the node runs.
#[derive(Default)]
pub(crate) struct Handle {
    pub(crate) hold: Cell<Option<Reason>>,
    pub(crate) is_cut: Cell<bool>,
    /// It follows no command, and does not say so.
    pub(crate) is_blocked: Cell<bool>,
    pub(crate) restarts: Cell<bool>,
    /// Force along x that the sensor reports in place of the contact's, by the time of the sample.
    pub(crate) writes_its_time: Cell<bool>,
    pub(crate) peer: RefCell<Option<Peer>>,
    /// Messages for which the node's queue had no room.
    pub(crate) unsent: Cell<u64>,
    /// The link reads up to 16 messages per cycle, as its thread does; it reads messages sent in this cycle in the next one.
    pub(crate) reads_once: Cell<bool>,
}

/// Commanded side of a node: its link, and the network and the far side at the other end of the socket.
pub(crate) struct LinkedSide {
    pub(crate) side: LinkSide,
    pub(crate) thread: LinkThread,
    pub(crate) folder: TempDir,
    pub(crate) socket: Socket,
    pub(crate) there: Way,
    pub(crate) back: Way,
    pub(crate) far: FarEnd,
    pub(crate) capability: Capability,
    pub(crate) site: VirtualSite,
    pub(crate) handle: Rc<Handle>,
    pub(crate) sessions: u64,
}

impl LinkedSide {
    pub(crate) fn new(near: &Config, far: &Config, network: Network, handle: Rc<Handle>) -> Self {
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
        let stated = StatedCapability { sample_period: 1e-3, hold_after: 0.1, ..agreement.stated };
        let way = |seed| Way { network, random: SplitMix::new(seed), under_way: VecDeque::new() };
        Self {
            side,
            thread,
            socket: connected(&path),
            folder,
            there: way(1),
            back: way(2),
            far: FarEnd::new(near.far_side.arm, 0xface, MS * 100),
            capability: stated.capability(WORKSPACE),
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
        let command = messages::command(&mut self.far, now);
        let command = if self.handle.is_blocked.get() { Command::HOLD } else { command };
        let mut sensed = self.site.exchange(now, &command).unwrap();
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
        let mut messages = self.back.arrived(now);
        if let Some(peer) = self.handle.peer.borrow_mut().as_mut() {
            messages = peer(now, &mut self.far, messages);
        }
        for message in messages {
            let is_sent = self.socket.send(&message).is_ok();
            self.handle.unsent.update(|unsent| unsent + u64::from(!is_sent));
        }
    }
}

pub(crate) fn connected(path: &Path) -> Socket {
    let socket = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
    socket.connect(&SockAddr::unix(path).unwrap()).unwrap();
    socket.set_nonblocking(true).unwrap();
    socket
}

impl Remote for LinkedSide {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        self.thread.step(now);
        self.run_far_side(now);
        if !self.handle.reads_once.get() {
            self.thread.receive(now);
        }
        self.side.exchange(now, command)
    }

    fn begin_epoch(&mut self) {
        self.side.begin_epoch();
    }

    fn end_epoch(&mut self) {
        self.side.end_epoch();
    }

    fn misfits(&mut self, now: Instant, mode: CommandMode) -> Vec<Misfit> {
        self.side.misfits(now, mode)
    }

    fn mode_misfit(&mut self, mode: CommandMode) -> Option<Misfit> {
        self.side.mode_misfit(mode)
    }

    fn error(&mut self) -> Option<SideError> {
        self.side.error()
    }
}

/// A node on a bus in memory, with a tap of its frames.
pub(crate) type LinkedNode<T = ()> = Node<Memory<World, T>, LinkedSide>;

/// Boots a node whose operator presses towards the wall of the far side, 0.1 mm away.
pub(crate) fn booted(hand: &str, keys: &str, network: Network) -> (LinkedNode, Rc<Handle>) {
    booted_with(hand, keys, network, ())
}

/// Boots such a node with a tap of its frames.
pub(crate) fn booted_with<T: Tap>(
    hand: &str,
    keys: &str,
    network: Network,
    tap: T,
) -> (LinkedNode<T>, Rc<Handle>) {
    booted_near(hand, &parse(KRAFT, &linked(hand, keys)), network, tap)
}

/// Boots a node of this configuration, whose far side has the scene of this hand's file.
pub(crate) fn booted_near<T: Tap>(
    hand: &str,
    near: &Config,
    network: Network,
    tap: T,
) -> (LinkedNode<T>, Rc<Handle>) {
    let text = fs::read_to_string(format!("config/{hand}.toml")).unwrap();
    let far = parse_as(hand, &text.replace("start_m = [0.4,", "start_m = [0.4499,"));
    let bitrates: Vec<u32> = near.buses.iter().map(|bus| bus.bitrate).collect();
    let world = world::build(near, script(&press_script(1.2)), 1);
    let handle = Rc::new(Handle::default());
    let remote = LinkedSide::new(near, &far, network, Rc::clone(&handle));
    let mut node = Node::new(near, Memory::new(&bitrates, world, tap), remote);
    node.bring_up(&mut || false).unwrap();
    while node.cycle().inputs.is_none() || node.bus().now() < Instant::ZERO + MS * 1_000 {}
    (node, handle)
}

pub(crate) fn ask<T: Tap>(node: &mut LinkedNode<T>, request: Request) -> Result<Mode, String> {
    node.request(request, &mut || false).map_err(|error| error.to_string())
}

/// Arms the node, and runs it until the hand presses.
pub(crate) fn engage<T: Tap>(node: &mut LinkedNode<T>) -> Record {
    let armed = ask(node, Request::Arm);
    assert_eq!(armed, Ok(Mode::Armed), "{:?}", node.remote().there.network);
    let engaged = (0..3_000).find(|_| node.cycle().mode == Mode::Engaged);
    assert!(engaged.is_some(), "{:?}: {:?}", node.cause(), node.remote().there.network);
    cycles(node, 500)
}

pub(crate) fn cycles<T: Tap>(node: &mut LinkedNode<T>, count: usize) -> Record {
    (0..count).map(|_| node.cycle()).last().unwrap()
}
