//! Chunk of an MCAP file: its records as one LZ4 frame, and an index of its messages for each channel.

use std::collections::BTreeMap;
use std::io::{self, Write};

use lz4_flex::frame::{BlockMode, BlockSize, FrameEncoder, FrameInfo};

use crate::record::{CHECKSUM, Fields, Opcode, size};

/// Name of the compression in the file: LZ4 frames.
const COMPRESSION: &str = "lz4";

/// Records of a chunk that is not in the file yet.
#[derive(Clone, Debug, Default)]
pub(crate) struct Chunk {
    records: Vec<u8>,
    /// Time in ns and offset in `records` of each message, by channel.
    messages: BTreeMap<u16, Fields>,
    /// Earliest and latest time of a message, in ns.
    times: Option<(u64, u64)>,
}

/// Chunk as the file has it.
#[derive(Clone, Debug)]
pub(crate) struct ChunkRecords {
    /// Chunk record.
    record: Vec<u8>,
    /// Message index record of each channel.
    indexes: Vec<(u16, Vec<u8>)>,
    times: (u64, u64),
    compressed_size: u64,
    uncompressed_size: u64,
}

impl Chunk {
    /// Returns the uncompressed size in bytes.
    pub(crate) fn size(&self) -> u64 {
        size(&self.records)
    }

    /// Appends a schema or channel record.
    pub(crate) fn put(&mut self, record: &[u8]) {
        self.records.extend_from_slice(record);
    }

    /// Appends a message record of a channel, at a time in ns.
    pub(crate) fn put_message(&mut self, channel: u16, nanos: u64, record: &[u8]) {
        let index = self.messages.entry(channel).or_default();
        *index = std::mem::take(index).u64(nanos).u64(size(&self.records));
        let (first, last) = self.times.unwrap_or((nanos, nanos));
        self.times = Some((first.min(nanos), last.max(nanos)));
        self.put(record);
    }

    /// Returns the chunk compressed, and starts the next one.
    ///
    /// # Errors
    /// Returns an error if the records cannot be compressed.
    pub(crate) fn take(&mut self) -> io::Result<ChunkRecords> {
        let frame = frame(&self.records)?;
        let times = self.times.take().unwrap_or_default();
        let uncompressed_size = self.size();
        let fields = Fields::default().u64(times.0).u64(times.1).u64(uncompressed_size);
        let fields = fields.u32(CHECKSUM.checksum(&self.records)).text(COMPRESSION);
        let record = fields.u64(size(&frame)).raw(&frame).record(Opcode::Chunk)?;
        self.records.clear();
        let indexes = std::mem::take(&mut self.messages).into_iter().map(|(channel, messages)| {
            let fields = Fields::default().u16(channel).bytes(messages.as_bytes());
            Ok((channel, fields.record(Opcode::MessageIndex)?))
        });
        let indexes = indexes.collect::<io::Result<_>>()?;
        Ok(ChunkRecords {
            record,
            indexes,
            times,
            compressed_size: size(&frame),
            uncompressed_size,
        })
    }
}

impl ChunkRecords {
    /// Returns the parts in the order of the file: chunk, then message indexes.
    pub(crate) fn parts(&self) -> impl Iterator<Item = &[u8]> {
        [&*self.record].into_iter().chain(self.indexes.iter().map(|(_, index)| &**index))
    }

    /// Returns the record of the summary about this chunk, which begins at `start` in the file.
    pub(crate) fn index(&self, start: u64) -> io::Result<Vec<u8>> {
        let length = size(&self.record);
        let (mut offsets, mut end) = (Fields::default(), start + length);
        for (channel, index) in &self.indexes {
            offsets = offsets.u16(*channel).u64(end);
            end += size(index);
        }
        let fields = Fields::default().u64(self.times.0).u64(self.times.1).u64(start).u64(length);
        let fields = fields.bytes(offsets.as_bytes()).u64(end - start - length).text(COMPRESSION);
        fields.u64(self.compressed_size).u64(self.uncompressed_size).record(Opcode::ChunkIndex)
    }
}

/// Returns the bytes as one LZ4 frame. The chunk has a checksum of its own.
fn frame(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let info = FrameInfo::new().block_size(BlockSize::Max4MB).block_mode(BlockMode::Independent);
    let mut encoder = FrameEncoder::with_frame_info(info, Vec::new());
    encoder.write_all(bytes)?;
    Ok(encoder.finish()?)
}
