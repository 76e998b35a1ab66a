//! `frhc ctl`: sends one request to a running node and prints the response.

pub mod client;
mod park;
mod table;
mod waiting;
mod zero;

use std::io;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::time::Duration;

use anyhow::{Context, anyhow, bail};
use clap::{Args, Subcommand, ValueEnum};
use serde_json::Value;
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::UnixStream;
use tokio::runtime::Runtime;
use tokio::time::{sleep, timeout};

use crate::console::{ConsoleCommand, RequestLine, default_sockets};
use crate::ctl::table::{row, table};
use crate::ctl::waiting::{NOTE_AFTER, note};
use crate::exit::{Failure, Kind, OrFail};
use crate::print;
use config::Config;
use node::zero::MOVING;

/// Time allowed for a connection, and for a response except to a reset or a homing.
const RESPONSE_TIMEOUT: Duration = Duration::from_secs(3);

/// Time allowed for the response to a reset, which may boot the network, and to a homing.
const RESET_TIMEOUT: Duration = Duration::from_secs(120);

/// Interval between two attempts while the node is busy or boots.
const RETRY_INTERVAL: Duration = Duration::from_millis(20);

/// Interval between two requests for zeros while joints move.
const AT_REST_INTERVAL: Duration = Duration::from_millis(100);

/// Requests for zeros in a second while joints move.
const ATTEMPTS_PER_SECOND: u64 = 10;

/// Maximum number of connections for a request that the node may execute twice.
const MAX_ATTEMPTS: u32 = 100;

/// `frhc ctl`.
#[derive(Debug, Args)]
pub struct Ctl {
    /// Request to send, with its arguments.
    #[command(subcommand)]
    pub request: CtlRequest,
    /// Control socket of the node [default: $XDG_RUNTIME_DIR/frhc/node.sock, then /run/frhc/node.sock].
    #[arg(long, value_name = "PATH", global = true)]
    pub socket: Option<PathBuf>,
    /// Read the path of the control socket from this configuration.
    #[arg(short, long, value_name = "FILE", global = true, conflicts_with = "socket")]
    pub config: Option<PathBuf>,
    /// Wait until a node listens and has booted, and for `zero` until the joints have been at rest, for at most this many seconds
    /// each.
    #[arg(
        long,
        value_name = "SECONDS",
        global = true,
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "30",
        value_parser = clap::value_parser!(u64).range(1..=3_600)
    )]
    pub wait: Option<u64>,
    /// Print the response as one JSON object.
    #[arg(long, global = true)]
    pub json: bool,
}

/// Requests to a running node.
#[derive(Clone, Debug, Subcommand)]
pub enum CtlRequest {
    /// Shows mode, torques, pose and counters.
    #[command(after_help = "Example:\n  frhc ctl status --json | jq .status.mode")]
    Status,
    /// Ramps up gravity compensation; afterwards the deadman switch engages.
    #[command(after_help = "Example:\n  frhc ctl arm && frhc ctl status")]
    Arm,
    /// Ramps all torques to zero.
    #[command(after_help = "Example:\n  frhc ctl disarm")]
    Disarm,
    /// Clears a latched stop, once its cause is gone.
    #[command(after_help = "Example:\n  frhc ctl reset && frhc ctl arm")]
    Reset,
    /// Sets the zeros of joints by their rest position, in which the arm lies still, hands off the grip.
    #[command(
        after_help = "Examples:\n  frhc ctl zero --show\n  frhc ctl zero && frhc ctl arm\n  frhc ctl zero --joint elbow"
    )]
    Zero {
        /// Joint, by its name or its number from 1 at the base, and all joints coupled to it [default: all].
        #[arg(long, value_name = "NAME")]
        joint: Option<String>,
        /// Print counts and positions, and the positions that this would set; set nothing.
        #[arg(long, conflicts_with = "joint")]
        show: bool,
    },
    /// Lets an armed arm move itself to its rest posture, slowly, while the deadman is held.
    #[command(
        after_help = "Example:\n  frhc ctl park && frhc ctl disarm\n\nShows the way of each joint, and waits for the deadman. Released, the deadman stops the arm, which\nstays carried; pressed again it goes on. Ctrl-C ends this command, not the motion. With --json the\nrequest is answered at once, and `ctl status --json` has its progress as `hold`."
    )]
    Park,
    /// Selects rate or position (pose) control.
    #[command(after_help = "Example:\n  frhc ctl mode pose")]
    Mode {
        /// Control mode.
        mode: CommandMode,
    },
    /// Scales the commanded motion or rotation, or the reflected force, within half a second.
    #[command(after_help = "Example:\n  frhc ctl scale motion 0.2")]
    Scale {
        /// Quantity to scale.
        #[arg(value_parser = ["motion", "rotation", "force"])]
        quantity: String,
        /// Factor on the configured gains, within `controller.scale` of the configuration.
        #[arg(allow_negative_numbers = true)]
        factor: f64,
    },
    /// Locks an axis of the command: the object is not commanded along or about it.
    #[command(after_help = "Example:\n  frhc ctl lock rz on")]
    Lock {
        /// Axis of the frame under control: along x, y, z, or about them.
        #[arg(value_parser = ["x", "y", "z", "rx", "ry", "rz"])]
        axis: String,
        /// Locked or released.
        #[arg(value_parser = ["on", "off"])]
        state: String,
    },
    /// Turns the object to the orientation of the grip, in pose mode while the deadman is held.
    #[command(after_help = "Example:\n  frhc ctl align")]
    Align,
}

