//! Socket of the telemetry, `telemetry.sock`: its path, and the thread that sends the lines.
//!
//! ```text
//!  cycle ─ ring ─► recorder ─ Publisher: lines, while there are readers ─ bounded queue ─► frhc-feed ─► readers
//! ```
//!
//! The recorder's thread makes the lines, and another thread sends them, so that no reader delays a recording.

use std::io;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::console::default_socket;
use crate::threads;
use canopen::frame::Telegram;
use config::Config;
use node::record::Record;
use telemetry::feed::{Feed, FeedLine, Scarce};
use units::time::Instant;
use unix_socket::{Audience, SocketFile};

/// Group whose members may read the telemetry, if the system has this group.
const GROUP: &str = "frhc-view";

/// Name of the socket.
pub const NAME: &str = "telemetry.sock";

/// Capacity of the queue to the thread, in lines. Further lines are dropped.
const QUEUE: usize = 64;

/// Interval at which new readers are accepted while no lines are sent.
const ACCEPT_EVERY: Duration = Duration::from_millis(50);

/// Returns the path of the telemetry socket for a control socket, `None` for the default one. It is in a separate folder,
/// whose group may differ.
pub fn beside(socket: Option<&Path>) -> PathBuf {
    match socket {
        Some(socket) => socket.with_file_name("view").join(NAME),
        None => of_default(&default_socket()),
    }
}

/// Returns the path of a configuration: the configured one, else that for its control socket.
pub(crate) fn of_config(config: &Config) -> PathBuf {
    config.telemetry_socket.clone().unwrap_or_else(|| beside(config.socket.as_deref()))
}

/// Returns the default paths of a viewer: for the user's own node, then for the service.
pub fn default_sockets() -> Vec<PathBuf> {
    let mut places: Vec<_> =
        crate::console::default_sockets().iter().map(|socket| of_default(socket)).collect();
    places.dedup();
    places
}

/// `/run/frhc/node.sock` has its telemetry in `/run/frhc-view`.
fn of_default(socket: &Path) -> PathBuf {
    let folder = socket.parent().unwrap_or(Path::new("/run/frhc"));
    folder.with_file_name(GROUP).join(NAME)
}

/// Publisher of telemetry: converts entries of the cycle thread to lines, and queues them for the thread that sends them.
/// Ends that thread when dropped.
#[derive(Debug)]
pub struct Publisher {
    feed: Feed,
    lines: Option<SyncSender<FeedLine>>,
    is_read: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Publisher {
    /// Listens at `path`, and starts the thread `frhc-feed`.
    ///
    /// # Errors
    /// As [`unix_socket::listen`], and when the thread cannot be started.
    pub fn start(path: &Path, feed: Feed) -> io::Result<Self> {
        let bind = |path: &Path| UnixListener::bind(path);
        let (listener, file) = unix_socket::listen(path.to_path_buf(), Some(GROUP), bind)?;
        let audience = Audience::new(listener)?;
        let (lines, received) = sync_channel(QUEUE);
        let is_read = Arc::new(AtomicBool::new(false));
        let description = feed.description().to_owned();
        let sender = Sender {
            audience,
            description,
            mode: feed.mode(),
            is_read: Arc::clone(&is_read),
            _file: file,
        };
        let thread = threads::builder("feed").spawn(move || sender.run(&received))?;
        Ok(Self { feed, lines: Some(lines), is_read, thread: Some(thread) })
    }

    /// Takes a frame that was sent or received `at` this time.
    pub fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.feed.set_read(self.is_read.load(Ordering::Relaxed));
        let line = self.feed.on_frame(at, telegram);
        self.send(line);
    }

    /// Takes the record of a cycle; `scarce` is called for slowly changing values, every half second.
    pub fn on_record(&mut self, record: &Record, scarce: impl FnOnce() -> Scarce) {
        self.feed.set_read(self.is_read.load(Ordering::Relaxed));
        for line in self.feed.on_record(record, scarce) {
            self.send(line);
        }
    }

    /// Queues a line for the thread; drops it if the queue is full.
    fn send(&self, line: Option<FeedLine>) {
        if let (Some(line), Some(lines)) = (line, &self.lines) {
            lines.try_send(line).ok();
        }
    }
}

