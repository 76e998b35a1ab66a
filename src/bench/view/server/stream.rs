//! Feed as the body of a response that does not end: Server-Sent Events.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::pin::Pin;
use std::task::{Context, Poll};

use axum::body::Bytes;
use http_body::{Body, Frame};

use crate::server::hub::Seat;

/// Events of one viewer.
#[derive(Debug)]
pub(super) struct EventStream {
    seat: Seat,
    /// Events taken from the hub and not yet sent.
    pending: VecDeque<Bytes>,
}

impl EventStream {
    pub(super) fn new(seat: Seat) -> Self {
        Self { seat, pending: VecDeque::new() }
    }
}

impl Body for EventStream {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        if self.pending.is_empty() {
            self.pending = self.seat.take(context.waker());
        }
        match self.pending.pop_front() {
            Some(text) => Poll::Ready(Some(Ok(Frame::data(text)))),
            None => Poll::Pending,
        }
    }
}
