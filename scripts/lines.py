#!/usr/bin/env python3
"""lines.py: counts the lines of code of each room, without blank lines, comments and what is compiled only for tests.

usage: scripts/lines.sh [--json | --check | --functions]
"""

import argparse
import json
import re
import sys
from collections import Counter
from pathlib import Path

from rust_source import blanked, functions, test_files, tests

ROOT = Path(__file__).resolve().parent.parent
# Lines of each part at the last release, to compare with: a figure to look at, no limit (ADR 36).
LAST_RELEASE = {"rack": 43_956, "bench": 45_502, "lab": 4_649}
MAX_FUNCTION_LINES = 60
PUBLIC = re.compile(r"(?m)^\s*pub (?:const |async |unsafe |extern )*(?:fn|struct|enum|trait|const|static|type|mod|union|macro) ")


def is_test_code(file, test_roots):
    """Returns whether a file, or a folder above it, is a module that is compiled only for tests."""
    return file in test_roots or any(root.name == "mod.rs" and root.parent in file.parents or
                                     root.with_suffix("") in file.parents for root in test_roots)


def long_functions(code):
    """Yields (first line, length in lines, name) of every function of more than MAX_FUNCTION_LINES lines of code."""
    for start, end, signature in functions(code, []):
        first = start - len(signature)
        length = sum(1 for line in code[first:end + 1].split("\n") if line.strip())
        if length > MAX_FUNCTION_LINES:
            yield code.count("\n", 0, first) + 1, length, re.match(r"fn (\w+)", signature)[1]


def room_of(file):
    """Returns the part and the room of a file below src/ or lab/src/; a program itself is a room."""
    if ROOT / "lab" in file.parents:
        return "lab", "frhc-lab"
    parts = file.relative_to(ROOT / "src").parts
    part = "bench" if parts[0] == "bench" else "rack"
    parts = parts[1:] if part == "bench" else parts
    return part, parts[0] if len(parts) > 1 and parts[0] != "program" else "frhc"


def measured():
    """Returns lines, public items and long functions by (part, room)."""
    files = sorted(file for folder in ("src", "lab/src") for file in (ROOT / folder).rglob("*.rs"))
    test_roots = set().union(*(test_files(file) for file in files))
    lines, public, long = Counter(), Counter(), []
    for file in files:
        if is_test_code(file, test_roots):
            continue
        text = blanked(file.read_text(), keep_strings=True)
        code = blanked(file.read_text())
        spans, _ = tests(code)
        for first, last in spans:
            # Lines keep their numbers.
            gap = re.sub(r"[^\n]", " ", text[first:last + 1])
            text, code = (whole[:first] + gap + whole[last + 1:] for whole in (text, code))
        lines[room_of(file)] += sum(1 for line in text.split("\n") if line.strip())
        public[room_of(file)] += len(PUBLIC.findall(code))
        long += [(room_of(file), file.relative_to(ROOT), *found) for found in long_functions(code)]
    return lines, public, long


def printed(lines, public, long):
    """Prints a table: a row for each room, and the sum of each part."""
    print("%-8s%-18s%8s%8s%6s" % ("part", "room", "lines", "public", "long"))
    for part in LAST_RELEASE:
        rooms = sorted(room for room in lines if room[0] == part)
        for room in rooms:
            count = sum(1 for found in long if found[0] == room)
            print("%-8s%-18s%8d%8d%6d" % (*room, lines[room], public[room], count))
        if rooms:
            count = sum(1 for found in long if found[0][0] == part)
            print("%-8s%-18s%8d%8d%6d" % (part, "(all)", sum(lines[room] for room in rooms),
                                        sum(public[room] for room in rooms), count))
    print("%-26s%8d%8d%6d" % ("(all)", lines.total(), public.total(), len(long)))
    print("at the last release: " + ", ".join("%s %d" % part for part in LAST_RELEASE.items()))


def checked(long):
    """Reports functions of the rack that are too long; returns whether there are any."""
    complaints = ["%s:%d: %s has %d lines, at most %d" % (path, line, name, length, MAX_FUNCTION_LINES)
                  for (part, _), path, line, length, name in long if part == "rack"]
    for complaint in complaints:
        print("lines: " + complaint, file=sys.stderr)
    return bool(complaints)


def main():
    parser = argparse.ArgumentParser(prog="scripts/lines.sh", description=__doc__.split("\n\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--check", action="store_true", help="print only functions of the rack that are too long, and fail there")
    parser.add_argument("--functions", action="store_true", help="print the functions of more than %d lines" % MAX_FUNCTION_LINES)
    args = parser.parse_args()
    lines, public, long = measured()
    if args.check:
        return checked(long)
    if args.functions:
        for _, path, line, length, name in long:
            print("%s:%d: %s, %d lines" % (path, line, name, length))
    elif args.json:
        print(json.dumps({"/".join(room): {"lines": lines[room], "public": public[room]} for room in sorted(lines)}, indent=1))
    else:
        printed(lines, public, long)
    return 0


if __name__ == "__main__":
    sys.exit(main())
