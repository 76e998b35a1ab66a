"""A force/torque sensor at its own address: ATI's Net F/T, which sends its records by RDT over UDP. docs/net-ft.md has the rules.

    with NetFT("192.168.1.1", counts_per_n=1e6, counts_per_nm=1e6) as sensor:
        for command in far:
            wrench = sensor.read()  # None: no new valid reading
            if sensor.condition is not Condition.VALID:
                far.hold(Reason.SENSOR_SILENT if sensor.condition is Condition.SILENT else Reason.SENSOR_INVALID)

Reader has the rules, without I/O and without a clock; NetFT has the socket, and never waits. Times are in ns.
"""
from __future__ import annotations

import ipaddress
import math
import socket
import struct
import time
from enum import Enum
from types import TracebackType
from typing import Dict, List, Optional, Tuple, Type

import numpy as np
from numpy.typing import NDArray

PORT = 49152
STOP, STREAM, BIAS = 0, 2, 0x42  # commands of a request
REQUEST = struct.Struct(">HHI")  # 1234h, command, number of records: 0 has no end
RECORD = struct.Struct(">III6i")  # RDT sequence, F/T sequence, status, counts of force and moment
MAX_DATAGRAMS = 256  # taken in one read: seven wait in each millisecond; after a pause, two reads empty a socket of the usual size
RETRY_AFTER = 100_000_000  # time without a new reading after which the sensor gets another request
SEQUENCES = 1 << 32  # they wrap around

Address = Tuple[str, int]
Wrench = NDArray[np.float64]  # force x, y, z in N, moment x, y, z in N·m


class Condition(Enum):
    """Condition of the sensor's records."""

    SILENT = "silent"  # no new reading within `max_wait`
    VALID = "valid"
    INVALID = "invalid"  # a status other than 0


def request(command: int) -> bytes:
    """Encodes a request."""
    return REQUEST.pack(0x1234, command, 0)


class Reader:
    """Rules of a reader. The newest record wins; it becomes the reading only right behind its predecessor."""

    def __init__(self, sensor: Address, scale: Tuple[float, float], max_wait: int, now: int) -> None:
        for unit, counts in zip(("n", "nm"), scale):
            if not (math.isfinite(counts) and counts > 0):
                raise ValueError(f"counts_per_{unit} must be finite and above zero, got {counts}")
        self.sensor, self.max_wait = sensor, max_wait
        self._per_unit = np.repeat(np.array(scale, dtype=float), 3)
        self._newest: Optional[Tuple[int, int]] = None  # RDT and F/T sequence of the newest record since the last request
        self._status = 0  # of the reading
        self._read_at = self._emptied = now
        self._requested: Optional[int] = None
        self.number = 0  # of the reading; 0 before the first
        self.wrench: Optional[Wrench] = None  # of the reading, in N and N·m; None while it is invalid
        self.counts: Dict[str, int] = dict.fromkeys(
            ("records", "lost", "overtaken", "frozen", "waited", "invalid", "malformed", "foreign", "requests"), 0)

    def take(self, now: int, source: Address, datagram: bytes) -> None:
        """Takes a datagram, found in the read of the socket that began at `now`."""
        if source != self.sensor:
            self.counts["foreign"] += 1
            return
        if len(datagram) != RECORD.size:
            self.counts["malformed"] += 1
            return
        self.counts["records"] += 1
        sequence, sample, status, *counts = RECORD.unpack(datagram)
        before, ahead = self._newest, 0
        if before is not None:
            ahead = (sequence - before[0]) % SEQUENCES
            if ahead == 0 or ahead >= SEQUENCES // 2:
                self.counts["overtaken"] += 1
                return
            self.counts["lost"] += ahead - 1
        self._newest = sequence, sample
        is_frozen = before is not None and before[1] == sample
        # RDT has no time of its own. What waited in the socket, since the process was stopped, is older than it seems.
        has_waited = now - self._emptied > self.max_wait
        self.counts["frozen"] += is_frozen
        self.counts["waited"] += has_waited
        if ahead == 1 and not is_frozen and not has_waited:
            self._status, self._read_at = status, now
            self.number += 1
            self.wrench = None if status else np.array(counts, dtype=float) / self._per_unit
            self.counts["invalid"] += status != 0

    def empty(self, now: int) -> None:
        """Learns that the read of the socket that began at `now` ended with an empty socket."""
        self._emptied = now

    def due(self, now: int) -> List[bytes]:
        """Returns the requests to send now: to stream, at the start, and again while the sensor is silent."""
        if self._requested is not None and now < max(self._requested, self._read_at) + RETRY_AFTER:
            return []
        return [self.stream(now)]

    def stream(self, now: int) -> bytes:
        """Returns a request to stream. The sensor begins its sequence anew."""
        self._newest, self._requested = None, now
        self.counts["requests"] += 1
        return request(STREAM)

    def condition(self, now: int) -> Condition:
        """Returns the condition of the records at `now`."""
        if self.number == 0 or now - self._read_at >= self.max_wait:
            return Condition.SILENT
        return Condition.INVALID if self._status else Condition.VALID

    @property
    def status(self) -> int:
        """Status of the reading; a valid one has 0."""
        return self._status


