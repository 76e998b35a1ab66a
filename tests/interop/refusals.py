"""Requests that a CANopen server must abort, and the abort codes.

Written from CiA 301 (7.2.4.3.17, table 22, and the object descriptions of 7.5.2), independent of our drives. Each row
contains the requests of a client, byte by byte, and the abort code for the last one.
"""

NO_OBJECT = 0x06020000
NO_SUB_INDEX = 0x06090011
READ_ONLY = 0x06010002
TOO_LONG = 0x06070012
TOO_SHORT = 0x06070013
INVALID = 0x06090030
TOO_HIGH = 0x06090031
TOO_LOW = 0x06090032
NOT_MAPPABLE = 0x06040041
PDO_TOO_LONG = 0x06040042
DEVICE_STATE = 0x08000022
NOT_STORED = 0x08000020
TOGGLE = 0x05030000
COMMAND = 0x05040001
BLOCK_SIZE = 0x05040002
CRC = 0x05040004
NO_MEMORY = 0x05040005


def frame(command, index, sub, data=b""):
    """A request with its multiplexer."""
    return bytes([command]) + index.to_bytes(2, "little") + bytes([sub]) + data.ljust(4, b"\0")


def read(index, sub=0):
    """Initiate upload."""
    return frame(0x40, index, sub)


def write(index, sub, value, size):
    """Expedited download of `size` bytes."""
    data = (value % (1 << 8 * size)).to_bytes(size, "little")
    return frame(0x23 | (4 - size) << 2, index, sub, data)


def write_long(index, sub, size=None):
    """Initiate a segmented download, with or without its size."""
    if size is None:
        return frame(0x20, index, sub)
    return frame(0x21, index, sub, size.to_bytes(4, "little"))


def segment(toggle, data, is_last=False):
    """A segment of a download."""
    return bytes([toggle << 4 | (7 - len(data)) << 1 | is_last]) + data.ljust(7, b"\0")


def write_blocks(index, sub, size=None, has_crc=False):
    """Initiate a block download."""
    command = 0xC0 | has_crc << 2 | (size is not None) << 1
    return frame(command, index, sub, (size or 0).to_bytes(4, "little"))


def read_blocks(index, sub, segments):
    """Initiate a block upload."""
    return frame(0xA0, index, sub, bytes([segments]))


def entry(index, sub, bits):
    """One object of a mapping."""
    return index << 16 | sub << 8 | bits


SAMPLES = 0x2000
OFF = 1 << 31

