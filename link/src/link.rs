//! Threads of one end of the link.
//!
//! ```text
//!  outwards   reader: local socket ── newest of each topic ──► publisher: flow rule, put      a put may wait, and no thread for it
//!  inwards    zenoh's threads: ──────────────────────────────► local socket                   never waits; what has no room is lost
//! ```

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use contract::Reject;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::sample::Locality;
use zenoh::{Session, Wait};

use crate::certificate::Files;
use crate::clock;
use crate::failure::Failure;
use crate::flow::Flow;
use crate::local::{Local, Outlet};
use crate::mailbox::{Mailbox, Outgoing};
use crate::network;
use crate::peers;
use crate::priority;
use crate::role::{Role, Topic};
use crate::settings::Settings;

/// Maximum wait for a message, after which connections are retried and a stop is noticed.
const TURN: Duration = Duration::from_millis(20);

/// Maximum time for which an end continues after its stop signal while its local socket is connected.
const LINGER: Duration = Duration::from_millis(200);

/// Time for the session to close at the end of the process.
const CLOSING: Duration = Duration::from_millis(500);

/// State shared by the threads of an end.
#[derive(Debug)]
struct EndState {
    role: Role,
    arm: u16,
    mailbox: Mailbox,
    flow: Mutex<Flow>,
    is_ending: AtomicBool,
    counts: Counts,
}

/// Numbers of messages by their outcome.
#[derive(Debug, Default)]
struct Counts {
    published: AtomicU64,
    passed_on: AtomicU64,
    /// Replaced by a newer message, or omitted by the flow rule.
    left_out: AtomicU64,
    /// Dropped at the local socket, without connection or room.
    dropped: AtomicU64,
    /// Not a message of this contract, arm and direction.
    rejected: AtomicU64,
}

impl Counts {
    fn count(counter: &AtomicU64) -> u64 {
        counter.fetch_add(1, Ordering::Relaxed)
    }

    fn log(&self) {
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        tracing::info!(
            published = of(&self.published),
            left_out = of(&self.left_out),
            passed_on = of(&self.passed_on),
            dropped = of(&self.dropped),
            rejected = of(&self.rejected),
            "ends"
        );
    }
}

/// Runs an end until SIGTERM or SIGINT.
///
/// # Errors
/// Returns an error if settings or certificates are invalid, or a socket cannot be opened.
pub(crate) fn run(role: Role, config: &Path) -> Result<(), Failure> {
    let settings = Settings::load(role, config)?;
    let files = Files::in_folder(&settings.keys, role.name());
    files.check(role, settings.arm)?;
    let failed =
        |error: std::io::Error| Failure::system(format!("cannot receive signals: {error}"));
    let mut signals = Signals::new([SIGTERM, SIGINT]).map_err(failed)?;
    let local = Local::open(role, &settings.socket)?;
    // Before zenoh opens: its threads have the priority of the one that starts them.
    priority::ask();
    let session = network::open(role, &settings, &files)?;
    announce(role, &settings);
    let shared = Arc::new(EndState {
        role,
        arm: settings.arm,
        mailbox: Mailbox::default(),
        flow: Mutex::new(Flow::new(settings.in_flight)),
        is_ending: AtomicBool::new(false),
        counts: Counts::default(),
    });
    let outlet = local.outlet();
    let watch = peers::watch(&session, role, settings.arm)?;
    let subscribers = subscribe(&session, &shared, &local)?;
    let publishers = publishers(&session, role, settings.arm)?;
    let threads = [
        spawn("reader", &shared, move |shared| read(local, shared))?,
        spawn("publisher", &shared, move |shared| publish(&publishers, shared))?,
    ];
    signals.forever().next();
    linger(&outlet);
    shared.is_ending.store(true, Ordering::Relaxed);
    for thread in threads {
        // A thread that panicked has ended, too.
        drop(thread.join());
    }
    drop((watch, subscribers));
    close(session);
    shared.counts.log();
    Ok(())
}

/// Waits until the process at the local socket has disconnected, so that its last message is carried after a common stop
/// signal.
fn linger(outlet: &Outlet) {
    let until = clock::now() + LINGER;
    while outlet.is_connected() && clock::now() < until {
        thread::park_timeout(Duration::from_millis(5));
    }
}

fn announce(role: Role, settings: &Settings) {
    let Settings { arm, listen, connect, .. } = settings;
    let name = role.name();
    if !listen.is_empty() {
        tracing::info!("{name} end of arm {arm} listens at {}", listen.join(", "));
    }
    if !connect.is_empty() {
        tracing::info!("{name} end of arm {arm} connects to {}", connect.join(", "));
    }
}

