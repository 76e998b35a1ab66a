"""rooms.py: the walls between the crates, by their folders: reads `cargo metadata --no-deps` from standard input.

A crate of the rack lies in src/, one of the bench in src/bench/. The rack depends on no crate of the bench, not even for
its tests; the root package only by an optional dependency, and for its tests. Nothing depends on lab/. The simulation depends neither directly
nor by others on the crates that it judges.
"""

import json
import sys
from pathlib import Path

# What must not be below a crate, so that a mistake cannot cancel itself out.
APART = {"frhc-sim": {"frhc-controller", "frhc-robot", "frhc-remote"}}


def below(name, packages):
    """Returns every package of the workspace that one depends on, except for its tests."""
    found, left = set(), [name]
    while left:
        needed = packages[left.pop()]["dependencies"]
        new = {one["name"] for one in needed if one.get("path") and one["kind"] != "dev"} - found
        found |= new
        left += new
    return found


def main():
    metadata = json.load(sys.stdin)
    root = Path(metadata["workspace_root"])
    bench, lab = root / "src" / "bench", root / "lab"
    packages = {package["name"]: package for package in metadata["packages"]}
    complaints, rack = [], 0
    for name, package in packages.items():
        manifest = Path(package["manifest_path"])
        in_lab = [needed["name"] for needed in package["dependencies"] if needed.get("path") and Path(needed["path"]) == lab]
        complaints += ["%s depends on %s of the lab" % (name, one) for one in in_lab]
        if bench in manifest.parents:
            continue
        rack += 1
        is_root = manifest.parent == root
        for needed in package["dependencies"]:
            if not needed.get("path") or bench not in Path(needed["path"]).parents:
                continue
            if not (is_root and (needed["optional"] or needed["kind"] == "dev")):
                complaints.append("%s of the rack depends on %s of the bench" % (name, needed["name"]))
    for name, forbidden in APART.items():
        complaints += ["%s depends on %s" % (name, one) for one in sorted(below(name, packages) & forbidden)]
    if rack < 5 or rack == len(packages):
        complaints.append("%d of %d crates are in the rack: the folders are not those of ARCHITECTURE.md" % (rack, len(packages)))
    for complaint in complaints:
        print("rooms: " + complaint, file=sys.stderr)
    return bool(complaints)


if __name__ == "__main__":
    sys.exit(main())
