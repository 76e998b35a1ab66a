//! A task for each client, so that none waits for another: not for one that keeps its connection, does not read, or
//! sends half a line.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering;
use std::time::Duration;

use tokio::io::AsyncBufReadExt;
use tokio::io::AsyncReadExt;
use tokio::io::AsyncWriteExt;
use tokio::io::BufReader;
use tokio::io::Interest;
use tokio::net::UnixStream;
use tokio::net::unix::ReadHalf;
use tokio::net::unix::WriteHalf;
use tokio::task::AbortHandle;
use tokio::task::JoinSet;
use tokio::time::sleep;
use tokio::time::timeout;

use crate::console::Answer;
use crate::console::Ask;
use crate::console::Question;
use crate::console::Socket;
use crate::console::desk::Desk;

/// Clients at once. For one more the one that has been idle longest is closed.
const MAX_CLIENTS: usize = 16;

/// Bytes of a request.
const MAX_LINE: u64 = 1_024;

/// Time for a line to be complete after its first byte, and for an answer to be taken.
const LINE_TIMEOUT: Duration = Duration::from_secs(1);

/// Pause after a connection that could not be accepted, such as for want of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Interval at which a client that waits for its answer is looked after.
const HANG_UP_POLL: Duration = Duration::from_millis(10);

impl Socket {
    /// Serves clients for ever.
    pub(crate) async fn serve(&self, desk: &Arc<Desk>) {
        let mut clients = Clients::default();
        let mut is_failing = false;
        loop {
            match self.listener.accept().await {
                Ok((stream, _)) => {
                    is_failing = false;
                    clients.admit(stream, desk);
                    // What it has to say is read before the next one may take its place.
                    tokio::task::yield_now().await;
                }
                Err(error) => {
                    if !std::mem::replace(&mut is_failing, true) {
                        tracing::warn!(%error, "console: a client could not be accepted");
                    }
                    clients.close_one();
                    sleep(ACCEPT_PAUSE).await;
                }
            }
        }
    }
}

/// Connected clients.
#[derive(Debug, Default)]
struct Clients {
    tasks: JoinSet<()>,
    open: Vec<Client>,
}

#[derive(Debug)]
struct Client {
    task: AbortHandle,
    activity: Arc<Activity>,
}

/// State of a client, for the choice of the one to close.
#[derive(Debug, Default)]
struct Activity {
    /// From the first byte of a request to the end of its answer.
    is_busy: AtomicBool,
    /// When it last began to wait for a request, in µs of the bus's clock.
    idle_since: AtomicU64,
}

impl Clients {
    fn admit(&mut self, stream: UnixStream, desk: &Arc<Desk>) {
        while self.tasks.try_join_next().is_some() {}
        self.open.retain(|client| !client.task.is_finished());
        if self.open.len() >= MAX_CLIENTS {
            self.close_one();
        }
        let activity = Arc::new(Activity::default());
        let (desk, seen) = (Arc::clone(desk), Arc::clone(&activity));
        let task = self.tasks.spawn(async move {
            if let Err(error) = converse(stream, &desk, &seen).await {
                tracing::debug!(%error, "console client left");
            }
        });
        self.open.push(Client { task, activity });
    }

    /// Closes the client that has been idle longest; if none is idle, the one that has been busy longest.
    fn close_one(&mut self) {
        let rank = |(_, client): &(usize, &Client)| {
            let Activity { is_busy, idle_since } = &*client.activity;
            (is_busy.load(Ordering::Relaxed), idle_since.load(Ordering::Relaxed))
        };
        let oldest = self.open.iter().enumerate().min_by_key(rank).map(|(place, _)| place);
        if let Some(place) = oldest {
            self.open.remove(place).task.abort();
        }
    }
}

