//! Log lines of the leading node, of what the robot follows, and of the reason to hold.

use contract::{FarState, Reason};
use far_socket::SocketEvent;
use net_ft::socket::SensorEvent;

/// Change worth a line.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Event {
    /// Change of the connection.
    Socket(SocketEvent),
    /// Change of the force/torque sensor.
    Sensor(SensorEvent),
    /// Node that leads from now on.
    Leads {
        /// Session of the node.
        session: u64,
        /// Epoch of the node.
        epoch: u32,
    },
    /// Robot that follows from now on.
    Follows {
        /// Epoch of the node that leads.
        epoch: u32,
    },
    /// Reason of a hold from now on.
    Holds(Reason),
}

impl Event {
    /// Writes the line.
    pub(super) fn log(&self) {
        match self {
            Self::Socket(event) => event.log(),
            Self::Sensor(event) => event.log(),
            Self::Leads { session, epoch } => {
                tracing::info!(session = format_args!("{session:016x}"), epoch, "a node leads");
            }
            Self::Follows { epoch } => tracing::info!(epoch, "follows"),
            Self::Holds(reason @ (Reason::None | Reason::NotArmed | Reason::Ending)) => {
                tracing::info!("holds: {reason}");
            }
            Self::Holds(reason) => tracing::warn!("holds: {reason}"),
        }
    }
}

/// Leader and reason of the cycle before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Narrator {
    leader: (u64, u32),
    reason: Reason,
}

impl Default for Narrator {
    /// Returns the state of a robot that holds without a leading node.
    fn default() -> Self {
        Self { leader: (0, 0), reason: Reason::NotArmed }
    }
}

impl Narrator {
    /// Takes session and epoch of the leading node and the reason to hold; returns the changes since the last cycle.
    pub(super) fn observe(
        &mut self,
        leader: (u64, u32),
        reason: Reason,
    ) -> impl Iterator<Item = Event> {
        let before = std::mem::replace(self, Self { leader, reason });
        let (session, epoch) = leader;
        let is_new_leader = session != before.leader.0;
        let leads = is_new_leader.then_some(Event::Leads { session, epoch });
        let is_new_reason = reason != before.reason;
        let is_new_epoch = epoch != before.leader.1;
        let state = match reason.state() {
            FarState::Following => {
                (is_new_reason || is_new_epoch).then_some(Event::Follows { epoch })
            }
            FarState::Holding => (is_new_reason || is_new_leader).then_some(Event::Holds(reason)),
        };
        leads.into_iter().chain(state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_change_of_leader_and_reason_is_one_line() {
        let mut narrator = Narrator::default();
        let mut observe = |leader, reason| narrator.observe(leader, reason).collect::<Vec<_>>();
        assert_eq!(observe((0, 0), Reason::NotArmed), []);
        let leads = Event::Leads { session: 7, epoch: 2 };
        assert_eq!(observe((7, 2), Reason::NotArmed), [leads, Event::Holds(Reason::NotArmed)]);
        assert_eq!(observe((7, 3), Reason::None), [Event::Follows { epoch: 3 }]);
        assert_eq!(observe((7, 3), Reason::None), []);
        assert_eq!(observe((7, 4), Reason::None), [Event::Follows { epoch: 4 }]);
        assert_eq!(observe((7, 4), Reason::Silence), [Event::Holds(Reason::Silence)]);
        assert_eq!(observe((7, 4), Reason::Silence), []);
    }
}
