//! Round trip of the contract's messages on this host, over three paths. They are both Unix sockets with both ends of
//! `frhc-link`, two bare sessions of zenoh with the same settings, and two over UDP. Interleaved, at 500 Hz.
//!
//! `cargo bench --features carriers --bench latency [-- SECONDS]` prints the table of docs/network.md.
#![allow(
    clippy::disallowed_methods,
    clippy::indexing_slicing,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "what a measurement cannot do without has failed it; its clock is the host's"
)]

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread::sleep;
use std::time::{Duration, Instant};

use contract::{FarEnd, Measurements, Motion, NodeEnd, Order};
use frhc_link::certificate::Files;
use frhc_link::role::{Role, Topic};
use frhc_link::settings::Settings;
use frhc_link::{keys, network, priority};
use socket2::{Domain, SockAddr, Socket, Type};
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::sample::Locality;
use zenoh::{Session, Wait};

const ARM: u16 = 1;

/// Consecutive round trips over one path before the next path.
const TURN: usize = 250;

/// Time from one message to the next.
const PERIOD: Duration = Duration::from_millis(2);

/// Maximum wait for an answer.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// Path of messages in both directions.
trait Way {
    fn name(&self) -> &'static str;
    /// Sends a command; returns the feedback to it.
    fn exchange(&mut self, command: &[u8]) -> Vec<u8>;
}

fn main() {
    priority::ask();
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    match args.first().map(String::as_str) {
        Some("bare") => answer_bare(args[1].parse().unwrap(), args[2].as_ref(), args[3] == "udp"),
        Some("local") => answer_local(args[1].as_ref()),
        Some(seconds) => measure(seconds.parse().unwrap()),
        None => measure(10),
    }
}

fn measure(seconds: usize) {
    let folder = std::env::temp_dir().join(format!("latency-{}", std::process::id()));
    std::fs::create_dir(&folder).unwrap();
    keys::write(&folder.join("keys"), ARM, false, 1).unwrap();
    let mut ways: Vec<Box<dyn Way>> = vec![
        Box::new(Bare::open(17_447, &folder, false)),
        Box::new(Through::open(17_448, &folder)),
        Box::new(Bare::open(17_449, &folder, true)),
    ];
    let mut nodes: Vec<_> = (0..ways.len()).map(|_| NodeEnd::new(ARM, 7)).collect();
    let mut trips: Vec<Vec<u64>> = vec![Vec::new(); ways.len()];
    for turn in 0..=seconds * 2 {
        for ((way, node), trips) in ways.iter_mut().zip(&mut nodes).zip(&mut trips) {
            let turn_trips = (0..TURN).map(|_| round_trip(way.as_mut(), node));
            let turn_trips: Vec<u64> = turn_trips.collect();
            // The first turn warms up.
            if turn > 0 {
                trips.extend(turn_trips);
            }
        }
    }
    println!("| way | p50 µs | p99 µs | max µs |\n|---|--:|--:|--:|");
    for (way, trips) in ways.iter().zip(&mut trips) {
        trips.sort_unstable();
        let at = |part: usize| trips[(trips.len() - 1) * part / 100];
        println!("| {} | {} | {} | {} |", way.name(), at(50), at(99), at(100));
    }
    drop(ways);
    std::fs::remove_dir_all(folder).unwrap();
}

/// Returns a round trip in µs.
fn round_trip(way: &mut dyn Way, node: &mut NodeEnd) -> u64 {
    sleep(PERIOD);
    let order = Order { motion: Motion::Hold, is_engaged: false, gripper: None };
    let command = node.command(time(), &order);
    let begin = Instant::now();
    let feedback = way.exchange(&command);
    let taken = begin.elapsed();
    node.on_message(time(), &feedback);
    u64::try_from(taken.as_micros()).unwrap()
}

/// Time of the contract's ends.
fn time() -> units::time::Instant {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap();
    units::time::Instant::ZERO + now
}

/// Far side that answers each command at once.
struct Answers(FarEnd);

impl Answers {
    fn new() -> Self {
        Self(FarEnd::new(ARM, 8, Duration::from_millis(100)))
    }

    fn to(&mut self, command: &[u8]) -> Vec<u8> {
        self.0.on_message(time(), command);
        self.0.feedback(time(), &Measurements::default()).to_vec()
    }
}

/// Process that is ended when dropped.
struct Other(Child);

