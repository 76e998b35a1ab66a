//! `frhc-link` as a process, and the test in the place of the node or the robot.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;

use socket2::{Domain, SockAddr, Socket, Type};
use tempfile::TempDir;

use super::{RECEIVE_TIMEOUT, free_port};

/// Process with its log.
pub(crate) struct Running {
    child: Child,
    lines: Receiver<String>,
    seen: Vec<String>,
}

impl Running {
    pub(crate) fn start(args: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_frhc-link"))
            .args(args)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let log = BufReader::new(child.stderr.take().unwrap());
        let (sender, lines) = channel();
        thread::spawn(move || {
            log.lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        Self { child, lines, seen: Vec::new() }
    }

    /// Waits for a line with these words, which may have been read before.
    pub(crate) fn wait_for(&mut self, words: &str) {
        while !self.seen.iter().any(|line| line.contains(words)) {
            let line = self.lines.recv_timeout(RECEIVE_TIMEOUT);
            let line = line.unwrap_or_else(|_| panic!("no line {words:?}: {:#?}", self.seen));
            self.seen.push(line);
        }
    }

    /// Returns the number of lines so far with these words.
    pub(crate) fn lines_with(&mut self, words: &str) -> usize {
        self.seen.extend(self.lines.try_iter());
        self.seen.iter().filter(|line| line.contains(words)).count()
    }

    /// Waits for the end; returns exit status, standard output and log.
    pub(crate) fn ended(mut self) -> (ExitStatus, String, Vec<String>) {
        let mut output = String::new();
        self.child.stdout.take().unwrap().read_to_string(&mut output).unwrap();
        let status = self.child.wait().unwrap();
        self.seen.extend(self.lines.iter());
        (status, output, std::mem::take(&mut self.seen))
    }

    /// Sends SIGTERM.
    pub(crate) fn terminate(self) -> (ExitStatus, String, Vec<String>) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").arg(id).status().unwrap().success());
        self.ended()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// Local socket of an end.
pub(crate) struct Local {
    socket: Socket,
    others: usize,
}

impl Local {
    /// Returns whether this message is received; counts others.
    pub(crate) fn receives(&mut self, expected: &[u8]) -> bool {
        let mut buffer = [0; 512];
        self.socket.set_read_timeout(Some(RECEIVE_TIMEOUT)).unwrap();
        while let Ok(length @ 1..) = self.socket.read(&mut buffer) {
            if &buffer[..length] == expected {
                return true;
            }
            self.others += 1;
        }
        false
    }

    /// Sends a message.
    pub(crate) fn send(&mut self, message: &[u8]) {
        self.socket.write_all(message).unwrap();
    }

    /// Returns the number of unexpected messages.
    pub(crate) const fn others(&self) -> usize {
        self.others
    }
}

/// Writes the settings of an end; returns the file.
pub(crate) fn settings(folder: &Path, keys: &Path, network: &str) -> PathBuf {
    let file = folder.join("link.toml");
    let socket = folder.join("s");
    fs::write(&file, format!("keys = {keys:?}\nsocket = {socket:?}\n{network}\n")).unwrap();
    file
}

/// Far end that listens.
pub(crate) struct FarEnd {
    pub(crate) end: Running,
    pub(crate) port: u16,
    folder: TempDir,
}

impl FarEnd {
    pub(crate) fn start(keys: &Path) -> Self {
        let (folder, port) = (tempfile::tempdir().unwrap(), free_port());
        let file = settings(folder.path(), keys, &format!("listen = [\"127.0.0.1:{port}\"]"));
        let mut end = Running::start(&["far", "--config", file.to_str().unwrap()]);
        end.wait_for("listens at");
        Self { end, port, folder }
    }

    /// Connects as the robot.
    pub(crate) fn robot(&mut self) -> Local {
        let socket = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        socket.connect(&SockAddr::unix(self.folder.path().join("s")).unwrap()).unwrap();
        self.end.wait_for("robot connected");
        Local { socket, others: 0 }
    }
}

/// Near end, with the test as the node.
pub(crate) struct NearEnd {
    pub(crate) end: Running,
    pub(crate) port: u16,
    listener: Socket,
    _folder: TempDir,
}

impl NearEnd {
    /// Starts one that listens.
    pub(crate) fn start(keys: &Path) -> Self {
        let port = free_port();
        let mut near = Self::with(keys, port, &format!("listen = [\"127.0.0.1:{port}\"]"));
        near.end.wait_for("listens at");
        near
    }

    /// Starts one that connects to a port.
    pub(crate) fn connecting(keys: &Path, port: u16) -> Self {
        Self::with(keys, port, &format!("connect = [\"127.0.0.1:{port}\"]"))
    }

    fn with(keys: &Path, port: u16, network: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let listener = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        listener.bind(&SockAddr::unix(folder.path().join("s")).unwrap()).unwrap();
        listener.listen(4).unwrap();
        let file = settings(folder.path(), keys, network);
        let end = Running::start(&["near", "--config", file.to_str().unwrap()]);
        Self { end, port, listener, _folder: folder }
    }

    /// Accepts the connection of the near end.
    pub(crate) fn node(&mut self) -> Local {
        let (socket, _) = self.listener.accept().unwrap();
        Local { socket, others: 0 }
    }
}
