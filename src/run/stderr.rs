//! Messages on stderr that never block the program.
//!
//! A terminal stopped with Ctrl-S, or a pipe without a reader, blocks its writer. `run` therefore writes from a thread
//! with a bounded queue, and drops and counts messages that do not fit. Other commands write directly.

use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use crate::threads;
use units::wording::counted;

/// Capacity of the queue, in messages.
const QUEUE_CAPACITY: usize = 1_024;

/// Time allowed for the queue to empty at the end of the process.
const FLUSH_TIMEOUT: Duration = Duration::from_millis(200);

/// Queue of this process, once [`detach`] was called.
static QUEUE: OnceLock<StderrQueue> = OnceLock::new();

/// Starts the writer thread, after which no message blocks its sender.
///
/// # Errors
/// When the thread cannot be started. Messages are then written directly.
pub fn detach() -> io::Result<()> {
    let queue = StderrQueue::start(io::stderr())?;
    QUEUE.set(queue).ok();
    Ok(())
}

/// Returns the queue, if stderr is detached.
pub fn queue() -> Option<&'static StderrQueue> {
    QUEUE.get()
}

/// Waits up to 200 ms until the queued messages are written.
pub fn flush() {
    if let Some(queue) = QUEUE.get() {
        queue.flush(FLUSH_TIMEOUT);
    }
}

/// Sender of messages; never blocks.
#[derive(Clone, Debug)]
pub struct StderrQueue {
    queue: SyncSender<Message>,
    lost: Arc<AtomicU64>,
}

#[derive(Debug)]
enum Message {
    /// One or more complete lines.
    Text(Vec<u8>),
    /// Request for a reply once all earlier messages are written.
    Flush(SyncSender<()>),
}

impl StderrQueue {
    /// Starts a thread that writes to `to` until the process ends.
    fn start(to: impl Write + Send + 'static) -> io::Result<Self> {
        let (queue, messages) = sync_channel(QUEUE_CAPACITY);
        let lost = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&lost);
        let writer = threads::builder("stderr");
        writer.spawn(move || write(to, &messages, &counted))?;
        Ok(Self { queue, lost })
    }

    /// Queues a message; drops and counts it if the queue is full.
    pub(super) fn send(&self, text: &[u8]) {
        if self.queue.try_send(Message::Text(text.to_vec())).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Waits until the queued messages are written; returns false after `limit`.
    fn flush(&self, limit: Duration) -> bool {
        let (done, written) = sync_channel(1);
        self.queue.try_send(Message::Flush(done)).is_ok() && written.recv_timeout(limit).is_ok()
    }
}

fn write(mut to: impl Write, messages: &Receiver<Message>, lost: &AtomicU64) {
    for message in messages {
        match message {
            // A closed stderr (`2>&1 | head`) is not a failure of the command.
            Message::Text(text) => to.write_all(&text).unwrap_or_default(),
            Message::Flush(done) => done.try_send(()).unwrap_or_default(),
        }
        match lost.swap(0, Ordering::Relaxed) {
            0 => {}
            lost => {
                writeln!(to, "frhc: {} lost: stderr was blocked", counted(lost, "message"))
                    .unwrap_or_default();
            }
        }
    }
}

/// Writer for tracing, which writes every event with one call.
impl Write for &StderrQueue {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.send(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// Stopped terminal, whose writes block until the other end of `go` is dropped.
    struct StoppedTerminal {
        go: Receiver<()>,
        shown: Arc<Mutex<Vec<u8>>>,
    }

    impl Write for StoppedTerminal {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.go.recv().ok();
            self.shown.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn hazard_32_stopped_terminal_blocks_no_sender_and_is_counted() {
        let (release, go) = sync_channel(1);
        let shown = Arc::new(Mutex::new(Vec::new()));
        let queue = StderrQueue::start(StoppedTerminal { go, shown: Arc::clone(&shown) }).unwrap();
        let sent = QUEUE_CAPACITY + 100;
        for number in 0..sent {
            queue.send(format!("line {number}\n").as_bytes());
        }
        assert!(!queue.flush(Duration::ZERO), "nothing is written, and no sender blocks");
        drop(release);
        // The queue is full until the thread goes on; until then a flush request does not fit.
        while !queue.flush(Duration::from_secs(60)) {
            std::thread::yield_now();
        }
        let shown = String::from_utf8(shown.lock().unwrap().clone()).unwrap();
        let written = shown.lines().filter(|line| line.starts_with("line")).count();
        let report = shown.lines().find(|line| line.contains("messages lost")).unwrap();
        assert!(written < sent && shown.starts_with("line 0\nfrhc: "), "{report}");
        let lost: usize = report.split(' ').nth(1).unwrap().parse().unwrap();
        assert_eq!(written + lost, sent);
    }

    #[test]
    fn hazard_32_closed_stderr_is_no_failure() {
        /// Pipe whose other end is closed.
        struct Broken;
        impl Write for Broken {
            fn write(&mut self, _bytes: &[u8]) -> io::Result<usize> {
                Err(io::Error::from(io::ErrorKind::BrokenPipe))
            }

            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let queue = StderrQueue::start(Broken).unwrap();
        queue.send(b"line\n");
        assert!(queue.flush(Duration::from_secs(60)));
    }
}