impl Other {
    fn start(program: &Path, args: &[&str]) -> Self {
        let mut command = Command::new(program);
        Self(command.args(args).stdin(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    }
}

impl Drop for Other {
    fn drop(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

fn settings(folder: &Path, network: &str) -> PathBuf {
    let file =
        folder.join(format!("{}.toml", network.replace(|it: char| !it.is_alphanumeric(), "")));
    let socket = file.with_extension("sock");
    std::fs::write(&file, format!("keys = \"keys\"\nsocket = {socket:?}\n{network}\n")).unwrap();
    file
}

/// Opens a session as `frhc-link` does; over UDP without identity.
fn session(role: Role, file: &Path, is_udp: bool) -> Session {
    let settings = Settings::load(role, file).unwrap();
    let files = Files::in_folder(&settings.keys, role.name());
    let mut config = network::configuration(role, &settings, &files).unwrap();
    if is_udp {
        config.insert_json5("access_control/enabled", "false").unwrap();
        for (key, addresses) in [("listen", &settings.listen), ("connect", &settings.connect)] {
            let endpoints: Vec<_> = addresses.iter().map(|it| format!("\"udp/{it}\"")).collect();
            let list = format!("[{}]", endpoints.join(","));
            config.insert_json5(&format!("{key}/endpoints"), &list).unwrap();
        }
    }
    zenoh::open(config).wait().unwrap()
}

fn publisher(session: &Session, topic: Topic) -> Publisher<'static> {
    let publisher = session.declare_publisher(topic.key(ARM)).express(true);
    let publisher =
        publisher.priority(Priority::RealTime).congestion_control(CongestionControl::Drop);
    publisher.reliability(Reliability::BestEffort).wait().unwrap()
}

fn subscriber(
    session: &Session,
    topic: Topic,
    mut take: impl FnMut(Vec<u8>) + Send + Sync + 'static,
) -> Subscriber<()> {
    let subscriber = session.declare_subscriber(topic.key(ARM)).allowed_origin(Locality::Remote);
    subscriber
        .callback_mut(move |sample| take(sample.payload().to_bytes().into_owned()))
        .wait()
        .unwrap()
}

/// Path over two sessions of zenoh without `frhc-link`.
struct Bare {
    name: &'static str,
    publisher: Publisher<'static>,
    feedbacks: Receiver<Vec<u8>>,
    _subscriber: Subscriber<()>,
    _session: Session,
    _answers: Other,
}

impl Bare {
    fn open(port: u16, folder: &Path, is_udp: bool) -> Self {
        let kind = if is_udp { "udp" } else { "quic" };
        let program = std::env::current_exe().unwrap();
        let answers =
            Other::start(&program, &["bare", &port.to_string(), folder.to_str().unwrap(), kind]);
        let file = settings(folder, &format!("connect = [\"127.0.0.1:{port}\"]"));
        let session = session(Role::Near, &file, is_udp);
        let (sender, feedbacks) = channel();
        let subscriber = subscriber(&session, Topic::Feedback, move |bytes| {
            sender.send(bytes).unwrap_or_default();
        });
        let publisher = publisher(&session, Topic::Command);
        let name = if is_udp { "two sessions over UDP, without identity" } else { "two sessions" };
        let mut bare = Self {
            name,
            publisher,
            feedbacks,
            _subscriber: subscriber,
            _session: session,
            _answers: answers,
        };
        bare.wait();
        bare
    }

    /// Waits until the other session answers.
    fn wait(&mut self) {
        let order = Order { motion: Motion::Hold, is_engaged: false, gripper: None };
        let mut node = NodeEnd::new(ARM, 9);
        loop {
            self.publisher.put(node.command(time(), &order).to_vec()).wait().unwrap();
            if self.feedbacks.recv_timeout(Duration::from_millis(50)).is_ok() {
                return;
            }
        }
    }
}

impl Way for Bare {
    fn name(&self) -> &'static str {
        self.name
    }

    fn exchange(&mut self, command: &[u8]) -> Vec<u8> {
        self.publisher.put(command.to_vec()).wait().unwrap();
        self.feedbacks.recv_timeout(ANSWER_TIMEOUT).unwrap()
    }
}

fn answer_bare(port: u16, folder: &Path, is_udp: bool) {
    let file = settings(folder, &format!("listen = [\"127.0.0.1:{port}\"]"));
    let session = session(Role::Far, &file, is_udp);
    let feedbacks = publisher(&session, Topic::Feedback);
    let mut answers = Answers::new();
    let _subscriber = subscriber(&session, Topic::Command, move |command| {
        feedbacks.put(answers.to(&command)).wait().unwrap();
    });
    std::thread::park();
}

/// Path over both Unix sockets and both ends of `frhc-link`.
struct Through {
    node: Socket,
    _others: [Other; 3],
}

impl Through {
    fn open(port: u16, folder: &Path) -> Self {
        let near = settings(folder, &format!("connect = [\"127.0.0.1:{port}\"]"));
        let far = settings(folder, &format!("listen = [\"127.0.0.1:{port}\"]"));
        let listener = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        listener.bind(&SockAddr::unix(near.with_extension("sock")).unwrap()).unwrap();
        listener.listen(1).unwrap();
        let link = Path::new(env!("CARGO_BIN_EXE_frhc-link"));
        let robot = far.with_extension("sock");
        let others = [
            Other::start(link, &["far", "--config", far.to_str().unwrap()]),
            Other::start(link, &["near", "--config", near.to_str().unwrap()]),
            Other::start(&std::env::current_exe().unwrap(), &["local", robot.to_str().unwrap()]),
        ];
        let (node, _) = listener.accept().unwrap();
        node.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
        let mut through = Self { node, _others: others };
        through.wait();
        through.node.set_read_timeout(Some(ANSWER_TIMEOUT)).unwrap();
        through
    }

    /// Waits until the robot answers.
    fn wait(&mut self) {
        let order = Order { motion: Motion::Hold, is_engaged: false, gripper: None };
        let mut node = NodeEnd::new(ARM, 9);
        loop {
            self.node.write_all(&node.command(time(), &order)).unwrap();
            if self.node.read(&mut [0; 512]).is_ok() {
                return;
            }
        }
    }
}

impl Way for Through {
    fn name(&self) -> &'static str {
        "through both sockets and both ends"
    }

    fn exchange(&mut self, command: &[u8]) -> Vec<u8> {
        self.node.write_all(command).unwrap();
        let mut buffer = [0; 512];
        let length = self.node.read(&mut buffer).unwrap();
        buffer[..length].to_vec()
    }
}

fn answer_local(path: &Path) {
    let mut robot = loop {
        let robot = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        if robot.connect(&SockAddr::unix(path).unwrap()).is_ok() {
            break robot;
        }
        sleep(Duration::from_millis(20));
    };
    let (mut answers, mut buffer) = (Answers::new(), [0; 512]);
    while let Ok(length @ 1..) = robot.read(&mut buffer) {
        robot.write_all(&answers.to(&buffer[..length])).unwrap();
    }
}
