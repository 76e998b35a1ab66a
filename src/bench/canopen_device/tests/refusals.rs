//! Abort codes of invalid SDO requests, written from CiA 301: 7.2.4.3.17, table 22, and the clauses of the
//! objects in 7.5.2.

use std::sync::LazyLock;

use canopen_rs::sdo::SdoPayload;

use super::*;

/// Objects of types that the EDS of the drive lacks.
const MORE: &str = "
[1016sub2]
ParameterName=Consumer heartbeat time 2
ObjectType=0x7
DataType=0x0007
AccessType=rw
[5000]
ParameterName=Write only
ObjectType=0x7
DataType=0x0006
AccessType=wo
PDOMapping=1
[5001]
ParameterName=Variable length
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

fn fixture() -> Fixture {
    static EDS: LazyLock<Eds> = LazyLock::new(|| {
        let text = include_str!("../../../../eds/frhc_drive.eds");
        Eds::parse(format!("{text}{MORE}").as_bytes()).unwrap()
    });
    Fixture::from_eds(&EDS)
}

/// Request from text: `40 1018:9` and up to four bytes.
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

/// Sends `requests`: the last is aborted with this code and the multiplexer of its transfer, the others are not.
fn assert_abort(what: &str, requests: &[&str], code: u32) {
    let mut fixture = fixture();
    let (last, before) = requests.split_last().unwrap();
    for text in before {
        let sent = fixture.deliver(Frame::new(0x605, request(text)));
        let is_abort = |frame: &Frame| frame.cob_id == 0x585 && frame.data()[0] == 0x80;
        assert!(!sent.iter().any(is_abort), "{what}: {text} gives {sent:?}");
    }
    let sent = fixture.deliver(Frame::new(0x605, request(last)));
    let named = requests.iter().rev().find(|text| text.contains(':'));
    let [_, low, high, sub, ..] = named.map_or([0; 8], |text| request(text));
    let [a, b, c, d] = code.to_le_bytes();
    let abort = Frame::new(0x585, [0x80, low, high, sub, a, b, c, d]);
    assert_eq!(sent.last(), Some(&abort), "{what}: {requests:?}");
}

#[test]
fn upload_of_missing_or_write_only_objects_is_aborted() {
    for (what, requests, code) in [
        ("no such object", ["40 5FFF:0"], 0x0602_0000),
        ("no such object, block transfer", ["A4 5FFF:0 7F"], 0x0602_0000),
        ("no such entry of a record", ["40 1018:5"], 0x0609_0011),
        ("no such entry of an array", ["40 1003:9"], 0x0609_0011),
        ("variable with sub-index 1", ["40 1000:1"], 0x0609_0011),
        ("no such entry, block transfer", ["A4 1018:5 7F"], 0x0609_0011),
        ("sub-index 4 of an RPDO is reserved", ["40 1400:4"], 0x0609_0011),
        ("write only", ["40 5000:0"], 0x0601_0001),
        ("write only, block transfer", ["A4 5000:0 7F"], 0x0601_0001),
        ("error history entry that is empty (7.5.2.4)", ["40 1003:1"], 0x0800_0024),
        ("sub-block of 0 segments", ["A4 1008:0 00"], 0x0504_0002),
        ("sub-block of 128 segments", ["A4 1008:0 80"], 0x0504_0002),
    ] {
        assert_abort(what, &requests, code);
    }
}

#[test]
fn download_to_missing_or_read_only_objects_is_aborted() {
    for (what, requests, code) in [
        ("no such object", ["2F 5FFF:0 00"], 0x0602_0000),
        ("no such object, segmented", ["21 5FFF:0 08"], 0x0602_0000),
        ("no such object, block transfer", ["C6 5FFF:0 08"], 0x0602_0000),
        ("dummy entry", ["2B 0006:0 00 00"], 0x0602_0000),
        ("no such entry", ["2F 1018:5 00"], 0x0609_0011),
        ("no such entry, segmented", ["20 1018:5"], 0x0609_0011),
        ("no such entry, block transfer", ["C2 1018:5 04"], 0x0609_0011),
        ("const", ["23 1018:0 04"], 0x0601_0002),
        ("const, segmented", ["21 1008:0 08"], 0x0601_0002),
        ("const, block transfer", ["C6 1008:0 08"], 0x0601_0002),
        ("read only", ["23 1000:0 92 01 02 00"], 0x0601_0002),
        ("read only, wrong length", ["2F 1000:0 92"], 0x0601_0002),
        ("error register", ["2F 1001:0 00"], 0x0601_0002),
        ("error history entry", ["23 1003:1"], 0x0601_0002),
        ("stored EDS", ["21 1021:0 08"], 0x0601_0002),
        ("default SDO server (7.5.2.33)", ["23 1200:1 05 06"], 0x0601_0002),
        ("statusword", ["2B 6041:0 00 00"], 0x0601_0002),
    ] {
        assert_abort(what, &requests, code);
    }
}

