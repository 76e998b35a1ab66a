//! What the kernel says of one network interface: an `RTM_GETLINK` request and its answer, byte by byte
//! (linux/netlink.h, linux/rtnetlink.h, linux/if_link.h, linux/can/netlink.h).
//!
//! ```text
//!  nlmsghdr 16 │ ifinfomsg 16 │ attribute │ attribute │ …
//!                              └ length 2, type 2, what it holds, padding to 4
//! ```
//!
//! Only what a node must know is read. Bytes that are no such answer say nothing, and never panic.

/// Of a request and of an answer.
const HEADER: usize = 16;

/// `struct ifinfomsg`, between the header and the attributes.
const LINK: usize = 16;

/// Types of messages.
mod message {
    /// An answer.
    pub(super) const NEW_LINK: u16 = 16;
    /// A request.
    pub(super) const GET_LINK: u16 = 18;
    /// The flag of every request.
    pub(super) const REQUEST: u16 = 1;
}

/// Types of attributes. Those that hold others are marked by a bit that is none of the type.
mod attribute {
    /// The interface's name, ended by a zero.
    pub(super) const NAME: u16 = 3;
    /// The name of its queueing discipline.
    pub(super) const QDISC: u16 = 6;
    /// Frames that may wait for the driver.
    pub(super) const QUEUE: u16 = 13;
    /// Holds [`KIND`] and [`OF_KIND`].
    pub(super) const LINK_INFO: u16 = 18;
    /// In it: the name of the kind of driver.
    pub(super) const KIND: u16 = 1;
    /// In it: what only this kind has.
    pub(super) const OF_KIND: u16 = 2;
    /// In that, of a CAN controller: milliseconds from bus-off to a restart; 0 is never.
    pub(super) const RESTART: u16 = 6;
    /// The bits of a type that are its number.
    pub(super) const TYPE: u16 = u16::MAX >> 2;
}

/// What is known of an interface.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Link {
    /// `IFF_…`.
    pub(super) flags: u32,
    /// Its queueing discipline: `noqueue`, `pfifo_fast`, …
    pub(super) qdisc: String,
    /// Frames that may wait for the driver, where its queueing discipline lets any.
    pub(super) queue: u32,
    /// The kind of driver: `can`, `vcan`, …
    pub(super) kind: String,
    /// Milliseconds from bus-off to a restart by itself; 0 is never. `None` without a CAN controller.
    pub(super) restart_millis: Option<u32>,
}

/// Asks for the interface of this name; names are shorter than 16 bytes.
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

/// Reads the answer; `None` if it is none.
pub(super) fn answer(bytes: &[u8]) -> Option<Link> {
    let kind = u16::from_ne_bytes(bytes.get(4..6)?.try_into().ok()?);
    if kind != message::NEW_LINK {
        return None;
    }
    let flags = u32::from_ne_bytes(bytes.get(HEADER + 8..HEADER + 12)?.try_into().ok()?);
    let mut link = Link { flags, ..Link::default() };
    for (kind, held) in Attributes(bytes.get(HEADER + LINK..)?) {
        match kind {
            attribute::QDISC => link.qdisc = text(held),
            attribute::QUEUE => link.queue = number(held)?,
            attribute::LINK_INFO => link.of_driver(held),
            _ => {}
        }
    }
    Some(link)
}

impl Link {
    fn of_driver(&mut self, held: &[u8]) {
        for (kind, held) in Attributes(held) {
            match kind {
                attribute::KIND => self.kind = text(held),
                attribute::OF_KIND => {
                    let mut restart =
                        Attributes(held).filter(|(kind, _)| *kind == attribute::RESTART);
                    self.restart_millis = restart.find_map(|(_, held)| number(held));
                }
                _ => {}
            }
        }
    }
}

/// Attributes that follow each other, by type and what they hold.
struct Attributes<'a>(&'a [u8]);

impl<'a> Iterator for Attributes<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let &[l0, l1, k0, k1, ref rest @ ..] = self.0 else { return None };
        let length = usize::from(u16::from_ne_bytes([l0, l1])).checked_sub(4)?;
        let held = rest.get(..length)?;
        self.0 = rest.get(length.next_multiple_of(4)..).unwrap_or_default();
        Some((u16::from_ne_bytes([k0, k1]) & attribute::TYPE, held))
    }
}

fn number(held: &[u8]) -> Option<u32> {
    held.try_into().ok().map(u32::from_ne_bytes)
}

fn text(held: &[u8]) -> String {
    let until_zero = held.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(until_zero).into_owned()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn attribute(kind: u16, held: &[u8]) -> Vec<u8> {
        let length = u16::try_from(4 + held.len()).unwrap();
        let mut bytes = [length.to_ne_bytes(), kind.to_ne_bytes()].concat();
        bytes.extend(held);
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
    fn an_answer_about_a_controller_says_how_it_queues_and_restarts() {
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
            Some(Link { flags: 0x4_00C1, qdisc, queue: 10, kind, restart_millis })
        );
    }

    #[test]
    fn a_request_holds_its_own_length_and_the_name() {
        let bytes = request("vcan0");
        assert_eq!(bytes.len() % 4, 0);
        assert_eq!(bytes[..4], u32::try_from(bytes.len()).unwrap().to_ne_bytes());
        assert_eq!(&bytes[HEADER + LINK + 4..][..6], b"vcan0\0");
    }

    proptest! {
        #[test]
        fn any_bytes_are_an_answer_or_none(
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
