//! Disturbance of an SDO request by another client: its replies may answer that client, so a failed one is repeated.

/// Maximum repetitions of a request.
pub(super) const MAX_REPEATS: u32 = 3;

/// Requests of other clients to the same server, and the repetitions that followed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Disturbance {
    /// Another client has sent a request since the current one.
    is_present: bool,
    repeats: u32,
}

impl Disturbance {
    /// Notes a request of another client.
    pub(super) const fn note(&mut self) {
        self.is_present = true;
    }

    /// Returns whether the request that failed is to be repeated. Counts for one repetition.
    pub(super) const fn take(&mut self) -> bool {
        let is_repeated = self.is_present && self.repeats < MAX_REPEATS;
        if is_repeated {
            self.repeats += 1;
        }
        self.is_present = false;
        is_repeated
    }

    /// Starts a request that no client has disturbed yet.
    pub(super) const fn forget(&mut self) {
        self.is_present = false;
    }
}