#[test]
fn download_of_wrong_length_is_aborted() {
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
        ("UNSIGNED64, expedited", &["23 5004:0 01"], short),
        ("size indicated too large", &["21 6071:0 03"], long),
        ("size indicated too small", &["21 6071:0 01"], short),
        ("size indicated much too large", &["21 6071:0 FF FF FF FF"], long),
        ("last segment too long", &["20 6071:0", "09 01 02 03"], long),
        ("last segment too short", &["20 6071:0", "0D 01"], short),
        ("first segment too long", &["20 6071:0", "00 01 02 03"], long),
        ("longer than indicated", &["21 5001:0 02", "09 01 02 03"], long),
        ("size indicated too large, block transfer", &["C6 6071:0 03"], long),
        ("size indicated too small, block transfer", &["C2 6071:0 01"], short),
        ("shorter than indicated", &["C2 5001:0 08", "81 1 2 3 4 5 6 7", "C1"], short),
    ];
    for (what, requests, code) in rows {
        assert_abort(what, requests, code);
    }
}

#[test]
fn download_outside_the_limits_is_aborted() {
    let (high, low) = (0x0609_0031, 0x0609_0032);
    let rows: [(&str, &[&str], u32); 9] = [
        ("above", &["2B 6071:0 B9 0B"], high),
        ("below", &["2B 6071:0 47 F4"], low),
        ("INTEGER8 above", &["2F 5002:0 65"], high),
        ("INTEGER8 below", &["2F 5002:0 9B"], low),
        ("SYNC counter overflow of 241", &["2F 1019:0 F1"], high),
        ("error behaviour 3", &["2F 1029:1 03"], high),
        ("segmented", &["21 6071:0 02", "0B B9 0B"], high),
        ("block transfer", &["C2 6071:0 02", "81 B9 0B", "D5"], high),
        ("UNSIGNED64", &["21 5004:0 08", "00 11 0 0 0 0 0 0", "1D 00"], high),
    ];
    for (what, requests, code) in rows {
        assert_abort(what, requests, code);
    }
}

#[test]
fn download_of_invalid_values_is_aborted() {
    let invalid = 0x0609_0030;
    let rows: [(&str, &[&str], u32); 21] = [
        ("count of 1 in the error history (7.5.2.4)", &["2F 1003:0 01"], invalid),
        ("count of 255 in the error history", &["2F 1003:0 FF"], invalid),
        ("SYNC producer (7.5.2.5)", &["23 1005:0 80 00 00 40"], invalid),
        ("SYNC with 29 bits", &["23 1005:0 80 00 00 20"], invalid),
        ("SYNC on the COB-ID of NMT", &["23 1005:0 00"], invalid),
        ("SYNC on the COB-ID of an SDO", &["23 1005:0 05 06"], invalid),
        ("TIME producer (7.5.2.15)", &["23 1012:0 00 01 00 C0"], invalid),
        ("TIME with 29 bits", &["23 1012:0 00 01 00 A0"], invalid),
        ("EMCY on the COB-ID of a heartbeat", &["23 1014:0 05 07"], invalid),
        ("EMCY with 29 bits", &["23 1014:0 85 00 00 20"], invalid),
        ("reserved bits (7.5.2.19)", &["23 1016:1 14 00 7F 01"], invalid),
        ("SYNC counter overflow of 1 (7.5.2.22)", &["2F 1019:0 01"], invalid),
        ("RPDO on the COB-ID of SYNC", &["23 1400:1 80 00 00 80", "23 1400:1 80"], invalid),
        ("RPDO on the COB-ID of an SDO", &["23 1400:1 80 00 00 80", "23 1400:1 05 06"], invalid),
        ("RPDO with 29 bits", &["23 1400:1 05 02 00 20"], invalid),
        ("bits above the identifier", &["23 1400:1 05 12 00 80"], invalid),
        ("reserved transmission type of an RPDO", &["2F 1400:2 F1"], invalid),
        ("RPDO with an RTR-only type", &["2F 1400:2 FC"], invalid),
        ("reserved transmission type of a TPDO", &["2F 1800:2 FB"], invalid),
        ("RTR-only type without RTR allowed", &["23 1800:1 85 01 00 40", "2F 1800:2 FD"], invalid),
        ("SYNC start value of 241", &["23 1800:1 85 01 00 80", "2F 1800:6 F1"], 0x0609_0031),
    ];
    for (what, requests, code) in rows {
        assert_abort(what, requests, code);
    }
}

