"""What was felt in a recorded session with the MuJoCo arm: contacts, wrenches and displayed stiffness, by `frhc export csv`."""
import csv
import json
import subprocess
from array import array
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mujoco_world import STIFFNESS

SIGNALS = ["mode", *(f"f_s.f{a}" for a in "xyz"), "x_b_m.px", "x_b_m.py", "dx.z", *(f"f_g_task.{p}" for p in
           ("fx", "fy", "fz", "mx", "my", "mz")), *(f"v_g.v{a}" for a in "xyz")]
ENGAGED = 3  # of the signal `mode`
TOUCH, RELEASE = 1.0, 0.3
"""Force at the sensor, in N, at which a contact begins and ends."""
FACE, MIDDLE = 0.43, -0.03
"""Of wall and plate along x of {b}, and between them along y, in m."""
INSERTED, WITHDRAWN = 0.015, 0.002
"""Depth of the tip in m at which the peg is in the hole, and at which it is out again."""
STILL = 0.003
"""Speed of the hand in m/s, below which a sample in contact with the wall counts for the stiffness."""


@dataclass
class Felt:
    """What was felt. Forces in N, moments in N·m, depths in m, stiffness in N/m.

    `off_the_line` and `across` are rms at the hand, at the wall: of the force along the push beside displayed_stiffness, and of
    the force across the push, which nothing but friction and a loop that shakes make.
    """

    engaged_s: float
    trips: list
    wall_contacts: int
    insertions: int
    depth: float
    peak_sensed: float
    felt_at_wall: float
    felt_in_hole: float
    moment_in_hole: float
    displayed_stiffness: float
    off_the_line: float
    across: float
    reversals: int
    energy_to_hand: float

    def text(self):
        """For a terminal."""
        return "\n".join([
            f"engaged    {self.engaged_s:.1f} s, {len(self.trips)} trips {' '.join(self.trips)}".rstrip(),
            f"wall       touched {times(self.wall_contacts)}, up to {self.felt_at_wall:.2f} N at the hand",
            f"peg        inserted {times(self.insertions)}, up to {1e3 * self.depth:.1f} mm; in the hole up to "
            f"{self.felt_in_hole:.2f} N and {self.moment_in_hole:.3f} N·m at the hand",
            f"wrist      up to {self.peak_sensed:.1f} N",
            f"displayed  {self.displayed_stiffness:.0f} N/m at the hand, {STIFFNESS:.0f} N/m at the wall",
            f"steady     {1e3 * self.off_the_line:.0f} mN rms off that line, {1e3 * self.across:.0f} mN rms across it; "
            f"{self.reversals} reversals, {1e3 * self.energy_to_hand:.1f} mJ from the contacts to the hand",
        ])


def times(count):
    """How often, in words."""
    return "once" if count == 1 else f"{count} times"


def table(frhc, session):
    """Columns of `frhc export csv` by name; an absent value is NaN."""
    command = [frhc, "-q", "export", "csv", str(session), *SIGNALS]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as export:
        rows = csv.reader(export.stdout)
        names = next(rows)
        columns = [array("d") for _ in names]
        for row in rows:
            for column, value in zip(columns, row):
                column.append(float(value or "nan"))
    if export.returncode != 0:
        raise RuntimeError(f"frhc export csv ended with {export.returncode}")
    return {name: np.array(column) for name, column in zip(names, columns)}


def spans(value, begin, end):
    """Slices from where `value` rises above `begin` to where it falls to `end`."""
    found, start = [], None
    for row, one in enumerate(value):
        if start is None and one > begin:
            start = row
        elif start is not None and not one > end:
            found.append(slice(start, row))
            start = None
    return found if start is None else [*found, slice(start, len(value))]


def read(frhc, session):
    """Reads a session."""
    columns = table(frhc, session)
    norm = lambda *names: np.sqrt(sum(columns[name] ** 2 for name in names))
    engaged = columns["mode"] == ENGAGED
    force = np.where(engaged, norm("f_s.fx", "f_s.fy", "f_s.fz"), 0.0)
    is_wall = columns["x_b_m.py"] > MIDDLE
    wall = spans(np.where(is_wall, force, 0.0), TOUCH, RELEASE)
    depth = np.where(engaged & ~is_wall, columns["x_b_m.px"] - FACE, 0.0)
    is_in_hole, hand_force = depth > WITHDRAWN, norm("f_g_task.fx", "f_g_task.fy", "f_g_task.fz")

    hand_speed, still = norm("v_g.vx", "v_g.vy", "v_g.vz"), np.zeros(len(force), dtype=bool)
    for contact in wall:
        still[contact] = hand_speed[contact] < STILL
    # z of the grip points along the push: force at the grip over the displacement of the hand, a line by least squares.
    push, way = -columns["f_g_task.fz"][still], columns["dx.z"][still]
    if len(way) < 100:
        raise RuntimeError("the hand was never still at the wall")
    slope, offset = np.polyfit(way, push, 1)

    across = columns["f_g_task.fx"] ** 2 + columns["f_g_task.fy"] ** 2
    summary = json.loads((Path(session) / "summary.json").read_text())
    return Felt(
        engaged_s=summary["engaged_seconds"],
        trips=sorted(path.name for path in (Path(session) / "faults").glob("*")),
        wall_contacts=len(wall),
        insertions=len(spans(depth, INSERTED, WITHDRAWN)),
        depth=float(np.nanmax(depth)),
        peak_sensed=float(np.nanmax(force)),
        felt_at_wall=float(np.nanmax(np.where(is_wall, hand_force, 0.0))),
        felt_in_hole=float(np.nanmax(np.where(is_in_hole, hand_force, 0.0))),
        moment_in_hole=float(np.nanmax(np.where(is_in_hole, norm("f_g_task.mx", "f_g_task.my", "f_g_task.mz"), 0.0))),
        displayed_stiffness=float(slope),
        off_the_line=float(np.std(push - slope * way - offset)),
        across=float(np.sqrt(np.mean(np.concatenate([across[contact] for contact in wall])))),
        reversals=summary["contact"]["reversals"],
        energy_to_hand=max(0.0, -summary["contact"]["lowest_energy_j"]),
    )
