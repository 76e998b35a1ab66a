//! Datagrams of RDT (Raw Data Transfer), the protocol of ATI's Net F/T over UDP. All numbers are big-endian.
//!
//! ```text
//!  request    0 u16 1234h          2 u16 command       4 u32 number of records, 0: until the next request
//!  record     0 u32 RDT sequence   4 u32 F/T sequence  8 u32 status, 0: valid   12 i32[6] Fx Fy Fz Tx Ty Tz, in counts
//! ```

/// First bytes of a request: 1234h.
const HEADER: [u8; 2] = [0x12, 0x34];

/// Request to a sensor. The sensor does not acknowledge requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Stops the records.
    Stop,
    /// Starts one record per sample, without a buffer, until the next request. The RDT sequence restarts.
    Stream,
    /// Sets the present load as zero, for all readers of this sensor.
    Bias,
}

impl Request {
    /// Length, in bytes.
    pub const LENGTH: usize = 8;

    /// Returns the number of the command.
    const fn command(self) -> u16 {
        match self {
            Self::Stop => 0,
            Self::Stream => 2,
            Self::Bias => 0x42,
        }
    }

    /// Returns the datagram.
    pub const fn encode(self) -> [u8; Self::LENGTH] {
        let [h1, h0] = HEADER;
        let [c1, c0] = self.command().to_be_bytes();
        [h1, h0, c1, c0, 0, 0, 0, 0]
    }
}

/// One sample of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// Number of the record since the request to stream; wraps around.
    pub rdt_sequence: u32,
    /// Number of the sample inside the sensor; wraps around.
    pub ft_sequence: u32,
    /// Status of the sensor; 0 for a valid sample.
    pub status: u32,
    /// Force x, y, z and moment x, y, z, in counts.
    pub counts: [i32; 6],
}

impl Record {
    /// Length, in bytes.
    pub const LENGTH: usize = 36;

    /// Decodes a datagram; returns `None` for one of another length.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let (words, []) = bytes.as_chunks() else { return None };
        let &[rdt_sequence, ft_sequence, status, fx, fy, fz, mx, my, mz] = words else {
            return None;
        };
        Some(Self {
            rdt_sequence: u32::from_be_bytes(rdt_sequence),
            ft_sequence: u32::from_be_bytes(ft_sequence),
            status: u32::from_be_bytes(status),
            counts: [fx, fy, fz, mx, my, mz].map(i32::from_be_bytes),
        })
    }

    /// Returns the datagram, as a sensor sends it.
    pub fn encode(&self) -> [u8; Self::LENGTH] {
        let head = [self.rdt_sequence, self.ft_sequence, self.status].map(u32::to_be_bytes);
        let counts = self.counts.map(i32::to_be_bytes);
        let words = head.as_flattened().iter().chain(counts.as_flattened());
        let mut bytes = [0; Self::LENGTH];
        bytes.iter_mut().zip(words).for_each(|(place, byte)| *place = *byte);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn requests_have_the_bytes_of_the_protocol() {
        assert_eq!(Request::Stop.encode(), [0x12, 0x34, 0, 0, 0, 0, 0, 0]);
        assert_eq!(Request::Stream.encode(), [0x12, 0x34, 0, 2, 0, 0, 0, 0]);
        assert_eq!(Request::Bias.encode(), [0x12, 0x34, 0, 0x42, 0, 0, 0, 0]);
    }

    #[test]
    fn record_has_the_bytes_of_the_protocol() {
        let record = Record {
            rdt_sequence: 0x0102_0304,
            ft_sequence: 5,
            status: 0x8001_0000,
            counts: [1, -1, i32::MAX, i32::MIN, 256, 0],
        };
        let mut expected = vec![1, 2, 3, 4, 0, 0, 0, 5, 0x80, 1, 0, 0, 0, 0, 0, 1];
        expected.extend([0xff, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 0x80, 0, 0, 0]);
        expected.extend([0, 0, 1, 0, 0, 0, 0, 0]);
        assert_eq!(record.encode().as_slice(), expected);
        assert_eq!(Record::decode(&expected), Some(record));
    }

    proptest! {
        #[test]
        fn any_bytes_decode_by_their_length_alone(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let record = Record::decode(&bytes);
            prop_assert_eq!(record.is_some(), bytes.len() == Record::LENGTH);
            if let Some(record) = record {
                prop_assert_eq!(record.encode().to_vec(), bytes);
            }
        }
    }
}
