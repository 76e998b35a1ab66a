//! `RTM_GETLINK` request and response about one network interface (linux/netlink.h, linux/rtnetlink.h,
//! linux/if_link.h, linux/can/netlink.h).
//!
//! ```text
//!  nlmsghdr 16 │ ifinfomsg 16 │ attribute │ attribute │ …
//!                              └ length 2, type 2, payload, padding to 4
//! ```
//!
//! Reads only the attributes that a node needs. Malformed responses give `None`, never a panic.

/// Size of the header of request and response.
const HEADER: usize = 16;

/// Size of `struct ifinfomsg`, between header and attributes.
const LINK: usize = 16;

/// Message types.
mod message {
    /// Response.
    pub(super) const NEW_LINK: u16 = 16;
    /// Request.
    pub(super) const GET_LINK: u16 = 18;
    /// Flag of a request.
    pub(super) const REQUEST: u16 = 1;
}

/// Attribute types. A flag outside the type marks nested attributes.
mod attribute {
    /// Interface name, with a terminating zero.
    pub(super) const NAME: u16 = 3;
    /// Name of the queueing discipline.
    pub(super) const QDISC: u16 = 6;
    /// Transmit queue length, in frames.
    pub(super) const QUEUE: u16 = 13;
    /// Nested [`KIND`] and [`OF_KIND`].
    pub(super) const LINK_INFO: u16 = 18;
    /// Nested: kind of driver.
    pub(super) const KIND: u16 = 1;
    /// Nested: attributes of this kind.
    pub(super) const OF_KIND: u16 = 2;
    /// Nested twice, for CAN: restart delay after bus-off, in ms; 0 for never.
    pub(super) const RESTART: u16 = 6;
    /// Bits of the type number.
    pub(super) const TYPE: u16 = u16::MAX >> 2;
}

/// Link attributes that the kernel reports (`RTM_NEWLINK`).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct InterfaceProperties {
    /// Interface flags (`IFF_…`).
    pub(super) flags: u32,
    /// Queueing discipline: `noqueue`, `pfifo_fast`, …
    pub(super) qdisc: String,
    /// Transmit queue length, in frames, if the queueing discipline uses it.
    pub(super) queue: u32,
    /// Kind of driver: `can`, `vcan`, …
    pub(super) kind: String,
    /// Restart delay after bus-off, in ms; 0 for never. `None` without a CAN controller.
    pub(super) restart_millis: Option<u32>,
}

/// Encodes a request for the interface of this name, shorter than 16 bytes.
pub(super) fn request(interface: &str) -> Vec<u8> {
    let mut bytes = vec![0; HEADER + LINK];
    let name = interface.as_bytes();
    let length = u16::try_from(4 + name.len() + 1).unwrap_or(u16::MAX);
    bytes.extend(length.to_ne_bytes());
    bytes.extend(attribute::NAME.to_ne_bytes());
    bytes.extend(name);
    bytes.push(0);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let whole = u32::try_from(bytes.len()).unwrap_or(u32::MAX).to_ne_bytes();
    let header = whole.into_iter();
    let header = header.chain(message::GET_LINK.to_ne_bytes());
    let header = header.chain(message::REQUEST.to_ne_bytes());
    bytes.iter_mut().zip(header).for_each(|(to, from)| *to = from);
    bytes
}

/// Decodes the response; `None` for anything else.
pub(super) fn answer(bytes: &[u8]) -> Option<InterfaceProperties> {
    let kind = u16::from_ne_bytes(bytes.get(4..6)?.try_into().ok()?);
    if kind != message::NEW_LINK {
        return None;
    }
    let flags = u32::from_ne_bytes(bytes.get(HEADER + 8..HEADER + 12)?.try_into().ok()?);
    let mut link = InterfaceProperties { flags, ..InterfaceProperties::default() };
    for (kind, payload) in Attributes(bytes.get(HEADER + LINK..)?) {
        match kind {
            attribute::QDISC => link.qdisc = text(payload),
            attribute::QUEUE => link.queue = number(payload)?,
            attribute::LINK_INFO => link.of_driver(payload),
            _ => {}
        }
    }
    Some(link)
}

