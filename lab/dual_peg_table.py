#!/usr/bin/env python3
"""dual_peg_table.py FOLDER: computes the table of `frhc-lab experiment dual-peg --out FOLDER` again, with numpy.

Reads trials.csv alone, and compares means, spreads, counts and ratios with figures.json: all within 1e-6.
"""

import csv
import json
import pathlib
import sys

import numpy as np

TOLERANCE = 1e-6
PARTS = ["x", "y", "z", "about_x", "about_y", "about_z"]


def main() -> int:
    folder = pathlib.Path(sys.argv[1])
    with open(folder / "trials.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    figures = json.loads((folder / "figures.json").read_text(encoding="utf-8"))
    worst = compared(figures["table"], figures["ratios"], of(rows, "table"))
    worst = max(worst, compared(figures["aligned"], [], of(rows, "aligned")))
    for swept in figures["sweep"]:
        ((name, value),) = swept["series"].items()
        part = of(rows, name.replace("_", " "), value)
        worst = max(worst, compared(swept["pooled"], swept["ratios"], part))
    print(f"{len(rows)} trials, largest difference {worst:.1e}")
    return 0 if worst <= TOLERANCE else 1


def of(rows: list, series: str, value: float | None = None) -> list:
    """Rows of a series, at one swept value in m."""
    found = [row for row in rows if row["series"] == series]
    if value is not None:
        found = [row for row in found if abs(float(row["value_mm"]) - 1e3 * value) < 1e-9]
    assert found, (series, value)
    return found


def compared(pooled: list, ratios: list, rows: list) -> float:
    """Largest difference of pooled figures from those of the rows."""
    worst, works = 0.0, {}
    for one in pooled:
        switches = {key: str(value).lower() for key, value in one["condition"].items()}
        mine = [row for row in rows if row["operator"] == one["operator"] and all(row[key] == switches[key] for key in switches)]
        literal = np.array([[float(row[f"literal_{part}_j"]) for part in PARTS] for row in mine])
        absolute = np.array([[float(row[f"absolute_{part}_j"]) for part in PARTS] for row in mine])
        work = literal.sum(axis=1)
        column = lambda name: np.mean([float(row[name]) for row in mine])
        pairs = [
            (one["literal_j"], work.mean()),
            (one["literal_deviation_j"], work.std()),
            (one["absolute_j"], absolute.sum(axis=1).mean()),
            (one["peak_n"], column("peak_n")),
            (one["mean_n"], column("mean_n")),
            (one["seconds"], column("seconds")),
            (one["trials"], len(mine)),
            (one["inserted"], sum(row["outcome"] == "inserted" for row in mine)),
            *zip(one["literal_parts_j"], literal.mean(axis=0)),
        ]
        worst = max([worst, *(abs(a - b) for a, b in pairs)])
        works[one["operator"], *switches.values()] = work.mean()
    for one in ratios:
        ratio = works[one["operator"], "true", "true"] / works[one["operator"], "false", "false"]
        worst = max(worst, abs(one["ratio"] - ratio))
    return worst


if __name__ == "__main__":
    sys.exit(main())
