//! The SDO server of a device (CiA 301, 7.2.4.3): expedited and segmented, both ways.
//!
//! Only the protocol: what an object holds, and who may write it, is asked of [`Objects`]. The bytes are
//! put together here, from the standard, and not with the codecs the client uses, so that a mistake
//! cannot hide by being made twice.
//!
//! | byte 0 from the client | meaning                     | byte 0 from here |
//! |------------------------|-----------------------------|------------------|
//! | `001n nnes` (20h)      | download, begin             | 60h              |
//! | `000t nnnc` (00h)      | download, segment           | 20h, 30h         |
//! | `0100 0000` (40h)      | upload, begin               | 4xh              |
//! | `011t 0000` (60h)      | upload, segment             | `000t nnnc`      |
//! | `1000 0000` (80h)      | abort                       | none             |

use crate::canopen::abort::AbortCode;
use crate::canopen::object::Object;

/// No object is larger, in bytes.
const LARGEST: usize = 1 << 20;

/// What the server serves.
pub(super) trait Objects {
    /// What an object holds, if it may be read.
    fn read(&self, object: Object) -> Result<&[u8], AbortCode>;
    /// Whether an object may be written at all.
    fn may_write(&self, object: Object) -> Result<(), AbortCode>;
    /// Writes it.
    fn write(&mut self, object: Object, value: &[u8]) -> Result<(), AbortCode>;
}

/// One server, with at most one transfer under way.
#[derive(Clone, Debug, Default)]
pub(super) struct SdoServer {
    transfer: Option<Transfer>,
}

#[derive(Clone, Debug)]
struct Transfer {
    object: Object,
    way: Way,
    toggle: bool,
    data: Vec<u8>,
}

#[derive(Clone, Copy, Debug)]
enum Way {
    /// To the client; so many bytes have been sent.
    Upload(usize),
    /// From the client, which has announced so many bytes, or none.
    Download(Option<usize>),
}

impl SdoServer {
    /// Ends what is under way, without a word.
    pub(super) fn reset(&mut self) {
        self.transfer = None;
    }

    /// Answers one request.
    pub(super) fn answer(
        &mut self,
        request: [u8; 8],
        objects: &mut impl Objects,
    ) -> Option<[u8; 8]> {
        let [command, i0, i1, sub, d @ ..] = request;
        let object = Object { index: u16::from_le_bytes([i0, i1]), sub };
        let answered = match command >> 5 {
            0 => self.take_segment(request, objects),
            1 => self.begin_download(command, object, d, objects),
            2 => self.begin_upload(object, objects),
            3 => self.give_segment(command & 0x10 != 0),
            4 => {
                self.transfer = None;
                return None;
            }
            _ => Err((object, AbortCode::COMMAND_UNKNOWN)),
        };
        Some(answered.unwrap_or_else(|(object, code)| {
            self.transfer = None;
            abort(object, code)
        }))
    }

    fn begin_download(
        &mut self,
        command: u8,
        object: Object,
        data: [u8; 4],
        objects: &mut impl Objects,
    ) -> Answer {
        self.transfer = None;
        let failed = |code| (object, code);
        let (is_expedited, has_size) = (command & 0x02 != 0, command & 0x01 != 0);
        if is_expedited {
            let unused = if has_size { usize::from(command >> 2 & 0x03) } else { 0 };
            let value = data.get(..4 - unused).unwrap_or_default();
            objects.may_write(object).map_err(failed)?;
            objects.write(object, value).map_err(failed)?;
        } else {
            objects.may_write(object).map_err(failed)?;
            let announced = usize::try_from(u32::from_le_bytes(data)).unwrap_or(usize::MAX);
            if has_size && announced > LARGEST {
                return Err((object, AbortCode::OUT_OF_MEMORY));
            }
            let way = Way::Download(has_size.then_some(announced));
            self.transfer = Some(Transfer { object, way, toggle: false, data: Vec::new() });
        }
        Ok(confirm(0x60, object))
    }

