//! MCAP file under construction: header, chunks, attachments, metadata, and the summary with every index.
//!
//! It is written from its start to its end, so that any stream can take it. Memory holds one chunk, and the indexes.

use std::collections::BTreeMap;
use std::io::{self, Write};

use crate::chunk::Chunk;
use crate::record::{CHECKSUM, Fields, MAGIC, Opcode, size};

/// Uncompressed size of a chunk, in bytes. A file of 100 GB then has 100,000 of them, whose index is held in memory.
const CHUNK_SIZE: u64 = 4 << 20;

/// Checksum of the data section so far.
type Digest = crc::Digest<'static, u32, crc::Table<16>>;

/// MCAP file under construction.
pub(crate) struct Container<W: Write> {
    out: W,
    /// Number of bytes written.
    position: u64,
    checksum: Digest,
    chunk: Chunk,
    /// Names of the schemas; the first has number 1.
    schemas: Vec<String>,
    /// Numbers of messages by channel.
    messages: BTreeMap<u16, u64>,
    /// Earliest and latest time of a message, in ns.
    times: Option<(u64, u64)>,
    summary: Summary,
}

/// Groups of records in the summary.
#[derive(Clone, Debug, Default)]
struct Summary {
    schemas: Group,
    channels: Group,
    chunks: Group,
    attachments: Group,
    metadata: Group,
}

/// Records of one kind.
#[derive(Clone, Debug, Default)]
struct Group {
    records: Vec<u8>,
    count: u32,
}

impl Group {
    fn put(&mut self, record: &[u8]) {
        self.records.extend_from_slice(record);
        self.count = self.count.saturating_add(1);
    }
}

impl<W: Write> Container<W> {
    /// Starts a file of a profile, written by a library.
    pub(crate) fn new(out: W, profile: &str, library: &str) -> io::Result<Self> {
        let mut container = Self {
            out,
            position: 0,
            checksum: CHECKSUM.digest(),
            chunk: Chunk::default(),
            schemas: Vec::new(),
            messages: BTreeMap::new(),
            times: None,
            summary: Summary::default(),
        };
        container.write(&MAGIC)?;
        let header = Fields::default().text(profile).text(library);
        container.write(&header.record(Opcode::Header)?)?;
        Ok(container)
    }

    /// Returns the number of the schema of this name, which is added if it is new.
    pub(crate) fn schema(&mut self, name: &str, encoding: &str, content: &str) -> io::Result<u16> {
        let known = self.schemas.iter().position(|known| known == name);
        let number = number(known.unwrap_or(self.schemas.len()) + 1)?;
        if known.is_none() {
            let fields = Fields::default().u16(number).text(name).text(encoding).text(content);
            let record = fields.record(Opcode::Schema)?;
            self.schemas.push(name.to_owned());
            self.chunk.put(&record);
            self.summary.schemas.put(&record);
        }
        Ok(number)
    }

    /// Adds a channel of a topic, whose messages have a schema and an encoding. Returns its number.
    pub(crate) fn channel(
        &mut self,
        schema: u16,
        topic: &str,
        encoding: &str,
        metadata: &BTreeMap<String, String>,
    ) -> io::Result<u16> {
        let number = number(self.messages.len() + 1)?;
        let fields = Fields::default().u16(number).u16(schema).text(topic).text(encoding);
        let record = fields.texts(metadata).record(Opcode::Channel)?;
        self.messages.insert(number, 0);
        self.chunk.put(&record);
        self.summary.channels.put(&record);
        Ok(number)
    }

    /// Writes message `sequence` of a channel, logged and published at a time in ns.
    pub(crate) fn message(
        &mut self,
        channel: u16,
        sequence: u32,
        nanos: u64,
        content: &[u8],
    ) -> io::Result<()> {
        let fields = Fields::default().u16(channel).u32(sequence).u64(nanos).u64(nanos);
        let record = fields.raw(content).record(Opcode::Message)?;
        self.chunk.put_message(channel, nanos, &record);
        *self.messages.entry(channel).or_default() += 1;
        let (first, last) = self.times.unwrap_or((nanos, nanos));
        self.times = Some((first.min(nanos), last.max(nanos)));
        if self.chunk.size() >= CHUNK_SIZE { self.end_chunk() } else { Ok(()) }
    }

