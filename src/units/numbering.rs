//! Numbers of joints and nodes. Joints count from 1, indices in lists from 0.

use std::iter::Zip;
use std::{array, fmt};

use serde::Serialize;

/// Joint of the arm, numbered from the base: 1 to 6.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct Joint(u8);

impl Joint {
    /// All joints, the base's first.
    pub const ALL: [Self; 6] = [Self(1), Self(2), Self(3), Self(4), Self(5), Self(6)];

    /// Returns the joint of this number, from 1; `None` unless it is 1 to 6.
    pub fn new(number: impl TryInto<u8>) -> Option<Self> {
        number.try_into().ok().map(Self).filter(|joint| Self::ALL.contains(joint))
    }

    /// Returns the joint of a constant number, 1 to 6, checked at compile time.
    ///
    /// ```
    /// assert_eq!(units::numbering::Joint::of::<3>().index(), 2);
    /// ```
    /// ```compile_fail
    /// units::numbering::Joint::of::<7>();
    /// ```
    pub const fn of<const NUMBER: u8>() -> Self {
        const { assert!(1 <= NUMBER && NUMBER <= 6, "joints are 1 to 6") };
        Self(NUMBER)
    }

    /// Returns the joint at this index in a list of all joints; `None` unless it is 0 to 5.
    pub fn at(index: usize) -> Option<Self> {
        Self::ALL.get(index).copied()
    }

    /// Returns 1 to 6, counted from the base.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Returns the index in a list of all joints, 0 to 5.
    pub fn index(self) -> usize {
        usize::from(self.0 - 1)
    }

    /// Pairs each joint with its entry in a list of all joints, base first.
    pub fn each<I: IntoIterator>(all: I) -> Zip<array::IntoIter<Self, 6>, I::IntoIter> {
        Self::ALL.into_iter().zip(all)
    }

    /// Returns the entry of this joint in a list of all joints, base first.
    pub fn entry<T>(self, all: &[T; 6]) -> &T {
        self.entry_mut(&mut all.each_ref())
    }

    /// Returns the mutable entry of this joint in a list of all joints, base first.
    pub const fn entry_mut<T>(self, all: &mut [T; 6]) -> &mut T {
        let [first, second, third, fourth, fifth, sixth] = all;
        match self.0 {
            1 => first,
            2 => second,
            3 => third,
            4 => fourth,
            5 => fifth,
            _ => sixth,
        }
    }
}

/// Formats the number, from 1.
impl fmt::Display for Joint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Index of a node in the list of plans, from 0: the drives in the order of their joints, then the switch box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeIndex(pub usize);

impl NodeIndex {
    /// Pairs each index with its entry in a list in the order of the plans.
    pub fn each<T>(all: impl IntoIterator<Item = T>) -> impl Iterator<Item = (Self, T)> {
        (0..).map(Self).zip(all)
    }

    /// Returns the joint whose drive has this index; `None` for the switch box.
    pub fn joint(self) -> Option<Joint> {
        Joint::at(self.0)
    }
}

/// Returns the index of the joint's drive.
impl From<Joint> for NodeIndex {
    fn from(joint: Joint) -> Self {
        Self(joint.index())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joint_number_outside_1_to_6_is_refused() {
        assert_eq!(
            [0, 1, 6, 7, 256].map(Joint::new),
            [None, Joint::at(0), Joint::at(5), None, None]
        );
        assert_eq!(Joint::new(-1), None);
        assert_eq!(Joint::at(6), None);
    }

    #[test]
    fn joint_counts_from_1_and_its_index_from_0() {
        for (index, joint) in Joint::ALL.into_iter().enumerate() {
            assert_eq!((joint.index(), usize::from(joint.number())), (index, index + 1));
            assert_eq!((Joint::at(index), NodeIndex::from(joint)), (Some(joint), NodeIndex(index)));
            assert_eq!(joint.to_string(), (index + 1).to_string());
            assert_eq!(joint.entry(&Joint::ALL), &joint);
            let mut all = Joint::ALL;
            assert_eq!(joint.entry_mut(&mut all), &joint);
        }
    }

    #[test]
    fn nodes_are_the_joints_drives_then_the_switch_box() {
        let joints: Vec<_> = NodeIndex::each(0..7).map(|(node, _)| node.joint()).collect();
        assert_eq!(joints[..6], Joint::ALL.map(Some));
        assert_eq!(joints[6], None);
        assert!(Joint::each(0..7).map(|(joint, index)| joint.index() == index).eq([true; 6]));
    }
}
