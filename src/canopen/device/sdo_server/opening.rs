//! What opens a transfer, seen from the server: the four requests that name an object, and the replies.
//!
//! The sizes of the object, of what was announced and of what may come at most must agree.

use canopen_rs::sdo::SdoPayload;
use canopen_rs::sdo::block::encode_sub_response;

use crate::abort::AbortCode;
use crate::device::sdo_server::Access;
use crate::device::sdo_server::SdoServer;
use crate::device::sdo_server::Transfer;
use crate::device::sdo_server::Way;
use crate::device::sdo_server::block;
use crate::device::sdo_server::block::SCS_BLOCK_DOWNLOAD;
use crate::device::sdo_server::block::SCS_BLOCK_UPLOAD;
use crate::device::sdo_server::segmented;
use crate::device::sdo_server::size::check_size;
use crate::object::Object;
use crate::sdo::MAX_BYTES;
use crate::sdo::Promise;
use crate::sdo::Receiver;

/// Segments that a sub-block of a download has.
pub(super) const BLOCK_SIZE: u8 = 127;

impl SdoServer {
    /// A write begins, and with four bytes or fewer ends.
    pub(super) fn on_download(
        &mut self,
        object: Object,
        [command, low, high, sub, four @ ..]: SdoPayload,
        objects: &mut impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let size = objects.size(object)?;
        let is_sized = command & SIZE_INDICATED != 0;
        if command & EXPEDITED != 0 {
            let told = is_sized.then_some(4 - usize::from(command >> 2 & 3));
            let taken = told.or(size).unwrap_or(4).min(4);
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

    /// Reads an object into the spare buffer, and takes it.
    fn value_of(&mut self, object: Object, objects: &impl Access) -> Result<Vec<u8>, AbortCode> {
        self.spare.clear();
        objects.read(object, &mut self.spare)?;
        Ok(std::mem::take(&mut self.spare))
    }

    /// A read begins, and with one to four bytes ends.
    pub(super) fn on_upload(
        &mut self,
        object: Object,
        objects: &impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let bytes = self.value_of(object, objects)?;
        Ok(Some(self.open_upload(object, bytes, objects.tells_sizes())))
    }

    /// The reply that opens an upload of `bytes`, expedited or segmented, and tells how many they are.
    fn open_upload(&mut self, object: Object, mut bytes: Vec<u8>, tells_size: bool) -> SdoPayload {
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
        if !tells_size {
            let [a, b, c, d] = if command == 0 { [0; 4] } else { [a, b, c, d] };
            let command = SCS_UPLOAD << 5 | command & EXPEDITED;
            return [command, low, high, object.sub, a, b, c, d];
        }
        [SCS_UPLOAD << 5 | SIZE_INDICATED | command, low, high, object.sub, a, b, c, d]
    }

    /// A read by blocks begins; a short one goes the other way, if the client says so.
    pub(super) fn on_block_upload(
        &mut self,
        object: Object,
        [command, low, high, sub, block_size, threshold, ..]: SdoPayload,
        objects: &impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let mut bytes = Vec::new();
        objects.read(object, &mut bytes)?;
        if threshold != 0 && bytes.len() <= usize::from(threshold) {
            return Ok(Some(self.open_upload(object, bytes, objects.tells_sizes())));
        }
        let [a, b, c, d] = announced(&bytes);
        let upload = block::Upload::new(bytes, block_size, command & CRC != 0)?;
        self.transfer = Some(Transfer { object, way: Way::BlockUp(upload) });
        let command = SCS_BLOCK_UPLOAD << 5 | command & CRC | SIZE_INDICATED_IN_BLOCK;
        Ok(Some([command, low, high, sub, a, b, c, d]))
    }

    /// A write by blocks begins.
    pub(super) fn on_block_download(
        &mut self,
        object: Object,
        request: SdoPayload,
        objects: &impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let [command, low, high, sub, four @ ..] = request;
        let is_sized = command & SIZE_INDICATED_IN_BLOCK != 0;
        let declared = agreed_size(objects.size(object)?, is_sized, four)?;
        let promise = Promise {
            declared,
            has_crc: command & CRC != 0,
            limit: MAX_BYTES,
            block_size: BLOCK_SIZE,
        };
        let nothing_yet = encode_sub_response(0, BLOCK_SIZE);
        let receiver = Receiver::new([request, nothing_yet], promise)?;
        self.transfer =
            Some(Transfer { object, way: Way::BlockDown(block::Download::new(receiver)) });
        let command = SCS_BLOCK_DOWNLOAD << 5 | command & CRC;
        Ok(Some([command, low, high, sub, BLOCK_SIZE, 0, 0, 0]))
    }
}

/// The size a value must have: as its object has it, or as it was announced.
///
/// # Errors
/// When these are not the same, or more is announced than may come.
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

/// The size of a value, as it is announced.
fn announced(bytes: &[u8]) -> [u8; 4] {
    u32::try_from(bytes.len()).unwrap_or(u32::MAX).to_le_bytes()
}

const SCS_UPLOAD: u8 = 2;
const SCS_DOWNLOAD: u8 = 3;

/// Bit e: the value is in this frame.
const EXPEDITED: u8 = 1 << 1;
/// Bit s: how long it is, is said.
const SIZE_INDICATED: u8 = 1;
/// The same where block transfer has it.
pub(super) const SIZE_INDICATED_IN_BLOCK: u8 = 1 << 1;
/// Bits cc and sc: a checksum is wanted, and there will be one. A server that offers one nobody wants
/// is misread by clients that look at sc alone.
const CRC: u8 = 1 << 2;
