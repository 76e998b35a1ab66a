//! `frhc robot` as a process: a node of this test leads it over a socket.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, ErrorKind, Read};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use socket2::{Domain, SockAddr, Socket, Type};

use crate::common::linked::{LINK, linked, with_model};
use crate::common::prelude::*;
use bus::clock;
use contract::{Feedback, Motion, NodeEnd, Order, Reason};

/// Maximum time of a wait in a test, on a busy machine.
const LIMIT: Duration = Duration::from_secs(60);

/// Waits.
fn pause(duration: Duration) {
    clock::wait(clock::monotonic() + duration);
}

/// A node without a hand controller.
struct Node {
    listener: Socket,
    robot: Option<Socket>,
    end: NodeEnd,
    /// Start, on the clock of the host.
    started: Duration,
    feedback: Option<Feedback>,
}

impl Node {
    /// Listens at a path.
    fn at(path: &str, session: u64) -> Self {
        let listener = Socket::new(Domain::UNIX, Type::SEQPACKET.nonblocking(), None).unwrap();
        listener.bind(&SockAddr::unix(path).unwrap()).unwrap();
        listener.listen(1).unwrap();
        let started = clock::monotonic();
        Self { listener, robot: None, end: NodeEnd::new(1, session), started, feedback: None }
    }

    fn now(&self) -> Instant {
        Instant::ZERO + (clock::monotonic() - self.started)
    }

