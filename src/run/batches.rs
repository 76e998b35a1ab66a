//! Batches of entries for the disk writers. Their memory is reused, so a steady state does not allocate.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::record_sink::RecordSink;
use canopen::frame::Telegram;
use inputs::Input;
use node::record::Record;
use units::time::Instant;

/// Number of batches kept for reuse. More exist only while a disk is slow.
const KEPT: usize = 16;

/// Entries in their order on the buses.
#[derive(Debug, Default)]
pub(super) struct Batch {
    entries: Vec<Entry>,
    records: Vec<Record>,
    /// Inputs of the node, in their own order.
    inputs: Vec<Input>,
}

/// Frame, or the place of the next record.
#[derive(Debug)]
enum Entry {
    Frame(Instant, Telegram),
    Cycle,
}

impl Batch {
    /// Adds a frame.
    pub(super) fn push_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.entries.push(Entry::Frame(at, *telegram));
    }

    /// Adds a cycle.
    pub(super) fn push_cycle(&mut self, record: &Record) {
        self.entries.push(Entry::Cycle);
        self.records.push(*record);
    }

    /// Adds an input of the node.
    pub(super) fn push_input(&mut self, input: Input) {
        self.inputs.push(input);
    }

    /// Returns the number of frames and cycles.
    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns the number of inputs.
    pub(super) fn inputs(&self) -> usize {
        self.inputs.len()
    }

    /// Passes all entries to `sink`.
    pub(super) fn write(&self, sink: &mut impl RecordSink) {
        let mut records = self.records.iter();
        for entry in &self.entries {
            match entry {
                Entry::Frame(at, telegram) => sink.on_frame(*at, telegram),
                Entry::Cycle => records.next().into_iter().for_each(|record| sink.on_cycle(record)),
            }
        }
        self.inputs.iter().for_each(|input| sink.on_input(input));
    }

    fn clear(&mut self) {
        self.entries.clear();
        self.records.clear();
        self.inputs.clear();
    }
}

/// Batch being filled, and batches in use by the writers.
#[derive(Debug, Default)]
pub(super) struct Batches {
    pub(super) filling: Batch,
    /// Batches handed out, oldest first. A batch is free when no writer holds it.
    handed_out: VecDeque<Arc<Batch>>,
}

impl Batches {
    /// Returns the batch that was filled, unless it is empty.
    pub(super) fn take(&mut self) -> Option<Arc<Batch>> {
        if self.filling.len() == 0 && self.filling.inputs() == 0 {
            return None;
        }
        let is_free = self.handed_out.front().is_some_and(|batch| Arc::strong_count(batch) == 1);
        let oldest = if is_free { self.handed_out.pop_front() } else { None };
        let mut batch = oldest.unwrap_or_default();
        if let Some(free) = Arc::get_mut(&mut batch) {
            free.clear();
            std::mem::swap(free, &mut self.filling);
        }
        self.handed_out.push_back(Arc::clone(&batch));
        if self.handed_out.len() > KEPT {
            self.handed_out.pop_front();
        }
        Some(batch)
    }
}
