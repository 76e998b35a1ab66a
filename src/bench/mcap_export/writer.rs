//! Messages by topic in an MCAP file, encoded as their topics want.

use std::collections::BTreeMap;
use std::io::Write;

use serde::Serialize;

use crate::ExportError;
use crate::cdr;
use crate::container::Container;
use crate::topics::{Encoding, Topic};

/// MCAP file of topics under construction.
pub(crate) struct Messages<W: Write> {
    file: Container<W>,
    channels: Vec<Channel>,
    buffer: Vec<u8>,
}

/// Channel of the file, and the number of messages in it.
#[derive(Clone, Copy, Debug)]
struct Channel {
    topic: Topic,
    id: u16,
    messages: u32,
}

impl<W: Write> Messages<W> {
    /// Starts a file with the channels of these topics.
    pub(crate) fn new(out: W, topics: impl Iterator<Item = Topic>) -> Result<Self, ExportError> {
        let mut file = Container::new(out, "ros2", concat!("frhc ", env!("CARGO_PKG_VERSION")))?;
        let mut channels = Vec::new();
        for topic in topics {
            let encoding = topic.encoding();
            let (schema_encoding, text, message_encoding) = encoding.schema();
            let schema = file.schema(&encoding.schema_name(), schema_encoding, &text)?;
            let id = file.channel(schema, topic.name(), message_encoding, &metadata(topic))?;
            channels.push(Channel { topic, id, messages: 0 });
        }
        Ok(Self { file, channels, buffer: Vec::new() })
    }

    /// Writes a message of a topic, if the file has it, at a time in ns.
    pub(crate) fn put(
        &mut self,
        topic: Topic,
        nanos: u64,
        message: &impl Serialize,
    ) -> Result<(), ExportError> {
        if self.channels.iter().all(|channel| channel.topic != topic) {
            return Ok(());
        }
        let mut buffer = std::mem::take(&mut self.buffer);
        let encoded = match topic.encoding() {
            Encoding::Cdr { .. } => cdr::encode(&mut buffer, message).map_err(ExportError::from),
            Encoding::Json { .. } => {
                buffer.clear();
                serde_json::to_writer(&mut buffer, message).map_err(ExportError::from)
            }
        };
        let written = encoded.and_then(|()| self.put_bytes(topic, nanos, &buffer));
        self.buffer = buffer;
        written
    }

    /// Writes an encoded message of a topic, at a time in ns.
    pub(crate) fn put_bytes(
        &mut self,
        topic: Topic,
        nanos: u64,
        bytes: &[u8],
    ) -> Result<(), ExportError> {
        let Some(channel) = self.channels.iter_mut().find(|channel| channel.topic == topic) else {
            return Ok(());
        };
        let sequence = channel.messages;
        channel.messages = channel.messages.wrapping_add(1);
        Ok(self.file.message(channel.id, sequence, nanos, bytes)?)
    }

    /// Writes a record of named texts.
    pub(crate) fn put_metadata(
        &mut self,
        name: &str,
        texts: &BTreeMap<String, String>,
    ) -> Result<(), ExportError> {
        Ok(self.file.metadata(name, texts)?)
    }

    /// Writes a file that belongs to the session.
    pub(crate) fn attach(
        &mut self,
        name: &str,
        nanos: u64,
        content: &[u8],
    ) -> Result<(), ExportError> {
        Ok(self.file.attachment(name, "text/plain", nanos, content)?)
    }

    /// Returns the number of messages of a topic.
    pub(crate) fn count(&self, topic: Topic) -> u32 {
        let channel = self.channels.iter().find(|channel| channel.topic == topic);
        channel.map_or(0, |channel| channel.messages)
    }

    /// Writes the summary and the end of the file.
    pub(crate) fn finish(self) -> Result<(), ExportError> {
        Ok(self.file.finish()?)
    }
}

/// Returns what rosbag2 keeps with a channel.
fn metadata(topic: Topic) -> BTreeMap<String, String> {
    const FOR_EVER: &str = "{sec: 9223372036, nsec: 854775807}";
    let durability = topic.durability();
    let profile = format!(
        "- history: 3\n  depth: 0\n  reliability: 1\n  durability: {durability}\n  deadline: {FOR_EVER}\n  \
         lifespan: {FOR_EVER}\n  liveliness: 1\n  liveliness_lease_duration: {FOR_EVER}\n  \
         avoid_ros_namespace_conventions: false"
    );
    BTreeMap::from([("offered_qos_profiles".to_owned(), profile)])
}
