#!/usr/bin/env python3
"""drive_eds.py: an EDS for each real drive in eds/drives/facts, with texts of our own.

  scripts/drive_eds.py           writes eds/drives/*.eds
  scripts/drive_eds.py --check   exits 1 if a committed file differs

Indices, types, access, defaults and limits are as in the maker's data sheet, slips included; an object
that only a default mapping mentions has the type of its length. Names are those of eds/frhc_drive.eds, which are CiA's.
"""

import argparse
import csv
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FACTS = ROOT / "eds/drives/facts"
FOLDER = ROOT / "eds/drives"
NAMES_FROM = ROOT / "eds/frhc_drive.eds"

MANDATORY = {0x1000, 0x1001, 0x1018}
MANUFACTURER = range(0x2000, 0x6000)
RPDO_MAPPINGS = range(0x1600, 0x1800)
TPDO_MAPPINGS = range(0x1A00, 0x1C00)
HEADS = {8, 9}  # ARRAY and RECORD

# Data types of objects that the facts mention in a default mapping only, by their length in bits: UNSIGNED8, 16, 32, 64.
UNSIGNED = {8: 5, 16: 6, 32: 7, 64: 0x1B}

# CiA's names of objects that our own drive does not have.
NAMES = {
    0x1F80: "NMT startup",
    0x6042: "vl target velocity",
    0x6043: "vl velocity demand",
    0x6044: "vl velocity actual value",
    0x6046: "vl velocity min max amount",
    0x6048: "vl velocity acceleration",
    0x6049: "vl velocity deceleration",
    0x604A: "vl velocity quick stop",
    0x604C: "vl dimension factor",
    0x604F: "vl ramp function time",
    0x6066: "Following error time out",
    0x6069: "Velocity sensor actual value",
    0x606A: "Sensor selection code",
    0x6082: "End velocity",
    0x6088: "Torque profile type",
    0x6089: "Position notation index",
    0x608A: "Position dimension index",
    0x608B: "Velocity notation index",
    0x608C: "Velocity dimension index",
    0x608D: "Acceleration notation index",
    0x608E: "Acceleration dimension index",
    0x6090: "Velocity encoder resolution",
    0x6093: "Position factor",
    0x6094: "Velocity encoder factor",
    0x6096: "Velocity factor",
    0x6097: "Acceleration factor",
    0x60A4: "Profile jerk",
    0x60B8: "Touch probe function",
    0x60B9: "Touch probe status",
    0x60BA: "Touch probe 1 positive edge",
    0x60BB: "Touch probe 1 negative edge",
    0x60BC: "Touch probe 2 positive edge",
    0x60BD: "Touch probe 2 negative edge",
    0x60C0: "Interpolation sub mode select",
    0x60C1: "Interpolation data record",
    0x60C3: "Interpolation sync definition",
    0x60C4: "Interpolation data configuration",
    0x60D0: "Touch probe source",
    0x60D5: "Touch probe 1 positive edge counter",
    0x60D6: "Touch probe 1 negative edge counter",
    0x60E4: "Additional position actual value",
    0x60E5: "Additional velocity actual value",
    0x60E6: "Additional position encoder increments",
    0x60E8: "Additional gear motor revolutions",
    0x60E9: "Additional feed",
    0x60EB: "Additional position encoder revolutions",
    0x60ED: "Additional gear shaft revolutions",
    0x60EE: "Additional feed revolutions",
    0x60F2: "Position option code",
    0x60F6: "Torque control parameters",
    0x60F8: "Max slippage",
    0x60F9: "Velocity control parameter set",
    0x60FA: "Control effort",
    0x60FB: "Position control parameter set",
    0x6402: "Motor type",
    0x6403: "Motor catalogue number",
    0x6404: "Motor manufacturer",
    0x6410: "Motor data",
    0x6503: "Drive catalogue number",
    0x6505: "http drive catalogue address",
    0x6510: "Drive data",
}


