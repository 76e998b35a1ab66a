//! Delay from the computation of a torque to the motion that it causes (CiA 301, 7.2.2.5.1: a synchronous RPDO acts
//! from the next SYNC on).
//!
//! ```text
//!  cycle k-2              cycle k-1               cycle k
//!  SYNC ─── RPDO ───────► SYNC ─────────────────► SYNC ─── TPDO ──►
//!           τ(k-2) sent   acts from here to here: its motion is q(k) - q(k-1)
//! ```
//!
//! Every product of motion and torque uses this torque.

/// Torques of the last two cycles. `T` holds one value per joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueDelay<T> {
    sent: [T; 2],
}

impl<T: Copy> TorqueDelay<T> {
    /// Creates a delay with `none` as the torque of earlier cycles.
    pub const fn new(none: T) -> Self {
        Self { sent: [none; 2] }
    }

    /// Returns the torques that acted between the last two SYNCs.
    pub const fn acted(&self) -> T {
        let [_, acted] = self.sent;
        acted
    }

    /// Returns the torques of the last cycle, which act from the last SYNC to the next.
    pub const fn in_flight(&self) -> T {
        let [in_flight, _] = self.sent;
        in_flight
    }

    /// Records the torques that this cycle sends.
    pub const fn push(&mut self, torques: T) {
        let [last, _] = self.sent;
        self.sent = [torques, last];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_is_returned_two_cycles_after_it_was_sent() {
        let mut delay = TorqueDelay::new(0);
        let seen = [1, 2, 3, 4].map(|sent| {
            let seen = (delay.acted(), delay.in_flight());
            delay.push(sent);
            seen
        });
        assert_eq!(seen, [(0, 0), (0, 1), (1, 2), (2, 3)]);
    }
}
