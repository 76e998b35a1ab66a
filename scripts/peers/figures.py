#!/usr/bin/env python3
"""figures.py: reads what the peers exchanged and what it cost (scripts/peers.sh), and prints a table.

usage: scripts/peers/figures.py PERIOD_US FILE

Fails where the peers do not exchange the same frames, or one has ended.
"""

import sys
from collections import Counter, defaultdict
from pathlib import Path

NAMES = {
    "plain": "C loop",
    "guarded": "C loop with the same guarantees",
    "drained": "C loop with the same guarantees that sleeps until the samples are there",
    "frhc": "frhc run",
    "python-canopen": "python-canopen",
    "lely": "lely",
}
REASONS = {"python-canopen": "not installed (scripts/setup.sh tools)", "lely": "no source tree (--lely TREE)"}
TPDOS = range(0x181, 0x187)
RPDOS = range(0x201, 0x207)
# A SYNC so soon after another frame is left out of the jitter: the simulated drives, which have sent it, hold the one processor.
DISTURBED_S = 200e-6
EXCHANGE = {0x80, *TPDOS, *RPDOS}


def sections(path):
    """Returns the lines of each file behind its `== NAME`."""
    found, lines = {}, None
    for line in path.read_text().splitlines():
        if line.startswith("== "):
            lines = found[line[3:]] = []
        elif lines is not None:
            lines.append(line)
    return found


def frames(log):
    """Yields (time in s, COB-ID, data length) of each line of candump."""
    for line in log:
        stamp, _, frame = line.split()
        cob_id, data = frame.split("#")
        yield float(stamp[1:-1]), int(cob_id, 16), len(data) // 2


def cycles(log):
    """Returns the frames of each complete cycle, each of which begins with SYNC."""
    found, cycle = [], None
    for frame in frames(log):
        if frame[1] == 0x80:
            found.append(cycle)
            cycle = []
        if cycle is not None:
            cycle.append(frame)
    return found[1:]


def percentile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))]


def of_peer(name, found, period_us):
    """Returns a peer's exchange of one cycle, and its row."""
    each = cycles(found[f"{name}.log"])
    exchanges = Counter(frozenset((cob_id, length) for _, cob_id, length in cycle if cob_id in EXCHANGE) for cycle in each)
    exchange, common = exchanges.most_common(1)[0]
    if common < 0.99 * len(each):
        sys.exit(f"peers: {name}: only {common} of {len(each)} cycles have the same frames")
    reactions, syncs, disturbed, before = [], [], [], 0.0
    for cycle in each:
        answers = [at for at, cob_id, _ in cycle if cob_id in TPDOS]
        torques = [at for at, cob_id, _ in cycle if cob_id in RPDOS]
        syncs.append(cycle[0][0])
        disturbed.append(cycle[0][0] - before < DISTURBED_S)
        before = cycle[-1][0]
        if answers and torques:
            reactions.append((max(torques) - max(answers)) * 1e6)
    periods = zip(syncs, syncs[1:], disturbed, disturbed[1:])
    deviations = [abs((end - start) * 1e6 - period_us) for start, end, *are_disturbed in periods if not any(are_disturbed)]
    used, moments = defaultdict(list), []
    for line in found[f"{name}.time"]:
        key, value = line.split()
        if key == "clock":
            moments.append(defaultdict(int))
        moments[-1][key] += int(value)
    per_cycle = sum(len(cycle) for cycle in each) / len(each)
    first, second = moments
    count = (second["frames"] - first["frames"]) / per_cycle
    cost = sum(second[key] - first[key] for key in second if key not in ("clock", "frames"))
    others = sorted({cob_id for cycle in each for _, cob_id, _ in cycle} - EXCHANGE)
    row = [f"{cost / count / 1000:,.1f} k", f"{percentile(reactions, 0.5):.0f} / {percentile(reactions, 0.99):.0f} µs",
           f"{percentile(deviations, 0.999):.0f} µs", f"{len(each) - common} of {len(each)}"]
    return exchange, row, others


def main():
    period_us, found = int(sys.argv[1]), sections(Path(sys.argv[2]))
    rows, exchanges = [], {}
    for name, title in NAMES.items():
        if f"{name}.log" not in found:
            if f"{name}.txt" in found or name not in REASONS:
                sys.exit("\n".join([f"peers: {name}: no exchange", *found.get(f"{name}.txt", [])]))
            rows.append([title, f"not measured: {REASONS[name]}", "", "", ""])
            continue
        exchanges[name], row, others = of_peer(name, found, period_us)
        rows.append([title, *row])
        print(f"peers: {name}: besides the exchange {', '.join(f'{cob_id:03X}h' for cob_id in others) or 'nothing'}", file=sys.stderr)
    exchange = exchanges["frhc"]
    for name, other in exchanges.items():
        if other != exchange:
            sys.exit(f"peers: {name} does not exchange the same frames as frhc: {sorted(other ^ exchange)}")
    text = ", ".join(f"{cob_id:03X}h with {length} bytes" for cob_id, length in sorted(exchange))
    print(f"Each cycle of each peer: {text}.\n")
    print("| | instructions a cycle, all threads | last TPDO to last RPDO, p50 / p99 | SYNC period, p99.9 off | cycles with other frames |")
    print("|---|---|---|---|---|")
    for row in rows:
        print("| " + " | ".join(row) + " |")


main()
