//! `frhc ctl`: asks a running node one question and prints its answer.

use std::io;
use std::path::Path;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use anyhow::anyhow;
use anyhow::bail;
use clap::Args;
use clap::Subcommand;
use clap::ValueEnum;
use tokio::io::AsyncBufReadExt;
use tokio::io::AsyncWriteExt;
use tokio::io::BufReader;
use tokio::net::UnixStream;
use tokio::time::sleep;
use tokio::time::timeout;

use crate::console::Ask;
use crate::console::Question;
use crate::console::usual_sockets;
use crate::exit::Failure;
use crate::exit::Kind;
use crate::exit::OrFail;
use crate::print;
use config::Config;

/// Time allowed for a connection, and for an answer …
const ANSWER_TIMEOUT: Duration = Duration::from_secs(3);

/// … but for that of a reset, which may boot the network.
const RESET_TIMEOUT: Duration = Duration::from_secs(120);

/// Interval between two attempts, where the node is busy or boots.
const RETRY: Duration = Duration::from_millis(20);

/// `frhc ctl`.
#[derive(Debug, Args)]
pub struct Ctl {
    /// What to ask.
    #[command(subcommand)]
    pub request: CtlRequest,
    /// The node's socket; otherwise frhc/node.sock in $XDG_RUNTIME_DIR, then /run/frhc/node.sock, the service's.
    #[arg(long, value_name = "PATH", global = true)]
    pub socket: Option<PathBuf>,
    /// The configuration that names the socket.
    #[arg(short, long, value_name = "FILE", global = true, conflicts_with = "socket")]
    pub config: Option<PathBuf>,
    /// Waits until a node listens and its boot is over, for so many seconds at most.
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
    /// The answer as one JSON object.
    #[arg(long, global = true)]
    pub json: bool,
}

/// What to ask a node.
#[derive(Clone, Copy, Debug, Subcommand)]
pub enum CtlRequest {
    /// Mode, torques, pose, counters.
    #[command(after_help = "Example:\n  frhc ctl status --json | jq .status.mode")]
    Status,
    /// Gravity compensation on; from now on the deadman engages.
    #[command(after_help = "Example:\n  frhc ctl arm && frhc ctl status")]
    Arm,
    /// Torque off.
    #[command(after_help = "Example:\n  frhc ctl disarm")]
    Disarm,
    /// Leave a latched stop, once its cause is gone.
    #[command(after_help = "Example:\n  frhc ctl reset && frhc ctl arm")]
    Reset,
    /// Command rates or poses.
    #[command(after_help = "Example:\n  frhc ctl mode pose")]
    Mode {
        /// Which.
        mode: CommandMode,
    },
}

/// What a displacement of the hand means.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum CommandMode {
    /// A velocity of the object.
    Rate,
    /// A pose of the object.
    Pose,
}

