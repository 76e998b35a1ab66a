//! Use of every COB-ID of a bus: the predefined connection set (CiA 301, 7.3.3), overridden by the members' plans.

use canopen_rs::NodeId;
use canopen_rs::lss::{LSS_MASTER_COB_ID, LSS_SLAVE_COB_ID};
use canopen_rs::time::TIME_COB_ID;

use crate::decode::sdo::Side;
use crate::signals::{Member, PdoFrame};
use canopen::frame::{COB_ID_MAX, Channel};
use canopen::layout::Direction;
use canopen::{emcy, nmt, sync};

/// Use of a COB-ID.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Use {
    /// Neither predefined nor in a member's plan.
    #[default]
    Unknown,
    Nmt,
    Sync,
    Time,
    Emergency(u8),
    /// PDO of the layout: index in the list of frames.
    Pdo(usize),
    /// PDO outside the layout: direction, number and node.
    OtherPdo(Direction, u8, u8),
    Sdo(Side, u8),
    Heartbeat(u8),
    Lss(Side),
}

impl Use {
    /// Returns the node by the COB-ID alone.
    pub(super) const fn node(self) -> Option<u8> {
        match self {
            Self::Emergency(node)
            | Self::OtherPdo(_, _, node)
            | Self::Sdo(_, node)
            | Self::Heartbeat(node) => Some(node),
            Self::Unknown | Self::Nmt | Self::Sync | Self::Time | Self::Pdo(_) | Self::Lss(_) => {
                None
            }
        }
    }

    /// Text of the expected data.
    pub(super) const fn expects(self) -> &'static str {
        match self {
            Self::Nmt => "an NMT command and a node-id",
            Self::Sync => "a SYNC of at most one byte",
            Self::Time => "a time of six bytes",
            Self::Emergency(_) => "an emergency of eight bytes",
            Self::Sdo(..) => "an SDO of eight bytes",
            Self::Heartbeat(_) => "a state of one byte",
            Self::Lss(_) => "an LSS message of eight bytes",
            Self::Pdo(_) | Self::OtherPdo(..) => "a PDO",
            Self::Unknown => "anything",
        }
    }
}

/// Bus with the use of its COB-IDs, and its nodes.
#[derive(Clone, Debug)]
pub(super) struct Network {
    uses: Vec<Use>,
    members: [Option<usize>; 128],
    /// Indices of this bus's PDOs in the list of frames.
    pub(super) frames: Vec<usize>,
}

impl Network {
    /// Returns a bus with these members and their frames.
    ///
    /// COB-IDs and node-ids of two members are unknown, as `members` may be on several buses.
    pub(super) fn new(
        members: &[Member],
        frames: &[PdoFrame],
        is_here: impl Fn(Channel) -> bool,
    ) -> Self {
        let mut network = Self {
            uses: (0..=COB_ID_MAX).map(predefined).collect(),
            members: [None; 128],
            frames: Vec::new(),
        };
        let mut taken = [false; 128];
        for (place, member) in
            members.iter().enumerate().filter(|(_, member)| is_here(member.channel))
        {
            let node = usize::from(member.node().raw());
            let (Some(slot), Some(taken)) = (network.members.get_mut(node), taken.get_mut(node))
            else {
                continue;
            };
            *slot = (!*taken).then_some(place);
            *taken = true;
            if member.plan.emcy_cob_id != emcy::default_cob_id(member.node()) {
                network.assign(member.plan.emcy_cob_id, Use::Emergency(member.node().raw()));
            }
        }
        let here = || frames.iter().enumerate().filter(|(_, frame)| is_here(frame.channel));
        for (place, frame) in here() {
            if here().filter(|(_, other)| other.cob_id == frame.cob_id).count() == 1 {
                network.assign(frame.cob_id, Use::Pdo(place));
                network.frames.push(place);
            }
        }
        network
    }

