//! Three processes, with this test as the far side: it floods the socket of the link, and sets the wall clock.

use std::io::Read;
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};

use contract::{Capability, FarEnd, Measurements, Pose};
use nix::libc::MSG_DONTWAIT;
use socket2::{Domain, SockAddr, Socket, Type};

use crate::common::linked::{LINK, linked};
use crate::common::prelude::*;
use crate::common::rig::{Rig, simulated};
use bus::clock::monotonic;
use remote::stated::StatedCapability;

/// Messages in a period of 1 ms: 50,000 in a second.
const FLOOD: usize = 50;

/// Wrench of a contact along x of {S}, in N.
const CONTACT: Measurements = Measurements {
    wrench: Some([-2.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    pose: Some(Pose { position: [0.4, 0.0, 0.3], orientation: [0.0, 0.0, 0.0, 1.0] }),
    gripper: None,
};

/// Conduct of the peer.
#[derive(Clone, Copy, PartialEq)]
enum Conduct {
    /// It answers each command with a feedback.
    Answers,
    /// It floods its queue after each feedback message.
    FloodsBehind,
    /// It floods its queue first: there is no room for the feedback.
    FloodsFirst,
}

/// The far side of a node, in a thread of this test: the commands of the node are its clock.
struct Peer {
    conduct: Arc<Mutex<Conduct>>,
    thread: JoinHandle<u64>,
}

impl Peer {
    /// Connects to the node of a configuration.
    fn connected(path: &str, config: &str) -> Self {
        let config = Config::parse("config/kraft_like.toml".as_ref(), config).unwrap();
        let socket = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        socket.connect(&SockAddr::unix(path).unwrap()).unwrap();
        let conduct = Arc::new(Mutex::new(Conduct::Answers));
        let shared = Arc::clone(&conduct);
        let thread = thread::spawn(move || {
            let mut far = Far::new(&config, &socket);
            let mut buffer = [0; 512];
            while let Ok(length @ 1..) = (&socket).read(&mut buffer) {
                let (now, conduct) = (Instant::ZERO + monotonic(), *shared.lock().unwrap());
                far.cycle(now, &buffer[..length], conduct);
            }
            far.flooded
        });
        Self { conduct, thread }
    }

    fn conducts(&self, itself: Conduct) {
        *self.conduct.lock().unwrap() = itself;
    }
}

/// End of the far side with its socket.
struct Far<'s> {
    socket: &'s Socket,
    end: FarEnd,
    figures: Capability,
    /// Messages of the flood for which the queue had room.
    flooded: u64,
}

impl<'s> Far<'s> {
    fn new(config: &Config, socket: &'s Socket) -> Self {
        let stated = config.far_side.agreement.unwrap().stated;
        let range = [200.0, 20.0];
        let stated = StatedCapability {
            sample_period: 1e-3,
            hold_after: 0.1,
            sensor_range: range,
            ..stated
        };
        let end = FarEnd::new(config.far_side.arm, 0xface, Duration::from_millis(100));
        Self { socket, end, figures: stated.capability([[-1.0; 3], [1.0; 3]]), flooded: 0 }
    }

    /// Answers a command.
    fn cycle(&mut self, now: Instant, command: &[u8], conduct: Conduct) {
        self.end.on_message(now, command);
        self.end.motion(now);
        if conduct == Conduct::FloodsFirst {
            self.flood();
        }
        let feedback = self.end.feedback(now, &CONTACT);
        self.send(&feedback);
        if let Some(figures) = self.end.capability(now, &self.figures) {
            self.send(&figures);
        }
        if conduct == Conduct::FloodsBehind {
            self.flood();
        }
    }

    fn flood(&mut self) {
        let sent = (0..FLOOD).filter(|_| self.send(&[7; 40])).count();
        self.flooded += u64::try_from(sent).unwrap();
    }

    /// Sends a message; returns whether the queue had room for it.
    fn send(&self, message: &[u8]) -> bool {
        self.socket.send_with_flags(message, MSG_DONTWAIT).is_ok()
    }
}

#[test]
fn flood_of_50000_a_second_misses_no_cycle() {
    let config = linked("kraft_like", LINK);
    let mut rig = Rig::started("far-flood", &config, |_, _| Process::start("true", &[]));
    let peer = Peer::connected(&rig.scratch.path("frhc/link.sock"), &config);
    rig.until(0.7);
    rig.pressing();
    for (conduct, cause) in [
        (Conduct::FloodsBehind, "of the round trips to the far side take"),
        (Conduct::FloodsFirst, "no new wrench from the commanded side"),
    ] {
        let onset = rig.now();
        peer.conducts(conduct);
        rig.until(onset + 1.0);
        let found = rig.off_for(onset);
        assert!(found.contains(cause), "{found}");
        peer.conducts(Conduct::Answers);
        rig.reset();
        let status = rig.status();
        let expected = (&"armed".into(), &0.into(), &0.into());
        let found = (&status["mode"], &status["overruns"], &status["missing_samples"]);
        assert_eq!(found, expected, "{status:#}");
        assert_eq!(status["link"]["far_side"], "following", "{status:#}");
        assert!(status["link"]["rejects"]["foreign"].as_u64() > Some(10_000), "{status:#}");
    }
    rig.run.terminate().succeeds();
    let flooded = peer.thread.join().unwrap();
    assert!(flooded > 20_000, "{flooded}");
    rig.sim.terminate().succeeds();
}

#[test]
fn hazard_31_wall_clock_set_by_an_hour_stops_no_link() {
    // The clock of a machine that others use is not set.
    if !fs::read_to_string("/proc/cpuinfo").unwrap().contains("User Mode Linux") {
        return;
    }
    let config = linked("kraft_like", LINK);
    let mut rig = Rig::started("far-clock", &config, simulated(KRAFT, PUMA));
    rig.pressing();
    let before = rig.now();
    for by in ["+1 hour", "-1 hour"] {
        Process::start("date", &["-s", by]).wait().succeeds();
        rig.syncs(500);
        let status = rig.status();
        assert_eq!(
            (&status["mode"], &status["overruns"], &status["missing_samples"]),
            (&"engaged".into(), &0.into(), &0.into()),
            "{by}: {status:#}"
        );
        let link = &status["link"];
        assert_eq!((&link["far_side"], &link["lost"]), (&"following".into(), &0.into()));
        assert_eq!(link["rejects"], serde_json::json!({}), "{by}: {status:#}");
        let passed = rig.now() - before;
        assert_eq!(passed > 3_600.0, by == "+1 hour", "{passed} s");
    }
    rig.run.terminate().succeeds();
    rig.robot.terminate().succeeds();
    rig.sim.terminate().succeeds();
}
