//! Unix socket of an end. A near end connects to the node, a far end listens for the robot.

use std::io;
use std::os::fd::AsRawFd;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use far_socket::FarSocket;
use nix::libc::{MSG_DONTWAIT, MSG_NOSIGNAL};
use socket2::Socket;
use units::time::Instant;
use unix_socket::{Arrival, Door, Reception, SocketFile, listen_for_messages};

use crate::failure::Failure;
use crate::role::Role;

/// Group whose members may connect as the robot, if the system has this group.
const GROUP: &str = "frhc-link";

/// Maximum number of connections waiting to be accepted or refused.
const BACKLOG: i32 = 4;

/// Maximum number of messages taken at once.
const MAX_MESSAGES: usize = 16;

/// Size of the buffer for a message, in bytes. It exceeds every message of the contract, so that longer ones are
/// detected.
const MAX_LENGTH: usize = 512;

/// Requested send buffer, in bytes. The kernel raises it to its minimum, which holds a few messages.
const SEND_BUFFER: usize = 1;

/// Local socket, for the thread that reads it.
#[derive(Debug)]
pub(crate) struct Local {
    end: End,
    outlet: Outlet,
    /// Connection that the outlet has.
    shared: Option<i32>,
}

#[derive(Debug)]
enum End {
    Connector(FarSocket),
    Listener {
        door: Door,
        /// Removes the socket's file at the end.
        _file: SocketFile,
    },
}

/// Local socket, for the threads that send. They never wait, and drop messages without room.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outlet(Arc<Mutex<Option<Socket>>>);

impl Outlet {
    /// Sends a message; returns whether it was sent.
    pub(crate) fn send(&self, message: &[u8]) -> bool {
        let socket = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let flags = MSG_DONTWAIT | MSG_NOSIGNAL;
        socket.as_ref().is_some_and(|socket| socket.send_with_flags(message, flags).is_ok())
    }

    /// Returns whether there is a connection.
    pub(crate) fn is_connected(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    fn set(&self, socket: Option<Socket>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = socket;
    }
}

impl Local {
    /// Opens the socket of a role.
    ///
    /// # Errors
    /// Returns path and reason if the socket can never be used.
    pub(crate) fn open(role: Role, path: &Path) -> Result<Self, Failure> {
        let end = match role {
            Role::Near => End::Connector(FarSocket::open(path).map_err(Failure::system)?),
            Role::Far => {
                let opened = listen_for_messages(path.to_path_buf(), Some(GROUP), BACKLOG)
                    .and_then(|(socket, file)| {
                        Ok(End::Listener { door: Door::new(socket)?, _file: file })
                    });
                let failed = |error: io::Error| format!("{}: {error}", path.display());
                let end = opened.map_err(failed).map_err(Failure::system)?;
                tracing::info!("{}: a robot is expected here", path.display());
                end
            }
        };
        Ok(Self { end, outlet: Outlet::default(), shared: None })
    }

    /// Returns the outlet for other threads.
    pub(crate) fn outlet(&self) -> Outlet {
        self.outlet.clone()
    }

    /// Waits for a message or connection, for at most `span`.
    pub(crate) fn wait(&self, span: Duration) {
        match &self.end {
            End::Connector(socket) => socket.wait(span),
            End::Listener { door, .. } => door.wait(span, true),
        }
    }

    /// Takes at most 16 waiting messages; connects or accepts if due.
    pub(crate) fn receive(&mut self, now: Instant, mut take: impl FnMut(&[u8])) {
        match &mut self.end {
            End::Connector(socket) => {
                socket.receive(now, take);
                socket.events().for_each(|event| event.log());
            }
            End::Listener { door, .. } => {
                let mut buffer = [0; MAX_LENGTH];
                for _ in 0..MAX_MESSAGES {
                    match door.receive(&mut buffer) {
                        Reception::Message(length) => take(buffer.get(..length).unwrap_or(&buffer)),
                        Reception::Nothing => break,
                        Reception::Closed => {
                            tracing::warn!("robot disconnected");
                            // The next one may get the same descriptor.
                            self.outlet.set(None);
                            self.shared = None;
                        }
                    }
                }
                match door.accept() {
                    Some(Arrival::Peer(who)) => {
                        tracing::info!(uid = who.uid(), pid = who.pid(), "robot connected");
                    }
                    Some(Arrival::Second(who)) => {
                        let (uid, pid) = (who.uid(), who.pid());
                        tracing::warn!(uid, pid, "second robot refused: one is connected");
                    }
                    None => {}
                }
            }
        }
        self.share();
    }

    /// Sets a new connection in the outlet, and clears an ended one.
    fn share(&mut self) {
        let socket = match &self.end {
            End::Connector(socket) => socket.socket(),
            End::Listener { door, .. } => door.peer(),
        };
        let connection = socket.map(AsRawFd::as_raw_fd);
        if connection == self.shared {
            return;
        }
        let copy = socket.map(|socket| {
            socket.set_send_buffer_size(SEND_BUFFER)?;
            socket.try_clone()
        });
        match copy.transpose() {
            Ok(copy) => {
                self.outlet.set(copy);
                self.shared = connection;
            }
            Err(error) => tracing::warn!("local socket: {error}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};

    use socket2::{Domain, SockAddr, Type};

    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::from_micros(1_000 * millis)
    }

    fn received(local: &mut Local, millis: u64) -> Vec<Vec<u8>> {
        let mut messages = Vec::new();
        local.receive(at(millis), |message| messages.push(message.to_vec()));
        messages
    }

    fn robot(path: &Path) -> Socket {
        let robot = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        robot.connect(&SockAddr::unix(path).unwrap()).unwrap();
        robot
    }

    #[test]
    fn far_end_has_one_robot_and_takes_the_next_after_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("far.sock");
        let mut far = Local::open(Role::Far, &path).unwrap();
        let outlet = far.outlet();
        assert!(!outlet.send(b"lost"), "no robot");
        let mut first = robot(&path);
        received(&mut far, 0);
        let mut second = robot(&path);
        first.write_all(b"one").unwrap();
        assert_eq!(received(&mut far, 1), [b"one"]);
        assert!(outlet.send(b"two"));
        let mut buffer = [0; 8];
        assert_eq!(first.read(&mut buffer).unwrap(), 3);
        assert_eq!(second.read(&mut buffer).unwrap(), 0, "refused");
        drop(first);
        let mut next = robot(&path);
        received(&mut far, 2);
        assert!(outlet.send(b"three"));
        assert_eq!(next.read(&mut buffer).unwrap(), 5);
    }

    #[test]
    fn robot_that_does_not_read_finds_a_few_old_messages() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("far.sock");
        let mut far = Local::open(Role::Far, &path).unwrap();
        let _robot = robot(&path);
        received(&mut far, 0);
        let outlet = far.outlet();
        let taken = (0..5_000).filter(|_| outlet.send(&[7; 188])).count();
        assert!((1..20).contains(&taken), "{taken}");
    }

    #[test]
    fn near_end_connects_again_to_a_node_that_starts_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("link.sock");
        let mut near = Local::open(Role::Near, &path).unwrap();
        let outlet = near.outlet();
        for start in [0, 1_000] {
            let (listener, _file) = listen_for_messages(path.clone(), None, 1).unwrap();
            received(&mut near, start);
            received(&mut near, start + 100);
            let (mut node, _) = listener.accept().unwrap();
            node.write_all(b"one").unwrap();
            assert_eq!(received(&mut near, start + 101), [b"one"]);
            assert!(outlet.send(b"two"));
            drop(node);
            received(&mut near, start + 102);
            assert!(!outlet.send(b"lost"));
        }
    }
}