def read(name):
    with open(FACTS / name, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def standard_names():
    """Names by (index, sub-index) of our own drive; the index alone for heads and single objects."""
    names, place = {(index, None): name for index, name in NAMES.items()}, None
    for line in NAMES_FROM.read_text(encoding="ascii").splitlines():
        if line.startswith("["):
            title, _, sub = line.strip("[]").lower().partition("sub")
            try:
                place = (int(title, 16), int(sub, 16) if sub else None) if len(title) == 4 else None
            except ValueError:
                place = None
        elif place and line.startswith("ParameterName="):
            names[place] = line.removeprefix("ParameterName=")
    return names


def name_of(names, index, sub):
    if (index, sub) in names:
        return names[index, sub]
    if sub == 0:
        return "Highest sub-index supported"
    if (index, None) in names:
        return names[index, None] if sub is None else f"{names[index, None]} {sub}"
    kind = "Manufacturer object" if index in MANUFACTURER else "Object"
    return kind if sub is None else f"{kind} {sub}"


def flag(text):
    return "1" if text.strip() == "1" else "0"


def device_sections(device, path):
    drive, slug = device["drive"], device["file"]
    info = [
        ("VendorName", drive.split()[0]),
        ("VendorNumber", device["vendor_id"] or "0"),
        ("ProductName", drive),
        ("ProductNumber", device["product_code"] or "0"),
        ("RevisionNumber", device["revision"] or "0"),
        ("OrderCode", slug),
        *((f"BaudRate_{rate}", "0") for rate in (10, 20, 50, 125, 250)),
        ("BaudRate_500", flag(device["baud_500"])),
        ("BaudRate_800", "0"),
        ("BaudRate_1000", flag(device["baud_1000"])),
        ("SimpleBootUpMaster", "0"),
        ("SimpleBootUpSlave", "1"),
        ("Granularity", device["granularity"] or "0"),
        ("DynamicChannelsSupported", "0"),
        ("GroupMessaging", "0"),
        ("NrOfRXPDO", device["nr_rx_pdo"] or "0"),
        ("NrOfTXPDO", device["nr_tx_pdo"] or "0"),
        ("LSS_Supported", flag(device["lss"])),
    ]
    dummies = [("Dummy0001", "0")]
    dummies += [(f"Dummy000{index}", flag(device.get(f"dummy_000{index}h") or "")) for index in (2, 3, 4)]
    dummies += [(f"Dummy000{index}", "0") for index in (5, 6, 7)]
    file = [
        ("FileName", path.name),
        ("FileVersion", "1"),
        ("FileRevision", "0"),
        ("EDSVersion", "4.0"),
        ("Description", f"Facts of the data sheet {device['file_revision']}".rstrip("/ ") + ", texts of frhc"),
        ("CreationTime", "12:00AM"),
        ("CreationDate", "11-23-2026"),
        ("CreatedBy", "frhc"),
        ("ModificationTime", "12:00AM"),
        ("ModificationDate", "11-23-2026"),
        ("ModifiedBy", "frhc"),
    ]
    return [("FileInfo", file), ("DeviceInfo", info), ("DummyUsage", dummies)]


def object_section(names, row, count):
    index, sub = int(row["index"], 16), int(row["sub"], 16) if row["sub"] else None
    title = f"{index:04X}" if sub is None else f"{index:04X}sub{sub:X}"
    kind = int(row["object_type"], 0)
    entries = [("ParameterName", name_of(names, index, sub)), ("ObjectType", f"0x{kind:X}")]
    if sub is None and kind in HEADS:
        return title, [*entries, ("SubNumber", str(count))]
    entries += [("DataType", f"0x{int(row['data_type'], 0):04X}"), ("AccessType", row["access"])]
    values = [("DefaultValue", "default"), ("LowLimit", "low"), ("HighLimit", "high")]
    entries += [(key, row[column]) for key, column in values if row[column]]
    mapping = row["pdo_mapping"]
    return title, [*entries, ("PDOMapping", str(int(mapping, 0)) if mapping else "0")]


def mapped_only(rows):
    """Rows of the objects in default mappings that the facts do not describe otherwise."""
    known = {(int(row["index"], 16), int(row["sub"] or "0", 16)) for row in rows}
    heads = {index for index, _ in known}
    found = {}
    for row in rows:
        index = int(row["index"], 16)
        is_mapping = index in RPDO_MAPPINGS or index in TPDO_MAPPINGS
        if is_mapping and row["sub"] not in ("", "0") and row["default"]:
            entry = int(row["default"], 0)
            place, bits = (entry >> 16, entry >> 8 & 0xFF), entry & 0xFF
            if place[0] >= 0x2000 and place not in known and bits in UNSIGNED:
                access = "rww" if index in RPDO_MAPPINGS else "ro"
                before = found.get(place, (bits, access))[1]
                found[place] = (bits, access if access == before else "rw")
    empty = {"default": "", "low": "", "high": "", "pdo_mapping": "0"}
    for (index, sub), (bits, access) in sorted(found.items()):
        is_single = sub == 0
        if not is_single and index not in heads:
            heads.add(index)
            last = max(place[1] for place in found if place[0] == index)
            yield {**empty, "index": f"{index:X}", "sub": "", "object_type": "9"}
            yield {**empty, "index": f"{index:X}", "sub": "0", "object_type": "7", "data_type": "5", "access": "ro", "default": str(last)}
        yield {
            **empty, "index": f"{index:X}", "sub": "" if is_single else f"{sub:X}", "object_type": "7",
            "data_type": str(UNSIGNED[bits]), "access": access, "pdo_mapping": "1",
        }


def eds(device, rows, names):
    # Of a section that a file repeats the first counts.
    first = {(int(row["index"], 16), row["sub"]): row for row in reversed(rows)}
    rows = [*first.values(), *mapped_only(rows)]
    path = FOLDER / f"{device['file']}.eds"
    indices = sorted({int(row["index"], 16) for row in rows})
    subs = {index: 0 for index in indices}
    for row in rows:
        subs[int(row["index"], 16)] += row["sub"] != ""
    lists = [
        ("MandatoryObjects", [index for index in indices if index in MANDATORY]),
        ("OptionalObjects", [index for index in indices if index not in MANDATORY and index not in MANUFACTURER]),
        ("ManufacturerObjects", [index for index in indices if index in MANUFACTURER]),
    ]
    sections = device_sections(device, path)
    for title, listed in lists:
        numbered = [(str(place), f"0x{index:04X}") for place, index in enumerate(listed, 1)]
        sections.append((title, [("SupportedObjects", str(len(listed))), *numbered]))
    place = lambda row: (int(row["index"], 16), int(row["sub"], 16) if row["sub"] else -1)
    sections += [object_section(names, row, subs[int(row["index"], 16)]) for row in sorted(rows, key=place)]
    text = "\n".join("\n".join([f"[{title}]", *(f"{key}={value}" for key, value in entries), ""]) for title, entries in sections)
    return path, text


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare only; exit 1 if a file differs")
    check = parser.parse_args().check
    names, objects = standard_names(), {}
    for row in read("objects.csv"):
        objects.setdefault(row["drive"], []).append(row)
    made = dict(eds(device, objects[device["drive"]], names) for device in read("devices.csv") if device["file"])
    wrong = []
    for path, text in made.items():
        if check:
            is_same = path.exists() and path.read_text(encoding="ascii") == text
            wrong += [] if is_same else [path]
        else:
            path.write_text(text, encoding="ascii")
    wrong += [path for path in sorted(FOLDER.glob("*.eds")) if path not in made]
    for path in wrong:
        print(f"{path.relative_to(ROOT)} differs from eds/drives/facts: run scripts/drive_eds.py", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