/// Answers a client's lines until it hangs up, sends one that is too long, or takes too long.
async fn converse(mut stream: UnixStream, desk: &Arc<Desk>, activity: &Activity) -> io::Result<()> {
    let uid = stream.peer_cred().ok().map(|peer| peer.uid());
    let (read, mut write) = stream.split();
    let mut read = BufReader::new(read);
    loop {
        activity.idle_since.store(desk.now().as_micros(), Ordering::Relaxed);
        activity.is_busy.store(false, Ordering::Relaxed);
        if read.fill_buf().await?.is_empty() {
            return Ok(());
        }
        activity.is_busy.store(true, Ordering::Relaxed);
        let line = timeout(LINE_TIMEOUT, line(&mut read)).await??;
        let answer = match serde_json::from_str::<Question>(&line) {
            // It is done even for a client that has left.
            Ok(Question { ask: Ask::Disarm }) => desk.disarm(uid).await,
            Ok(Question { ask }) => tokio::select! {
                // A client that has left is noticed before anything is done for it.
                biased;
                error = hang_up(&write) => return Err(error),
                answer = desk.answer(ask, uid) => answer,
            },
            Err(error) => Answer::refused(&format!("not understood: {error}")),
        };
        let mut text = serde_json::to_string(&answer)?;
        text.push('\n');
        timeout(LINE_TIMEOUT, write.write_all(text.as_bytes())).await??;
    }
}

/// One request, up to the end of its line or of what the client sends.
async fn line(read: &mut BufReader<ReadHalf<'_>>) -> io::Result<String> {
    let mut line = String::new();
    read.take(MAX_LINE).read_line(&mut line).await?;
    if u64::try_from(line.len()).is_ok_and(|length| length < MAX_LINE) {
        Ok(line)
    } else {
        Err(io::Error::new(io::ErrorKind::InvalidData, "a request is too long"))
    }
}