/// Control modes: the meaning of a displacement of the hand.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum CommandMode {
    /// A displacement of the hand commands a velocity of the object.
    Rate,
    /// A displacement of the hand commands a pose of the object.
    Pose,
}

/// Sends the request and prints the response.
///
/// # Errors
/// When no node responds (exit 4), or it refuses the request (exit 1).
pub fn run(args: &Ctl) -> Result<(), Failure> {
    let paths = socket_paths(args)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("cannot start the async runtime").or_fail(Kind::System)?;
    let node = Connection { paths, runtime };
    if let Some(seconds) = args.wait {
        node.runtime.block_on(wait_for_boot(&node.paths, seconds)).or_fail(Kind::Bus)?;
    }
    let command = command(&args.request, &node)?;
    let line = node.request_at_rest(command, args.wait)?;
    let answer = granted(&line, args.json)?;
    if matches!(args.request, CtlRequest::Park) && !args.json {
        return park::watch(&node);
    }
    let text = |key| answer.get(key).and_then(Value::as_str);
    if let (CtlRequest::Zero { show, .. }, false) = (&args.request, args.json) {
        let status = if *show { answer } else { node.status()? };
        let status = status.get("status").unwrap_or(&Value::Null);
        let rows = if *show { zero::preview(status) } else { zero::states(status) };
        rows.iter().for_each(|row| print::line(row));
    } else if !args.json {
        match answer.get("status") {
            Some(status) => print::line(&table(status)),
            None => print::line(text("mode").unwrap_or_default()),
        }
        if let Some(note) = text("note") {
            print::line(&row("note", note));
        }
    }
    Ok(())
}

/// Sockets to try, and the runtime of the connections.
#[derive(Debug)]
struct Connection {
    paths: Vec<PathBuf>,
    runtime: Runtime,
}

impl Connection {
    /// Sends a request; returns the line of the response.
    fn request(&self, command: ConsoleCommand) -> Result<String, Failure> {
        self.runtime.block_on(send(&self.paths, command)).or_fail(Kind::Bus)
    }

    /// As [`request`](Self::request). A request for zeros that is refused because joints move is sent again until they have been at
    /// rest, for at most `wait` seconds.
    fn request_at_rest(
        &self,
        command: ConsoleCommand,
        wait: Option<u64>,
    ) -> Result<String, Failure> {
        let is_zero = matches!(command, ConsoleCommand::Zero(_));
        let attempts = wait.filter(|_| is_zero).unwrap_or_default() * ATTEMPTS_PER_SECOND;
        for _ in 0..attempts {
            let line = self.request(command)?;
            if !line.contains(MOVING) {
                return Ok(line);
            }
            self.runtime.block_on(async { sleep(AT_REST_INTERVAL).await });
        }
        self.request(command)
    }

    /// Returns the response to a request for the status.
    fn status(&self) -> Result<Value, Failure> {
        granted(&self.request(ConsoleCommand::Status)?, false)
    }
}

