//! What a transfer brings back, and what it carries there.

use canopen_rs::Value;

/// What an object holds, as far as the transfer can tell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Content {
    bytes: Vec<u8>,
    size: Size,
}

/// How the number of bytes is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Size {
    /// The node told it.
    #[default]
    Told,
    /// The node did not tell it, but every byte counts.
    Counted,
    /// Expedited without a size: how many of the four bytes count is not said.
    Open,
}

impl Content {
    pub(super) const fn new(bytes: Vec<u8>, size: Size) -> Self {
        Self { bytes, size }
    }

    /// Every byte there is; an expedited reply that does not tell its size has four.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The `size` bytes of the object's type, `None` if the node sent another number of them.
    pub fn exactly(&self, size: usize) -> Option<&[u8]> {
        if self.size == Size::Open { self.bytes.get(..size) } else { Some(self.bytes()) }
            .filter(|bytes| bytes.len() == size)
    }

    /// Whether the node told how many bytes there are.
    pub fn is_size_told(&self) -> bool {
        self.size == Size::Told
    }
}

/// A value as SDO carries it, little-endian.
pub fn bytes(value: &Value) -> Vec<u8> {
    let mut bytes = vec![0; value.size()];
    // It fails only for a buffer that is too small, and then writes nothing.
    value.encode_le(&mut bytes).map_or_else(|_| Vec::new(), |_| bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_reply_without_a_size_can_be_cut_to_the_size_of_the_type() {
        for size in [Size::Told, Size::Counted] {
            let content = Content::new(vec![1, 2, 3, 4], size);
            assert_eq!((content.exactly(4), content.exactly(2)), (Some(&[1, 2, 3, 4][..]), None));
        }
        let open = Content::new(vec![1, 2, 3, 4], Size::Open);
        assert_eq!((open.exactly(2), open.exactly(5)), (Some(&[1, 2][..]), None));
        assert!(!open.is_size_told());
    }
}