/// Asks, and prints the answer.
///
/// # Errors
/// Without a node that answers (exit 4), or when it refuses (exit 1).
pub fn run(args: &Ctl) -> Result<(), Failure> {
    let places = places(args)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("no runtime").or_fail(Kind::Bus)?;
    let line = runtime.block_on(async {
        if let Some(seconds) = args.wait {
            wait_for_boot(&places, seconds).await?;
        }
        ask(&places, question(args.request)).await
    });
    let line = line.or_fail(Kind::Bus)?;
    let answer: serde_json::Value = serde_json::from_str(&line).or_fail(Kind::Bus)?;
    if args.json {
        print::line(line.trim_end());
    }
    let text = |key| answer.get(key).and_then(serde_json::Value::as_str);
    if answer.get("ok").and_then(serde_json::Value::as_bool) != Some(true) {
        let reason = text("error").unwrap_or("the node's answer is not understood");
        return Err(Failure::new(Kind::Negative, reason));
    }
    if !args.json {
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

fn question(request: CtlRequest) -> Ask {
    match request {
        CtlRequest::Status => Ask::Status,
        CtlRequest::Arm => Ask::Arm,
        CtlRequest::Disarm => Ask::Disarm,
        CtlRequest::Reset => Ask::Reset,
        CtlRequest::Mode { mode: CommandMode::Rate } => Ask::Rate,
        CtlRequest::Mode { mode: CommandMode::Pose } => Ask::Pose,
    }
}

/// Places of the node's socket: the one that is given or configured, else the usual ones.
fn places(args: &Ctl) -> Result<Vec<PathBuf>, Failure> {
    if let Some(socket) = &args.socket {
        return Ok(vec![socket.clone()]);
    }
    let configured = match &args.config {
        Some(file) => Config::load(file).or_fail(Kind::Configuration)?.socket.clone(),
        None => None,
    };
    Ok(configured.map_or_else(usual_sockets, |socket| vec![socket]))
}

/// Waits until a node listens that does not boot, for so many seconds at most.
async fn wait_for_boot(places: &[PathBuf], seconds: u64) -> anyhow::Result<()> {
    let boots = async {
        loop {
            let answer = ask(places, Ask::Status).await.unwrap_or_default();
            let answer: serde_json::Value = serde_json::from_str(&answer).unwrap_or_default();
            match answer.get("mode").and_then(serde_json::Value::as_str) {
                None | Some("boot") => sleep(RETRY).await,
                Some(_) => return,
            }
        }
    };
    let waited = timeout(Duration::from_secs(seconds), boots).await;
    let tried = || places.iter().map(|place| place.display().to_string());
    waited.map_err(|_| {
        anyhow!("{}: no node is ready within {seconds} s", tried().collect::<Vec<_>>().join(", "))
    })
}

/// Asks one question; the line of the answer.
async fn ask(places: &[PathBuf], ask: Ask) -> anyhow::Result<String> {
    let (mut stream, place) = find(places).await?;
    let place = place.display();
    let limit = if ask == Ask::Reset { RESET_TIMEOUT } else { ANSWER_TIMEOUT };
    let mut question = serde_json::to_string(&Question { ask })?;
    question.push('\n');
    let mut line = String::new();
    let asked = async {
        stream.write_all(question.as_bytes()).await?;
        BufReader::new(&mut stream).read_line(&mut line).await
    };
    match timeout(limit, asked).await {
        Ok(Ok(length)) if length > 0 => Ok(line),
        Ok(Ok(_)) => bail!("the node at {place} closed the connection"),
        Ok(Err(error)) => bail!("the node at {place} closed the connection: {}", reason(&error)),
        Err(_) => bail!("the node at {place} does not answer within {} s", limit.as_secs()),
    }
}

/// Connects to the first of these places at which a node listens.
async fn find(places: &[PathBuf]) -> anyhow::Result<(UnixStream, &Path)> {
    let mut absent = Vec::new();
    for path in places {
        let place = path.display();
        match timeout(ANSWER_TIMEOUT, connect(path)).await {
            Ok(Ok(stream)) => return Ok((stream, path)),
            Ok(Err(error)) => absent.push(format!("no node at {place}: {}", reason(&error))),
            Err(_) => {
                let limit = ANSWER_TIMEOUT.as_secs();
                bail!("the node at {place} takes no connection within {limit} s")
            }
        }
    }
    bail!(absent.join("\n"))
}

/// Connects. A node whose queue of connections is full is asked again.
async fn connect(socket: &Path) -> io::Result<UnixStream> {
    loop {
        match UnixStream::connect(socket).await {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => sleep(RETRY).await,
            connected => return connected,
        }
    }
}

/// A system's error in words, without its number.
fn reason(error: &io::Error) -> String {
    let kind = error.kind();
    if kind == io::ErrorKind::NotFound {
        "no such socket: start `frhc run`, or give --socket".to_owned()
    } else if kind == io::ErrorKind::ConnectionRefused {
        "no process listens there".to_owned()
    } else if kind == io::ErrorKind::PermissionDenied {
        "permission denied: it is for the node's user and group".to_owned()
    } else {
        kind.to_string()
    }
}

/// A status as rows of name and value; what is inside another value follows it, indented.
fn table(status: &serde_json::Value) -> String {
    rows(status, 0).join("\n")
}

fn rows(object: &serde_json::Value, indent: usize) -> Vec<String> {
    let members = object.as_object().into_iter().flatten();
    let members = members.filter(|(_, value)| !value.is_null());
    let of_member = |(name, value): (&String, &serde_json::Value)| {
        let name = format!("{:indent$}{name}", "");
        match value.is_object() {
            true => [vec![name], rows(value, indent + 2)].concat(),
            false => vec![row(&name, &plain(value))],
        }
    };
    members.flat_map(of_member).collect()
}

fn row(name: &str, value: &str) -> String {
    format!("{name:16} {value}")
}

fn plain(value: &serde_json::Value) -> String {
    if let Some(text) = value.as_str() {
        return text.to_owned();
    }
    if let Some(number) = value.as_f64().filter(|_| value.is_f64()) {
        return format!("{number:.3}");
    }
    match value.as_array() {
        Some(list) => list.iter().map(|item| format!("{:>8} ", plain(item))).collect(),
        None => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::net::UnixListener;

    use super::*;

    #[test]
    fn a_status_is_rows_of_names_and_numbers() {
        let status = serde_json::json!({
            "mode": "armed", "stopped_by": null, "q": [0.5, -1.0],
            "budget": { "task": [0.0, 1.5], "assist_scale": 1.0, "limiting_joint": null },
        });
        let rows = "mode             armed\n\
            q                   0.500   -1.000 \n\
            budget\n\
            \x20 task              0.000    1.500 \n\
            \x20 assist_scale   1.000";
        assert_eq!(table(&status), rows);
    }

    #[test]
    fn the_first_place_with_a_node_is_taken() {
        let folder = crate::scratch::path("places");
        fs::create_dir_all(&folder).unwrap();
        let [absent, service] = ["user.sock", "service.sock"].map(|name| folder.join(name));
        let listener = UnixListener::bind(&service).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let places = [absent.clone(), service.clone()];
        let (_, found) = runtime.block_on(find(&places)).unwrap();
        assert_eq!(found, service);
        drop(listener);
        let error = runtime.block_on(find(&places)).unwrap_err().to_string();
        assert!(error.contains(&format!("no node at {}: no such socket", absent.display())));
        assert!(
            error.contains(&format!("no node at {}: no process", service.display())),
            "{error}"
        );
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn node_that_takes_no_connection_is_given_up_in_words() {
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
            find(std::slice::from_ref(&place)).await.unwrap_err().to_string()
        });
        let reason = format!("the node at {} takes no connection within 3 s", place.display());
        assert_eq!(error, reason);
        drop((listener, waiting));
        fs::remove_dir_all(&folder).unwrap();
    }
}
