//! Lock-free ring of the node's inputs, from the cycle thread to the recorder thread. Only a recorded session has one.
//!
//! As with the [rings](crate::rings) of frames and records, the producer never waits. Inputs that do not fit are counted.
//! The count is recorded as an input, so that a replay ends at the first loss.

use std::cell::{Cell, RefCell};

use rtrb::{Consumer, Producer, RingBuffer};

use crate::rings::LossCounters;
use inputs::{Input, InputSink};

/// Capacity in inputs: a second of two buses at 1 kHz.
const CAPACITY: usize = 1 << 15;

/// Producer of inputs, owned by the cycle thread.
#[derive(Debug, Default)]
pub struct InputProducer {
    ring: Option<RefCell<Producer<Input>>>,
    /// Inputs lost since the last one that fitted, and of the run.
    lost: Cell<u64>,
    counters: LossCounters,
}

/// Consumer of inputs, which the recorder thread polls.
#[derive(Debug, Default)]
pub struct InputConsumer(Option<Consumer<Input>>);

/// Returns producer and consumer, without a ring if nothing is recorded. Allocates all memory.
pub fn input_ring(is_recorded: bool, counters: LossCounters) -> (InputProducer, InputConsumer) {
    if !is_recorded {
        return Default::default();
    }
    let (producer, consumer) = RingBuffer::new(CAPACITY);
    let ring = Some(RefCell::new(producer));
    let producer = InputProducer { ring, lost: Cell::new(0), counters };
    (producer, InputConsumer(Some(consumer)))
}

impl InputSink for InputProducer {
    fn is_recording(&self) -> bool {
        self.ring.is_some()
    }

    fn on_input(&self, input: Input) {
        // One thread, which does not come back here before the borrow ends.
        let Some(Ok(mut ring)) = self.ring.as_ref().map(RefCell::try_borrow_mut) else { return };
        let lost = self.lost.get();
        let is_pushed = (lost == 0 || ring.push(Input::Lost(lost)).is_ok()) && {
            self.lost.set(0);
            ring.push(input).is_ok()
        };
        if !is_pushed {
            self.lost.set(self.lost.get() + 1);
            self.counters.add_input();
        }
    }
}

impl InputConsumer {
    /// Passes up to `max` inputs to `handler`, oldest first; returns their number.
    pub fn take(&mut self, max: usize, mut handler: impl FnMut(Input)) -> usize {
        let Some(ring) = &mut self.0 else { return 0 };
        let waiting = ring.slots().min(max);
        for _ in 0..waiting {
            ring.pop().into_iter().for_each(&mut handler);
        }
        waiting
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(consumer: &mut InputConsumer) -> Vec<Input> {
        let mut inputs = Vec::new();
        consumer.take(usize::MAX, |input| inputs.push(input));
        inputs
    }

    #[test]
    fn lost_inputs_are_counted_where_they_are_missing() {
        let counters = LossCounters::default();
        let (producer, mut consumer) = input_ring(true, counters.clone());
        for at in 0..CAPACITY + 3 {
            producer.on_input(Input::Polled(at == 0));
        }
        assert_eq!(taken(&mut consumer).len(), CAPACITY);
        producer.on_input(Input::Polled(true));
        assert_eq!(taken(&mut consumer), [Input::Lost(3), Input::Polled(true)]);
        assert_eq!(counters.snapshot().to_string(), "3 inputs");
    }

    #[test]
    fn run_without_a_session_records_no_inputs() {
        let (producer, mut consumer) = input_ring(false, LossCounters::default());
        assert!(!producer.is_recording());
        producer.on_input(Input::Polled(true));
        assert_eq!(taken(&mut consumer), []);
    }
}