# What, what is sent, what the last of it is answered with.
REFUSALS = [
    # No such object; no such sub-index (attempts of every service).
    ("read of an index that is not there", [read(0x2FFF)], NO_OBJECT),
    ("read of the highest index", [read(0xFFFF)], NO_OBJECT),
    ("read of index 0", [read(0x0000)], NO_OBJECT),
    ("write to an index that is not there", [write(0x2FFF, 0, 0, 1)], NO_OBJECT),
    ("segmented write to it", [write_long(0x2FFF, 0, 8)], NO_OBJECT),
    ("block read of it", [read_blocks(0x2FFF, 0, 127)], NO_OBJECT),
    ("block write to it", [write_blocks(0x2FFF, 0, 8)], NO_OBJECT),
    ("read beyond a record", [read(0x1018, 5)], NO_SUB_INDEX),
    ("read of the last sub-index", [read(0x1018, 255)], NO_SUB_INDEX),
    ("read of a variable's sub-index", [read(0x6041, 1)], NO_SUB_INDEX),
    ("read of a reserved sub-index", [read(0x1800, 4)], NO_SUB_INDEX),
    ("write beyond a record", [write(0x1018, 9, 0, 1)], NO_SUB_INDEX),
    ("write to a variable's sub-index", [write(0x6072, 1, 0, 2)], NO_SUB_INDEX),
    ("segmented write beyond a record", [write_long(0x1016, 9, 8)], NO_SUB_INDEX),
    ("block read beyond a record", [read_blocks(0x1018, 9, 127)], NO_SUB_INDEX),
    ("block write beyond a record", [write_blocks(0x1018, 9, 8)], NO_SUB_INDEX),
    # Access.
    ("write to the statusword", [write(0x6041, 0, 0, 2)], READ_ONLY),
    ("write to the device type", [write(0x1000, 0, 0, 4)], READ_ONLY),
    ("write to the vendor-ID", [write(0x1018, 1, 0, 4)], READ_ONLY),
    ("write to a highest sub-index", [write(0x1018, 0, 4, 1)], READ_ONLY),
    ("write to the SDO server's COB-ID", [write(0x1200, 1, 0x601, 4)], READ_ONLY),
    ("write to an error of the past", [write(0x1003, 1, 0, 4)], READ_ONLY),
    ("segmented write to the device name", [write_long(0x1008, 0, 9)], READ_ONLY),
    ("block write to the device name", [write_blocks(0x1008, 0, 9)], READ_ONLY),
    # Length.
    ("one byte to UNSIGNED16", [write(0x6072, 0, 0, 1)], TOO_SHORT),
    ("three bytes to UNSIGNED16", [write(0x6072, 0, 0, 3)], TOO_LONG),
    ("four bytes to UNSIGNED16", [write(0x6072, 0, 0, 4)], TOO_LONG),
    ("two bytes to UNSIGNED8", [write(0x1029, 1, 0, 2)], TOO_LONG),
    ("two bytes to INTEGER8", [write(0x6060, 0, 0, 2)], TOO_LONG),
    ("one byte to INTEGER16", [write(0x6071, 0, 0, 1)], TOO_SHORT),
    ("two bytes to UNSIGNED32", [write(0x1016, 1, 0, 2)], TOO_SHORT),
    ("three bytes to INTEGER32", [write(0x607A, 0, 0, 3)], TOO_SHORT),
    ("eight bytes announced to UNSIGNED32", [write_long(0x1016, 1, 8)], TOO_LONG),
    ("one byte announced to UNSIGNED16", [write_long(0x6072, 0, 1)], TOO_SHORT),
    ("eight bytes in blocks to UNSIGNED16", [write_blocks(0x6072, 0, 8)], TOO_LONG),
    ("one byte in blocks to UNSIGNED32", [write_blocks(0x1016, 1, 1)], TOO_SHORT),
    (
        "three bytes in a segment to UNSIGNED16",
        [write_long(0x6072, 0), segment(0, b"\1\2\3", True)],
        TOO_LONG,
    ),
    (
        "one byte in a segment to UNSIGNED16",
        [write_long(0x6072, 0), segment(0, b"\1", True)],
        TOO_SHORT,
    ),
    # Range.
    ("max torque above its limit", [write(0x6072, 0, 3001, 2)], TOO_HIGH),
    ("target torque above its limit", [write(0x6071, 0, 3001, 2)], TOO_HIGH),
    ("target torque below its limit", [write(0x6071, 0, -3001, 2)], TOO_LOW),
    ("a SYNC counter above 240", [write(0x1019, 0, 241, 1)], TOO_HIGH),
    ("an error behaviour above 2", [write(0x1029, 1, 3, 1)], TOO_HIGH),
    ("a quick stop option above 8", [write(0x605A, 0, 9, 2)], TOO_HIGH),
    ("a quick stop option below 0", [write(0x605A, 0, -1, 2)], TOO_LOW),
    ("a halt option below 1", [write(0x605D, 0, 0, 2)], TOO_LOW),
    ("a fault reaction above 4", [write(0x605E, 0, 5, 2)], TOO_HIGH),
    ("an abort connection option above 3", [write(0x6007, 0, 4, 2)], TOO_HIGH),
    ("an unsupported mode (6502h)", [write(0x6060, 0, 5, 1)], INVALID),
    ("a TPDO of a reserved type", [write(0x1800, 2, 241, 1)], INVALID),
    ("an RPDO of a reserved type", [write(0x1400, 2, 253, 1)], INVALID),
    ("an error history that is not 0", [write(0x1003, 0, 1, 1)], INVALID),
    ("a PDO on an SDO's identifier", [write(0x1803, 1, OFF, 4), write(0x1803, 1, 0x601, 4)], INVALID),
    ("a PDO on NMT's identifier", [write(0x1803, 1, OFF, 4), write(0x1803, 1, 0, 4)], INVALID),
    (
        "a PDO with an identifier of 29 bits",
        [write(0x1803, 1, OFF, 4), write(0x1803, 1, 1 << 29 | 0x12345, 4)],
        INVALID,
    ),
    # State: valid communication objects cannot change (7.5.2.35 to 7.5.2.38).
    ("another identifier for an RPDO that is valid", [write(0x1400, 1, 0x222, 4)], DEVICE_STATE),
    ("another identifier for a TPDO that is valid", [write(0x1800, 1, 0x1A2, 4)], DEVICE_STATE),
    ("an inhibit time for a TPDO that is valid", [write(0x1800, 3, 10, 2)], DEVICE_STATE),
    ("fewer objects for an RPDO that is valid", [write(0x1600, 0, 0, 1)], DEVICE_STATE),
    ("another object for a TPDO that is valid", [write(0x1A00, 1, entry(0x6064, 0, 32), 4)], DEVICE_STATE),
    ("another identifier for a valid EMCY", [write(0x1014, 0, 0x222, 4)], DEVICE_STATE),
]

