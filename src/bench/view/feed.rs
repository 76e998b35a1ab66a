//! Reader of a node's telemetry: connects, passes on lines, and connects again when the node has ended.

use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde::Deserialize;

/// Version of the telemetry that this program reads.
pub const VERSION: u64 = 1;

/// Maximum length of a line, in bytes: twice what a node sends.
const MAX_LINE: u64 = 65_536;

/// Time until a connection is tried again.
const RETRY_AFTER: Duration = Duration::from_millis(250);

/// Interval of the check whether the reader is to end.
const END_POLL: Duration = Duration::from_millis(100);

/// Kinds of lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Constants of the node.
    Description,
    /// Mode and cause.
    Mode,
    /// All that changes.
    Snapshot,
    /// Kind that this program does not know.
    #[serde(other)]
    Other,
}

/// Line of the telemetry, without its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// Kind that the line states; [`Kind::Other`] for an unknown one.
    pub kind: Kind,
    /// JSON object.
    pub text: Arc<str>,
}

/// News from the reader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum News {
    /// Line that the node sent.
    Line(Line),
    /// Reason, as a sentence, why no telemetry can be read; reported once for each reason.
    Absent(String),
}

/// Head of each line.
#[derive(Debug, Deserialize)]
struct Head {
    version: u64,
    kind: Kind,
}

/// Reader on a thread of its own. Ends when dropped.
#[derive(Debug)]
pub struct FeedReader {
    is_ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl FeedReader {
    /// Starts to read the first of these sockets on which a node listens, and calls `on_news` with lines and failures.
    ///
    /// # Errors
    /// Returns an error if the thread cannot be started.
    pub fn start(
        sockets: Vec<PathBuf>,
        mut on_news: impl FnMut(News) + Send + 'static,
    ) -> io::Result<Self> {
        let is_ending = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&is_ending);
        let read = move || {
            let mut last_reason = None;
            while !flag.load(Ordering::Relaxed) {
                let reason = read_once(&sockets, &flag, &mut |line| {
                    last_reason = None;
                    on_news(News::Line(line));
                });
                if last_reason.as_ref() != Some(&reason) {
                    last_reason = Some(reason.clone());
                    on_news(News::Absent(reason));
                }
                // Unparked at the end.
                thread::park_timeout(RETRY_AFTER);
            }
        };
        let thread = thread::Builder::new().name("frhc-reader".to_owned()).spawn(read)?;
        Ok(Self { is_ending, thread: Some(thread) })
    }
}

impl Drop for FeedReader {
    fn drop(&mut self) {
        self.is_ending.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            thread.join().ok();
        }
    }
}

/// Reads lines of one connection until it ends; returns the reason of its end.
fn read_once(
    sockets: &[PathBuf],
    is_ending: &AtomicBool,
    on_line: &mut impl FnMut(Line),
) -> String {
    let mut reasons = Vec::new();
    for path in sockets {
        match UnixStream::connect(path) {
            Ok(stream) => return read_lines(path, stream, is_ending, on_line),
            Err(error) => reasons.push(refusal(path, &error)),
        }
    }
    // The reason of a socket without a working node says more than that of an absent socket.
    let absent = |reason: &&String| reason.starts_with("No node");
    let telling = reasons.iter().find(|reason| !absent(reason)).or(reasons.first());
    telling.cloned().unwrap_or_else(|| "No socket is given.".to_owned())
}

/// Returns why a connection failed, as a sentence.
fn refusal(path: &Path, error: &io::Error) -> String {
    let path = path.display();
    let kind = error.kind();
    if matches!(kind, ErrorKind::NotFound | ErrorKind::ConnectionRefused) {
        return format!("No node offers {path}.");
    }
    if kind == ErrorKind::PermissionDenied {
        let group = "this user must be in the group of the socket, frhc-view";
        return format!("{path}: permission denied; {group}.");
    }
    format!("{path}: {error}.")
}

fn read_lines(
    path: &Path,
    stream: UnixStream,
    is_ending: &AtomicBool,
    on_line: &mut impl FnMut(Line),
) -> String {
    let named = |reason: &str| format!("{}: {reason}.", path.display());
    if let Err(error) = stream.set_read_timeout(Some(END_POLL)) {
        return named(&error.to_string());
    }
    let mut reader = BufReader::new(stream);
    let mut line = Vec::new();
    while !is_ending.load(Ordering::Relaxed) {
        let room = MAX_LINE.saturating_sub(u64::try_from(line.len()).unwrap_or(u64::MAX));
        match reader.by_ref().take(room).read_until(b'\n', &mut line) {
            Ok(_) if line.last() == Some(&b'\n') => {
                match parsed(&line) {
                    Ok(parsed) => on_line(parsed),
                    Err(reason) => return named(&reason),
                }
                line.clear();
            }
            Ok(_) if u64::try_from(line.len()) == Ok(MAX_LINE) => {
                return named("a line has no end");
            }
            Ok(_) => return named("the node has ended"),
            Err(error) if is_interruption(&error) => {}
            Err(error) => return named(&error.to_string()),
        }
    }
    named("the reader has ended")
}

