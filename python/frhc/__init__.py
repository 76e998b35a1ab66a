"""Far side of a force-reflecting hand controller: the robot or simulation that an frhc node commands.

    with frhc.FarSide("arm1") as far:
        for command in far:
            wrench, pose = world.step(command, far.period)
            far.send(wrench, pose)

far_side.py is the loop above, cycles.py one blocking call a period, far_end.py the rules, with bytes and times as arguments.
docs/python.md of the repository has rules and guarantees, docs/link.md the messages.
"""
from .capability import Capability, PayloadRemoval
from .command import Command, Motion
from .far_side import FarSide
from .reasons import Reason, Reject
from .status import NoNode, status

__all__ = ["Capability", "Command", "FarSide", "Motion", "NoNode", "PayloadRemoval", "Reason", "Reject", "status"]
