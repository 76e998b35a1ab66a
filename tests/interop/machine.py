"""What other programs take of the processors while something is timed: a time beside them is no measure of ours."""

import os
from pathlib import Path

TICKS = os.sysconf("SC_CLK_TCK")
MAX_OTHERS = 0.1
"""Processors that other programs may take beside a time that is judged."""


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
    """`with` measures what other programs take."""

    def __enter__(self):
        self.begin = os.times().elapsed, _busy(), _own()
        return self

    def __exit__(self, *_):
        elapsed, busy, own = (end - begin for end, begin in zip((os.times().elapsed, _busy(), _own()), self.begin))
        self.processors = max(0.0, busy - own) / TICKS / elapsed


def judge(is_met, figure, others):
    """Fails with a figure that is not met, unless other programs took processors meanwhile: then says that it is not judged."""
    if is_met:
        return
    assert others.processors > MAX_OTHERS, figure
    print(f"  NOT JUDGED: {figure}; other programs took {others.processors:.1f} processors", flush=True)