#[test]
fn download_forbidden_by_the_device_state_is_aborted() {
    let state = 0x0800_0022;
    let rows: [(&str, &[&str], u32); 11] = [
        ("COB-ID of a valid RPDO (7.5.2.35)", &["23 1400:1 05 03"], state),
        ("COB-ID of a valid TPDO (7.5.2.37)", &["23 1800:1 85 02"], state),
        ("inhibit time of a valid TPDO", &["2B 1800:3 64 00"], state),
        ("SYNC start value of a valid TPDO", &["2F 1800:6 01"], state),
        ("mapping of a valid RPDO (7.5.2.36)", &["2F 1600:0 00"], state),
        ("mapping entry of a valid RPDO", &["23 1600:1 10 00 71 60"], state),
        ("mapping of a valid TPDO (7.5.2.38)", &["2F 1A00:0 00"], state),
        ("mapping entry of a valid TPDO", &["23 1A00:1 10 00 41 60"], state),
        ("COB-ID of a valid EMCY (7.5.2.17)", &["23 1014:0 85 06"], state),
        ("COB-ID of TIME while consuming (7.5.2.15)", &["23 1012:0 05 03 00 80"], state),
        (
            "SYNC counter overflow while a cycle period is set (7.5.2.22)",
            &["23 1006:0 E8 03", "2F 1019:0 0A"],
            state,
        ),
    ];
    for (what, requests, code) in rows {
        assert_abort(what, requests, code);
    }
}

