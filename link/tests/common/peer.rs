//! Session of zenoh without access control, which can publish and receive anything.

use std::sync::Mutex;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use contract::{FarEnd, Measurements, Motion, NodeEnd, Order};
use units::time::Instant;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Locality;
use zenoh::{Config, Session, Wait};

use super::program::Local;
use super::{PeerKeys, RECEIVE_TIMEOUT, free_port};

/// Peer of an end.
pub(crate) struct Peer {
    session: Session,
    pub(crate) port: u16,
    /// Messages received.
    received: Receiver<Vec<u8>>,
    _subscribers: [Subscriber<()>; 2],
    node: Mutex<NodeEnd>,
    far: Mutex<FarEnd>,
}

impl Peer {
    /// Connects to an end.
    pub(crate) fn connect(port: u16, keys: &PeerKeys) -> Self {
        Self::open(port, "connect", keys)
    }

    /// Listens at a free port.
    pub(crate) fn listen(keys: &PeerKeys) -> Self {
        Self::open(free_port(), "listen", keys)
    }

    fn open(port: u16, uses: &str, keys: &PeerKeys) -> Self {
        let mut config = Config::default();
        let mut set = |key: &str, value: &str| config.insert_json5(key, value).unwrap();
        set("mode", "\"peer\"");
        set("scouting/multicast/enabled", "false");
        set("scouting/gossip/enabled", "false");
        set("open/return_conditions/connect_scouted", "false");
        set("listen/endpoints", "[]");
        set(&format!("{uses}/endpoints"), &format!("[\"quic/127.0.0.1:{port}?mixed_rel=1\"]"));
        set("connect/exit_on_failure", "false");
        set("connect/timeout_ms", "-1");
        set("connect/retry", "{ period_init_ms: 100, period_max_ms: 500 }");
        set("transport/unicast/open_timeout", "1000");
        set("transport/link/tls/verify_name_on_connect", "false");
        let authority = keys.authority.display();
        set("transport/link/tls/root_ca_certificate", &format!("\"{authority}\""));
        if let Some(own) = &keys.own {
            set("transport/link/tls/enable_mtls", "true");
            let own = own.display();
            set(&format!("transport/link/tls/{uses}_certificate"), &format!("\"{own}/peer.pem\""));
            set(&format!("transport/link/tls/{uses}_private_key"), &format!("\"{own}/peer.key\""));
        }
        let session = zenoh::open(config).wait().unwrap();
        let (sender, received) = channel();
        let subscribers = ["frhc/1/command", "frhc/1/feedback"].map(|key| {
            let sender = sender.clone();
            let subscriber = session.declare_subscriber(key).callback(move |sample| {
                sender.send(sample.payload().to_bytes().into_owned()).unwrap_or_default();
            });
            subscriber.allowed_origin(Locality::Remote).wait().unwrap()
        });
        let random = u64::from(port) << 16 | u64::from(std::process::id());
        Self {
            session,
            port,
            received,
            _subscribers: subscribers,
            node: Mutex::new(NodeEnd::new(1, random)),
            far: Mutex::new(FarEnd::new(1, random, Duration::from_millis(100))),
        }
    }

    /// Waits until the end has subscribed to a key.
    pub(crate) fn wait_for_subscriber(&self, key: &'static str) {
        let publisher = self.session.declare_publisher(key);
        let publisher = publisher.allowed_destination(Locality::Remote).wait().unwrap();
        let listener = publisher.matching_listener().wait().unwrap();
        while !publisher.matching_status().wait().unwrap().matching() {
            listener.recv().unwrap();
        }
    }

    /// Publishes valid messages on a key.
    pub(crate) fn publish(&self, key: &str, count: usize) {
        for _ in 0..count {
            let bytes = if key.ends_with("command") { self.command() } else { self.feedback() };
            self.session.put(key, bytes).express(true).wait().unwrap();
        }
    }

    fn command(&self) -> Vec<u8> {
        let order = Order { motion: Motion::Hold, is_engaged: false, gripper: None };
        self.node.lock().unwrap().command(Instant::from_micros(1), &order).to_vec()
    }

    fn feedback(&self) -> Vec<u8> {
        let measured = Measurements::default();
        self.far.lock().unwrap().feedback(Instant::from_micros(1), &measured).to_vec()
    }

    /// Returns the number of messages received so far.
    pub(crate) fn received(&self) -> usize {
        self.received.try_iter().count()
    }

    /// Sends a feedback at the local socket of the far end; returns whether it is received.
    pub(crate) fn takes_feedback_of(&self, robot: &mut Local) -> bool {
        self.takes(&self.feedback(), robot)
    }

    /// Sends a command at the local socket of the near end; returns whether it is received.
    pub(crate) fn takes_command_of(&self, node: &mut Local) -> bool {
        self.takes(&self.command(), node)
    }

    /// Sends a command and a feedback at the local socket of an end, which may be lost.
    pub(crate) fn sends_first(&self, local: &mut Local) {
        local.send(&self.command());
        local.send(&self.feedback());
    }

    fn takes(&self, bytes: &[u8], local: &mut Local) -> bool {
        local.send(bytes);
        let mut later = std::iter::from_fn(|| self.received.recv_timeout(RECEIVE_TIMEOUT).ok());
        later.any(|received| received == bytes)
    }

    /// Publishes a command; returns whether it reaches the robot.
    pub(crate) fn command_reaches(&self, robot: &mut Local) -> bool {
        self.reaches("frhc/1/command", &self.command(), robot)
    }

    /// Publishes a feedback; returns whether it reaches the node.
    pub(crate) fn feedback_reaches(&self, node: &mut Local) -> bool {
        self.reaches("frhc/1/feedback", &self.feedback(), node)
    }

    fn reaches(&self, key: &str, bytes: &[u8], local: &mut Local) -> bool {
        self.session.put(key, bytes).express(true).wait().unwrap();
        local.receives(bytes)
    }
}