UNMAPPED = [write(0x1803, 1, OFF, 4), write(0x1A03, 0, 0, 1)]
UNMAPPED_RPDO = [write(0x1403, 1, OFF, 4), write(0x1603, 0, 0, 1)]


def mapped(*entries):
    """Requests that map objects into the invalid TPDO 4."""
    return [*UNMAPPED, *(write(0x1A03, sub, each, 4) for sub, each in enumerate(entries, 1))]


REFUSALS += [
    # Mapping (7.5.2.36, 7.5.2.38).
    ("a parameter in a TPDO", mapped(entry(0x6072, 0, 16)), NOT_MAPPABLE),
    ("length below the object's in a TPDO", mapped(entry(0x6064, 0, 16)), NOT_MAPPABLE),
    ("length above the object's in a TPDO", mapped(entry(0x6041, 0, 32)), NOT_MAPPABLE),
    ("a dummy in a TPDO", mapped(entry(0x0005, 0, 8)), NOT_MAPPABLE),
    ("a missing object in a TPDO", mapped(entry(0x2FFF, 0, 8)), NO_OBJECT),
    ("a missing sub-index in a TPDO", mapped(entry(0x6064, 1, 32)), NO_SUB_INDEX),
    (
        "the statusword in an RPDO",
        [*UNMAPPED_RPDO, write(0x1603, 1, entry(0x6041, 0, 16), 4)],
        NOT_MAPPABLE,
    ),
    (
        "ten bytes in a TPDO",
        [
            *mapped(entry(0x6064, 0, 32), entry(0x606C, 0, 32), entry(0x6041, 0, 16)),
            write(0x1A03, 0, 3, 1),
        ],
        PDO_TOO_LONG,
    ),
    # Store and restore: signatures (7.5.2.13, 7.5.2.14).
    ("a store without signature", [write(0x1010, 1, 1, 4)], NOT_STORED),
    ("a store signed in capitals", [frame(0x23, 0x1010, 1, b"SAVE")], NOT_STORED),
    ("a restore signed as a store", [frame(0x23, 0x1011, 1, b"save")], NOT_STORED),
    # The protocol itself (7.2.4.3).
    ("an unknown command specifier", [frame(0xE0, 0x1000, 0)], COMMAND),
    ("an upload segment of no transfer", [bytes([0x60]) + bytes(7)], COMMAND),
    ("a download segment of no transfer", [bytes(8)], COMMAND),
    ("an upload segment with the wrong toggle", [read(0x1008), bytes([0x70]) + bytes(7)], TOGGLE),
    (
        "a download segment with the wrong toggle",
        [write_long(SAMPLES, 0, 14), segment(1, b"1234567")],
        TOGGLE,
    ),
    ("a block of no segments", [read_blocks(0x1008, 0, 0)], BLOCK_SIZE),
    ("a block of 128 segments", [read_blocks(0x1008, 0, 128)], BLOCK_SIZE),
    (
        "a block whose checksum is wrong",
        [
            write_blocks(SAMPLES, 0, 7, has_crc=True),
            bytes([0x81]) + b"1234567",
            bytes([0xC1, 0xFF, 0xFF]) + bytes(5),
        ],
        CRC,
    ),
    ("a value larger than any memory", [write_long(SAMPLES, 0, 0xFFFFFFF0)], NO_MEMORY),
    ("excess size, block transfer", [write_blocks(SAMPLES, 0, 0xFFFFFFF0)], NO_MEMORY),
]