impl InterfaceProperties {
    fn of_driver(&mut self, payload: &[u8]) {
        for (kind, payload) in Attributes(payload) {
            match kind {
                attribute::KIND => self.kind = text(payload),
                attribute::OF_KIND => {
                    let mut restart =
                        Attributes(payload).filter(|(kind, _)| *kind == attribute::RESTART);
                    self.restart_millis = restart.find_map(|(_, payload)| number(payload));
                }
                _ => {}
            }
        }
    }
}

/// Iterator over attributes: type and payload.
struct Attributes<'a>(&'a [u8]);

impl<'a> Iterator for Attributes<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let &[l0, l1, k0, k1, ref rest @ ..] = self.0 else { return None };
        let length = usize::from(u16::from_ne_bytes([l0, l1])).checked_sub(4)?;
        let payload = rest.get(..length)?;
        self.0 = rest.get(length.next_multiple_of(4)..).unwrap_or_default();
        Some((u16::from_ne_bytes([k0, k1]) & attribute::TYPE, payload))
    }
}

fn number(payload: &[u8]) -> Option<u32> {
    payload.try_into().ok().map(u32::from_ne_bytes)
}

fn text(payload: &[u8]) -> String {
    let until_zero = payload.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(until_zero).into_owned()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn attribute(kind: u16, payload: &[u8]) -> Vec<u8> {
        let length = u16::try_from(4 + payload.len()).unwrap();
        let mut bytes = [length.to_ne_bytes(), kind.to_ne_bytes()].concat();
        bytes.extend(payload);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }

    fn link(attributes: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = vec![0; HEADER + LINK];
        bytes[4..6].copy_from_slice(&message::NEW_LINK.to_ne_bytes());
        bytes[HEADER + 8..HEADER + 12].copy_from_slice(&0x4_00C1_u32.to_ne_bytes());
        bytes.extend(attributes.concat());
        bytes
    }

    #[test]
    fn response_has_queue_and_restart_delay() {
        let restart = attribute(attribute::RESTART, &100_u32.to_ne_bytes());
        let of_can = attribute(attribute::OF_KIND | 0x8000, &restart);
        let driver = [attribute(attribute::KIND, b"can\0"), of_can].concat();
        let answered = answer(&link(&[
            attribute(attribute::QDISC, b"pfifo_fast\0"),
            attribute(attribute::QUEUE, &10_u32.to_ne_bytes()),
            attribute(attribute::LINK_INFO, &driver),
        ]));
        let (qdisc, kind) = ("pfifo_fast".to_owned(), "can".to_owned());
        let restart_millis = Some(100);
        assert_eq!(
            answered,
            Some(InterfaceProperties { flags: 0x4_00C1, qdisc, queue: 10, kind, restart_millis })
        );
    }

    #[test]
    fn request_has_its_length_and_the_name() {
        let bytes = request("vcan0");
        assert_eq!(bytes.len() % 4, 0);
        assert_eq!(bytes[..4], u32::try_from(bytes.len()).unwrap().to_ne_bytes());
        assert_eq!(&bytes[HEADER + LINK + 4..][..6], b"vcan0\0");
    }

    proptest! {
        #[test]
        fn any_bytes_are_decoded_or_refused(
            mut bytes in proptest::collection::vec(any::<u8>(), 0..200),
            is_answer: bool,
        ) {
            if is_answer && bytes.len() > 6 {
                bytes[4..6].copy_from_slice(&message::NEW_LINK.to_ne_bytes());
            }
            prop_assert!(answer(&bytes).is_none() || bytes.len() >= HEADER + LINK);
        }
    }
}