impl Drop for Publisher {
    fn drop(&mut self) {
        self.lines = None;
        if let Some(thread) = self.thread.take() {
            thread.join().ok();
        }
    }
}

/// State of the thread that sends the lines.
#[derive(Debug)]
struct Sender {
    audience: Audience,
    description: String,
    /// Newest line about the mode.
    mode: String,
    is_read: Arc<AtomicBool>,
    _file: SocketFile,
}

impl Sender {
    /// Sends lines until their source ends.
    fn run(mut self, lines: &Receiver<FeedLine>) {
        loop {
            match lines.recv_timeout(ACCEPT_EVERY) {
                Ok(FeedLine::Mode(line)) => {
                    self.audience.send(line.as_bytes());
                    self.mode = line;
                }
                Ok(FeedLine::Snapshot(line)) => self.audience.send(line.as_bytes()),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            self.audience.admit(&[self.description.as_bytes(), self.mode.as_bytes()]);
            self.is_read.store(!self.audience.is_empty(), Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader, Lines};
    use std::os::unix::net::UnixStream;

    use super::*;
    use crate::scratch;
    use canopen::frame::{Channel, Frame};
    use config::Config;
    use telemetry::feed::Source;

    fn feed() -> Feed {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        Feed::new(&config, Source::Run, None)
    }

    fn reader(path: &Path) -> Lines<BufReader<UnixStream>> {
        BufReader::new(UnixStream::connect(path).unwrap()).lines()
    }

    fn kind(lines: &mut Lines<BufReader<UnixStream>>) -> String {
        let line: serde_json::Value =
            serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
        line["kind"].as_str().unwrap().to_owned()
    }

    #[test]
    fn reader_gets_description_mode_and_then_snapshots() {
        let path = scratch::path("telemetry").join("view/telemetry.sock");
        let mut publisher = Publisher::start(&path, feed()).unwrap();
        let record = scratch::any_record();
        // Without a reader nothing waits.
        (0..1_000).for_each(|_| publisher.on_record(&record, Scarce::default));
        let mut lines = reader(&path);
        assert_eq!([kind(&mut lines), kind(&mut lines)], ["description", "mode"]);
        let next = Record { cycle: 20, ..record };
        while !publisher.is_read.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
        publisher.on_record(&next, Scarce::default);
        assert_eq!([kind(&mut lines), kind(&mut lines)], ["mode", "snapshot"]);
        drop(publisher);
        assert!(lines.next().is_none(), "the thread has ended, and its readers with it");
        assert!(!path.exists());
    }

    #[test]
    fn reader_of_a_boot_gets_its_mode_again_with_the_frames() {
        let path = scratch::path("boot").join("telemetry.sock");
        let mut publisher = Publisher::start(&path, feed()).unwrap();
        let mut lines = reader(&path);
        assert_eq!([kind(&mut lines), kind(&mut lines)], ["description", "mode"]);
        while !publisher.is_read.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
        let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x701, [0x7F]) };
        for millis in [499, 500, 999, 1_000] {
            publisher.on_frame(Instant::from_micros(1_000 * millis), &telegram);
        }
        assert_eq!([kind(&mut lines), kind(&mut lines)], ["mode", "mode"]);
        drop(publisher);
        assert!(lines.next().is_none());
    }

    #[test]
    fn telemetry_is_in_a_folder_of_its_own() {
        let of = |socket| of_default(Path::new(socket));
        assert_eq!(of("/run/frhc/node.sock"), Path::new("/run/frhc-view/telemetry.sock"));
        assert_eq!(
            of("/run/user/7/frhc/node.sock"),
            Path::new("/run/user/7/frhc-view/telemetry.sock")
        );
        let given = beside(Some(Path::new("/tmp/a/node.sock")));
        assert_eq!(given, Path::new("/tmp/a/view/telemetry.sock"));
    }

    #[test]
    fn hazard_37_taken_path_is_refused_and_kept() {
        let path = scratch::path("taken").join("telemetry.sock");
        let publisher = Publisher::start(&path, feed()).unwrap();
        let refused = Publisher::start(&path, feed()).unwrap_err().to_string();
        assert!(refused.contains("another process listens"), "{refused}");
        assert_eq!(kind(&mut reader(&path)), "description");
        drop(publisher);
    }
}
