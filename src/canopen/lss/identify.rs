//! Is anybody there: slaves of a description, or slaves without a node-id (CiA 305, LSS identification).
//!
//! Every slave it concerns answers the same frame, so answers that meet on the wire are one: it is known
//! *whether* anybody is there, and not how many.

use std::time::Duration;

use crate::frame::Frame;
use crate::lss::codec::Condition;
use crate::lss::codec::Reply;
use crate::lss::codec::Request;
use crate::procedure::Procedure;
use units::time::Instant;

/// The numbers slaves are described by, ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Description {
    /// Vendor-ID.
    pub vendor: u32,
    /// Product code.
    pub product: u32,
    /// Lowest and highest revision number.
    pub revision: [u32; 2],
    /// Lowest and highest serial number.
    pub serial: [u32; 2],
}

/// One question to all slaves.
#[derive(Clone, Copy, Debug)]
pub struct Identify {
    question: Request,
    answers: u32,
    closes: Instant,
}

impl Identify {
    /// Who fits a description?
    pub fn remote(whom: Description, window: Duration, now: Instant, out: &mut Vec<Frame>) -> Self {
        let Description { vendor, product, revision: [r0, r1], serial: [s0, s1] } = whom;
        let numbers = [vendor, product, r0, r1, s0, s1];
        let conditions = Condition::ALL.into_iter().zip(numbers);
        out.extend(conditions.map(|(c, number)| Request::IdentifyRemote(c, number).frame()));
        let question = Request::IdentifyRemote(Condition::HighestSerial, s1);
        Self { question, answers: 0, closes: now + window }
    }

    /// Who has no node-id?
    pub fn non_configured(window: Duration, now: Instant, out: &mut Vec<Frame>) -> Self {
        let question = Request::IdentifyNonConfigured;
        out.push(question.frame());
        Self { question, answers: 0, closes: now + window }
    }
}

impl Procedure for Identify {
    /// The answers that were heard: 0 means nobody, more mean somebody.
    type Outcome = u32;

    fn on_frame(&mut self, _: Instant, frame: &Frame, _: &mut Vec<Frame>) -> Option<u32> {
        let is_answer = Reply::decode(frame).is_some_and(|reply| reply.answers(self.question));
        self.answers = self.answers.saturating_add(u32::from(is_answer));
        None
    }

    fn on_time(&mut self, now: Instant, _: &mut Vec<Frame>) -> Option<u32> {
        (now >= self.closes).then_some(self.answers)
    }

    fn deadline(&self) -> Option<Instant> {
        Some(self.closes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: Duration = Duration::from_millis(50);

    #[test]
    fn six_frames_ask_for_a_description() {
        let whom = Description { vendor: 1, product: 2, revision: [3, 4], serial: [5, 6] };
        let mut out = Vec::new();
        let mut identify = Identify::remote(whom, WINDOW, Instant::ZERO, &mut out);
        let bytes = |frame: &Frame| (frame.data()[0], frame.data()[1]);
        let said: Vec<_> = out.iter().map(bytes).collect();
        assert_eq!(said, [(0x46, 1), (0x47, 2), (0x48, 3), (0x49, 4), (0x4A, 5), (0x4B, 6)]);
        for frame in [Reply::Identified.frame(), Reply::NonConfigured.frame()] {
            assert_eq!(identify.on_frame(Instant::ZERO, &frame, &mut out), None);
        }
        assert_eq!(identify.on_time(Instant::ZERO, &mut out), None);
        assert_eq!(identify.on_time(Instant::ZERO + WINDOW, &mut out), Some(1));
    }

    #[test]
    fn nobody_answers_where_nobody_is() {
        let mut out = Vec::new();
        let mut identify = Identify::non_configured(WINDOW, Instant::ZERO, &mut out);
        assert_eq!(out, [Request::IdentifyNonConfigured.frame()]);
        identify.on_frame(Instant::ZERO, &Reply::Identified.frame(), &mut out);
        assert_eq!(identify.on_time(Instant::ZERO + WINDOW, &mut out), Some(0));
    }
}