    /// Returns the use of a COB-ID on this bus; [`Use::Unknown`] beyond 7FFh.
    pub(super) fn use_of(&self, cob_id: u16) -> Use {
        self.uses.get(usize::from(cob_id)).copied().unwrap_or_default()
    }

    /// Returns the index of the member at a node-id.
    pub(super) fn member(&self, node: u8) -> Option<usize> {
        self.members.get(usize::from(node)).copied().flatten()
    }

    fn assign(&mut self, cob_id: u16, to: Use) {
        if let Some(slot) = self.uses.get_mut(usize::from(cob_id)) {
            *slot = to;
        }
    }
}

/// Predefined connection set, and the COB-IDs of CiA 305.
fn predefined(cob_id: u16) -> Use {
    let [low, _] = cob_id.to_le_bytes();
    let node = low & 0x7F;
    match (cob_id, cob_id & 0x780) {
        (nmt::COB_ID, _) => Use::Nmt,
        (sync::COB_ID, _) => Use::Sync,
        (TIME_COB_ID, _) => Use::Time,
        (LSS_MASTER_COB_ID, _) => Use::Lss(Side::Client),
        (LSS_SLAVE_COB_ID, _) => Use::Lss(Side::Server),
        _ if NodeId::new(node).is_err() || node == 0 => Use::Unknown,
        (_, 0x080) => Use::Emergency(node),
        (_, 0x180) => Use::OtherPdo(Direction::Transmit, 1, node),
        (_, 0x200) => Use::OtherPdo(Direction::Receive, 1, node),
        (_, 0x280) => Use::OtherPdo(Direction::Transmit, 2, node),
        (_, 0x300) => Use::OtherPdo(Direction::Receive, 2, node),
        (_, 0x380) => Use::OtherPdo(Direction::Transmit, 3, node),
        (_, 0x400) => Use::OtherPdo(Direction::Receive, 3, node),
        (_, 0x480) => Use::OtherPdo(Direction::Transmit, 4, node),
        (_, 0x500) => Use::OtherPdo(Direction::Receive, 4, node),
        (_, 0x580) => Use::Sdo(Side::Server, node),
        (_, 0x600) => Use::Sdo(Side::Client, node),
        (_, 0x700) => Use::Heartbeat(node),
        _ => Use::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signals;
    use crate::signals::tests::per_drive;

    #[test]
    fn predefined_connection_set_is_that_of_the_standard() {
        assert_eq!(predefined(0x000), Use::Nmt);
        assert_eq!(predefined(0x080), Use::Sync);
        assert_eq!(predefined(0x081), Use::Emergency(1));
        assert_eq!(predefined(0x100), Use::Time);
        assert_eq!(predefined(0x180), Use::Unknown, "no node has the id 0");
        assert_eq!(predefined(0x57F), Use::OtherPdo(Direction::Receive, 4, 127));
        assert_eq!(predefined(0x5FF), Use::Sdo(Side::Server, 127));
        assert_eq!(predefined(0x601), Use::Sdo(Side::Client, 1));
        assert_eq!(predefined(0x701), Use::Heartbeat(1));
        assert_eq!(predefined(0x7E5), Use::Lss(Side::Client));
    }

    #[test]
    fn ambiguous_cob_id_of_an_unknown_bus_has_no_node() {
        let mut members = per_drive();
        members[0].channel = Channel(1);
        let twin = members[1].clone();
        members.push(Member { channel: Channel(1), ..twin });
        let frames = signals::frames(&members);
        let anywhere = Network::new(&members, &frames, |_| true);
        assert_eq!(anywhere.use_of(0x182), Use::OtherPdo(Direction::Transmit, 1, 2));
        assert_eq!(anywhere.member(2), None);
        assert!(matches!(anywhere.use_of(0x181), Use::Pdo(_)));
        let here = Network::new(&members, &frames, |channel| channel == Channel(1));
        assert!(matches!(here.use_of(0x182), Use::Pdo(_)));
        assert_eq!(here.member(2), Some(4));
    }
}
