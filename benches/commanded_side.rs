//! Benchmark of the commanded side in the cycle: the virtual object in contact with its wall, the model of an arm that holds
//! it, and a robot in another process over a real socket.
//!
//! `cargo bench --bench commanded_side` prints the median, the 99th percentile and the maximum of the cycle's part; with
//! `-- KIND --steps N` (`virtual`, `arm` or `link`) it plays N cycles and prints nothing. `scripts/bench.sh` counts the
//! instructions of `cycle_part` in them; the link's own thread is not part of it.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "a benchmark prints, and cannot go on without what it needs"
)]

use std::hint::black_box;
use std::io::{Read, Write};
use std::path::Path;
use std::time::{Duration, Instant as Clock};

use config::Config;
use config::robots::RobotArm;
use contract::FarEnd;
use nalgebra::Isometry3;
use remote::link::{LinkSettings, LinkSide, LinkThread, link};
use remote::site::VirtualSite;
use remote::stated::StatedCapability;
use remote::{Command, Remote, RemoteSample, messages};
use socket2::{Domain, SockAddr, Socket, Type};
use units::spatial::{Motion, Twist, Wrench};
use units::time::Instant;

const CONFIG: &str = "config/kraft_like.toml";
const ARM: &str = "config/robots/puma560.toml";
const KINDS: [&str; 3] = ["virtual", "arm", "link"];

fn main() {
    let mut arguments = std::env::args().skip_while(|argument| argument != "--steps");
    let steps: Option<u32> = arguments.nth(1).and_then(|steps| steps.parse().ok());
    let Some(steps) = steps else {
        KINDS.iter().for_each(|kind| print(kind));
        return;
    };
    let kind = std::env::args().find(|argument| KINDS.contains(&argument.as_str()));
    played(&kind.unwrap(), steps, |_| ());
}

fn print(kind: &str) {
    let mut spans = Vec::new();
    played(kind, 20_000, |span| spans.push(span.as_secs_f64() * 1e6));
    spans.sort_by(f64::total_cmp);
    let at = |percent: usize| spans.get((spans.len() - 1) * percent / 100).unwrap();
    println!(
        "{kind}, its part of a cycle: p50 {:.2} µs, p99 {:.2} µs, max {:.1} µs ({} cycles)",
        at(50),
        at(99),
        at(100),
        spans.len()
    );
}

/// Runs cycles of one kind of commanded side; calls `measured` with the duration of each.
fn played(kind: &str, steps: u32, measured: impl FnMut(Duration)) {
    let config = Config::load(Path::new(CONFIG)).unwrap();
    match kind {
        "virtual" => {
            let mut site = VirtualSite::new(&config.remote, config.period);
            cycles(&mut site, |_| (), config.period, steps, measured);
        }
        "arm" => {
            let config = config.with_robot(RobotArm::load(Path::new(ARM)).unwrap());
            let mut site = VirtualSite::new(&config.remote, config.period);
            cycles(&mut site, |_| (), config.period, steps, measured);
        }
        _ => {
            let (mut side, mut far) = linked(&config);
            cycles(&mut side, |now| far.run(now), config.period, steps, measured);
        }
    }
}

fn cycles<R: Remote>(
    side: &mut R,
    mut run_far: impl FnMut(Instant),
    period: Duration,
    steps: u32,
    mut measured: impl FnMut(Duration),
) {
    // Towards the wall, with contact within a second.
    let rate = Motion::Rate(Twist::from_components([0.0, 0.0, 0.06, 0.0, 0.0, 0.0])).into();
    side.begin_epoch();
    for cycle in 1..=steps {
        let now = Instant::ZERO + period * cycle;
        run_far(now);
        let begun = Clock::now();
        cycle_part(side, now, &rate);
        measured(begun.elapsed());
    }
}

/// Runs the part of the node's cycle that depends on the kind of commanded side.
#[inline(never)]
fn cycle_part<R: Remote>(side: &mut R, now: Instant, command: &Command) {
    black_box(side.error());
    black_box(side.exchange(now, black_box(command)));
}

/// Thread of the link, and the far side at the other end of its socket.
struct FarSide {
    thread: LinkThread,
    socket: Socket,
    end: FarEnd,
}

impl FarSide {
    /// Runs a period of the link's thread and a cycle of the far side, which is in contact.
    fn run(&mut self, now: Instant) {
        self.thread.step(now);
        let mut message = [0; 512];
        while let Ok(length) = (&self.socket).read(&mut message) {
            self.end.on_message(now, message.get(..length).unwrap());
        }
        self.end.motion(now);
        let f_s = Wrench::from_components([0.0, 0.0, -6.0, 0.1, 0.0, 0.0]);
        let sensed = RemoteSample { at: now, f_s, x_b_m: Isometry3::identity(), gripper: None };
        let feedback = self.end.feedback(now, &messages::measured(&sensed));
        (&self.socket).write_all(&feedback).unwrap();
        self.thread.receive(now);
    }
}

fn linked(config: &Config) -> (LinkSide, FarSide) {
    let folder = tempfile::tempdir().unwrap();
    let path = SockAddr::unix(folder.path().join("link.sock")).unwrap();
    let listener = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
    listener.bind(&path).unwrap();
    listener.listen(1).unwrap();
    let socket = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
    socket.connect(&path).unwrap();
    socket.set_nonblocking(true).unwrap();
    let settings = LinkSettings {
        arm: 1,
        session: 1,
        period: config.period,
        round_trip: Duration::from_millis(5),
        stated: StatedCapability::from_interaction(
            &config.remote.interaction,
            &config.remote.servo,
        ),
    };
    let (side, thread) = link(listener, &settings).unwrap();
    (side, FarSide { thread, socket, end: FarEnd::new(1, 2, Duration::from_millis(100)) })
}