/// Waits until the client has closed its end. One that only sends no more may still wait for its answer.
async fn hang_up(write: &WriteHalf<'_>) -> io::Error {
    loop {
        match write.ready(Interest::WRITABLE).await {
            Ok(ready) if !ready.is_write_closed() => {}
            Ok(_) => return io::Error::from(io::ErrorKind::BrokenPipe),
            Err(error) => return error,
        }
        sleep(HANG_UP_POLL).await;
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::future::Future;
    use std::path::Path;
    use std::path::PathBuf;

    use super::*;
    use crate::console::Inbox;
    use crate::console::channel;
    use crate::recorder::Latest;
    use config::Config;
    use lab::bench;
    use node::Refused;
    use node::Request;
    use node::record::Mode;
    use node::record::Record;
    use node::safety::Refusal;
    use sim::scenario::Scenario;
    use telemetry::losses::Losses;
    use telemetry::status::Status;
    use units::time::Instant;

    /// A console without a node, in a folder of this test alone.
    struct Bench {
        folder: PathBuf,
        desk: Arc<Desk>,
        socket: Socket,
    }

    /// The time on the bus, which stands still.
    const NOW: Instant = Instant::from_micros(1_000_000);

    fn run<T: Future<Output = ()>>(name: &str, test: impl FnOnce(PathBuf, Inbox) -> T) {
        run_with(name, |path, inbox, _latest| test(path, inbox));
    }

    /// Runs `test` beside a console, in a runtime whose timers end as soon as nothing else can happen.
    fn run_with<T: Future<Output = ()>>(
        name: &str,
        test: impl FnOnce(PathBuf, Inbox, Latest) -> T,
    ) {
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        runtime.enable_all().start_paused(true).build().unwrap().block_on(async {
            let folder = crate::scratch::path(name);
            let path = folder.join("node.sock");
            let (requests, mut inbox) = channel();
            inbox.booted(Instant::ZERO);
            let latest = Latest::default();
            let desk = Arc::new(Desk::new(requests, latest.clone(), || NOW, None));
            let bench = Bench { socket: Socket::bind(path.clone()).await.unwrap(), folder, desk };
            tokio::select! {
                () = bench.socket.serve(&bench.desk) => {}
                () = test(path, inbox, latest) => {}
            }
            drop(bench.socket);
            fs::remove_dir_all(&bench.folder).unwrap();
        });
    }

    /// The first cycle of a node that has not booted.
    fn any_record() -> Record {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        bench::Bench::new(&config, Scenario::parse("seconds = 1").unwrap(), 1, false, ()).cycle()
    }

    async fn connect(path: &PathBuf) -> UnixStream {
        UnixStream::connect(path).await.unwrap()
    }

    async fn says(path: &PathBuf, text: &str) -> UnixStream {
        let mut client = connect(path).await;
        client.write_all(text.as_bytes()).await.unwrap();
        client
    }

    async fn answer(client: &mut UnixStream) -> String {
        let mut line = String::new();
        BufReader::new(client).read_line(&mut line).await.unwrap();
        line
    }

    /// Grants every disarm, as cycles do.
    async fn disarms(inbox: &Inbox) {
        loop {
            if let Some(disarm) = inbox.disarm() {
                inbox.disarmed(disarm, Mode::Ready);
            }
            sleep(Duration::from_millis(1)).await;
        }
    }

    const DISARM: &str = "{\"ask\":\"disarm\"}\n";
    const ARM: &str = "{\"ask\":\"arm\"}\n";
    const STATUS: &str = "{\"ask\":\"status\"}\n";

    #[test]
    fn disarm_is_granted_beside_clients_that_hold_the_console() {
        run("held", |path, inbox| async move {
            let mut others = Vec::new();
            for number in 0..3 * MAX_CLIENTS {
                let client = match number % 4 {
                    0 => connect(&path).await,
                    1 => says(&path, "{\"ask").await,
                    2 => says(&path, ARM).await,
                    _ => says(&path, &STATUS.repeat(1_000)).await,
                };
                others.push(client);
            }
            let asks = async {
                let mut client = says(&path, DISARM).await;
                assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"ready\"}\n");
            };
            tokio::select! {
                () = asks => {}
                () = disarms(&inbox) => {}
            }
        });
    }

    #[test]
    fn client_that_holds_half_a_line_is_closed() {
        run("half", |path, _inbox| async move {
            let mut client = says(&path, "{\"ask").await;
            assert_eq!(answer(&mut client).await, "", "closed, without an answer");
        });
    }

    #[test]
    fn client_that_does_not_read_is_closed() {
        run("unread", |path, _inbox| async move {
            let mut client = connect(&path).await;
            let question = STATUS.repeat(100);
            // Until nothing more is taken, and then until the other end is closed.
            while client.write_all(question.as_bytes()).await.is_ok() {}
        });
    }

    #[test]
    fn seventeenth_client_takes_the_place_of_the_idlest() {
        run("places", |path, _inbox| async move {
            let mut clients = Vec::new();
            for _ in 0..=MAX_CLIENTS {
                clients.push(connect(&path).await);
                // The server has time to take it.
                sleep(Duration::from_millis(1)).await;
            }
            assert_eq!(answer(&mut clients[0]).await, "");
            for client in &mut clients[1..] {
                client.write_all(STATUS.as_bytes()).await.unwrap();
                assert!(answer(client).await.starts_with("{\"ok\":true"));
            }
        });
    }

    #[test]
    fn request_of_a_client_that_left_is_not_done() {
        run("left", |path, mut inbox| async move {
            drop(says(&path, ARM).await);
            sleep(Duration::from_millis(100)).await;
            assert!(inbox.next(Instant::ZERO).is_none());
            let waits = says(&path, ARM).await;
            sleep(Duration::from_millis(100)).await;
            drop(waits);
            sleep(Duration::from_millis(100)).await;
            assert!(inbox.next(Instant::ZERO).is_none());
        });
    }

    #[test]
    fn disarm_of_a_client_that_left_is_done() {
        run("left-disarmed", |path, inbox| async move {
            drop(says(&path, DISARM).await);
            sleep(Duration::from_millis(100)).await;
            assert!(inbox.disarm().is_some());
        });
    }

    #[test]
    fn status_asked_for_after_an_answer_shows_what_was_granted() {
        run_with("shown", |path, mut inbox, latest| async move {
            let record = any_record();
            let of = |mode| Status::of(&Record { mode, ..record }, 0, Losses::default());
            latest.set(Instant::ZERO, of(Mode::Ready));
            let mut client = says(&path, ARM).await;
            sleep(Duration::from_millis(100)).await;
            inbox.next(NOW).unwrap().answer(Ok(Mode::Armed));
            // The recorder is some cycles behind.
            sleep(Duration::from_millis(5)).await;
            latest.set(NOW, of(Mode::Armed));
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"armed\"}\n");
            client.write_all(STATUS.as_bytes()).await.unwrap();
            assert!(answer(&mut client).await.starts_with("{\"ok\":true,\"mode\":\"armed\""));
        });
    }

    #[test]
    fn disarm_is_answered_when_its_ramp_is_over() {
        run_with("ramp", |path, inbox, latest| async move {
            let record = any_record();
            let of = |mode| Status::of(&Record { mode, ..record }, 0, Losses::default());
            latest.set(NOW, of(Mode::Engaged));
            let mut client = says(&path, DISARM).await;
            sleep(Duration::from_millis(5)).await;
            inbox.disarmed(inbox.disarm().unwrap(), Mode::Armed);
            sleep(Duration::from_millis(50)).await;
            latest.set(NOW, of(Mode::Ready));
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"ready\"}\n");
            // One whose ramp is never over is answered, too.
            latest.set(NOW, of(Mode::Armed));
            client.write_all(DISARM.as_bytes()).await.unwrap();
            sleep(Duration::from_millis(5)).await;
            inbox.disarmed(inbox.disarm().unwrap(), Mode::Armed);
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"armed\"}\n");
        });
    }

    #[test]
    fn client_that_sends_no_more_still_gets_its_answer() {
        run("half-closed", |path, mut inbox| async move {
            let mut client = says(&path, ARM).await;
            client.shutdown().await.unwrap();
            sleep(Duration::from_millis(100)).await;
            inbox.next(Instant::ZERO).unwrap().answer(Ok(Mode::Armed));
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"armed\"}\n");
        });
    }

    #[test]
    fn request_without_an_answer_is_withdrawn_after_a_second() {
        run("unanswered", |path, mut inbox| async move {
            let mut client = says(&path, ARM).await;
            assert!(answer(&mut client).await.contains("within 1 s: the request is withdrawn"));
            assert!(inbox.next(Instant::ZERO).is_none());
        });
    }

    #[test]
    fn failed_reset_is_in_the_status_though_its_client_left() {
        run("reset", |path, mut inbox| async move {
            let client = says(&path, "{\"ask\":\"reset\"}\n").await;
            sleep(Duration::from_millis(100)).await;
            let due = inbox.next(Instant::ZERO).unwrap();
            assert_eq!(due.request, Request::Reset);
            drop(client);
            sleep(Duration::from_millis(100)).await;
            due.answer(Err(Refused::Mode(Refusal::NotStopped(Mode::Ready))));
            sleep(Duration::from_millis(100)).await;
            let mut client = says(&path, STATUS).await;
            let status = answer(&mut client).await;
            let note = "the last reset failed: nothing to reset: the node is ready";
            assert!(status.contains(note), "{status}");
        });
    }

    #[test]
    fn node_that_boots_says_so_and_refuses_to_arm() {
        run("boots", |path, inbox| async move {
            inbox.boots();
            let mut client = says(&path, STATUS).await;
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"boot\"}\n");
            let mut client = says(&path, ARM).await;
            assert!(answer(&mut client).await.contains("the node is booting"));
        });
    }
}