    fn take_segment(&mut self, request: [u8; 8], objects: &mut impl Objects) -> Answer {
        let [command, segment @ ..] = request;
        let nobody = (Object { index: 0, sub: 0 }, AbortCode::COMMAND_UNKNOWN);
        let transfer = self.transfer.as_mut().ok_or(nobody)?;
        let Way::Download(announced) = transfer.way else {
            return Err((transfer.object, AbortCode::COMMAND_UNKNOWN));
        };
        let object = transfer.object;
        let toggle = command & 0x10 != 0;
        if toggle != transfer.toggle {
            return Err((object, AbortCode::TOGGLE_NOT_ALTERNATED));
        }
        transfer.toggle = !toggle;
        let unused = usize::from(command >> 1 & 0x07);
        transfer.data.extend_from_slice(segment.get(..7 - unused).unwrap_or_default());
        let length = transfer.data.len();
        if length > announced.unwrap_or(LARGEST) {
            return Err((object, AbortCode::LENGTH_TOO_HIGH));
        }
        let is_last = command & 0x01 != 0;
        if is_last {
            if announced.is_some_and(|announced| length < announced) {
                return Err((object, AbortCode::LENGTH_TOO_LOW));
            }
            let data = std::mem::take(&mut transfer.data);
            self.transfer = None;
            objects.write(object, &data).map_err(|code| (object, code))?;
        }
        Ok([0x20 | u8::from(toggle) << 4, 0, 0, 0, 0, 0, 0, 0])
    }

    fn begin_upload(&mut self, object: Object, objects: &impl Objects) -> Answer {
        self.transfer = None;
        let value = objects.read(object).map_err(|code| (object, code))?;
        let [_, i0, i1, sub, ..] = confirm(0, object);
        if let Some(unused) = 4_usize.checked_sub(value.len()).filter(|unused| *unused < 4) {
            let mut data = [0; 4];
            for (to, from) in data.iter_mut().zip(value) {
                *to = *from;
            }
            let [a, b, c, d] = data;
            let unused = u8::try_from(unused).unwrap_or(0);
            return Ok([0x43 | unused << 2, i0, i1, sub, a, b, c, d]);
        }
        let [a, b, c, d] = u32::try_from(value.len()).unwrap_or(u32::MAX).to_le_bytes();
        let data = value.to_vec();
        self.transfer = Some(Transfer { object, way: Way::Upload(0), toggle: false, data });
        Ok([0x41, i0, i1, sub, a, b, c, d])
    }

    fn give_segment(&mut self, toggle: bool) -> Answer {
        let nobody = (Object { index: 0, sub: 0 }, AbortCode::COMMAND_UNKNOWN);
        let transfer = self.transfer.as_mut().ok_or(nobody)?;
        let Way::Upload(sent) = &mut transfer.way else {
            return Err((transfer.object, AbortCode::COMMAND_UNKNOWN));
        };
        if toggle != transfer.toggle {
            return Err((transfer.object, AbortCode::TOGGLE_NOT_ALTERNATED));
        }
        transfer.toggle = !toggle;
        let left = transfer.data.get(*sent..).unwrap_or_default();
        let count = left.len().min(7);
        let mut segment = [0; 8];
        for (to, from) in segment.iter_mut().skip(1).zip(left) {
            *to = *from;
        }
        let is_last = left.len() <= 7;
        let unused = u8::try_from(7 - count).unwrap_or(0);
        if let Some(command) = segment.first_mut() {
            *command = u8::from(toggle) << 4 | unused << 1 | u8::from(is_last);
        }
        *sent += count;
        if is_last {
            self.transfer = None;
        }
        Ok(segment)
    }
}

/// The reply, or the object and the reason of an abort.
type Answer = Result<[u8; 8], (Object, AbortCode)>;

fn confirm(command: u8, object: Object) -> [u8; 8] {
    let [i0, i1] = object.index.to_le_bytes();
    [command, i0, i1, object.sub, 0, 0, 0, 0]
}

fn abort(object: Object, code: AbortCode) -> [u8; 8] {
    let [i0, i1] = object.index.to_le_bytes();
    let [a, b, c, d] = code.0.to_le_bytes();
    [0x80, i0, i1, object.sub, a, b, c, d]
}
