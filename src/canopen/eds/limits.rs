//! Values that an object takes, by the limits of its EDS (CiA 306, 4.6.3).
//!
//! A device refuses others with abort code 06090030h or one of its relatives. Files have slips: limits that
//! exclude every value do not count, and [`lint`](crate::eds::lint) reports them.

use std::ops::RangeInclusive;

use thiserror::Error;

use crate::NodeId;
use crate::data_type::{self, Kind};
use crate::eds::{EdsObject, Number, value};
use crate::object::Object;

/// Error of a value outside the limits of its object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{object} must be within {low}..={high} of the EDS, got {value}")]
pub struct OutsideLimits {
    /// Object whose limits are exceeded.
    pub object: Object,
    /// Refused value.
    pub value: i128,
    /// Smallest permitted value.
    pub low: i128,
    /// Largest permitted value.
    pub high: i128,
}

impl EdsObject {
    /// Returns the values that the object takes in `node`: its limits, or else the range of its data type.
    /// `None` for other types than integers and BOOLEAN.
    pub fn limits(&self, node: NodeId) -> Option<RangeInclusive<i128>> {
        let range = data_type::find(self.data_type)?.range()?;
        let limit = |limit: Option<Number>| limit.map(|limit| limit.resolve(node));
        let low = limit(self.low).unwrap_or(*range.start());
        let high = limit(self.high).unwrap_or(*range.end());
        Some(if low > high { range } else { low..=high })
    }

    /// Checks a number for `node`.
    ///
    /// # Errors
    /// Returns an error for a number outside the limits.
    pub fn check_number(&self, number: i128, node: NodeId) -> Result<(), OutsideLimits> {
        let object = self.object;
        match self.limits(node) {
            Some(limits) if !limits.contains(&number) => {
                let (low, high) = limits.into_inner();
                Err(OutsideLimits { object, value: number, low, high })
            }
            Some(_) | None => Ok(()),
        }
    }

    /// Checks a value for `node`, little-endian, signed or not as the data type is.
    ///
    /// # Errors
    /// Returns an error for a value outside the limits.
    pub fn check_content(&self, content: &[u8], node: NodeId) -> Result<(), OutsideLimits> {
        match data_type::find(self.data_type).map(|data_type| data_type.kind) {
            Some(Kind::Signed) => self.check_number(value::signed(content), node),
            Some(Kind::Boolean | Kind::Unsigned) => {
                self.check_number(value::unsigned(content), node)
            }
            Some(Kind::Real | Kind::Text | Kind::UnicodeText | Kind::Octets) | None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eds::Eds;

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    fn described(data_type: u16, limits: &str) -> EdsObject {
        let text = format!(
            "[2000]\nParameterName=x\nObjectType=7\nDataType={data_type}\nAccessType=rw\n{limits}\n"
        );
        Eds::parse(text.as_bytes()).unwrap().objects()[0].clone()
    }

    #[test]
    fn absent_limits_are_those_of_the_type() {
        assert_eq!(described(5, "").limits(node()), Some(0..=255));
        assert_eq!(described(3, "LowLimit=-5").limits(node()), Some(-5..=32_767));
        assert_eq!(described(6, "HighLimit=9").limits(node()), Some(0..=9));
        assert_eq!(described(8, "HighLimit=9").limits(node()), None, "REAL32");
        assert_eq!(described(9, "").limits(node()), None, "VISIBLE_STRING");
    }

    #[test]
    fn signed_values_are_compared_with_signed_limits() {
        let torque = described(3, "LowLimit=0xFF9C\nHighLimit=100");
        assert_eq!(torque.limits(node()), Some(-100..=100));
        assert_eq!(torque.check_content(&(-100_i16).to_le_bytes(), node()), Ok(()));
        let refused = torque.check_content(&(-101_i16).to_le_bytes(), node()).unwrap_err();
        assert_eq!(refused.to_string(), "2000h must be within -100..=100 of the EDS, got -101");
        assert!(described(6, "HighLimit=100").check_content(&[0xFF, 0xFF], node()).is_err());
    }

    #[test]
    fn node_id_is_added_to_limits() {
        let cob_id = described(7, "LowLimit=$NODEID+0x80\nHighLimit=0x100+$NODEID");
        assert_eq!(cob_id.limits(node()), Some(0x83..=0x103));
        assert!(cob_id.check_number(0x82, node()).is_err());
    }

    #[test]
    fn limits_that_exclude_every_value_do_not_count() {
        assert_eq!(described(5, "LowLimit=9\nHighLimit=1").limits(node()), Some(0..=255));
    }
}