/// Returns the response of a line, which is printed if `is_printed`.
///
/// # Errors
/// When the node has refused the request (exit 1).
fn granted(line: &str, is_printed: bool) -> Result<Value, Failure> {
    let answer: Value = serde_json::from_str(line).or_fail(Kind::Bus)?;
    if is_printed {
        print::line(line.trim_end());
    }
    if answer.get("ok").and_then(Value::as_bool) == Some(true) {
        return Ok(answer);
    }
    let reason = answer.get("error").and_then(Value::as_str);
    Err(Failure::new(Kind::Negative, reason.unwrap_or("invalid response from the node")))
}

/// Returns the command of a request; an adjustment is sent in the words of the command line. The name of a joint is looked up
/// in the status of `node`.
fn command(request: &CtlRequest, node: &Connection) -> Result<ConsoleCommand, Failure> {
    let words = match request {
        CtlRequest::Status | CtlRequest::Zero { show: true, .. } => {
            return Ok(ConsoleCommand::Status);
        }
        CtlRequest::Zero { joint: None, .. } => return Ok(ConsoleCommand::Zero(None)),
        CtlRequest::Zero { joint: Some(called), .. } => {
            let status = node.status()?;
            let joint = zero::joint(status.get("status").unwrap_or(&Value::Null), called);
            let joint = joint.map_err(|reason| Failure::new(Kind::Usage, reason))?;
            return Ok(ConsoleCommand::Zero(Some(joint)));
        }
        CtlRequest::Arm => return Ok(ConsoleCommand::Arm),
        CtlRequest::Disarm => return Ok(ConsoleCommand::Disarm),
        CtlRequest::Reset => return Ok(ConsoleCommand::Reset),
        CtlRequest::Park => return Ok(ConsoleCommand::Park),
        CtlRequest::Mode { mode: CommandMode::Rate } => return Ok(ConsoleCommand::Rate),
        CtlRequest::Mode { mode: CommandMode::Pose } => return Ok(ConsoleCommand::Pose),
        CtlRequest::Scale { quantity, factor } => format!("scale {quantity} {factor}"),
        CtlRequest::Lock { axis, state } => format!("lock {axis} {state}"),
        CtlRequest::Align => "align".to_owned(),
    };
    words.parse().map(ConsoleCommand::Adjust).or_fail(Kind::Usage)
}

/// Returns the paths to try: the one of the option or the configuration, else the default ones.
fn socket_paths(args: &Ctl) -> Result<Vec<PathBuf>, Failure> {
    if let Some(socket) = &args.socket {
        return Ok(vec![socket.clone()]);
    }
    let configured = match &args.config {
        Some(file) => Config::load(file).or_fail(Kind::Configuration)?.socket.clone(),
        None => None,
    };
    Ok(configured.map_or_else(default_sockets, |socket| vec![socket]))
}

/// Waits until a node listens and has booted, for at most `seconds`.
async fn wait_for_boot(paths: &[PathBuf], seconds: u64) -> anyhow::Result<()> {
    let booted = async {
        loop {
            let answer = send(paths, ConsoleCommand::Status).await.unwrap_or_default();
            let answer: Value = serde_json::from_str(&answer).unwrap_or_default();
            match answer.get("mode").and_then(Value::as_str) {
                None | Some("boot") => sleep(RETRY_INTERVAL).await,
                Some(_) => return,
            }
        }
    };
    let waited = timeout(Duration::from_secs(seconds), booted).await;
    let tried = || paths.iter().map(|path| path.display().to_string());
    waited.map_err(|_| {
        anyhow!("{}: no node is ready within {seconds} s", tried().collect::<Vec<_>>().join(", "))
    })
}

/// Sends one request; returns the line of the response. A node with too many clients may close the connection. The
/// request is then sent again, if it may be executed twice.
async fn send(paths: &[PathBuf], ask: ConsoleCommand) -> anyhow::Result<String> {
    let is_repeatable = matches!(ask, ConsoleCommand::Disarm | ConsoleCommand::Status);
    let attempts = if is_repeatable { MAX_ATTEMPTS } else { 1 };
    for _ in 1..attempts {
        match send_once(paths, ask, &print::note).await? {
            Answer::Line(line) => return Ok(line),
            Answer::Closed(_) => sleep(RETRY_INTERVAL).await,
        }
    }
    match send_once(paths, ask, &print::note).await? {
        Answer::Line(line) => Ok(line),
        Answer::Closed(reason) => bail!(reason),
    }
}

