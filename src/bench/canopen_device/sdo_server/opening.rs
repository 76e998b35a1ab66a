//! Initiation of transfers at the server: the four requests that name an object, and their replies.
//!
//! The sizes of object, announcement and limit must agree.

use canopen_rs::sdo::SdoPayload;
use canopen_rs::sdo::block::encode_sub_response;

use crate::sdo_server::block::{
    self, SCS_BLOCK_DOWNLOAD, SCS_BLOCK_UPLOAD, SIZE_INDICATED_IN_BLOCK,
};
use crate::sdo_server::size::check_size;
use crate::sdo_server::{Access, SdoServer, Transfer, Way, segmented};
use canopen::abort::AbortCode;
use canopen::object::Object;
use canopen::sdo::{BlockParameters, MAX_BYTES, Receiver};

/// Segments per sub-block of a download.
pub(super) const BLOCK_SIZE: u8 = 127;

impl SdoServer {
    /// Initiates a download; four bytes or fewer complete it.
    pub(super) fn on_download(
        &mut self,
        object: Object,
        [command, low, high, sub, four @ ..]: SdoPayload,
        objects: &mut impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let size = objects.size(object)?;
        let is_sized = command & SIZE_INDICATED != 0;
        if command & EXPEDITED != 0 {
            let indicated = is_sized.then_some(4 - usize::from(command >> 2 & 3));
            let taken = indicated.or(size).unwrap_or(4).min(4);
            let bytes = four.get(..taken).unwrap_or(&four);
            check_size(size, bytes.len())?;
            objects.write(object, bytes)?;
        } else {
            let size = agreed_size(size, is_sized, four)?;
            self.transfer =
                Some(Transfer { object, way: Way::Down(segmented::Download::new(size)) });
        }
        Ok(Some([SCS_DOWNLOAD << 5, low, high, sub, 0, 0, 0, 0]))
    }

    /// Reads an object into the spare buffer and takes it.
    fn value_of(&mut self, object: Object, objects: &impl Access) -> Result<Vec<u8>, AbortCode> {
        self.spare.clear();
        objects.read(object, &mut self.spare)?;
        Ok(std::mem::take(&mut self.spare))
    }

    /// Initiates an upload; one to four bytes complete it.
    pub(super) fn on_upload(
        &mut self,
        object: Object,
        objects: &impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let bytes = self.value_of(object, objects)?;
        Ok(Some(self.open_upload(object, bytes, objects.indicates_size())))
    }

    /// Returns the upload response for `bytes`, expedited or segmented.
    fn open_upload(&mut self, object: Object, mut bytes: Vec<u8>, has_size: bool) -> SdoPayload {
        let [low, high] = object.index.to_le_bytes();
        let (command, [a, b, c, d]) = match *bytes.as_slice() {
            [a] => (EXPEDITED | 3 << 2, [a, 0, 0, 0]),
            [a, b] => (EXPEDITED | 2 << 2, [a, b, 0, 0]),
            [a, b, c] => (EXPEDITED | 1 << 2, [a, b, c, 0]),
            [a, b, c, d] => (EXPEDITED, [a, b, c, d]),
            _ => {
                let size = announced(&bytes);
                let upload = segmented::Upload::new(std::mem::take(&mut bytes));
                self.transfer = Some(Transfer { object, way: Way::Up(upload) });
                (0, size)
            }
        };
        self.spare = bytes;
        if !has_size {
            let [a, b, c, d] = if command == 0 { [0; 4] } else { [a, b, c, d] };
            let command = SCS_UPLOAD << 5 | command & EXPEDITED;
            return [command, low, high, object.sub, a, b, c, d];
        }
        [SCS_UPLOAD << 5 | SIZE_INDICATED | command, low, high, object.sub, a, b, c, d]
    }

    /// Initiates a block upload; a short value switches to segments if the client allows it.
    pub(super) fn on_block_upload(
        &mut self,
        object: Object,
        [command, low, high, sub, block_size, threshold, ..]: SdoPayload,
        objects: &impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let mut bytes = Vec::new();
        objects.read(object, &mut bytes)?;
        if threshold != 0 && bytes.len() <= usize::from(threshold) {
            return Ok(Some(self.open_upload(object, bytes, objects.indicates_size())));
        }
        let [a, b, c, d] = announced(&bytes);
        let upload = block::Upload::new(bytes, block_size, command & CRC != 0)?;
        self.transfer = Some(Transfer { object, way: Way::BlockUp(upload) });
        let command = SCS_BLOCK_UPLOAD << 5 | command & CRC | SIZE_INDICATED_IN_BLOCK;
        Ok(Some([command, low, high, sub, a, b, c, d]))
    }

    /// Initiates a block download.
    pub(super) fn on_block_download(
        &mut self,
        object: Object,
        request: SdoPayload,
        objects: &impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let [command, low, high, sub, four @ ..] = request;
        let is_sized = command & SIZE_INDICATED_IN_BLOCK != 0;
        let declared = agreed_size(objects.size(object)?, is_sized, four)?;
        let parameters = BlockParameters {
            declared,
            has_crc: command & CRC != 0,
            limit: MAX_BYTES,
            block_size: BLOCK_SIZE,
        };
        let nothing_yet = encode_sub_response(0, BLOCK_SIZE);
        let receiver = Receiver::new([request, nothing_yet], parameters)?;
        self.transfer = Some(Transfer { object, way: Way::BlockDown(receiver) });
        let command = SCS_BLOCK_DOWNLOAD << 5 | command & CRC;
        Ok(Some([command, low, high, sub, BLOCK_SIZE, 0, 0, 0]))
    }
}

/// Returns the required size: that of the object, or the announced one.
///
/// # Errors
/// Returns an abort code if they differ, or if the announced size exceeds the limit.
fn agreed_size(
    size: Option<usize>,
    is_announced: bool,
    four: [u8; 4],
) -> Result<Option<usize>, AbortCode> {
    if !is_announced {
        return Ok(size);
    }
    let announced = usize::try_from(u32::from_le_bytes(four)).unwrap_or(usize::MAX);
    check_size(size, announced)?;
    Ok(Some(announced))
}

/// Size of a value, as announced.
fn announced(bytes: &[u8]) -> [u8; 4] {
    u32::try_from(bytes.len()).unwrap_or(u32::MAX).to_le_bytes()
}

const SCS_UPLOAD: u8 = 2;
const SCS_DOWNLOAD: u8 = 3;

/// Bit e: the frame carries the value.
const EXPEDITED: u8 = 1 << 1;
/// Bit s: the size is indicated.
const SIZE_INDICATED: u8 = 1;
/// Bits cc and sc: CRC support of client and server. Offered only on request, because some clients evaluate sc
/// alone.
const CRC: u8 = 1 << 2;
