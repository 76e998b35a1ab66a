//! LSS identification (CiA 305): slaves that match a description, or unconfigured slaves.
//!
//! All matching slaves send the same frame, so simultaneous replies merge: their number remains unknown.

use std::time::Duration;

use crate::procedure::Procedure;
use canopen::frame::Frame;
use canopen_device::lss::codec::{Condition, Reply, Request};
use units::time::Instant;

/// Ranges of identity parts, ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Description {
    /// Vendor-ID, 1018h:1.
    pub vendor: u32,
    /// Product code, 1018h:2.
    pub product: u32,
    /// Lowest and highest revision number.
    pub revision: [u32; 2],
    /// Lowest and highest serial number.
    pub serial: [u32; 2],
}

/// Identification in progress.
#[derive(Clone, Copy, Debug)]
pub struct Identify {
    request: Request,
    answers: u32,
    closes: Instant,
}

impl Identify {
    /// Starts an identification of slaves that match a description.
    pub fn remote(
        description: Description,
        window: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        let Description { vendor, product, revision: [r0, r1], serial: [s0, s1] } = description;
        let numbers = [vendor, product, r0, r1, s0, s1];
        let conditions = Condition::ALL.into_iter().zip(numbers);
        out.extend(conditions.map(|(c, number)| Request::IdentifyRemote(c, number).frame()));
        let request = Request::IdentifyRemote(Condition::HighestSerial, s1);
        Self { request, answers: 0, closes: now + window }
    }

    /// Starts an identification of unconfigured slaves.
    pub fn non_configured(window: Duration, now: Instant, out: &mut Vec<Frame>) -> Self {
        let request = Request::IdentifyNonConfigured;
        out.push(request.frame());
        Self { request, answers: 0, closes: now + window }
    }
}

impl Procedure for Identify {
    /// Number of received replies: 0 without a matching slave, else at least 1.
    type Outcome = u32;

    fn on_frame(&mut self, _: Instant, frame: &Frame, _: &mut Vec<Frame>) -> Option<u32> {
        let is_answer = Reply::decode(frame).is_some_and(|reply| reply.answers(self.request));
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
    fn identification_by_description_sends_six_frames() {
        let description = Description { vendor: 1, product: 2, revision: [3, 4], serial: [5, 6] };
        let mut out = Vec::new();
        let mut identify = Identify::remote(description, WINDOW, Instant::ZERO, &mut out);
        let bytes = |frame: &Frame| (frame.data()[0], frame.data()[1]);
        let sent: Vec<_> = out.iter().map(bytes).collect();
        assert_eq!(sent, [(0x46, 1), (0x47, 2), (0x48, 3), (0x49, 4), (0x4A, 5), (0x4B, 6)]);
        for frame in [Reply::Identified.frame(), Reply::NonConfigured.frame()] {
            assert_eq!(identify.on_frame(Instant::ZERO, &frame, &mut out), None);
        }
        assert_eq!(identify.on_time(Instant::ZERO, &mut out), None);
        assert_eq!(identify.on_time(Instant::ZERO + WINDOW, &mut out), Some(1));
    }

    #[test]
    fn no_reply_without_unconfigured_slaves() {
        let mut out = Vec::new();
        let mut identify = Identify::non_configured(WINDOW, Instant::ZERO, &mut out);
        assert_eq!(out, [Request::IdentifyNonConfigured.frame()]);
        identify.on_frame(Instant::ZERO, &Reply::Identified.frame(), &mut out);
        assert_eq!(identify.on_time(Instant::ZERO + WINDOW, &mut out), Some(0));
    }
}