/// Outcome of a request on one connection.
enum Answer {
    /// Line of the response.
    Line(String),
    /// Reason in words why the node closed the connection without a response.
    Closed(String),
}

/// Sends one request on a new connection. Calls `say` if a reset or a homing is not answered in half a second.
async fn send_once(
    paths: &[PathBuf],
    ask: ConsoleCommand,
    say: &dyn Fn(&str),
) -> anyhow::Result<Answer> {
    let (mut stream, socket) = connect_to_first(paths).await?;
    let path = socket.display();
    let is_long = matches!(ask, ConsoleCommand::Reset | ConsoleCommand::Zero(_));
    let limit = if is_long { RESET_TIMEOUT } else { RESPONSE_TIMEOUT };
    let mut line = String::new();
    let answered = async {
        let mut exchange = pin!(exchange(&mut stream, ask, &mut line));
        let noted = async {
            sleep(NOTE_AFTER).await;
            note(ask, mode_at(socket).await.as_deref(), limit)
        };
        tokio::select! {
            biased;
            length = &mut exchange => return length,
            text = noted, if is_long => say(&text),
        }
        exchange.await
    };
    match timeout(limit, answered).await {
        Ok(Ok(length)) if length > 0 => Ok(Answer::Line(line)),
        Ok(Ok(_)) => Ok(Answer::Closed(format!("the node at {path} closed the connection"))),
        Ok(Err(error)) => {
            let reason = reason(&error);
            Ok(Answer::Closed(format!("the node at {path} closed the connection: {reason}")))
        }
        Err(_) => bail!("the node at {path} did not respond within {} s", limit.as_secs()),
    }
}

/// Sends a request, and reads the line of the response; returns its length.
async fn exchange(
    stream: &mut UnixStream,
    ask: ConsoleCommand,
    line: &mut String,
) -> io::Result<usize> {
    let mut request = serde_json::to_string(&RequestLine { ask })?;
    request.push('\n');
    stream.write_all(request.as_bytes()).await?;
    BufReader::new(stream).read_line(line).await
}

/// Returns the mode of the node at a socket; `None` without an answer.
async fn mode_at(socket: &Path) -> Option<String> {
    let mut line = String::new();
    let answered = async {
        let mut stream = UnixStream::connect(socket).await?;
        exchange(&mut stream, ConsoleCommand::Status, &mut line).await
    };
    timeout(NOTE_AFTER, answered).await.ok()?.ok()?;
    let answer: Value = serde_json::from_str(&line).ok()?;
    answer.get("mode").and_then(Value::as_str).map(str::to_owned)
}

/// Connects to the first of these sockets on which a node listens.
async fn connect_to_first(paths: &[PathBuf]) -> anyhow::Result<(UnixStream, &Path)> {
    let mut absent = Vec::new();
    for path in paths {
        let shown = path.display();
        match timeout(RESPONSE_TIMEOUT, connect(path)).await {
            Ok(Ok(stream)) => return Ok((stream, path)),
            Ok(Err(error)) => absent.push(format!("no node at {shown}: {}", reason(&error))),
            Err(_) => {
                let limit = RESPONSE_TIMEOUT.as_secs();
                bail!("the node at {shown} accepts no connection within {limit} s")
            }
        }
    }
    bail!(absent.join("\n"))
}

/// Connects; retries while the backlog of the node is full.
async fn connect(socket: &Path) -> io::Result<UnixStream> {
    loop {
        match UnixStream::connect(socket).await {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => sleep(RETRY_INTERVAL).await,
            connected => return connected,
        }
    }
}

