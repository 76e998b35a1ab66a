//! Little-endian CDR of fixed length (OMG DDS-XTypes 1.3, 7.4): an encapsulation header of four bytes, then numbers aligned
//! to their size. Explicit reserved fields take the place of padding.

use crate::reject::Reject;

/// Encapsulation header: plain CDR, little-endian, no options.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Length of the encapsulation header, in bytes.
pub(crate) const ENCAPSULATION_LENGTH: usize = ENCAPSULATION.len();

/// Writer of a message; bytes not written remain zero.
#[derive(Debug)]
pub(crate) struct Writer<'b> {
    rest: &'b mut [u8],
}

impl<'b> Writer<'b> {
    /// Starts a message with its encapsulation header.
    pub(crate) fn new(bytes: &'b mut [u8]) -> Self {
        let mut writer = Self { rest: bytes };
        writer.put(ENCAPSULATION);
        writer
    }

    /// Appends bytes; drops them if they do not fit. Lengths are constants, and tests compare them.
    pub(crate) fn put<const N: usize>(&mut self, part: [u8; N]) {
        if let Some((place, rest)) = std::mem::take(&mut self.rest).split_first_chunk_mut() {
            *place = part;
            self.rest = rest;
        }
    }

    /// Appends numbers as little-endian IEEE 754 binary64.
    pub(crate) fn numbers(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|number| self.put(number.to_le_bytes()));
    }
}

/// Reader of a received message.
#[derive(Debug)]
pub(crate) struct Reader<'b> {
    rest: &'b [u8],
}

impl<'b> Reader<'b> {
    /// Creates a reader behind the encapsulation header, or returns [`Reject::Foreign`].
    pub(crate) fn new(bytes: &'b [u8]) -> Result<Self, Reject> {
        let rest = bytes.strip_prefix(&ENCAPSULATION).ok_or(Reject::Foreign)?;
        Ok(Self { rest })
    }

    pub(crate) fn take<const N: usize>(&mut self) -> Result<[u8; N], Reject> {
        let (taken, rest) = self.rest.split_first_chunk().ok_or(Reject::Length)?;
        self.rest = rest;
        Ok(*taken)
    }

    pub(crate) fn numbers<const N: usize>(&mut self) -> Result<[f64; N], Reject> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = f64::from_le_bytes(self.take()?);
        }
        Ok(numbers)
    }
}

/// Packs flags into a byte, the first into bit 0.
pub(crate) fn packed<const N: usize>(flags: [bool; N]) -> u8 {
    flags.into_iter().rev().fold(0, |bits, is_set| bits << 1 | u8::from(is_set))
}

/// Unpacks flags from a byte; other bits must be zero.
pub(crate) fn unpacked<const N: usize>(bits: u8) -> Result<[bool; N], Reject> {
    let flags = std::array::from_fn(|place| bits >> place & 1 == 1);
    if packed(flags) == bits { Ok(flags) } else { Err(Reject::Impossible) }
}

/// Returns whether all numbers are within ±`limit`; NaN is not.
pub(crate) fn are_within(numbers: &[f64], limit: f64) -> bool {
    numbers.iter().all(|number| number.abs() <= limit)
}
