//! Every wrong access and its abort code, as CiA 301 (7.2.4.3.17, table 22, and the objects' own clauses in
//! 7.5.2) has them; written from the standard, byte by byte.

use std::sync::LazyLock;

use canopen_rs::sdo::SdoPayload;

use super::*;

/// Objects of a kind the drive has none of.
const MORE: &str = "
[1016sub2]
ParameterName=Consumer heartbeat time 2
ObjectType=0x7
DataType=0x0007
AccessType=rw
[5000]
ParameterName=Written only
ObjectType=0x7
DataType=0x0006
AccessType=wo
PDOMapping=1
[5001]
ParameterName=Of any length
ObjectType=0x2
DataType=0x000F
AccessType=rw
[5002]
ParameterName=INTEGER8
ObjectType=0x7
DataType=0x0002
AccessType=rw
LowLimit=-100
HighLimit=100
[5003]
ParameterName=REAL32
ObjectType=0x7
DataType=0x0008
AccessType=rw
[5004]
ParameterName=UNSIGNED64
ObjectType=0x7
DataType=0x001B
AccessType=rw
HighLimit=0x10
";

fn desk() -> Desk {
    static EDS: LazyLock<Eds> = LazyLock::new(|| {
        let text = include_str!("../../../../eds/frhc_drive.eds");
        Eds::parse(format!("{text}{MORE}").as_bytes()).unwrap()
    });
    Desk::of(&EDS)
}

/// `40 1018:9` and up to four bytes: a request as an engineer reads it.
fn request(text: &str) -> SdoPayload {
    let mut payload = [0; 8];
    let mut parts = text.split_whitespace();
    payload[0] = u8::from_str_radix(parts.next().unwrap(), 16).unwrap();
    let mut at = 1;
    for part in parts {
        if let Some((index, sub)) = part.split_once(':') {
            let [low, high] = u16::from_str_radix(index, 16).unwrap().to_le_bytes();
            payload[1..4].copy_from_slice(&[low, high, u8::from_str_radix(sub, 16).unwrap()]);
            at = 4;
        } else {
            payload[at] = u8::from_str_radix(part, 16).unwrap();
            at += 1;
        }
    }
    payload
}

/// Says `requests` one after the other; the last is refused with this code, over the object that the first
/// of its transfer named, and the ones before are not.
fn is_refused(what: &str, requests: &[&str], code: u32) {
    let mut desk = desk();
    let (last, before) = requests.split_last().unwrap();
    for text in before {
        let sent = desk.deliver(Frame::new(0x605, request(text)));
        let is_abort = |frame: &Frame| frame.cob_id == 0x585 && frame.data()[0] == 0x80;
        assert!(!sent.iter().any(is_abort), "{what}: {text} gives {sent:?}");
    }
    let sent = desk.deliver(Frame::new(0x605, request(last)));
    let named = requests.iter().rev().find(|text| text.contains(':'));
    let [_, low, high, sub, ..] = named.map_or([0; 8], |text| request(text));
    let [a, b, c, d] = code.to_le_bytes();
    let abort = Frame::new(0x585, [0x80, low, high, sub, a, b, c, d]);
    assert_eq!(sent.last(), Some(&abort), "{what}: {requests:?}");
}

#[test]
fn what_is_not_there_or_not_to_be_read_is_not_read() {
    for (what, requests, code) in [
        ("no such object", ["40 5FFF:0"], 0x0602_0000),
        ("no such object, by blocks", ["A4 5FFF:0 7F"], 0x0602_0000),
        ("no such entry of a record", ["40 1018:5"], 0x0609_0011),
        ("no such entry of an array", ["40 1003:9"], 0x0609_0011),
        ("a variable has sub-index 0 alone", ["40 1000:1"], 0x0609_0011),
        ("no such entry, by blocks", ["A4 1018:5 7F"], 0x0609_0011),
        ("sub-index 4 of an RPDO is reserved", ["40 1400:4"], 0x0609_0011),
        ("write only", ["40 5000:0"], 0x0601_0001),
        ("write only, by blocks", ["A4 5000:0 7F"], 0x0601_0001),
        ("an error that never was (7.5.2.4)", ["40 1003:1"], 0x0800_0024),
        ("a sub-block of no segments", ["A4 1008:0 00"], 0x0504_0002),
        ("a sub-block of 128 segments", ["A4 1008:0 80"], 0x0504_0002),
    ] {
        is_refused(what, &requests, code);
    }
}