/// Describes an I/O error, without its errno.
fn reason(error: &io::Error) -> String {
    let kind = error.kind();
    if kind == io::ErrorKind::NotFound {
        "no such socket; start `frhc run`, or give --socket".to_owned()
    } else if kind == io::ErrorKind::ConnectionRefused {
        "no process listens on it".to_owned()
    } else if kind == io::ErrorKind::PermissionDenied {
        "permission denied; only the node's user and group may connect".to_owned()
    } else {
        kind.to_string()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::net::UnixListener;

    use super::*;

    #[test]
    fn first_socket_with_a_node_is_used() {
        let folder = crate::scratch::path("places");
        fs::create_dir_all(&folder).unwrap();
        let [absent, service] = ["user.sock", "service.sock"].map(|name| folder.join(name));
        let listener = UnixListener::bind(&service).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let paths = [absent.clone(), service.clone()];
        let (_, found) = runtime.block_on(connect_to_first(&paths)).unwrap();
        assert_eq!(found, service);
        drop(listener);
        let error = runtime.block_on(connect_to_first(&paths)).unwrap_err().to_string();
        assert!(error.contains(&format!("no node at {}: no such socket", absent.display())));
        assert!(
            error.contains(&format!("no node at {}: no process", service.display())),
            "{error}"
        );
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_30_disarm_is_sent_again_after_a_close_and_arm_is_not() {
        let folder = crate::scratch::path("closing");
        fs::create_dir_all(&folder).unwrap();
        let paths = [folder.join("node.sock")];
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let sent = |ask| {
            runtime.block_on(async {
                fs::remove_file(&paths[0]).ok();
                let node = tokio::net::UnixListener::bind(&paths[0]).unwrap();
                let answers = async {
                    drop(node.accept().await.unwrap());
                    let (mut client, _) = node.accept().await.unwrap();
                    client.write_all(b"{\"ok\":true}\n").await.unwrap();
                    std::future::pending::<()>().await;
                };
                tokio::select! {
                    line = send(&paths, ask) => line,
                    () = answers => panic!("pending"),
                }
            })
        };
        for ask in [ConsoleCommand::Disarm, ConsoleCommand::Status] {
            assert_eq!(sent(ask).unwrap(), "{\"ok\":true}\n");
        }
        for ask in [ConsoleCommand::Arm, ConsoleCommand::Reset, ConsoleCommand::Rate] {
            let error = sent(ask).unwrap_err().to_string();
            assert!(error.contains("closed the connection"), "{error}");
        }
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn reset_that_takes_long_says_what_it_waits_for() {
        let folder = crate::scratch::path("long-reset");
        fs::create_dir_all(&folder).unwrap();
        let paths = [folder.join("node.sock")];
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = runtime.enable_all().start_paused(true).build().unwrap();
        let said = std::cell::RefCell::new(Vec::new());
        let say = |text: &str| said.borrow_mut().push(text.to_owned());
        let answered = |delay: Duration, status: &'static [u8]| {
            runtime.block_on(async {
                fs::remove_file(&paths[0]).ok();
                let node = tokio::net::UnixListener::bind(&paths[0]).unwrap();
                let answers = async {
                    let (mut reset, _) = node.accept().await.unwrap();
                    let quick = sleep(delay);
                    let statuses = async {
                        let (mut client, _) = node.accept().await.unwrap();
                        client.write_all(status).await.unwrap();
                        std::future::pending::<()>().await;
                    };
                    tokio::select! { () = quick => {}, () = statuses => {} }
                    reset.write_all(b"{\"ok\":true}\n").await.unwrap();
                    std::future::pending::<()>().await;
                };
                tokio::select! {
                    answer = send_once(&paths, ConsoleCommand::Reset, &say) => {
                        assert!(matches!(answer.unwrap(), Answer::Line(_)));
                    }
                    () = answers => panic!("pending"),
                }
            });
        };
        answered(Duration::from_millis(400), b"");
        assert_eq!(*said.borrow(), Vec::<String>::new());
        answered(Duration::from_secs(20), b"{\"ok\":true,\"mode\":\"boot\"}\n");
        let note = "reset: the node boots its drives again; waits for at most 120 s";
        assert_eq!(*said.borrow(), [note]);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn node_with_a_full_backlog_times_out() {
        let folder = crate::scratch::path("backlog");
        fs::create_dir_all(&folder).unwrap();
        let place = folder.join("node.sock");
        let listener = UnixListener::bind(&place).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let mut waiting = Vec::new();
        while let Ok(stream) = runtime.block_on(UnixStream::connect(&place)) {
            waiting.push(stream);
        }
        let error = runtime.block_on(async {
            tokio::time::pause();
            connect_to_first(std::slice::from_ref(&place)).await.unwrap_err().to_string()
        });
        let reason = format!("the node at {} accepts no connection within 3 s", place.display());
        assert_eq!(error, reason);
        drop((listener, waiting));
        fs::remove_dir_all(&folder).unwrap();
    }
}
