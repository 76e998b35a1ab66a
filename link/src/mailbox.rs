//! Newest message of each topic, between the thread that reads the local socket and the thread that publishes. Neither waits
//! for the other, and a message that was not taken is replaced.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use contract::Echo;

use crate::role::Topic;

/// Message to publish.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Outgoing {
    /// Topic of the message.
    pub(crate) topic: Topic,
    /// Session and number of the message.
    pub(crate) own: Echo,
    /// Complete message.
    pub(crate) bytes: Vec<u8>,
}

/// Waiting messages, at most one of each topic.
#[derive(Debug, Default)]
pub(crate) struct Mailbox {
    waiting: Mutex<Vec<Outgoing>>,
    is_new: Condvar,
}

impl Mailbox {
    /// Stores a message as the newest of its topic; returns whether it replaced one.
    pub(crate) fn offer(&self, message: Outgoing) -> bool {
        let mut waiting = self.lock();
        let before = waiting.len();
        waiting.retain(|one| one.topic != message.topic);
        let is_replaced = waiting.len() < before;
        waiting.push(message);
        self.is_new.notify_one();
        is_replaced
    }

    /// Takes the waiting messages; waits for one, for at most `span`.
    pub(crate) fn take(&self, span: Duration) -> Vec<Outgoing> {
        let waiting = self.lock();
        let waited = self.is_new.wait_timeout_while(waiting, span, |waiting| waiting.is_empty());
        let (mut waiting, _) = waited.unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut waiting)
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Outgoing>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn newest_message_of_each_topic_waits() {
        let message = |topic, sequence| Outgoing {
            topic,
            own: Echo { session: 1, sequence },
            bytes: vec![1, 2],
        };
        let mailbox = Mailbox::default();
        assert!(!mailbox.offer(message(Topic::Feedback, 1)));
        assert!(!mailbox.offer(message(Topic::Capability, 2)));
        assert!(mailbox.offer(message(Topic::Feedback, 3)));
        let taken = mailbox.take(Duration::ZERO);
        assert_eq!(taken, [message(Topic::Capability, 2), message(Topic::Feedback, 3)]);
        assert!(mailbox.take(Duration::ZERO).is_empty());
    }
}