#[test]
fn what_is_not_there_or_not_to_be_written_is_not_written() {
    for (what, requests, code) in [
        ("no such object", ["2F 5FFF:0 00"], 0x0602_0000),
        ("no such object, in segments", ["21 5FFF:0 08"], 0x0602_0000),
        ("no such object, by blocks", ["C6 5FFF:0 08"], 0x0602_0000),
        ("a dummy is no object", ["2B 0006:0 00 00"], 0x0602_0000),
        ("no such entry", ["2F 1018:5 00"], 0x0609_0011),
        ("no such entry, in segments", ["20 1018:5"], 0x0609_0011),
        ("no such entry, by blocks", ["C2 1018:5 04"], 0x0609_0011),
        ("const", ["23 1018:0 04"], 0x0601_0002),
        ("const, in segments", ["21 1008:0 08"], 0x0601_0002),
        ("const, by blocks", ["C6 1008:0 08"], 0x0601_0002),
        ("read only", ["23 1000:0 92 01 02 00"], 0x0601_0002),
        ("read only, of whatever length", ["2F 1000:0 92"], 0x0601_0002),
        ("the error register", ["2F 1001:0 00"], 0x0601_0002),
        ("an error of the past", ["23 1003:1"], 0x0601_0002),
        ("the stored EDS", ["21 1021:0 08"], 0x0601_0002),
        ("the default SDO channel (7.5.2.33)", ["23 1200:1 05 06"], 0x0601_0002),
        ("the statusword", ["2B 6041:0 00 00"], 0x0601_0002),
    ] {
        is_refused(what, &requests, code);
    }
}

#[test]
fn a_value_of_another_length_is_not_written() {
    let (long, short) = (0x0607_0012, 0x0607_0013);
    let rows: [(&str, &[&str], u32); 22] = [
        ("UNSIGNED8 of 2 bytes", &["2B 1019:0 00 00"], long),
        ("UNSIGNED8 of 4 bytes", &["23 1019:0"], long),
        ("UNSIGNED16 of 1 byte", &["2F 1017:0 19"], short),
        ("UNSIGNED16 of 3 bytes", &["27 1017:0 19"], long),
        ("UNSIGNED32 of 2 bytes", &["2B 1006:0 E8 03"], short),
        ("UNSIGNED32 of 3 bytes", &["27 1006:0 E8 03"], short),
        ("INTEGER8 of 2 bytes", &["2B 5002:0 01 00"], long),
        ("INTEGER16 of 1 byte", &["2F 6071:0 01"], short),
        ("INTEGER16 of 4 bytes", &["23 6071:0 01"], long),
        ("INTEGER32 of 2 bytes", &["2B 607A:0 01"], short),
        ("REAL32 of 2 bytes", &["2B 5003:0 01"], short),
        ("UNSIGNED64, which no expedited one has", &["23 5004:0 01"], short),
        ("announced too long", &["21 6071:0 03"], long),
        ("announced too short", &["21 6071:0 01"], short),
        ("announced too long by far", &["21 6071:0 FF FF FF FF"], long),
        ("too long in the end", &["20 6071:0", "09 01 02 03"], long),
        ("too short in the end", &["20 6071:0", "0D 01"], short),
        ("too long in the middle", &["20 6071:0", "00 01 02 03"], long),
        ("longer than announced", &["21 5001:0 02", "09 01 02 03"], long),
        ("announced too long, by blocks", &["C6 6071:0 03"], long),
        ("announced too short, by blocks", &["C2 6071:0 01"], short),
        ("shorter than announced", &["C2 5001:0 08", "81 1 2 3 4 5 6 7", "C1"], short),
    ];
    for (what, requests, code) in rows {
        is_refused(what, requests, code);
    }
}

#[test]
fn a_value_outside_its_limits_is_not_written() {
    let (high, low) = (0x0609_0031, 0x0609_0032);
    let rows: [(&str, &[&str], u32); 9] = [
        ("above", &["2B 6071:0 B9 0B"], high),
        ("below", &["2B 6071:0 47 F4"], low),
        ("INTEGER8 above", &["2F 5002:0 65"], high),
        ("INTEGER8 below", &["2F 5002:0 9B"], low),
        ("a SYNC counter of 241", &["2F 1019:0 F1"], high),
        ("an error behaviour of 3", &["2F 1029:1 03"], high),
        ("in segments", &["21 6071:0 02", "0B B9 0B"], high),
        ("by blocks", &["C2 6071:0 02", "81 B9 0B", "D5"], high),
        ("UNSIGNED64", &["21 5004:0 08", "00 11 0 0 0 0 0 0", "1D 00"], high),
    ];
    for (what, requests, code) in rows {
        is_refused(what, requests, code);
    }
}