fn spawn(
    name: &str,
    shared: &Arc<EndState>,
    run: impl FnOnce(&EndState) + Send + 'static,
) -> Result<thread::JoinHandle<()>, Failure> {
    let shared = Arc::clone(shared);
    let builder = thread::Builder::new().name(format!("link-{name}"));
    let failed = |error| Failure::system(format!("cannot start thread {name}: {error}"));
    builder.spawn(move || run(&shared)).map_err(failed)
}

/// Reads the local socket until the end.
fn read(mut local: Local, shared: &EndState) {
    while !shared.is_ending.load(Ordering::Relaxed) {
        local.wait(TURN);
        local.receive(clock::now(), |bytes| shared.offer(bytes));
    }
}

/// Publishes the messages that were read, until the end.
fn publish(publishers: &[(Topic, Publisher<'static>)], shared: &EndState) {
    while !shared.is_ending.load(Ordering::Relaxed) {
        for message in shared.mailbox.take(TURN) {
            if !shared.flow().admits(clock::now(), message.own) {
                Counts::count(&shared.counts.left_out);
                continue;
            }
            let publisher = publishers.iter().find(|(topic, _)| *topic == message.topic);
            let put = publisher.map(|(_, publisher)| publisher.put(message.bytes).wait());
            match put.transpose() {
                Ok(_) => _ = Counts::count(&shared.counts.published),
                Err(error) => tracing::warn!("not published: {error}"),
            }
        }
    }
}

impl EndState {
    fn flow(&self) -> MutexGuard<'_, Flow> {
        self.flow.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a message of the local socket.
    fn offer(&self, bytes: &[u8]) {
        match self.role.read(bytes, self.arm) {
            Ok((topic, head)) => {
                let message = Outgoing { topic, own: head.own, bytes: bytes.to_vec() };
                if self.mailbox.offer(message) {
                    Counts::count(&self.counts.left_out);
                }
            }
            Err(reject) => self.reject(reject, "local socket"),
        }
    }

    /// Logs the first invalid message, and counts all.
    fn reject(&self, reject: Reject, whose: &str) {
        if Counts::count(&self.counts.rejected) == 0 {
            let arm = self.arm;
            tracing::warn!(
                "{whose}: not a message of the contract for arm {arm} ({reject}): dropped, as are others like it"
            );
        }
    }
}

/// Subscribes to the topics of the other role, and passes their messages to the local socket.
fn subscribe(
    session: &Session,
    shared: &Arc<EndState>,
    local: &Local,
) -> Result<Vec<Subscriber<()>>, Failure> {
    let other = shared.role.other();
    let of = |topic: &Topic| {
        let (shared, outlet) = (Arc::clone(shared), local.outlet());
        let subscriber = session.declare_subscriber(topic.key(shared.arm));
        // A session's own messages would pass the access control.
        let subscriber = subscriber.allowed_origin(Locality::Remote).callback(move |sample| {
            let bytes = sample.payload().to_bytes();
            match other.read(&bytes, shared.arm) {
                Ok((_, head)) => {
                    shared.flow().on_echo(head.echo);
                    let counts = &shared.counts;
                    let is_sent = outlet.send(&bytes);
                    Counts::count(if is_sent { &counts.passed_on } else { &counts.dropped });
                }
                Err(reject) => shared.reject(reject, "network"),
            }
        });
        subscriber.wait().map_err(|error| Failure::system(format!("zenoh: {error}")))
    };
    other.topics().iter().map(of).collect()
}

fn publishers(
    session: &Session,
    role: Role,
    arm: u16,
) -> Result<Vec<(Topic, Publisher<'static>)>, Failure> {
    let of = |topic: &Topic| {
        let publisher = session.declare_publisher(topic.key(arm)).express(true);
        let publisher = publisher.priority(Priority::RealTime);
        let publisher = publisher.congestion_control(CongestionControl::Drop);
        let publisher = publisher.reliability(Reliability::BestEffort).wait();
        let failed = |error| Failure::system(format!("zenoh: {error}"));
        publisher.map(|publisher| (*topic, publisher)).map_err(failed)
    };
    role.topics().iter().map(of).collect()
}

/// Closes the session, so that the other end detects it at once; gives up after half a second.
fn close(session: Session) {
    let (closed, is_closed) = channel();
    let closing = thread::Builder::new().name("link-close".to_owned()).spawn(move || {
        if let Err(error) = session.close().wait() {
            tracing::debug!("close: {error}");
        }
        closed.send(()).unwrap_or_default();
    });
    if closing.is_ok() && is_closed.recv_timeout(CLOSING).is_err() {
        tracing::debug!("the session did not close in time");
    }
}
