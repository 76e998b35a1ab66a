"""The package of python/ for this process and for those that it starts, without an installation."""

import os
import sys
from pathlib import Path

FOLDER = str(Path(__file__).resolve().parents[2] / "python")

if FOLDER not in sys.path:
    sys.path.insert(0, FOLDER)
others = os.environ.get("PYTHONPATH")
os.environ["PYTHONPATH"] = os.pathsep.join([FOLDER, others]) if others else FOLDER