#[test]
fn a_value_that_means_nothing_is_not_written() {
    let invalid = 0x0609_0030;
    let rows: [(&str, &[&str], u32); 21] = [
        ("a history of one error (7.5.2.4)", &["2F 1003:0 01"], invalid),
        ("a history of more than there is room for", &["2F 1003:0 FF"], invalid),
        ("it makes no SYNC (7.5.2.5)", &["23 1005:0 80 00 00 40"], invalid),
        ("SYNC with 29 bits", &["23 1005:0 80 00 00 20"], invalid),
        ("SYNC where NMT is", &["23 1005:0 00"], invalid),
        ("SYNC where an SDO is", &["23 1005:0 05 06"], invalid),
        ("it makes no TIME (7.5.2.15)", &["23 1012:0 00 01 00 C0"], invalid),
        ("TIME with 29 bits", &["23 1012:0 00 01 00 A0"], invalid),
        ("EMCY where a heartbeat is", &["23 1014:0 05 07"], invalid),
        ("EMCY with 29 bits", &["23 1014:0 85 00 00 20"], invalid),
        ("reserved bits (7.5.2.19)", &["23 1016:1 14 00 7F 01"], invalid),
        ("a SYNC counter of 1 (7.5.2.22)", &["2F 1019:0 01"], invalid),
        ("an RPDO where SYNC is", &["23 1400:1 80 00 00 80", "23 1400:1 80"], invalid),
        ("an RPDO where an SDO is", &["23 1400:1 80 00 00 80", "23 1400:1 05 06"], invalid),
        ("an RPDO with 29 bits", &["23 1400:1 05 02 00 20"], invalid),
        ("bits beyond the identifier", &["23 1400:1 05 12 00 80"], invalid),
        ("reserved types of RPDOs", &["2F 1400:2 F1"], invalid),
        ("an RPDO on request", &["2F 1400:2 FC"], invalid),
        ("reserved types of TPDOs", &["2F 1800:2 FB"], invalid),
        (
            "a TPDO on request that answers none",
            &["23 1800:1 85 01 00 40", "2F 1800:2 FD"],
            invalid,
        ),
        ("a first SYNC of 241", &["23 1800:1 85 01 00 80", "2F 1800:6 F1"], 0x0609_0031),
    ];
    for (what, requests, code) in rows {
        is_refused(what, requests, code);
    }
}

#[test]
fn what_the_state_of_the_device_forbids_is_not_written() {
    let state = 0x0800_0022;
    let rows: [(&str, &[&str], u32); 11] = [
        ("an RPDO that is on moves (7.5.2.35)", &["23 1400:1 05 03"], state),
        ("a TPDO that is on moves (7.5.2.37)", &["23 1800:1 85 02"], state),
        ("the inhibit time of a TPDO that is on", &["2B 1800:3 64 00"], state),
        ("the first SYNC of a TPDO that is on", &["2F 1800:6 01"], state),
        ("the mapping of an RPDO that is on (7.5.2.36)", &["2F 1600:0 00"], state),
        ("a mapped object of an RPDO that is on", &["23 1600:1 10 00 71 60"], state),
        ("the mapping of a TPDO that is on (7.5.2.38)", &["2F 1A00:0 00"], state),
        ("a mapped object of a TPDO that is on", &["23 1A00:1 10 00 41 60"], state),
        ("EMCY that is on moves (7.5.2.17)", &["23 1014:0 85 06"], state),
        ("TIME that is heard moves (7.5.2.15)", &["23 1012:0 05 03 00 80"], state),
        (
            "SYNC is counted otherwise within a cycle (7.5.2.22)",
            &["23 1006:0 E8 03", "2F 1019:0 0A"],
            state,
        ),
    ];
    for (what, requests, code) in rows {
        is_refused(what, requests, code);
    }
}

#[test]
fn what_cannot_be_mapped_is_not_mapped() {
    let rpdo_off = "23 1400:1 05 02 00 80";
    let tpdo_off = "23 1800:1 85 01 00 80";
    let (no_object, unmappable, exceeds) = (0x0602_0000, 0x0604_0041, 0x0604_0042);
    let rows: [(&str, &[&str], u32); 15] = [
        ("no such object", &[rpdo_off, "2F 1600:0", "23 1600:1 10 00 FF 5F"], no_object),
        ("no such entry", &[rpdo_off, "2F 1600:0", "23 1600:1 20 09 18 10"], 0x0609_0011),
        ("not mappable", &[tpdo_off, "2F 1A00:0", "23 1A00:1 20 01 18 10"], unmappable),
        (
            "read only is not received",
            &[rpdo_off, "2F 1600:0", "23 1600:1 20 00 64 60"],
            unmappable,
        ),
        ("written only is not sent", &[tpdo_off, "2F 1A00:0", "23 1A00:1 10 00 00 50"], unmappable),
        ("more bits than it has", &[rpdo_off, "2F 1600:0", "23 1600:1 20 00 71 60"], unmappable),
        ("fewer bits than it has", &[rpdo_off, "2F 1600:0", "23 1600:1 08 00 71 60"], unmappable),
        ("no bits", &[rpdo_off, "2F 1600:0", "23 1600:1 00 00 71 60"], unmappable),
        ("of any length", &[rpdo_off, "2F 1600:0", "23 1600:1 08 00 01 50"], unmappable),
        ("a dummy is not sent", &[tpdo_off, "2F 1A00:0", "23 1A00:1 10 00 06 00"], unmappable),
        (
            "counted without being there",
            &[rpdo_off, "2F 1600:0", "23 1600:1", "2F 1600:0 01"],
            no_object,
        ),
        (
            "72 bits",
            &[
                tpdo_off,
                "2F 1A00:0",
                "23 1A00:1 20 00 64 60",
                "23 1A00:2 20 00 6C 60",
                "23 1A00:3 10 00 77 60",
                "2F 1A00:0 03",
            ],
            exceeds,
        ),
        ("more entries than there are", &[rpdo_off, "2F 1600:0", "2F 1600:0 09"], no_object),
        ("an MPDO", &[tpdo_off, "2F 1A00:0", "2F 1A00:0 FE"], no_object),
        ("while entries are counted", &[tpdo_off, "23 1A00:2 20 00 64 60"], 0x0601_0000),
    ];
    for (what, requests, code) in rows {
        is_refused(what, requests, code);
    }
}

