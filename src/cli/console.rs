//! The control socket of a running node: one JSON object a line in, one a line out.
//!
//! `{"ask":"status"}`, `{"ask":"arm"}`, `{"ask":"disarm"}`, `{"ask":"reset"}`, `{"ask":"mode rate"}`,
//! `{"ask":"mode pose"}`; answered by `{"ok":true,…}` or `{"ok":false,"error":"…"}`.

use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::path::PathBuf;

use serde::Deserialize;
use serde::Serialize;
use tokio::io::AsyncBufReadExt;
use tokio::io::AsyncReadExt;
use tokio::io::AsyncWriteExt;
use tokio::io::BufReader;
use tokio::net::UnixListener;
use tokio::net::UnixStream;
use tokio::sync::mpsc;
use tokio::sync::oneshot;

use crate::cli::recorder::Latest;
use crate::controller::switches::Mode as CommandMode;
use crate::node::Refused;
use crate::node::Request;
use crate::telemetry::record::Mode;
use crate::telemetry::status::Status;

/// No request is longer than this.
const LONGEST_LINE: u64 = 1_024;

/// What may be asked, in the words of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Ask {
    #[serde(rename = "status")]
    Status,
    #[serde(rename = "arm")]
    Arm,
    #[serde(rename = "disarm")]
    Disarm,
    #[serde(rename = "reset")]
    Reset,
    #[serde(rename = "mode rate")]
    Rate,
    #[serde(rename = "mode pose")]
    Pose,
}

/// One line in.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Question {
    pub(super) ask: Ask,
}

/// One line out.
#[derive(Debug, Serialize)]
struct Answer {
    ok: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mode: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    status: Option<Status>,
}

impl Answer {
    fn refused(reason: &impl ToString) -> Self {
        Self { ok: false, error: Some(reason.to_string()), mode: None, status: None }
    }
}

/// A request on its way to the cycle, and where its answer goes.
#[derive(Debug)]
pub(super) struct Pending {
    pub(super) request: Request,
    pub(super) answer: oneshot::Sender<Result<Mode, Refused>>,
}

/// Where a node listens unless told otherwise.
pub(super) fn default_socket() -> PathBuf {
    let runtime = std::env::var_os("RUNTIME_DIRECTORY").map(PathBuf::from);
    let user = || std::env::var_os("XDG_RUNTIME_DIR").map(|folder| Path::new(&folder).join("frhc"));
    runtime.or_else(user).unwrap_or_else(|| PathBuf::from("/run/frhc")).join("node.sock")
}

/// The socket, removed when dropped.
#[derive(Debug)]
pub(super) struct Socket {
    path: PathBuf,
    listener: UnixListener,
}

impl Socket {
    /// Listens at `path`, for this user and group only. A socket that nobody answers is replaced.
    pub(super) async fn bind(path: PathBuf) -> io::Result<Self> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        if UnixStream::connect(&path).await.is_ok() {
            return Err(io::Error::new(io::ErrorKind::AddrInUse, "another node listens here"));
        }
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            Ok(()) | Err(_) => {}
        }
        let listener = UnixListener::bind(&path)?;
        fs::set_permissions(&path, fs::Permissions::from_mode(0o660))?;
        Ok(Self { path, listener })
    }

    /// Serves clients one after the other, for ever.
    pub(super) async fn serve(&self, requests: mpsc::Sender<Pending>, latest: &Latest) {
        loop {
            let Ok((stream, _)) = self.listener.accept().await else { continue };
            let served = converse(stream, &requests, latest).await;
            if let Err(error) = served {
                tracing::debug!(%error, "console client left");
            }
        }
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        if let Err(error) = fs::remove_file(&self.path) {
            tracing::debug!(%error, "control socket not removed");
        }
    }
}

/// Answers one client's lines until it hangs up or says something too long.
async fn converse(
    stream: UnixStream,
    requests: &mpsc::Sender<Pending>,
    latest: &Latest,
) -> io::Result<()> {
    let (read, mut write) = stream.into_split();
    let mut read = BufReader::new(read);
    let mut line = String::new();
    loop {
        line.clear();
        let length = (&mut read).take(LONGEST_LINE).read_line(&mut line).await?;
        if length == 0 {
            return Ok(());
        }
        let answer = match serde_json::from_str::<Question>(&line) {
            Ok(question) => answer(question.ask, requests, latest).await,
            Err(error) => Answer::refused(&format!("not understood: {error}")),
        };
        let mut text = serde_json::to_string(&answer)?;
        text.push('\n');
        write.write_all(text.as_bytes()).await?;
    }
}

async fn answer(ask: Ask, requests: &mpsc::Sender<Pending>, latest: &Latest) -> Answer {
    let request = match ask {
        Ask::Status => return status(latest),
        Ask::Arm => Request::Arm,
        Ask::Disarm => Request::Disarm,
        Ask::Reset => Request::Reset,
        Ask::Rate => Request::Command(CommandMode::Rate),
        Ask::Pose => Request::Command(CommandMode::Pose),
    };
    let (answer, answered) = oneshot::channel();
    if requests.try_send(Pending { request, answer }).is_err() {
        return Answer::refused(&"the node is busy");
    }
    match answered.await {
        Ok(Ok(mode)) => Answer { ok: true, error: None, mode: Some(mode.name()), status: None },
        Ok(Err(refused)) => Answer::refused(&refused),
        Err(_) => Answer::refused(&"the node has stopped"),
    }
}

fn status(latest: &Latest) -> Answer {
    match latest.get() {
        Some(status) => {
            Answer { ok: true, error: None, mode: Some(status.mode), status: Some(status) }
        }
        None => Answer::refused(&"the node is still booting"),
    }
}
