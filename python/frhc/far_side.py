"""FarSide: a robot or simulation that a node commands. docs/python.md is its page, docs/link.md the rules that it keeps."""
import os
import re
import secrets
import weakref
from types import TracebackType
from typing import Any, Dict, Iterator, Optional, Tuple, Type, Union

from numpy.typing import ArrayLike

from .capability import Capability
from .clock import SECOND, Clock
from .command import Command, command_of
from .cycles import Cycles
from .far_end import FarEnd
from .link import Link
from .local import LocalLink
from .measured import checked
from .paths import link_socket
from .reasons import Reason, Reject

OWN_REASONS = (Reason.SENSOR_INVALID, Reason.SENSOR_SATURATED, Reason.SENSOR_SILENT, Reason.WRENCH_LIMIT,
               Reason.END_OF_PROCESS, Reason.FAULT)
MAX_PERIOD_S = 0.1
Path = Union[str, "os.PathLike[str]"]


class FarSide:
    """A far side of an arm, by its number or its name, "arm0" for 0.

    Over the Unix socket `socket` on this host, without it that of `frhc robot`; over a network with the folder `keys` of
    `frhc-link key new`, listening on or connecting to HOST:PORT. Iteration is one blocking call a period, in the thread
    that iterates. At the end, whatever it is, it holds and says why. Each object has a session of its own.
    """

    def __init__(self, arm: Union[int, str] = 1, *, capability: Optional[Capability] = None,
                 socket: Optional[Path] = None, keys: Optional[Path] = None, listen: Optional[str] = None,
                 connect: Optional[str] = None, link: Optional[Link] = None, clock: Optional[Clock] = None) -> None:
        number = number_of(arm)
        self._figures = capability or Capability()
        if not 0.0 < self._figures.sample_period <= MAX_PERIOD_S:
            raise ValueError(f"sample_period must be above 0 and at most {MAX_PERIOD_S} s, "
                             f"got {self._figures.sample_period}")
        if not self._figures.sample_period < self._figures.hold_after <= 1.0:
            raise ValueError(f"hold_after must be above sample_period and at most 1 s, got {self._figures.hold_after}")
        if keys is None and (listen or connect):
            raise ValueError("listen and connect need keys: the folder of frhc-link key new")
        if sum(one is not None for one in (socket, keys, link)) > 1:
            raise ValueError("give one of socket, keys and link")
        if keys is not None:
            from .network import NetworkLink, open_session  # zenoh is needed here alone

            link = NetworkLink(number, open_session(number, keys, listen, connect))
        session = 1 + secrets.randbelow(2**64 - 1)
        far_end = FarEnd(number, session, round(self._figures.hold_after * SECOND))
        if link is None:
            link = LocalLink(link_socket() if socket is None else socket)
        self._cycles = Cycles(far_end, link, clock or Clock(), self._figures)
        # Also at the end of the interpreter.
        self._finalizer = weakref.finalize(self, self._cycles.end, Reason.END_OF_PROCESS)

    def __enter__(self) -> "FarSide":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        is_fault = kind is not None and issubclass(kind, Exception)
        self.close(Reason.FAULT if is_fault else Reason.END_OF_PROCESS)

    def __iter__(self) -> Iterator[Command]:
        return self

    def __next__(self) -> Command:
        if self._cycles.is_ended:
            raise StopIteration
        return command_of(self._cycles.begin())

    def send(self, wrench: Optional[ArrayLike], pose: Any, gripper: Optional[Tuple[float, float]] = None) -> None:
        """Sends what was measured in this cycle; None is not valid.

        The wrench is that of the environment on the object, at {S} in {S}, payload removed: N, then N·m. The pose is that of
        {MRF} in {b}: (position in m, orientation as x, y, z, w) or a 4x4 matrix. A wrench that is NaN, infinite or beyond
        the sensor's range, and an invalid pose, are not sent, and make the far side hold. Raises ValueError for a shape.
        """
        measured, reason = checked(wrench, pose, gripper, self._figures)
        self._cycles.send(measured, reason)

    def hold(self, reason: Reason) -> None:
        """Holds for a reason of the robot's own until a later epoch: an arming or a reset of the node."""
        if reason not in OWN_REASONS:
            raise ValueError(f"reason must be of the robot's own, got {reason!r}")
        self._cycles.far_end.hold(reason)

    def close(self, reason: Reason = Reason.END_OF_PROCESS) -> None:
        """Holds, says why for five periods, and closes the link. Iteration ends."""
        self._cycles.end(reason)
        self._finalizer.detach()

    @property
    def period(self) -> float:
        """Returns the period of the cycle, in s."""
        return self._figures.sample_period

    @property
    def reason(self) -> Reason:
        """Returns why it holds; Reason.NONE while it follows."""
        return self._cycles.far_end.reason

    @property
    def leader(self) -> int:
        """Returns the session of the node that leads; 0 for none."""
        return self._cycles.far_end.leader

    @property
    def session(self) -> int:
        """Returns its own session."""
        return self._cycles.far_end.session

    @property
    def rejects(self) -> Dict[Reject, int]:
        """Returns how many messages had no effect, by reason."""
        return dict(self._cycles.far_end.rejects)


def number_of(arm: Union[int, str]) -> int:
    """Returns the number of an arm that is given by it or by a name. Raises ValueError."""
    found = re.fullmatch(r"(?:arm)?(\d+)", arm) if isinstance(arm, str) else None
    number = int(found[1]) if found else arm
    if not isinstance(number, int) or not 0 <= number <= 65535:
        raise ValueError(f"arm must be a number within 0..=65535 or a name like arm0, got {arm!r}")
    return number
