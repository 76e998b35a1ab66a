//! Readers of a stream socket, who get every line and send nothing. Slow readers are dropped; nothing here waits.

use std::io;
use std::net::Shutdown;
use std::os::fd::AsRawFd;
use std::os::unix::net::{UnixListener, UnixStream};

use nix::sys::socket::{MsgFlags, send};

/// Maximum number of readers. A further one is closed at once.
pub const MAX_READERS: usize = 64;

/// Listening socket with its readers.
#[derive(Debug)]
pub struct Audience {
    listener: UnixListener,
    readers: Vec<UnixStream>,
}

impl Audience {
    /// Takes a listening socket.
    ///
    /// # Errors
    /// When the socket cannot be made non-blocking.
    pub fn new(listener: UnixListener) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        Ok(Self { listener, readers: Vec::new() })
    }

    /// Returns whether there are no readers.
    pub const fn is_empty(&self) -> bool {
        self.readers.is_empty()
    }

    /// Accepts the waiting connections, and sends these first lines to each.
    pub fn admit(&mut self, first_lines: &[&[u8]]) {
        for _ in 0..MAX_READERS {
            let Ok((reader, _)) = self.listener.accept() else { return };
            // What a reader sends is never read: it gets EPIPE.
            let is_set = reader.set_nonblocking(true).and(reader.shutdown(Shutdown::Read));
            let has_room = self.readers.len() < MAX_READERS;
            let takes_all = || first_lines.iter().all(|line| takes(&reader, line));
            if has_room && is_set.is_ok() && takes_all() {
                self.readers.push(reader);
            }
        }
    }

    /// Sends lines to all readers; drops each that has no room for all of them.
    pub fn send(&mut self, lines: &[u8]) {
        self.readers.retain(|reader| takes(reader, lines));
    }
}

/// Returns whether the socket of a reader took all of these bytes.
fn takes(reader: &UnixStream, bytes: &[u8]) -> bool {
    let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
    send(reader.as_raw_fd(), bytes, flags) == Ok(bytes.len())
}

#[cfg(test)]
mod tests {
    use std::io::{ErrorKind, Read, Write};

    use tempfile::TempDir;

    use super::*;

    const LINE: &[u8] = &[b'x'; 4_096];

    fn audience() -> (TempDir, Audience, impl Fn() -> UnixStream) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("telemetry.sock");
        let audience = Audience::new(UnixListener::bind(&path).unwrap()).unwrap();
        (folder, audience, move || UnixStream::connect(&path).unwrap())
    }

    #[test]
    fn reader_gets_first_lines_and_then_all_others() {
        let (_folder, mut audience, connect) = audience();
        let mut reader = connect();
        audience.admit(&[b"first\n"]);
        audience.send(b"second\n");
        assert!(!audience.is_empty());
        drop(audience);
        let mut text = String::new();
        reader.read_to_string(&mut text).unwrap();
        assert_eq!(text, "first\nsecond\n");
    }

    #[test]
    fn hazard_37_what_a_reader_sends_is_refused() {
        let (_folder, mut audience, connect) = audience();
        let mut reader = connect();
        audience.admit(&[b"first\n"]);
        let refused = reader.write_all(b"{\"ask\":\"arm\"}\n").unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::BrokenPipe);
        audience.send(b"second\n");
        assert!(!audience.is_empty(), "it may read on");
    }

    #[test]
    fn stopped_reader_is_dropped_and_the_others_read_on() {
        let (_folder, mut audience, connect) = audience();
        let (stopped, mut living) = (connect(), connect());
        audience.admit(&[]);
        let mut buffer = LINE.to_vec();
        // The kernel's buffer holds some dozens of lines.
        for _ in 0..1_000 {
            audience.send(LINE);
            living.read_exact(&mut buffer).unwrap();
        }
        assert_eq!(audience.readers.len(), 1);
        drop(stopped);
    }

    #[test]
    fn one_reader_too_many_is_closed_at_once() {
        let (_folder, mut audience, connect) = audience();
        let mut readers: Vec<_> = (0..=MAX_READERS)
            .map(|_| {
                let reader = connect();
                audience.admit(&[b"!"]);
                reader
            })
            .collect();
        let mut byte = [0];
        assert_eq!(readers.pop().unwrap().read(&mut byte).unwrap(), 0, "closed");
        assert!(readers.iter_mut().all(|reader| reader.read(&mut byte).unwrap() == 1));
        drop(readers);
        audience.send(b"!");
        assert!(audience.is_empty(), "those that have left make room");
    }
}
