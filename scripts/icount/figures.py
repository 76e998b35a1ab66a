#!/usr/bin/env python3
"""figures.py: reads what scripts/icount.sh has counted, and compares it with benches/baseline.json.

usage: scripts/icount/figures.py [--write] FOLDER
"""

import argparse
import itertools
import json
import re
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BASELINE = ROOT / "benches/baseline.json"
ALLOWED = 1.03
CYCLES_PER_S = {"grouped": 1000, "grouped_in_batches": 1000, "recorded": 1000, "watched": 1000, "per_drive": 500,
                "per_drive_in_batches": 500}
ALLOWED_BY_READERS = 1.01
MOMENTS = 9
SOUND = {"mode": "engaged", "overruns": "0", "missing_samples": "0"}
CYCLE_THREAD = "frhc-cycle"


def of_machine(path):
    """Returns the instructions per cycle of `run` in each case, of all threads and of each, and the runs of the cycle's."""
    moments, state = {}, {}
    for line in path.read_text().splitlines():
        case, moment, name, *values = line.split()
        (state if name in SOUND else moments).setdefault(case, {})[name, int(moment)] = values
    figures, wake_ups = {}, {}
    for case, rate in CYCLES_PER_S.items():
        ended = {name: value for (name, _), (value,) in state.get(case, {}).items()}
        if ended != SOUND:
            sys.exit(f"icount: {case}: the cycle did not run as it should: {ended}")
        each = {}
        for name in {name for name, _ in moments[case]}:
            read = [tuple(map(int, moments[case][name, at])) for at in range(MOMENTS)]
            per_cycle = [(later_ns - ns) / ((end_us - start_us) * 1e-6 * rate)
                         for (ns, start_us, _), (later_ns, end_us, _) in itertools.pairwise(read)]
            if name == CYCLE_THREAD:
                (_, start_us, before), (_, end_us, after) = read[0], read[-1]
                wake_ups[case] = round((after - before) / ((end_us - start_us) * 1e-6 * rate), 1)
            # Once in some seconds the kernel does work of about 2 million instructions in the cycle's thread, with readers or without: the
            # median leaves it out. Other threads have work of their own that is as rare.
            each[name] = (statistics.median if name == CYCLE_THREAD else statistics.mean)(per_cycle)
        figures[case] = {"all threads": round(sum(each.values()))}
        figures[case] |= {name: round(each[name]) for name in sorted(each) if each[name] > 0}
    return figures, wake_ups


def collected(path):
    """Returns the instructions in a file of callgrind."""
    return int(re.search(r"^totals: (\d+)$", path.read_text(), re.M)[1])


def of_callgrind(folder):
    """Returns the user instructions per cycle of the cycle's thread, and of all threads of `run`."""
    cycles, cycle_thread, everything = {}, {}, {}
    for line in (folder / "cycles").read_text().splitlines():
        seconds, count = line.split()
        threads = sorted(folder.glob(f"run.{seconds}-*"))
        cycles[seconds] = int(count)
        cycle_thread[seconds] = sum(collected(it) for it in threads if "node::cycle::" in it.read_text())
        everything[seconds] = sum(map(collected, threads))
    each = lambda of: round((of["6"] - of["5"]) / (cycles["6"] - cycles["5"]))  # noqa: E731
    return {CYCLE_THREAD: each(cycle_thread), "all threads": each(everything)}


def versions():
    """Returns the versions of everything that decides how many instructions there are, but for the program's source."""
    def line(*command):
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]
    return {
        "rustc": line("rustc", "--version"),
        "C library": line("getconf", "GNU_LIBC_VERSION"),
        "kernel": (ROOT / "target/icount/version").read_text().strip(),
        "QEMU": line("qemu-system-x86_64", "--version"),
        "valgrind": line("valgrind", "--version"),
    }


def flat(tree, path=()):
    """Yields each figure with its path."""
    for key, value in tree.items():
        yield from flat(value, (*path, key)) if isinstance(value, dict) else [((*path, key), value)]


def main():
    parser = argparse.ArgumentParser(description="Compares instruction counts with the baseline.")
    parser.add_argument("--write", action="store_true", help="replace the baseline")
    parser.add_argument("folder", type=Path)
    arguments = parser.parse_args()
    folder = arguments.folder
    in_machine, wake_ups = of_machine(folder / "machine")
    measured = {
        "kernel and user, per cycle": in_machine,
        "wake-ups of the cycle's thread, per cycle": wake_ups,
        "user, per cycle": {"grouped": of_callgrind(folder)},
        "simulation, per simulated millisecond": {
            "demo": round((collected(folder / "demo.8") - collected(folder / "demo.6")) / 2000)},
    }
    alone, watched = (in_machine[case][CYCLE_THREAD] for case in ("grouped", "watched"))
    print(f"{100 * (watched / alone - 1):+.2f} % of the cycle's thread with 20 readers")
    if watched > alone * ALLOWED_BY_READERS:
        sys.exit("icount: readers of the telemetry cost the cycle's thread more than 1 %")
    used = versions()
    if arguments.write:
        BASELINE.write_text(json.dumps({"versions": used, "instructions": measured}, indent=2) + "\n")
    baseline = json.loads(BASELINE.read_text())
    before = dict(flat(baseline["instructions"]))
    above = []
    for path, figure in flat(measured):
        was = before.get(path)
        change = f"{100 * (figure / was - 1):+6.1f} %" if was else "    new"
        print(f"{figure:9,}  {change}  {', '.join(path)}")
        # The small threads are part of the sums, and too small to be judged alone.
        if was and figure > was * ALLOWED and (path[-1] in ("all threads", CYCLE_THREAD, "demo")):
            above.append(", ".join(path))
    others = [f"{name}: {version}, baseline {baseline['versions'].get(name)}"
              for name, version in used.items() if version != baseline["versions"].get(name)]
    for other in others:
        print(f"icount: not compared, other versions: {other}")
    if above and not others:
        sys.exit("icount: more than 3 % above benches/baseline.json: " + "; ".join(above) +
                 "\nicount: scripts/icount.sh --write replaces it; the commit says what the instructions are for")


if __name__ == "__main__":
    main()