    /// Writes a record of named texts.
    pub(crate) fn metadata(
        &mut self,
        name: &str,
        texts: &BTreeMap<String, String>,
    ) -> io::Result<()> {
        let record = Fields::default().text(name).texts(texts).record(Opcode::Metadata)?;
        let index = Fields::default().u64(self.position).u64(size(&record)).text(name);
        self.summary.metadata.put(&index.record(Opcode::MetadataIndex)?);
        self.write(&record)
    }

    /// Attaches a file, logged and created at a time in ns.
    pub(crate) fn attachment(
        &mut self,
        name: &str,
        media_type: &str,
        nanos: u64,
        content: &[u8],
    ) -> io::Result<()> {
        let fields = Fields::default().u64(nanos).u64(nanos).text(name).text(media_type);
        let fields = fields.u64(size(content)).raw(content).checksum();
        let record = fields.record(Opcode::Attachment)?;
        let index = Fields::default().u64(self.position).u64(size(&record)).u64(nanos).u64(nanos);
        let index = index.u64(size(content)).text(name).text(media_type);
        self.summary.attachments.put(&index.record(Opcode::AttachmentIndex)?);
        self.write(&record)
    }

    /// Writes the last chunk, the summary and the end of the file.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        if self.chunk.size() > 0 {
            self.end_chunk()?;
        }
        let data_end = Fields::default().u32(self.checksum.clone().finalize());
        self.write(&data_end.record(Opcode::DataEnd)?)?;
        let end = self.summary()?;
        self.write(&end)?;
        self.write(&MAGIC)?;
        self.out.flush()
    }

    fn end_chunk(&mut self) -> io::Result<()> {
        let chunk = self.chunk.take()?;
        let start = self.position;
        chunk.parts().try_for_each(|part| self.write(part))?;
        self.summary.chunks.put(&chunk.index(start)?);
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.checksum.update(bytes);
        self.position += size(bytes);
        Ok(())
    }

    /// Returns summary section, summary offset section and footer.
    fn summary(&self) -> io::Result<Vec<u8>> {
        let Summary { schemas, channels, chunks, attachments, metadata } = &self.summary;
        let statistics = self.statistics()?;
        let groups = [
            (Opcode::Schema, &schemas.records),
            (Opcode::Channel, &channels.records),
            (Opcode::Statistics, &statistics),
            (Opcode::ChunkIndex, &chunks.records),
            (Opcode::AttachmentIndex, &attachments.records),
            (Opcode::MetadataIndex, &metadata.records),
        ];
        let start = self.position;
        let (mut section, mut offsets) = (Vec::new(), Vec::new());
        for (opcode, records) in groups.into_iter().filter(|(_, records)| !records.is_empty()) {
            let offset = Fields::default().u8(opcode.number()).u64(start + size(&section));
            let offset = offset.u64(size(records)).record(Opcode::SummaryOffset)?;
            section.extend_from_slice(records);
            offsets.extend_from_slice(&offset);
        }
        let footer = Fields::default().u64(start).u64(start + size(&section));
        section.extend_from_slice(&offsets);
        // The checksum of the summary covers the footer up to itself.
        let footer = footer.u32(0).record(Opcode::Footer)?;
        section.extend_from_slice(footer.strip_suffix(&[0; 4]).unwrap_or_default());
        section.extend_from_slice(&CHECKSUM.checksum(&section).to_le_bytes());
        Ok(section)
    }

    fn statistics(&self) -> io::Result<Vec<u8>> {
        let Summary { schemas, channels, chunks, attachments, metadata } = &self.summary;
        let count =
            |fields: Fields, (channel, count): (&u16, &u64)| fields.u16(*channel).u64(*count);
        let counts = self.messages.iter().fold(Fields::default(), count);
        let (first, last) = self.times.unwrap_or_default();
        let fields = Fields::default().u64(self.messages.values().sum());
        let fields = fields.u16(u16::try_from(schemas.count).unwrap_or(u16::MAX));
        let fields = fields.u32(channels.count).u32(attachments.count).u32(metadata.count);
        let fields = fields.u32(chunks.count).u64(first).u64(last).bytes(counts.as_bytes());
        fields.record(Opcode::Statistics)
    }
}