    /// Accepts the robot's connection, and reads its messages.
    fn receive(&mut self) {
        if self.robot.is_none()
            && let Ok((robot, _)) = self.listener.accept()
        {
            robot.set_nonblocking(true).unwrap();
            self.robot = Some(robot);
        }
        let mut buffer = [0; 512];
        while let Some(robot) = &mut self.robot {
            match robot.read(&mut buffer) {
                Ok(0) => self.robot = None,
                Ok(length) => {
                    let sample = self.end.on_message(self.now(), &buffer[..length]);
                    self.feedback = sample.map(|sample| sample.feedback).or(self.feedback);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Sends a command, unless the robot does not read.
    fn send(&mut self, motion: Motion) {
        let command =
            self.end.command(self.now(), &Order { motion, is_engaged: true, gripper: None });
        if let Some(robot) = &self.robot {
            robot.send(&command).ok();
        }
    }

    /// Runs cycles of 1 ms with this command until a condition holds.
    #[track_caller]
    fn until(&mut self, motion: Option<Motion>, is_met: impl Fn(&Self) -> bool) {
        let begun = clock::monotonic();
        while !is_met(self) {
            assert!(clock::monotonic() < begun + LIMIT, "{:?}", self.feedback);
            self.receive();
            motion.iter().for_each(|motion| self.send(*motion));
            pause(MS);
        }
    }

    fn reason(&self) -> Option<Reason> {
        self.feedback.map(|feedback| feedback.reason)
    }

    /// Position of the robot, in m.
    fn position(&self) -> [f64; 3] {
        self.feedback.unwrap().measured.pose.unwrap().position
    }

    /// Distance from a position, in m.
    fn distance(&self, from: [f64; 3]) -> f64 {
        let squares = self.position().into_iter().zip(from).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    }
}

/// Rate out of reach of the wall, in m/s.
const BACK: Motion = Motion::Rate([0.0, 0.0, -0.02, 0.0, 0.0, 0.0]);

/// Time without a fresh command that a busy machine never causes.
const HOLD_AFTER: Duration = Duration::from_secs(1);

/// Returns a configuration whose robot holds after [`HOLD_AFTER`].
fn patient(scratch: &Scratch) -> String {
    let link = "[remote.link]\nhold_after_ms = 1000.0\n\n[safety]";
    scratch.variant(KRAFT, &[("[safety]", link)])
}

/// Rate into the wall, in m/s.
const AHEAD: Motion = Motion::Rate([0.0, 0.0, 0.2, 0.0, 0.0, 0.0]);

#[test]
fn configured_wrench_limit_holds_the_robot_process() {
    let scratch = Scratch::new("robot-limit");
    let link = "[remote.link]\nhold_after_ms = 1000.0\nwrench_limit_n = 8.0\n\n[safety]";
    let config = scratch.variant(KRAFT, &[("[safety]", link)]);
    let socket = scratch.path("far.sock");
    let mut node = Node::at(&socket, 7);
    let robot = scratch.frhc(&command(&config, &socket));
    node.until(Some(Motion::Hold), |node| node.feedback.is_some());
    node.end.begin_epoch();
    // Accommodation would let it press with 20 N.
    node.until(Some(AHEAD), |node| node.reason() == Some(Reason::WrenchLimit));
    let [x, y, z, ..] = node.feedback.unwrap().measured.wrench.unwrap();
    let force = x.hypot(y).hypot(z);
    assert!((8.0..16.0).contains(&force), "{force} N");
    robot.terminate().succeeds();
}

fn command<'a>(config: &'a str, socket: &'a str) -> Vec<&'a str> {
    vec!["robot", "--config", config, "--robot", PUMA, "--socket", socket]
}

#[test]
fn file_of_the_node_serves_its_robot_process_too() {
    let scratch = Scratch::new("robot-one-file");
    let limited = format!("wrench_limit_n = 40.0\n{LINK}");
    let both = with_model("kraft_like").replacen(LINK, &limited, 1);
    for (kind, text) in [("link", linked("kraft_like", LINK)), ("both", both)] {
        let eds = format!("\"{}/eds/", env!("CARGO_MANIFEST_DIR"));
        let file = scratch.write(kind, &text.replace("\"../eds/", &eds));
        let checked = frhc(&["check", "--config", &file]);
        assert_eq!(checked.code, 0, "{}", checked.stderr);
        let socket = scratch.path(&format!("{kind}.sock"));
        let mut node = Node::at(&socket, 7);
        let robot = scratch.frhc(&command(&file, &socket));
        node.until(Some(Motion::Hold), |node| node.end.capability().is_some());
        robot.terminate().succeeds();
    }
}

#[test]
fn robot_process_is_led_holds_and_ends_in_order() {
    let scratch = Scratch::new("robot-led");
    let (config, socket) = (patient(&scratch), scratch.path("far.sock"));
    let robot = scratch.frhc(&command(&config, &socket));
    let mut node = Node::at(&socket, 0x5eed);
    node.until(Some(Motion::Hold), |node| node.end.capability().is_some());
    assert_eq!(node.end.capability().unwrap().sensor_range, [200.0, 20.0]);
    node.until(Some(BACK), |node| node.feedback.is_some());
    assert_eq!(node.reason(), Some(Reason::NotArmed));

    let start = node.position();
    node.end.begin_epoch();
    node.until(Some(BACK), |node| node.distance(start) > 0.005);
    assert_eq!(
        (node.reason(), node.feedback.unwrap().obeyed_session),
        (Some(Reason::None), 0x5eed)
    );

    let until = node.now() + HOLD_AFTER + 300 * MS;
    node.until(None, |node| node.now() > until);
    node.until(Some(BACK), |node| node.reason() == Some(Reason::Silence));
    let held = node.position();
    let until = node.now() + 200 * MS;
    node.until(Some(BACK), |node| node.now() > until);
    assert!(node.distance(held) < 1e-4, "{} m", node.distance(held));

    node.end.begin_epoch();
    node.until(Some(BACK), |node| node.distance(held) > 0.002);
    robot.signal(Signal::SIGTERM);
    node.until(Some(BACK), |node| node.reason() == Some(Reason::Ending));
    let outcome = robot.wait();
    outcome.succeeds();
    for line in [
        "connected to a node",
        "a node leads session=0000000000005eed epoch=0",
        "follows epoch=1",
        "holds: no fresh command",
        "follows epoch=2",
        "holds: far side ends",
    ] {
        assert_eq!(outcome.stderr.matches(line).count(), 1, "{line}: {}", outcome.stderr);
    }
}

#[test]
fn hazard_35_continued_robot_process_acts_on_no_backlog() {
    let scratch = Scratch::new("robot-stopped");
    let (config, socket) = (patient(&scratch), scratch.path("far.sock"));
    let mut node = Node::at(&socket, 7);
    let robot = scratch.frhc(&command(&config, &socket));
    node.until(Some(Motion::Hold), |node| node.feedback.is_some());
    node.end.begin_epoch();
    node.until(Some(BACK), |node| node.reason() == Some(Reason::None));
    robot.signal(Signal::SIGSTOP);
    let fast = Motion::Rate([0.0, 0.0, -0.4, 0.0, 0.0, 0.0]);
    let until = node.now() + HOLD_AFTER + 300 * MS;
    node.until(Some(fast), |node| node.now() > until);
    let before = node.position();
    robot.signal(Signal::SIGCONT);
    let until = node.now() + 300 * MS;
    node.until(Some(fast), |node| node.now() > until);
    assert_eq!(node.reason(), Some(Reason::Silence));
    assert!(node.distance(before) < 2e-3, "{} m", node.distance(before));
    robot.terminate().succeeds();
}

#[test]
fn robot_process_finds_a_node_that_starts_again() {
    let scratch = Scratch::new("robot-again");
    let (config, socket) = (patient(&scratch), scratch.path("far.sock"));
    let mut node = Node::at(&socket, 7);
    let robot = scratch.frhc(&command(&config, &socket));
    node.until(Some(Motion::Hold), |node| node.feedback.is_some());
    drop(node);
    fs::remove_file(&socket).unwrap();
    let mut node = Node::at(&socket, 8);
    node.until(Some(BACK), |node| node.reason() == Some(Reason::NotArmed));
    let start = node.position();
    node.end.begin_epoch();
    node.until(Some(BACK), |node| node.distance(start) > 0.002);
    // Refused: the connection is closed before any message.
    node.robot = None;
    let begun = clock::monotonic();
    while node.listener.accept().is_err() {
        assert!(clock::monotonic() < begun + LIMIT, "not connected again");
        pause(MS);
    }
    pause(300 * MS);
    let outcome = robot.terminate();
    outcome.succeeds();
    for line in
        ["the node closed the connection\n", "closed the connection at once; is another far"]
    {
        assert!(outcome.stderr.contains(line), "{line}: {}", outcome.stderr);
    }
}

#[test]
fn robot_process_prints_its_status_on_request() {
    let scratch = Scratch::new("robot-status");
    let (config, socket) = (patient(&scratch), scratch.path("far.sock"));
    let mut node = Node::at(&socket, 0x5eed);
    let (robot, mut stdout) =
        scratch.frhc_and_stdout(&[&command(&config, &socket)[..], &["--json"]].concat());
    node.until(Some(Motion::Hold), |node| node.end.capability().is_some());
    robot.signal(Signal::SIGUSR1);
    let mut line = String::new();
    stdout.read_line(&mut line).unwrap();
    let status: Value = serde_json::from_str(&line).unwrap();
    assert_eq!(status["state"], "holding", "{line}");
    assert_eq!(status["connected"], true, "{line}");
    assert_eq!(status["leader"]["session"], "0000000000005eed", "{line}");
    assert_eq!(status["joints_rad"].as_array().unwrap().len(), 6, "{line}");
    robot.terminate().succeeds();
    let rest = stdout.lines().map(Result::unwrap).collect::<Vec<_>>();
    assert_eq!(rest.len(), 1, "and at its end: {rest:?}");
    assert!(rest[0].contains("\"reason\":\"far side ends\""), "{rest:?}");
}

#[test]
fn status_that_cannot_be_written_fails_the_robot_process() {
    let scratch = Scratch::new("robot-full");
    let (config, socket) = (patient(&scratch), scratch.path("far.sock"));
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut robot = Command::new(crate::common::program());
    let robot = robot.args(command(&config, &socket)).stdout(full).stderr(Stdio::piped());
    let mut robot = robot.spawn().unwrap();
    let mut node = Node::at(&socket, 7);
    node.until(Some(Motion::Hold), |node| node.feedback.is_some());
    kill(Pid::from_raw(robot.id().try_into().unwrap()), Signal::SIGINT).unwrap();
    let ended = robot.wait().unwrap();
    let mut stderr = String::new();
    robot.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
    assert_eq!(ended.code(), Some(4), "{stderr}");
    assert!(stderr.contains("frhc: stdout: No space left on device"), "{stderr}");
}

/// Starts the robot at a socket, and waits until its log has a line with these words. Returns the robot and its log.
fn waiting(scratch: &Scratch, socket: &str, words: &str) -> (Process, String) {
    let log = scratch.path("robot.log");
    let robot = scratch.frhc_onto(&command(KRAFT, socket), File::create(&log).unwrap());
    let begun = clock::monotonic();
    while !fs::read_to_string(&log).unwrap().contains(words) {
        assert!(clock::monotonic() < begun + LIMIT, "{}", fs::read_to_string(&log).unwrap());
        pause(MS);
    }
    (robot, log)
}

#[test]
fn robot_process_waits_at_a_socket_without_a_listener() {
    let scratch = Scratch::new("robot-orphan");
    let socket = scratch.path("far.sock");
    drop(Node::at(&socket, 7));
    let line = format!("{socket}: waits for a node");
    let (robot, log) = waiting(&scratch, &socket, &line);
    pause(300 * MS);
    fs::remove_file(&socket).unwrap();
    let mut node = Node::at(&socket, 8);
    node.until(Some(Motion::Hold), |node| node.feedback.is_some());
    robot.terminate().succeeds();
    let log = fs::read_to_string(&log).unwrap();
    assert_eq!(log.matches(&line).count(), 1, "{log}");
}

#[test]
fn robot_process_names_the_missing_folder_of_its_socket() {
    let scratch = Scratch::new("robot-folder");
    let socket = scratch.path("nowhere/far.sock");
    let line = format!("{socket}: waits for a node; the folder does not exist");
    let (robot, log) = waiting(&scratch, &socket, &line);
    pause(300 * MS);
    fs::create_dir(scratch.path("nowhere")).unwrap();
    let mut node = Node::at(&socket, 8);
    node.until(Some(Motion::Hold), |node| node.feedback.is_some());
    robot.terminate().succeeds();
    let log = fs::read_to_string(&log).unwrap();
    assert_eq!(log.matches(&line).count(), 1, "{log}");
}

/// Place of the version in a message, after its encapsulation header and its kind.
const VERSION_PLACE: usize = 5;

#[test]
fn messages_of_another_arm_or_version_count_in_the_status() {
    let scratch = Scratch::new("robot-other");
    let socket = scratch.path("far.sock");
    let mut node = Node::at(&socket, 7);
    let (robot, mut stdout) = scratch.frhc_and_stdout(&command(KRAFT, &socket));
    node.until(None, |node| node.robot.is_some());
    let order = Order { motion: BACK, is_engaged: true, gripper: None };
    let mut other_version = node.end.command(node.now(), &order);
    other_version[VERSION_PLACE] += 1;
    let other_arm = NodeEnd::new(2, 7).command(node.now(), &order);
    for message in [other_version, other_version, other_arm] {
        node.robot.as_ref().unwrap().send(&message).unwrap();
    }
    let begun = clock::monotonic();
    let mut line = String::new();
    while !line.contains("rejected 2 version, 1 arm") {
        assert!(clock::monotonic() < begun + LIMIT, "{line}");
        robot.signal(Signal::SIGUSR1);
        line.clear();
        stdout.read_line(&mut line).unwrap();
    }
    assert!(line.contains("connected, no leader"), "{line}");
    robot.terminate().succeeds();
}
