//! Ratio of the integers in two sub-indices, as in 608Fh, 6091h and 6092h.

use derive_more::Display;

/// Ratio of sub-index 1 to sub-index 2.
#[derive(Clone, Copy, Debug, Display)]
#[display("{}:{}", self.0, self.1)]
pub struct Ratio(pub u32, pub u32);

impl Ratio {
    /// One to one.
    pub const ONE: Self = Self(1, 1);

    /// Returns the reduced product with an integer; `None` beyond 32 bits.
    pub fn times(self, factor: u32) -> Option<Self> {
        let (of, to) = (u64::from(self.0) * u64::from(factor), u64::from(self.1));
        let divisor = common_divisor(of, to).max(1);
        Some(Self(u32::try_from(of / divisor).ok()?, u32::try_from(to / divisor).ok()?))
    }

    /// Returns the quotient; infinite or NaN for a ratio to zero.
    pub fn value(self) -> f64 {
        f64::from(self.0) / f64::from(self.1)
    }
}

/// Returns the greatest common divisor; zero of two zeros.
const fn common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// Equal as numbers; a ratio to zero equals nothing.
impl PartialEq for Ratio {
    fn eq(&self, other: &Self) -> bool {
        let cross = |a: u32, b: u32| u64::from(a) * u64::from(b);
        self.1 != 0 && other.1 != 0 && cross(self.0, other.1) == cross(other.0, self.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn product_of_a_ratio_is_reduced() {
        let times = |ratio: Ratio, factor| ratio.times(factor).map(|it| it.to_string());
        assert_eq!(times(Ratio(5_308_416, 65_536), 16_384).as_deref(), Some("1327104:1"));
        assert_eq!(times(Ratio(2, 3), 5).as_deref(), Some("10:3"));
        assert_eq!(times(Ratio(u32::MAX, 1), 2), None);
    }
}