#[test]
fn invalid_pdo_mappings_are_aborted() {
    let rpdo_off = "23 1400:1 05 02 00 80";
    let tpdo_off = "23 1800:1 85 01 00 80";
    let (no_object, unmappable, exceeds) = (0x0602_0000, 0x0604_0041, 0x0604_0042);
    let rows: [(&str, &[&str], u32); 15] = [
        ("no such object", &[rpdo_off, "2F 1600:0", "23 1600:1 10 00 FF 5F"], no_object),
        ("no such entry", &[rpdo_off, "2F 1600:0", "23 1600:1 20 09 18 10"], 0x0609_0011),
        ("not mappable", &[tpdo_off, "2F 1A00:0", "23 1A00:1 20 01 18 10"], unmappable),
        (
            "read-only object in an RPDO",
            &[rpdo_off, "2F 1600:0", "23 1600:1 20 00 64 60"],
            unmappable,
        ),
        (
            "write-only object in a TPDO",
            &[tpdo_off, "2F 1A00:0", "23 1A00:1 10 00 00 50"],
            unmappable,
        ),
        (
            "length above that of the object",
            &[rpdo_off, "2F 1600:0", "23 1600:1 20 00 71 60"],
            unmappable,
        ),
        (
            "length below that of the object",
            &[rpdo_off, "2F 1600:0", "23 1600:1 08 00 71 60"],
            unmappable,
        ),
        ("length 0", &[rpdo_off, "2F 1600:0", "23 1600:1 00 00 71 60"], unmappable),
        (
            "object of variable length",
            &[rpdo_off, "2F 1600:0", "23 1600:1 08 00 01 50"],
            unmappable,
        ),
        ("dummy entry in a TPDO", &[tpdo_off, "2F 1A00:0", "23 1A00:1 10 00 06 00"], unmappable),
        (
            "number of entries above those mapped",
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
        ("9 entries", &[rpdo_off, "2F 1600:0", "2F 1600:0 09"], no_object),
        ("MPDO", &[tpdo_off, "2F 1A00:0", "2F 1A00:0 FE"], no_object),
        (
            "mapping entry while the number of entries is not 0",
            &[tpdo_off, "23 1A00:2 20 00 64 60"],
            0x0601_0000,
        ),
    ];
    for (what, requests, code) in rows {
        assert_abort(what, requests, code);
    }
}

#[test]
fn download_with_conflicts_or_wrong_signature_is_aborted() {
    let rows: [(&str, &[&str], u32); 4] = [
        (
            "two consumer heartbeat times for one node (7.5.2.19)",
            &["23 1016:1 14 00 7F 00", "23 1016:2 28 00 7F 00"],
            0x0604_0043,
        ),
        (
            "store parameters, signature reversed (7.5.2.13)",
            &["23 1010:1 65 76 61 73"],
            0x0800_0020,
        ),
        ("store parameters, signature of restore", &["23 1010:1 6C 6F 61 64"], 0x0800_0020),
        (
            "restore defaults, signature of store (7.5.2.14)",
            &["23 1011:1 73 61 76 65"],
            0x0800_0020,
        ),
    ];
    for (what, requests, code) in rows {
        assert_abort(what, requests, code);
    }
}

#[test]
fn protocol_violations_abort_the_transfer() {
    let unknown = 0x0504_0001;
    let rows: [(&str, &[&str], u32); 18] = [
        ("unknown command specifier", &["E0 1000:0"], unknown),
        ("unknown command specifier within a transfer", &["20 5001:0", "E0"], unknown),
        ("download segment without a transfer", &["00 1 2 3 4 5 6 7"], unknown),
        ("upload segment without a transfer", &["60"], unknown),
        ("upload segment in a download", &["20 5001:0", "60"], unknown),
        ("download segment in an upload", &["40 1008:0", "00"], unknown),
        ("start of a block upload without initiate", &["A3"], unknown),
        ("end of a block upload without initiate", &["A1"], unknown),
        ("end of a block download without initiate", &["C1"], unknown),
        ("first download segment with toggle 1", &["20 5001:0", "10"], 0x0503_0000),
        ("second download segment with toggle 0", &["20 5001:0", "00", "00"], 0x0503_0000),
        ("first upload segment with toggle 1", &["40 1008:0", "70"], 0x0503_0000),
        ("second upload segment with toggle 0", &["40 1008:0", "60", "60"], 0x0503_0000),
        ("sequence number 0", &["C6 5001:0 0E", "00"], 0x0504_0003),
        ("acknowledged sequence number too high", &["A4 1008:0 02", "A3", "A2 03 02"], 0x0504_0003),
        ("wrong CRC", &["C6 5001:0 07", "81 1 2 3 4 5 6 7", "C1 01 02"], 0x0504_0004),
        ("size above the buffer", &["21 5001:0 FF FF FF FF"], 0x0504_0005),
        ("excess size, block transfer", &["C2 5001:0 FF FF FF FF"], 0x0504_0005),
    ];
    for (what, requests, code) in rows {
        assert_abort(what, requests, code);
    }
}

#[test]
fn transfer_is_aborted_after_the_client_timeout() {
    let mut fixture = fixture();
    fixture.deliver(Frame::new(0x605, request("20 5001:0")));
    let sent = fixture.wait_until(10_000);
    assert_eq!(sent, [Frame::new(0x585, [0x80, 0x01, 0x50, 0, 0, 0, 4, 5])], "05040000h");
}

#[test]
fn aborted_downloads_change_nothing() {
    let mut fixture = fixture();
    let before = fixture.device.dictionary().clone();
    for text in ["2B 6071:0 B9 0B", "23 1014:0 85 06", "2F 1003:0 01", "23 1010:1", "2F 1600:0 02"]
    {
        fixture.deliver(Frame::new(0x605, request(text)));
    }
    assert_eq!(*fixture.device.dictionary(), before);
    assert_eq!(fixture.device.application().written, []);
}
