//! Channel from the robot's thread to the main thread, which logs and prints.

use tokio::sync::mpsc;

use crate::robot::narrator::Event;
use crate::robot::report::Report;

/// Capacity of the channel, in messages; further ones are dropped.
const MAX_MESSAGES: usize = 64;

/// Message from the robot's thread.
#[derive(Debug)]
pub(super) enum Message {
    /// Line for the log.
    Event(Event),
    /// Requested status.
    Report(Box<Report>),
}

/// Sender of the robot's thread.
#[derive(Debug)]
pub(super) struct Outlet(mpsc::Sender<Message>);

impl Outlet {
    /// Creates both ends of the channel.
    pub(super) fn new() -> (Self, mpsc::Receiver<Message>) {
        let (sender, receiver) = mpsc::channel(MAX_MESSAGES);
        (Self(sender), receiver)
    }

    /// Sends an event; drops it if the channel is full.
    pub(super) fn event(&self, event: Event) {
        self.0.try_send(Message::Event(event)).ok();
    }

    /// Sends a status; returns false if the channel is full.
    pub(super) fn report(&self, report: impl FnOnce() -> Report) -> bool {
        let room = self.0.try_reserve();
        room.map(|room| room.send(Message::Report(Box::new(report())))).is_ok()
    }
}
