//! Server of the page of a running node. No part of a request is passed on to the node.

mod assets;
mod connections;
mod guard;
mod hub;
mod stream;

#[cfg(test)]
mod tests;

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use axum::Router;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::oneshot;

use crate::feed::FeedReader;
use crate::server::connections::BoundedListener;
use crate::server::guard::{Guard, Refusal};
use crate::server::hub::Hub;
use crate::server::stream::EventStream;

/// Reason of a refused stream, which the page shows.
const NO_SEAT: &str = "64 pages look at this node already: close one of them.";

/// Server that is bound to its address, but does not answer yet.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    sockets: Vec<PathBuf>,
}

/// Server on its own thread, which ends on drop.
#[derive(Debug)]
pub struct Running {
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    _reader: FeedReader,
}

impl Server {
    /// Takes the address. The node is read at the first of these sockets on which one listens.
    ///
    /// # Errors
    /// Returns an error if the address cannot be used: another program has it, for example.
    pub fn bind(listen: SocketAddr, sockets: Vec<PathBuf>) -> io::Result<Self> {
        let listener = TcpListener::bind(listen)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        Ok(Self { listener, address, sockets })
    }

    /// Returns the address, with the port that the system has chosen where 0 was given.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Starts to read the node and to answer browsers.
    ///
    /// # Errors
    /// Returns an error if a thread cannot be started.
    pub fn start(self) -> io::Result<Running> {
        let hub = Arc::new(Hub::default());
        let runtime = Builder::new_current_thread().enable_io().enable_time().build()?;
        let listener = {
            let _entered = runtime.enter();
            BoundedListener::new(tokio::net::TcpListener::from_std(self.listener)?)
        };
        let router = router(Guard::new(self.address), Arc::clone(&hub));
        let reader = FeedReader::start(self.sockets, move |news| hub.publish(&news))?;
        let (stop, stopped) = oneshot::channel();
        let serve = move || serve(&runtime, listener, router, stopped);
        let thread = thread::Builder::new().name("frhc-view".to_owned()).spawn(serve)?;
        Ok(Running { stop: Some(stop), thread: Some(thread), _reader: reader })
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.take();
        if let Some(thread) = self.thread.take() {
            thread.join().ok();
        }
    }
}

/// Answers until the sender of `stopped` is dropped; streams end with the runtime.
fn serve(
    runtime: &Runtime,
    listener: BoundedListener,
    router: Router,
    stopped: oneshot::Receiver<()>,
) {
    runtime.block_on(async {
        tokio::select! {
            _ = axum::serve(listener, router) => {}
            _ = stopped => {}
        }
    });
}

fn router(guard: Guard, hub: Arc<Hub>) -> Router {
    let mut router = Router::new().route("/feed", get(feed));
    for asset in assets::ASSETS {
        let answer =
            move || async move { ([(header::CONTENT_TYPE, asset.content_type)], asset.text) };
        router = router.route(asset.path, get(answer));
    }
    let router = router.fallback(|| async { (StatusCode::NOT_FOUND, "There is no such file.") });
    router.with_state(hub).layer(middleware::from_fn_with_state(guard, guarded))
}

/// Answers what [`Guard`] admits, and adds the headers of every response. A connection carries one request.
async fn guarded(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    let (parts, _) = request.into_parts();
    let mut response = match guard.refusal(&parts) {
        Some(Refusal(status, reason)) => (status, reason).into_response(),
        None => next.run(Request::from_parts(parts, Body::empty())).await,
    };
    if response.status() == StatusCode::METHOD_NOT_ALLOWED {
        response.headers_mut().insert(header::ALLOW, HeaderValue::from_static("GET, HEAD"));
    }
    guard::add_headers(response.headers_mut());
    response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    response
}

async fn feed(State(hub): State<Arc<Hub>>) -> Response {
    match hub.seat() {
        Some(seat) => {
            let content = [(header::CONTENT_TYPE, "text/event-stream")];
            (content, Body::new(EventStream::new(seat))).into_response()
        }
        None => (StatusCode::SERVICE_UNAVAILABLE, NO_SEAT).into_response(),
    }
}
