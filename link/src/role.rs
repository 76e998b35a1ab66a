//! Roles of a link, near and far: messages that each publishes and receives, and its name in certificates.

use contract::{Capability, Command, Feedback, Head, Reject};

/// Role of an end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Beside the node.
    Near,
    /// Beside the robot.
    Far,
}

/// Messages of one key expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Commands of the node.
    Command,
    /// Feedbacks of the robot.
    Feedback,
    /// Capabilities of the robot.
    Capability,
}

impl Role {
    /// Name in commands, files and certificates.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Near => "near",
            Self::Far => "far",
        }
    }

    /// Returns the role of the end at the other machine.
    pub const fn other(self) -> Self {
        match self {
            Self::Near => Self::Far,
            Self::Far => Self::Near,
        }
    }

    /// Topics that this role publishes and the other role subscribes to.
    pub const fn topics(self) -> &'static [Topic] {
        match self {
            Self::Near => &[Topic::Command],
            Self::Far => &[Topic::Feedback, Topic::Capability],
        }
    }

    /// Returns topic and head of a message that this role sends.
    ///
    /// # Errors
    /// Returns an error if it is not a message of the contract, or is for another arm.
    pub fn read(self, bytes: &[u8], arm: u16) -> Result<(Topic, Head), Reject> {
        let (topic, head) = match self {
            Self::Near => (Topic::Command, Command::decode(bytes)?.head),
            Self::Far if bytes.len() == Capability::LENGTH => {
                (Topic::Capability, Capability::decode(bytes)?.0)
            }
            Self::Far => (Topic::Feedback, Feedback::decode(bytes)?.head),
        };
        if head.arm == arm { Ok((topic, head)) } else { Err(Reject::Arm) }
    }

    /// Common name of the certificate of this role of an arm.
    pub fn common_name(self, arm: u16) -> String {
        common_name(arm, self.name())
    }

    /// Key expression of the liveliness token of a role.
    pub fn alive(self, arm: u16) -> String {
        format!("frhc/{arm}/alive/{}", self.name())
    }
}

impl Topic {
    /// Key expression of an arm.
    pub fn key(self, arm: u16) -> String {
        let name = match self {
            Self::Command => "command",
            Self::Feedback => "feedback",
            Self::Capability => "capability",
        };
        format!("frhc/{arm}/{name}")
    }
}

/// Common name of the certificate of a router between the ends.
pub fn router_name(arm: u16) -> String {
    common_name(arm, "router")
}

/// Common name of a certificate.
pub fn common_name(arm: u16, role: &str) -> String {
    format!("frhc-{arm}-{role}")
}

#[cfg(test)]
mod tests {
    use contract::{FarEnd, Measurements, Motion, NodeEnd, Order};
    use std::time::Duration;
    use units::time::Instant;

    use super::*;

    #[test]
    fn each_role_sends_its_own_messages_of_its_arm_alone() {
        let at = Instant::from_micros(1);
        let mut node = NodeEnd::new(3, 7);
        let mut far = FarEnd::new(3, 8, Duration::from_millis(100));
        let command =
            node.command(at, &Order { motion: Motion::Hold, is_engaged: false, gripper: None });
        let feedback = far.feedback(at, &Measurements::default());
        assert_eq!(Role::Near.read(&command, 3).map(|(topic, _)| topic), Ok(Topic::Command));
        assert_eq!(Role::Far.read(&feedback, 3).map(|(topic, _)| topic), Ok(Topic::Feedback));
        assert_eq!(Role::Near.read(&command, 4).map(drop), Err(Reject::Arm));
        assert_eq!(Role::Near.read(&feedback, 3).map(drop), Err(Reject::Foreign));
        assert!(Role::Far.read(&command, 3).is_err());
        assert!(Role::Far.read(&feedback[1..], 3).is_err());
    }
}