class NetFT:
    """A sensor with its socket. `read` once in a cycle; three cycles are at most `max_wait_s`."""

    def __init__(self, address: str, counts_per_n: float, counts_per_nm: float, port: int = PORT,
                 max_wait_s: float = 0.006) -> None:
        ip = ipaddress.ip_address(address)  # a name could be another sensor's tomorrow
        self.now = self._clock()
        self.reader = Reader((str(ip), port), (counts_per_n, counts_per_nm), round(max_wait_s * 1e9), self.now)
        # Not connected: that would hide the datagrams of others, which say why the sensor seems silent.
        self._socket = socket.socket(socket.AF_INET if ip.version == 4 else socket.AF_INET6, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind(("0.0.0.0" if ip.version == 4 else "::", 0))
        self._read = 0  # number of the reading that `read` returned last

    @staticmethod
    def _clock() -> int:
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)

    def read(self) -> Optional[Wrench]:
        """Reads until the socket is empty. Returns force in N and moment in N·m of the newest record, in the sensor's own frame;
        None where that is invalid, or none is new."""
        self.now = now = self._clock()
        for _ in range(MAX_DATAGRAMS):
            try:
                datagram, source = self._socket.recvfrom(RECORD.size + 1)
            except BlockingIOError:
                self.reader.empty(now)
                break
            except OSError:
                break  # what is there is taken in the next read
            self.reader.take(now, (source[0], source[1]), datagram)
        for datagram in self.reader.due(now):
            self._send(datagram)
        is_new, self._read = self.reader.number != self._read, self.reader.number
        return self.reader.wrench if is_new else None

    @property
    def condition(self) -> Condition:
        """Condition of the records at the last `read`."""
        return self.reader.condition(self.now)

    @property
    def counts(self) -> Dict[str, int]:
        """Counts of datagrams since the start."""
        return dict(self.reader.counts)

    def bias(self) -> None:
        """Has the sensor set its present load as zero, for all who read it. Only ever by this call."""
        if self.condition is not Condition.VALID:
            raise RuntimeError(f"the sensor is {self.condition.value}: its load is not set as zero")
        self._send(request(BIAS))
        self._send(self.reader.stream(self.now))

    def close(self) -> None:
        """Has the sensor stop its records, and closes the socket."""
        self._send(request(STOP))
        self._socket.close()

    def _send(self, datagram: bytes) -> None:
        try:
            self._socket.sendto(datagram, self.reader.sensor)
        except OSError:
            pass  # a sensor that gets no request is silent

    def __enter__(self) -> NetFT:
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        self.close()
