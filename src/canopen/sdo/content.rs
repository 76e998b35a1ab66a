//! Content of a transfer.

use canopen_rs::Value;

/// Content of an object, as the transfer delivers it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Content {
    bytes: Vec<u8>,
    size: Size,
}

/// Knowledge of the size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Size {
    /// Indicated by the server.
    #[default]
    Indicated,
    /// Not indicated; every received byte counts.
    Counted,
    /// Expedited without an indicated size: some of the four bytes may be unused.
    Unknown,
}

impl Content {
    pub(super) const fn new(bytes: Vec<u8>, size: Size) -> Self {
        Self { bytes, size }
    }

    /// All received bytes; four for an expedited reply without an indicated size.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the `size` bytes of the object's type; `None` if the node sent another number of bytes.
    pub fn exactly(&self, size: usize) -> Option<&[u8]> {
        if self.size == Size::Unknown { self.bytes.get(..size) } else { Some(self.bytes()) }
            .filter(|bytes| bytes.len() == size)
    }

    /// Returns whether the server indicated the size.
    pub fn has_size(&self) -> bool {
        self.size == Size::Indicated
    }
}

/// Encodes a value for SDO, little-endian.
pub fn bytes(value: &Value) -> Vec<u8> {
    let mut bytes = vec![0; value.size()];
    // Encoding fails only for a buffer that is too small.
    value.encode_le(&mut bytes).map_or_else(|_| Vec::new(), |_| bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_content_of_unknown_size_is_cut_to_the_type() {
        for size in [Size::Indicated, Size::Counted] {
            let content = Content::new(vec![1, 2, 3, 4], size);
            assert_eq!((content.exactly(4), content.exactly(2)), (Some(&[1, 2, 3, 4][..]), None));
        }
        let open = Content::new(vec![1, 2, 3, 4], Size::Unknown);
        assert_eq!((open.exactly(2), open.exactly(5)), (Some(&[1, 2][..]), None));
        assert!(!open.has_size());
    }
}
