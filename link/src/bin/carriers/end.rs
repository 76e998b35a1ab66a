//! One end of the link: a session of zenoh, a role of the contract, and the record of all messages.
#![expect(
    clippy::disallowed_methods,
    reason = "clock and sleep of a measuring program: there is no bus here"
)]

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::sleep;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use units::time::Instant;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::{Session, Wait};

use crate::Outcome;
use crate::carrier;
use crate::figures::Record;
use crate::options::Options;
use crate::role::Role;

/// Maximum silence of an end whose messages are not echoed.
const KEEP_SENDING: Duration = Duration::from_millis(20);

/// Silence of the other end after which the subscriber is undeclared, to be declared again.
const UNDECLARE: Duration = Duration::from_millis(500);

/// Silence after which it is declared again. If both were sent together, one could overtake the other and be lost.
const DECLARE_AGAIN: Duration = Duration::from_millis(600);

/// Bytes of the send time before each message.
const STAMP: usize = size_of::<u64>();

const COMMAND_KEY: &str = "frhc/0/command";
const FEEDBACK_KEY: &str = "frhc/0/feedback";

/// Packet with its time of reception.
type Packet = (Instant, Vec<u8>);

/// One end of the link.
#[derive(Debug)]
pub(crate) struct End {
    options: Options,
    role: Role,
    pub(crate) record: Record,
    /// Newest own message that the other end echoed.
    echoed: u64,
    due: Instant,
    received_at: Instant,
    packets: Receiver<Packet>,
    sender: Sender<Packet>,
    subscriber: Option<Subscriber<()>>,
    publisher: Publisher<'static>,
    session: Session,
}

/// Returns the time on the clock that both processes read.
pub(crate) fn now() -> Instant {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Instant::from_micros(u64::try_from(since.as_micros()).unwrap_or_default())
}

impl End {
    /// Opens the session of one end.
    pub(crate) fn open(options: &Options, role: Role) -> Outcome<Self> {
        let session = carrier::open(options)?;
        let key = if options.is_far { FEEDBACK_KEY } else { COMMAND_KEY };
        let publisher = session.declare_publisher(key);
        let publisher = publisher.congestion_control(CongestionControl::Drop);
        let publisher = publisher.priority(Priority::RealTime).express(true);
        let publisher = publisher.reliability(Reliability::BestEffort).wait()?;
        let (sender, packets) = channel();
        let mut end = Self {
            options: options.clone(),
            role,
            record: Record::default(),
            echoed: 0,
            due: now(),
            received_at: now(),
            packets,
            sender,
            subscriber: None,
            publisher,
            session,
        };
        end.subscribe()?;
        Ok(end)
    }

    fn subscribe(&mut self) -> Outcome<()> {
        let sender = self.sender.clone();
        let key = if self.options.is_far { COMMAND_KEY } else { FEEDBACK_KEY };
        let subscriber = self.session.declare_subscriber(key).callback(move |sample| {
            // The end that reads may have ended first.
            drop(sender.send((now(), sample.payload().to_bytes().into_owned())));
        });
        self.subscriber = Some(subscriber.wait()?);
        Ok(())
    }

    /// Repeats a declaration that may have been lost.
    fn declare_again(&mut self, at: Instant) -> Outcome<()> {
        let silence = at.since(self.received_at);
        if silence > UNDECLARE
            && let Some(subscriber) = self.subscriber.take()
        {
            subscriber.undeclare().wait()?;
        }
        if silence > DECLARE_AGAIN {
            self.subscribe()?;
            self.received_at = at;
            self.record.declared_again.push(at.as_micros());
        }
        Ok(())
    }

    /// Runs one cycle: takes what was received, and sends if `sends`. Returns the age of the newest sample.
    pub(crate) fn cycle(&mut self, sends: bool) -> Outcome<Option<Duration>> {
        self.wait();
        while let Ok((at, packet)) = self.packets.try_recv() {
            self.on_packet(at, &packet);
        }
        let at = now();
        let age = self.role.on_cycle(at).map(|newest| at.since(newest));
        self.record.cycles.extend(age.map(|age| (at.as_micros(), micros(age))));
        if self.role.is_held() {
            self.record.held_at.get_or_insert(at.as_micros());
        }
        if self.options.redeclares {
            self.declare_again(at)?;
        }
        if sends && self.may_send(at) {
            self.send(at)?;
        }
        Ok(age)
    }

    /// Sleeps until the cycle is due. Cycles that have passed meanwhile are skipped.
    fn wait(&mut self) {
        let (period, at) = (self.options.period(), now());
        while self.due <= at {
            self.due = self.due + period;
        }
        sleep(self.due.since(at));
    }

    fn on_packet(&mut self, at: Instant, packet: &[u8]) {
        self.received_at = at;
        let Some((stamp, message)) = packet.split_first_chunk::<STAMP>() else { return };
        let sent_at = Instant::from_micros(u64::from_le_bytes(*stamp));
        self.record.received.push((sent_at.as_micros(), micros(at.since(sent_at))));
        self.on_message(at, message);
    }

    fn on_message(&mut self, at: Instant, message: &[u8]) {
        let echoed = self.role.echo(message).map_or(0, |echo| echo.sequence);
        let place = usize::try_from(echoed).ok().and_then(|echoed| echoed.checked_sub(1));
        if let Some(sent) = place.and_then(|place| self.record.sent.get(place)) {
            self.record.round_trips.push((at.as_micros(), at.as_micros().saturating_sub(*sent)));
        }
        self.echoed = self.echoed.max(echoed);
        self.role.on_message(at, message);
    }

    /// Flow rule: a limited number of messages that are not echoed, but always one every 20 ms.
    fn may_send(&self, at: Instant) -> bool {
        let Some(newest) = self.record.sent.last() else { return true };
        let sent = u64::try_from(self.record.sent.len()).unwrap_or_default();
        let is_free = sent.saturating_sub(self.echoed) < self.options.window;
        let is_due = at.since(Instant::from_micros(*newest)) >= KEEP_SENDING;
        self.options.window == 0 || is_free || is_due
    }

    fn send(&mut self, at: Instant) -> Outcome<()> {
        let message = self.role.message(at);
        self.record.sent.push(at.as_micros());
        self.put(&message)
    }

    fn put(&mut self, message: &[u8]) -> Outcome<()> {
        let at = now();
        let stamp = at.as_micros().to_le_bytes();
        self.publisher.put([stamp.as_slice(), message].concat()).wait()?;
        self.record.longest_put = self.record.longest_put.max(micros(now().since(at)));
        Ok(())
    }

    /// Arms the node.
    pub(crate) fn arm(&mut self) {
        self.role.arm();
    }
}

/// Returns a duration in microseconds, rounded down.
fn micros(span: Duration) -> u64 {
    u64::try_from(span.as_micros()).unwrap_or(u64::MAX)
}
