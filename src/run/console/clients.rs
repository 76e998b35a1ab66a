//! One task per client, so that a client that stays connected, does not read or sends half a line does not delay others.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader, Interest};
use tokio::net::UnixStream;
use tokio::net::unix::{ReadHalf, WriteHalf};
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::{sleep, timeout};

use crate::console::request_handler::RequestHandler;
use crate::console::{ConsoleCommand, RequestLine, Response, Socket};

/// Maximum number of clients. A further connection closes the client that has been idle longest.
const MAX_CLIENTS: usize = 16;

/// Maximum length of a request, in bytes.
const MAX_LINE: u64 = 1_024;

/// Time allowed for a line after its first byte, and for writing a response.
const LINE_TIMEOUT: Duration = Duration::from_secs(1);

/// Pause after a failed accept, for example when file descriptors are exhausted.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Interval of the check whether a client that waits for its response has disconnected.
const HANG_UP_POLL: Duration = Duration::from_millis(10);

impl Socket {
    /// Serves clients; never returns.
    pub(crate) async fn serve(&self, handler: &Arc<RequestHandler>) {
        let mut clients = Clients::default();
        let mut is_failing = false;
        loop {
            match self.listener.accept().await {
                Ok((stream, _)) => {
                    is_failing = false;
                    clients.admit(stream, handler);
                    // Lets its task read a request before the next connection may close it.
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

/// Activity of a client, by which the one to close is chosen.
#[derive(Debug, Default)]
struct Activity {
    /// True from the first byte of a request to the end of its response.
    is_busy: AtomicBool,
    /// True from the receipt of a disarm to the end of its response.
    is_disarming: AtomicBool,
    /// Time at which the client became idle, in µs of the bus clock.
    idle_since: AtomicU64,
}

impl Clients {
    fn admit(&mut self, stream: UnixStream, handler: &Arc<RequestHandler>) {
        while self.tasks.try_join_next().is_some() {}
        self.open.retain(|client| !client.task.is_finished());
        if self.open.len() >= MAX_CLIENTS {
            self.close_one();
        }
        let activity = Arc::new(Activity::default());
        let (handler, seen) = (Arc::clone(handler), Arc::clone(&activity));
        let task = self.tasks.spawn(async move {
            if let Err(error) = converse(stream, &handler, &seen).await {
                tracing::debug!(%error, "console client left");
            }
        });
        self.open.push(Client { task, activity });
    }

    /// Closes the client that has been idle longest; if all are busy, the one that has been busy longest. A client that
    /// disarms, which takes little more than a second, is closed only if all clients disarm.
    fn close_one(&mut self) {
        let rank = |(_, client): &(usize, &Client)| {
            let Activity { is_busy, is_disarming, idle_since } = &*client.activity;
            let [disarms, is_busy] = [is_disarming, is_busy].map(|it| it.load(Ordering::Relaxed));
            (disarms, is_busy, idle_since.load(Ordering::Relaxed))
        };
        let oldest = self.open.iter().enumerate().min_by_key(rank).map(|(place, _)| place);
        if let Some(place) = oldest {
            self.open.remove(place).task.abort();
        }
    }
}

/// Answers a client's requests until it disconnects, sends a line that is too long, or exceeds a timeout.
async fn converse(
    mut stream: UnixStream,
    handler: &Arc<RequestHandler>,
    activity: &Activity,
) -> io::Result<()> {
    let uid = stream.peer_cred().ok().map(|peer| peer.uid());
    let (read, mut write) = stream.split();
    let mut read = BufReader::new(read);
    loop {
        activity.idle_since.store(handler.now().as_micros(), Ordering::Relaxed);
        activity.is_busy.store(false, Ordering::Relaxed);
        activity.is_disarming.store(false, Ordering::Relaxed);
        if read.fill_buf().await?.is_empty() {
            return Ok(());
        }
        activity.is_busy.store(true, Ordering::Relaxed);
        let line = timeout(LINE_TIMEOUT, line(&mut read)).await??;
        let answer = match serde_json::from_str::<RequestLine>(&line) {
            // Executed even if the client disconnects.
            Ok(RequestLine { ask: ConsoleCommand::Disarm }) => {
                activity.is_disarming.store(true, Ordering::Relaxed);
                handler.disarm(uid).await
            }
            Ok(RequestLine { ask }) => tokio::select! {
                // Polls the connection first: nothing is executed for a disconnected client.
                biased;
                error = hang_up(&write) => return Err(error),
                answer = handler.answer(ask, uid) => answer,
            },
            Err(error) => Response::refused(&format!("invalid request: {error}")),
        };
        let mut text = serde_json::to_string(&answer)?;
        text.push('\n');
        timeout(LINE_TIMEOUT, write.write_all(text.as_bytes())).await??;
    }
}

/// Reads one request, up to the end of the line or of the stream.
async fn line(read: &mut BufReader<ReadHalf<'_>>) -> io::Result<String> {
    let mut line = String::new();
    read.take(MAX_LINE).read_line(&mut line).await?;
    if u64::try_from(line.len()).is_ok_and(|length| length < MAX_LINE) {
        Ok(line)
    } else {
        Err(io::Error::new(io::ErrorKind::InvalidData, "request too long"))
    }
}

/// Waits until the client has closed the connection. A client that only shut down its sending side may still wait for a
/// response.
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
    use std::path::PathBuf;

    use super::*;
    use crate::console::request_queue::{RequestReceiver, channel};
    use crate::latest_status::LatestStatus;
    use crate::scratch::any_record;
    use node::push::Push;
    use node::record::{Mode, Record};
    use node::{BringUpError, Request, RequestError};
    use telemetry::losses::Losses;
    use units::time::Instant;

    /// Console without a node, in a separate folder.
    struct Bench {
        folder: PathBuf,
        handler: Arc<RequestHandler>,
        socket: Socket,
    }

    /// Time on the bus; constant.
    const NOW: Instant = Instant::from_micros(1_000_000);

    /// Time in which a disarm is answered.
    const LIMIT: Duration = Duration::from_millis(100);

    fn run<T: Future<Output = ()>>(name: &str, test: impl FnOnce(PathBuf, RequestReceiver) -> T) {
        run_with(name, |path, receiver, _latest| test(path, receiver));
    }

    /// Runs `test` beside a console, with paused time: timers expire as soon as no task can proceed.
    fn run_with<T: Future<Output = ()>>(
        name: &str,
        test: impl FnOnce(PathBuf, RequestReceiver, LatestStatus) -> T,
    ) {
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        runtime.enable_all().start_paused(true).build().unwrap().block_on(async {
            let folder = crate::scratch::path(name);
            let path = folder.join("node.sock");
            let (sender, mut receiver) = channel();
            receiver.end_boot(Instant::ZERO);
            let latest = LatestStatus::default();
            let handler =
                Arc::new(RequestHandler::new(sender, latest.clone(), || NOW, None, LIMIT));
            let bench = Bench { socket: Socket::bind(path.clone()).unwrap(), folder, handler };
            tokio::select! {
                () = bench.socket.serve(&bench.handler) => {}
                () = test(path, receiver, latest) => {}
            }
            drop(bench.socket);
            fs::remove_dir_all(&bench.folder).unwrap();
        });
    }

    async fn connect(path: &PathBuf) -> UnixStream {
        UnixStream::connect(path).await.unwrap()
    }

    async fn send(path: &PathBuf, text: &str) -> UnixStream {
        let mut client = connect(path).await;
        client.write_all(text.as_bytes()).await.unwrap();
        client
    }

    async fn answer(client: &mut UnixStream) -> String {
        let mut line = String::new();
        BufReader::new(client).read_line(&mut line).await.unwrap();
        line
    }

    /// Completes every disarm, as the cycle does.
    async fn complete_disarms(receiver: &RequestReceiver) {
        loop {
            if let Some(disarm) = receiver.pending_disarm() {
                receiver.complete_disarm(disarm, Mode::Ready);
            }
            sleep(Duration::from_millis(1)).await;
        }
    }

    const DISARM: &str = "{\"ask\":\"disarm\"}\n";
    const ARM: &str = "{\"ask\":\"arm\"}\n";
    const STATUS: &str = "{\"ask\":\"status\"}\n";

    #[test]
    fn disarm_is_executed_beside_clients_that_block_the_console() {
        run("held", |path, receiver| async move {
            let mut others = Vec::new();
            for number in 0..3 * MAX_CLIENTS {
                let client = match number % 4 {
                    0 => connect(&path).await,
                    1 => send(&path, "{\"ask").await,
                    2 => send(&path, ARM).await,
                    _ => send(&path, &STATUS.repeat(1_000)).await,
                };
                others.push(client);
            }
            let asks = async {
                let mut client = send(&path, DISARM).await;
                assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"ready\"}\n");
            };
            tokio::select! {
                () = asks => {}
                () = complete_disarms(&receiver) => {}
            }
        });
    }

    #[test]
    fn hazard_30_disarm_is_answered_beside_a_flood_of_connections() {
        run("flooded", |path, receiver| async move {
            let mut disarming = send(&path, DISARM).await;
            // Lets the server read it.
            sleep(Duration::from_millis(1)).await;
            let mut others = Vec::new();
            for _ in 0..5 * MAX_CLIENTS {
                // They wait for the cycle, and so are busy as well.
                others.push(send(&path, ARM).await);
                sleep(Duration::from_millis(1)).await;
            }
            let disarm = receiver.pending_disarm().unwrap();
            receiver.complete_disarm(disarm, Mode::Ready);
            assert_eq!(answer(&mut disarming).await, "{\"ok\":true,\"mode\":\"ready\"}\n");
        });
    }

    #[test]
    fn client_that_sends_half_a_line_is_closed() {
        run("half", |path, _inbox| async move {
            let mut client = send(&path, "{\"ask").await;
            assert_eq!(answer(&mut client).await, "", "closed, without an answer");
        });
    }

    #[test]
    fn client_that_does_not_read_is_closed() {
        run("unread", |path, _inbox| async move {
            let mut client = connect(&path).await;
            let question = STATUS.repeat(100);
            // Blocks when the buffers are full, and fails when the server closes the connection.
            while client.write_all(question.as_bytes()).await.is_ok() {}
        });
    }

    #[test]
    fn seventeenth_client_takes_the_place_of_the_idlest() {
        run("places", |path, _inbox| async move {
            let mut clients = Vec::new();
            for _ in 0..=MAX_CLIENTS {
                clients.push(connect(&path).await);
                // Lets the server accept it.
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
    fn request_of_a_disconnected_client_is_not_executed() {
        run("left", |path, mut receiver| async move {
            drop(send(&path, ARM).await);
            sleep(Duration::from_millis(100)).await;
            assert!(receiver.next(Instant::ZERO).is_none());
            let waits = send(&path, ARM).await;
            sleep(Duration::from_millis(100)).await;
            drop(waits);
            sleep(Duration::from_millis(100)).await;
            assert!(receiver.next(Instant::ZERO).is_none());
        });
    }

    #[test]
    fn disarm_of_a_disconnected_client_is_executed() {
        run("left-disarmed", |path, receiver| async move {
            drop(send(&path, DISARM).await);
            sleep(Duration::from_millis(100)).await;
            assert!(receiver.pending_disarm().is_some());
        });
    }

    #[test]
    fn status_after_a_response_shows_the_granted_mode() {
        run_with("shown", |path, mut receiver, latest| async move {
            let record = any_record();
            let set = |at, mode| latest.set(&Record { at, mode, ..record }, 0, Losses::default());
            set(Instant::ZERO, Mode::Ready);
            let mut client = send(&path, ARM).await;
            sleep(Duration::from_millis(100)).await;
            receiver.next(NOW).unwrap().answer(Ok(Mode::Armed));
            // The recorder thread is some cycles behind.
            sleep(Duration::from_millis(5)).await;
            set(NOW, Mode::Armed);
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"armed\"}\n");
            client.write_all(STATUS.as_bytes()).await.unwrap();
            assert!(answer(&mut client).await.starts_with("{\"ok\":true,\"mode\":\"armed\""));
        });
    }

    #[test]
    fn disarm_is_answered_after_its_ramp() {
        run_with("ramp", |path, receiver, latest| async move {
            let record = any_record();
            let set = |at, mode| latest.set(&Record { at, mode, ..record }, 0, Losses::default());
            set(NOW, Mode::Engaged);
            let mut client = send(&path, DISARM).await;
            sleep(Duration::from_millis(5)).await;
            receiver.complete_disarm(receiver.pending_disarm().unwrap(), Mode::Armed);
            sleep(Duration::from_millis(50)).await;
            set(NOW, Mode::Ready);
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"ready\"}\n");
            // A disarm whose ramp never ends is answered, too.
            set(NOW, Mode::Armed);
            client.write_all(DISARM.as_bytes()).await.unwrap();
            sleep(Duration::from_millis(5)).await;
            receiver.complete_disarm(receiver.pending_disarm().unwrap(), Mode::Armed);
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"armed\"}\n");
        });
    }

    #[test]
    fn client_that_waits_for_its_disarm_delays_no_other() {
        run_with("waits", |path, receiver, latest| async move {
            let record = any_record();
            let set = |push| {
                let record = Record { at: NOW, mode: Mode::Ready, pushes: [push; 6], ..record };
                latest.set(&record, 0, Losses::default());
            };
            set(Push::Unknown);
            let mut waits = send(&path, DISARM).await;
            let left = send(&path, DISARM).await;
            sleep(Duration::from_millis(5)).await;
            receiver.complete_disarm(receiver.pending_disarm().unwrap(), Mode::Ready);
            drop(left);
            let mut client = send(&path, STATUS).await;
            let status = timeout(Duration::from_millis(5), answer(&mut client)).await.unwrap();
            assert!(status.starts_with("{\"ok\":true,\"mode\":\"ready\""), "{status}");
            let answered = answer(&mut waits).await;
            assert!(answered.starts_with("{\"ok\":false,\"error\":\"ready, but joint 1 may push"));
            assert!(
                answered.contains("\"mode\":\"ready\",\"may_push\":[1,2,3,4,5,6]"),
                "{answered}"
            );
        });
    }

    #[test]
    fn client_that_shut_down_sending_gets_its_response() {
        run("half-closed", |path, mut receiver| async move {
            let mut client = send(&path, ARM).await;
            client.shutdown().await.unwrap();
            sleep(Duration::from_millis(100)).await;
            receiver.next(Instant::ZERO).unwrap().answer(Ok(Mode::Armed));
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"armed\"}\n");
        });
    }

    #[test]
    fn request_without_an_answer_is_withdrawn_after_a_second() {
        run("unanswered", |path, mut receiver| async move {
            let mut client = send(&path, ARM).await;
            assert!(answer(&mut client).await.contains("within 1 s: the request is withdrawn"));
            assert!(receiver.next(Instant::ZERO).is_none());
        });
    }

    #[test]
    fn failed_reset_is_in_the_status_after_its_client_left() {
        run("reset", |path, mut receiver| async move {
            let client = send(&path, "{\"ask\":\"reset\"}\n").await;
            sleep(Duration::from_millis(100)).await;
            let accepted = receiver.next(Instant::ZERO).unwrap();
            assert_eq!(accepted.request, Request::Reset);
            drop(client);
            sleep(Duration::from_millis(100)).await;
            accepted.answer(Err(RequestError::Boot(BringUpError::GivenUp)));
            sleep(Duration::from_millis(100)).await;
            let mut client = send(&path, STATUS).await;
            let status = answer(&mut client).await;
            let note = "the last reset failed: boot given up";
            assert!(status.contains(note), "{status}");
        });
    }

    #[test]
    fn booting_node_reports_boot_and_refuses_to_arm() {
        run("boots", |path, receiver| async move {
            receiver.begin_boot();
            let mut client = send(&path, STATUS).await;
            assert_eq!(answer(&mut client).await, "{\"ok\":true,\"mode\":\"boot\"}\n");
            let mut client = send(&path, ARM).await;
            assert!(answer(&mut client).await.contains("the node is booting"));
        });
    }
}
