//! Lines for people, for a program that must not wait for whoever reads them.
//!
//! A terminal that was stopped with Ctrl-S or a pipe that nobody empties holds up whoever writes to it. So a
//! thread of its own writes, from a bounded queue; what finds no room is lost and counted. Commands that
//! hold up nobody write directly.

use std::io;
use std::io::Write;
use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::sync::mpsc::SyncSender;
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::Duration;

/// Lines that may wait to be read.
const QUEUE: usize = 1_024;

/// How long what is left may take at the end.
const FLUSH_WITHIN: Duration = Duration::from_millis(200);

/// The process's own, once there is one.
static LINES: OnceLock<Lines> = OnceLock::new();

/// From now on nobody waits for stderr.
pub fn detach() {
    LINES.get_or_init(|| Lines::onto(io::stderr()));
}

/// The end of the queue, if stderr has been detached.
pub fn lines() -> Option<&'static Lines> {
    LINES.get()
}

/// Waits until what was said is written, but not for long.
pub fn flush() {
    if let Some(lines) = LINES.get() {
        lines.flush(FLUSH_WITHIN);
    }
}

/// The end of the queue that never waits.
#[derive(Clone, Debug)]
pub struct Lines {
    queue: SyncSender<Message>,
    lost: Arc<AtomicU64>,
}

#[derive(Debug)]
enum Message {
    /// Whole lines.
    Text(Vec<u8>),
    /// Somebody waits until everything before it is written.
    Flush(SyncSender<()>),
}

impl Lines {
    /// Written to `to`, by a thread that ends with the process.
    fn onto(to: impl Write + Send + 'static) -> Self {
        let (queue, messages) = sync_channel(QUEUE);
        let lost = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&lost);
        let writer = thread::Builder::new().name("frhc-stderr".to_owned());
        // Without the thread nobody takes messages, and all of them are lost: still nobody waits.
        writer.spawn(move || write(to, &messages, &counted)).ok();
        Self { queue, lost }
    }

    /// Says it, if there is room.
    pub(super) fn say(&self, text: &[u8]) {
        if self.queue.try_send(Message::Text(text.to_vec())).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Waits until all that was said is written; whether it is, `within` that time.
    fn flush(&self, within: Duration) -> bool {
        let (done, written) = sync_channel(1);
        self.queue.try_send(Message::Flush(done)).is_ok() && written.recv_timeout(within).is_ok()
    }
}

fn write(mut to: impl Write, messages: &Receiver<Message>, lost: &AtomicU64) {
    for message in messages {
        match message {
            // A reader that hung up is no failure of ours.
            Message::Text(text) => to.write_all(&text).unwrap_or_default(),
            Message::Flush(done) => done.try_send(()).unwrap_or_default(),
        }
        match lost.swap(0, Ordering::Relaxed) {
            0 => {}
            lost => writeln!(to, "frhc: {lost} lines lost: nobody read them").unwrap_or_default(),
        }
    }
}

/// For tracing, which writes every event in one piece.
impl Write for &Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.say(bytes);
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

    /// A terminal that was stopped: it takes nothing until somebody lets it go.
    struct Stopped {
        go: Receiver<()>,
        shown: Arc<Mutex<Vec<u8>>>,
    }

    impl Write for Stopped {
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
    fn hazard_32_a_stopped_terminal_holds_up_nobody_and_what_it_misses_is_counted() {
        let (release, go) = sync_channel(1);
        let shown = Arc::new(Mutex::new(Vec::new()));
        let lines = Lines::onto(Stopped { go, shown: Arc::clone(&shown) });
        let said = QUEUE + 100;
        for number in 0..said {
            lines.say(format!("line {number}\n").as_bytes());
        }
        assert!(!lines.flush(Duration::ZERO), "nothing is written, and nobody waits for it");
        drop(release);
        // A place becomes free as soon as the thread goes on; until then there is none to ask in.
        while !lines.flush(Duration::from_secs(60)) {
            thread::yield_now();
        }
        let shown = String::from_utf8(shown.lock().unwrap().clone()).unwrap();
        let written = shown.lines().filter(|line| line.starts_with("line")).count();
        let owned_up = shown.lines().find(|line| line.contains("lines lost: nobody")).unwrap();
        assert!(written < said && shown.starts_with("line 0\nfrhc: "), "{owned_up}");
        let lost: usize = owned_up.split(' ').nth(1).unwrap().parse().unwrap();
        assert_eq!(written + lost, said);
    }

    #[test]
    fn hazard_32_a_reader_that_hung_up_is_no_failure() {
        /// A pipe whose other end is closed.
        struct Broken;
        impl Write for Broken {
            fn write(&mut self, _bytes: &[u8]) -> io::Result<usize> {
                Err(io::Error::from(io::ErrorKind::BrokenPipe))
            }

            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let lines = Lines::onto(Broken);
        lines.say(b"line\n");
        assert!(lines.flush(Duration::from_secs(60)));
    }
}