fn is_interruption(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

/// Returns a line of this version, without its end.
fn parsed(line: &[u8]) -> Result<Line, String> {
    let foreign = "what is sent there is not the telemetry of a node";
    let text = std::str::from_utf8(line).map_err(|_| foreign)?.trim_end();
    let Head { version, kind } = serde_json::from_str(text).map_err(|_| foreign)?;
    if version != VERSION {
        let reason = format!(
            "the node's telemetry has version {version}, and this program reads {VERSION}: use both of one release"
        );
        return Err(reason);
    }
    Ok(Line { kind, text: text.into() })
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::os::unix::net::UnixListener;
    use std::sync::mpsc::{Receiver, channel};

    use super::*;

    const RECEIVE_TIMEOUT: Duration = Duration::from_secs(20);

    fn reading(sockets: Vec<PathBuf>) -> (FeedReader, Receiver<News>) {
        let (news, received) = channel();
        let reader = FeedReader::start(sockets, move |one| news.send(one).unwrap_or_default());
        (reader.unwrap(), received)
    }

    fn absence(received: &Receiver<News>) -> String {
        match received.recv_timeout(RECEIVE_TIMEOUT).unwrap() {
            News::Absent(reason) => reason,
            News::Line(line) => panic!("{line:?}"),
        }
    }

    #[test]
    fn reader_follows_a_node_that_ends_and_comes_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("telemetry.sock");
        let (_reader, received) = reading(vec![path.clone()]);
        assert_eq!(absence(&received), format!("No node offers {}.", path.display()));
        for cycle in [1, 2] {
            let listener = UnixListener::bind(&path).unwrap();
            let (mut node, _) = listener.accept().unwrap();
            let text = format!("{{\"version\":1,\"kind\":\"mode\",\"cycle\":{cycle}}}");
            writeln!(node, "{text}").unwrap();
            let line = Line { kind: Kind::Mode, text: text.into() };
            assert_eq!(received.recv_timeout(RECEIVE_TIMEOUT).unwrap(), News::Line(line));
            std::fs::remove_file(&path).unwrap();
            drop((node, listener));
            let ended = absence(&received);
            assert!(ended.ends_with("the node has ended."), "{ended}");
            assert!(absence(&received).starts_with("No node offers"));
        }
    }

    #[test]
    fn reader_ends_while_the_node_sends() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("telemetry.sock");
        let listener = UnixListener::bind(&path).unwrap();
        let (reader, received) = reading(vec![path]);
        let (mut node, _) = listener.accept().unwrap();
        // Ends when the reader has closed its end.
        let sending =
            thread::spawn(
                move || while node.write_all(b"{\"version\":1,\"kind\":\"mode\"}\n").is_ok() {},
            );
        assert!(matches!(received.recv_timeout(RECEIVE_TIMEOUT).unwrap(), News::Line(_)));
        let (ended, is_ended) = channel();
        thread::spawn(move || {
            drop(reader);
            ended.send(()).unwrap_or_default();
        });
        is_ended.recv_timeout(RECEIVE_TIMEOUT).unwrap();
        sending.join().unwrap();
    }

    #[test]
    fn line_of_another_version_or_program_is_refused() {
        let with = |line: &str| parsed(line.as_bytes()).unwrap_err();
        let newer = with("{\"version\":2,\"kind\":\"mode\"}\n");
        assert!(newer.contains("version 2, and this program reads 1"), "{newer}");
        for foreign in ["", "GET / HTTP/1.1", "{\"ok\":true}", "{\"version\":1}", "[1,2]"] {
            assert!(with(foreign).contains("not the telemetry"), "{foreign}");
        }
        let unknown = parsed(b"{\"version\":1,\"kind\":\"gripper\",\"new\":null}\n").unwrap();
        assert_eq!(unknown.kind, Kind::Other);
    }

    #[test]
    fn endless_line_ends_the_connection() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("telemetry.sock");
        let listener = UnixListener::bind(&path).unwrap();
        let (_reader, received) = reading(vec![folder.path().join("absent.sock"), path.clone()]);
        let (mut node, _) = listener.accept().unwrap();
        // The reader closes its end while this is written.
        node.write_all(&[b' '; 100_000]).unwrap_or_default();
        assert_eq!(absence(&received), format!("{}: a line has no end.", path.display()));
    }
}