/// Returns the number of a schema or channel.
fn number(place: usize) -> io::Result<u16> {
    let reason = "an MCAP file must have at most 65535 schemas and channels";
    u16::try_from(place).map_err(|_| io::Error::new(io::ErrorKind::InvalidInput, reason))
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::MessageStream;
    use mcap::read::{self, LinearReader, Summary as ReadSummary};
    use mcap::records::Record;

    /// Bytes that compress little, so that chunks have blocks of both kinds.
    fn content(number: u32) -> Vec<u8> {
        let mut state = u64::from(number) + 1;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            state.to_be_bytes()[0]
        };
        (0..1_000)
            .map(|place| if number.is_multiple_of(3) { 7 } else { next() ^ u8::from(place < 9) })
            .collect()
    }

    fn texts(pairs: &[(&str, &str)]) -> BTreeMap<String, String> {
        pairs.iter().map(|(key, text)| ((*key).to_owned(), (*text).to_owned())).collect()
    }

    /// Returns a file with `count` messages, in turn on two channels of one schema.
    fn file(count: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut file = Container::new(&mut bytes, "ros2", "test").unwrap();
        for topic in ["/a", "/b"] {
            let schema = file.schema("kind", "jsonschema", "{}").unwrap();
            file.channel(schema, topic, "json", &texts(&[("qos", "x")])).unwrap();
        }
        file.metadata("facts", &texts(&[("joints", "6"), ("kind", "demo")])).unwrap();
        file.attachment("arm.toml", "text/plain", 5, b"period_us = 1000").unwrap();
        for number in 0..count {
            let channel = if number % 2 == 0 { 1 } else { 2 };
            let nanos = u64::from(number) * 1_000 + 3;
            file.message(channel, number / 2, nanos, &content(number)).unwrap();
        }
        file.finish().unwrap();
        bytes
    }

    #[test]
    fn messages_in_lz4_chunks_are_read_by_liblz4() {
        let bytes = file(10_000);
        assert!(bytes.len() < 8_000_000, "{} bytes of 10,000,000", bytes.len());
        let read: Vec<_> = MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
        assert_eq!(read.len(), 10_000);
        for (number, message) in (0..).zip(&read) {
            assert!(message.data == content(number), "message {number}");
            let topic = if number % 2 == 0 { "/a" } else { "/b" };
            assert_eq!((&*message.channel.topic, message.sequence), (topic, number / 2));
            assert_eq!(message.log_time, u64::from(number) * 1_000 + 3);
        }
    }

    #[test]
    fn summary_indexes_every_chunk_message_and_attachment() {
        let bytes = file(10_000);
        let summary = ReadSummary::read(&bytes).unwrap().unwrap();
        let statistics = summary.stats.clone().unwrap();
        assert_eq!((statistics.message_count, statistics.chunk_count), (10_000, 3));
        assert_eq!((statistics.schema_count, statistics.channel_count), (1, 2));
        assert_eq!((statistics.message_start_time, statistics.message_end_time), (3, 9_999_003));
        assert_eq!(statistics.channel_message_counts, BTreeMap::from([(1, 5_000), (2, 5_000)]));
        assert_eq!(summary.channels[&2].topic, "/b");
        let mut number = 0;
        for chunk in &summary.chunk_indexes {
            assert_eq!(chunk.compression, "lz4");
            assert!(chunk.compressed_size < chunk.uncompressed_size);
            let indexes = summary.read_message_indexes(&bytes, chunk).unwrap();
            let mut entries: Vec<_> = indexes.into_values().flatten().collect();
            entries.sort_by_key(|entry| entry.log_time);
            for entry in entries {
                // To seek a message its chunk is decompressed.
                if number % 1_000 == 0 {
                    let message = summary.seek_message(&bytes, chunk, &entry).unwrap();
                    assert!(message.data == content(number), "message {number}");
                }
                number += 1;
            }
        }
        assert_eq!(number, 10_000);
        let attached = read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
        assert_eq!((&*attached.name, &*attached.data), ("arm.toml", &b"period_us = 1000"[..]));
        let facts = read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
        assert_eq!(facts.metadata, texts(&[("joints", "6"), ("kind", "demo")]));
    }

    #[test]
    fn file_without_messages_has_its_channels() {
        let bytes = file(0);
        assert_eq!(MessageStream::new(&bytes).unwrap().count(), 0);
        let summary = ReadSummary::read(&bytes).unwrap().unwrap();
        assert_eq!(summary.channels.len(), 2);
        let has_end =
            |record| matches!(record, Ok(Record::DataEnd(end)) if end.data_section_crc != 0);
        assert!(LinearReader::new(&bytes).unwrap().any(has_end));
    }
}
