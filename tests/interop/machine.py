"""Whether a time says something of ours: what other programs take of the processors meanwhile, and how fast these compute."""

import functools
import os
import time
import zlib
from pathlib import Path

TICKS = os.sysconf("SC_CLK_TCK")
MAX_OTHERS = 0.1
"""Processors that other programs may take beside a time that is judged."""
MAX_SLOWNESS = 1.15
"""How many times as long as on the machine of the figures a fixed computation may take beside a time that is judged."""
REFERENCE_S = 0.057
"""What it takes on that machine: 2 cores of an Intel processor at 2.1 GHz."""
COMPUTED = b"".join(number.to_bytes(4, "little") + bytes([number * number % 251, number % 7]) for number in range(100_000))


def _slowness():
    """Returns how many times as long as on the machine of the figures a fixed computation takes, in processor time."""
    times = []
    for _ in range(5):
        begin = time.process_time()
        zlib.compress(COMPUTED, 9)
        times.append(time.process_time() - begin)
    return min(times) / REFERENCE_S


def _busy():
    """Returns the processor time of all programs, and what the host of this machine took, in ticks."""
    user, nice, system, _idle, _wait, irq, softirq, steal = map(int, Path("/proc/stat").read_text().split("\n")[0].split()[1:9])
    return user + nice + system + irq + softirq + steal


def _times():
    """Returns the parent and the time of each process, with that of its children that have ended, in ticks."""
    times = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                rest = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue  # it has ended
            times[int(entry.name)] = int(rest[1]), sum(map(int, rest[11:15]))
    return times


def _own():
    """Returns the processor time of this process and its descendants, in ticks."""
    times = _times()
    children = {}
    for pid, (parent, _) in times.items():
        children.setdefault(parent, []).append(pid)
    total, waiting = 0, [os.getpid()]
    while waiting:
        pid = waiting.pop()
        total += times.get(pid, (0, 0))[1]
        waiting += children.get(pid, [])
    return total


class Others:
    """`with` measures what other programs take, and how slow the processors are before and after."""

    def __enter__(self):
        self.slowness = _slowness()
        self.begin = os.times().elapsed, _busy(), _own()
        return self

    def __exit__(self, *_):
        elapsed, busy, own = (end - begin for end, begin in zip((os.times().elapsed, _busy(), _own()), self.begin))
        self.processors = max(0.0, busy - own) / TICKS / elapsed
        # A host that gives its processors to others besides does not always say so.
        self.slowness = max(self.slowness, _slowness())


class Missed(AssertionError):
    """A figure in time that is not met."""


def tried(test):
    """Returns the test with up to three tries: a host's own pause lengthens one of them, a slower program of ours all."""

    @functools.wraps(test)
    def within_three(given):
        for _ in range(2):
            try:
                return test(given)
            except Missed as missed:
                print(f"  once more: {missed}", flush=True)
        return test(given)

    return within_three


def judge(is_met, figure, others):
    """Fails with a figure that is not met, unless the machine was slow or shared meanwhile: then says that it is not judged."""
    if is_met:
        return
    if others.processors <= MAX_OTHERS and others.slowness <= MAX_SLOWNESS:
        raise Missed(figure)
    print(
        f"  NOT JUDGED: {figure}; other programs took {others.processors:.1f} processors,"
        f" and a computation {others.slowness:.1f} times as long as on the machine of the figures",
        flush=True,
    )