#[test]
fn what_contradicts_another_object_or_lacks_its_signature_is_not_written() {
    let rows: [(&str, &[&str], u32); 4] = [
        (
            "two heartbeat times for one node (7.5.2.19)",
            &["23 1016:1 14 00 7F 00", "23 1016:2 28 00 7F 00"],
            0x0604_0043,
        ),
        ("to store without its signature (7.5.2.13)", &["23 1010:1 65 76 61 73"], 0x0800_0020),
        ("to store with that of loading", &["23 1010:1 6C 6F 61 64"], 0x0800_0020),
        ("to load without its signature (7.5.2.14)", &["23 1011:1 73 61 76 65"], 0x0800_0020),
    ];
    for (what, requests, code) in rows {
        is_refused(what, requests, code);
    }
}

#[test]
fn what_breaks_the_protocol_ends_the_transfer() {
    let unknown = 0x0504_0001;
    let rows: [(&str, &[&str], u32); 18] = [
        ("a command nobody knows", &["E0 1000:0"], unknown),
        ("the same within a transfer", &["20 5001:0", "E0"], unknown),
        ("a segment of no download", &["00 1 2 3 4 5 6 7"], unknown),
        ("a segment of no upload", &["60"], unknown),
        ("an upload's segment in a download", &["20 5001:0", "60"], unknown),
        ("a download's segment in an upload", &["40 1008:0", "00"], unknown),
        ("the start of no block", &["A3"], unknown),
        ("the end of no block", &["A1"], unknown),
        ("the end of no block download", &["C1"], unknown),
        ("a first segment with toggle 1", &["20 5001:0", "10"], 0x0503_0000),
        ("a second segment with toggle 0", &["20 5001:0", "00", "00"], 0x0503_0000),
        ("a first question with toggle 1", &["40 1008:0", "70"], 0x0503_0000),
        ("a second question with toggle 0", &["40 1008:0", "60", "60"], 0x0503_0000),
        ("segment 0 of a block", &["C6 5001:0 0E", "00"], 0x0504_0003),
        ("more segments than were sent", &["A4 1008:0 02", "A3", "A2 03 02"], 0x0504_0003),
        (
            "a checksum of other bytes",
            &["C6 5001:0 07", "81 1 2 3 4 5 6 7", "C1 01 02"],
            0x0504_0004,
        ),
        ("more bytes than there is room for", &["21 5001:0 FF FF FF FF"], 0x0504_0005),
        ("the same by blocks", &["C2 5001:0 FF FF FF FF"], 0x0504_0005),
    ];
    for (what, requests, code) in rows {
        is_refused(what, requests, code);
    }
}

#[test]
fn a_client_that_falls_silent_is_told_that_its_time_is_over() {
    let mut desk = desk();
    desk.deliver(Frame::new(0x605, request("20 5001:0")));
    let sent = desk.wait_until(10_000);
    assert_eq!(sent, [Frame::new(0x585, [0x80, 0x01, 0x50, 0, 0, 0, 4, 5])], "05040000h");
}

#[test]
fn a_refused_write_changes_nothing() {
    let mut desk = desk();
    let before = desk.device.dictionary().clone();
    for text in ["2B 6071:0 B9 0B", "23 1014:0 85 06", "2F 1003:0 01", "23 1010:1", "2F 1600:0 02"]
    {
        desk.deliver(Frame::new(0x605, request(text)));
    }
    assert_eq!(*desk.device.dictionary(), before);
    assert_eq!(desk.device.application().written, []);
}
