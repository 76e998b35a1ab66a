#!/usr/bin/env python3
"""Loopback sensor with RDT, the protocol of ATI's Net F/T: a stand-in for tests, at 7,000 records a second.

    rdt_server.py [--address A] [--port N] [--rate HZ] [--status CODE] [--gap-every N] [--repeat] [--foreign]

Streams to the newest client that requests it. The force along x of a record is its RDT sequence in counts, so that a reading
says which record it is, along y its negative; the other axes are fixed. A bias sets what x counts from. Standard library only.
"""
import argparse
import ipaddress
import selectors
import socket
import struct
import threading
import time

PORT = 49152
REQUEST, RECORD = struct.Struct(">HHI"), struct.Struct(">III6i")
HEADER, STOP, REALTIME, BUFFERED, BIAS = 0x1234, 0, 2, 3, 0x42
SEQUENCES = 1 << 32  # they wrap around


def counts_of(sequence):
    """Returns the counts of a record."""
    sequence = (sequence + (1 << 31)) % SEQUENCES - (1 << 31)
    return sequence, -sequence, 100_000, 2_500, -5_000, 7_500


class RdtServer:
    """A sensor. What it does next is set by its attributes and methods, also while it streams."""

    def __init__(self, address="127.0.0.1", port=PORT, rate=7000.0, first=1):
        self.period, self.first = 1.0 / rate, first
        self.status, self.is_silent, self.is_repeating, self.is_foreign, self.gap_every = 0, False, False, False, 0
        self.sent = 0  # newest RDT sequence on its way to the present client
        self.record_count = 0  # records on their way, of all requests
        self.requests = []  # commands and numbers of records
        self.zero = (0,) * 6
        self._client, self._left, self._due, self._sample, self._burst, self._skip = None, 0, 0.0, 0, 0, 0
        self._ended = False
        family = socket.AF_INET6 if ipaddress.ip_address(address).version == 6 else socket.AF_INET
        self._socket, self._other = (socket.socket(family, socket.SOCK_DGRAM) for _ in range(2))
        self._socket.bind((address, port))
        self._socket.setblocking(False)
        self._other.bind((address, 0))
        self.address = self._socket.getsockname()[:2]
        self._selector = selectors.SelectSelector()  # others wait whole milliseconds
        self._selector.register(self._socket, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended = True
        self._thread.join()
        self._socket.close()
        self._other.close()

    def skip(self, count):
        """Leaves out RDT sequences: records that the network lost."""
        self._skip += count

    def burst(self, count):
        """Keeps records back and sends that many at once."""
        self._burst = count

    def restart(self):
        """Forgets its client, as one does that was switched off and on."""
        self._client, self.zero = None, (0,) * 6

    def _serve(self):
        while not self._ended:
            wait = 0.05 if self._client is None else max(0.0, self._due - time.monotonic())
            for _ in self._selector.select(min(wait, 0.05)):
                self._answer()
            if self._client is not None and time.monotonic() >= self._due:
                self._send()

    def _answer(self):
        try:
            datagram, client = self._socket.recvfrom(64)
        except OSError:
            return  # of a client that has closed its socket
        if len(datagram) != REQUEST.size:
            return
        header, command, count = REQUEST.unpack(datagram)
        if header != HEADER:
            return
        self.requests.append((command, count))
        if command == STOP:
            self._client = None
        elif command in (REALTIME, BUFFERED):
            self.sent = (self.first - 1) % SEQUENCES
            self._client, self._left, self._due = client, count or float("inf"), time.monotonic()
        elif command == BIAS:
            self.zero = counts_of(self.sent)

    def _send(self):
        waiting = max(1, self._burst)
        self._due += self.period * waiting
        self._burst = 0
        for _ in range(waiting):
            self._send_record()

    def _send_record(self):
        if self.gap_every and (self.sent + 1) % self.gap_every == 0:
            self._skip += 1
        self._skip, skipped = 0, self._skip
        sequence = (self.sent + 1 + skipped) % SEQUENCES
        self._sample = (self._sample + 1 + skipped) % SEQUENCES
        counts = (count - zero for count, zero in zip(counts_of(sequence), self.zero))
        record = RECORD.pack(sequence, self._sample, self.status, *counts)
        self.sent = sequence
        if self.is_silent:
            return
        try:
            for _ in range(2 if self.is_repeating else 1):
                (self._other if self.is_foreign else self._socket).sendto(record, self._client)
        except OSError:
            return  # the client's socket is closed, or its host is gone
        self.record_count += 1
        self._left -= 1
        if self._left <= 0:
            self._client = None


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--address", default="127.0.0.1", help="address to listen on (default: %(default)s)")
    parser.add_argument("--port", type=int, default=PORT, help="UDP port (default: %(default)s)")
    parser.add_argument("--rate", type=float, default=7000.0, metavar="HZ", help="records a second (default: %(default)s)")
    parser.add_argument("--status", type=lambda text: int(text, 0), default=0, metavar="CODE", help="status of the records")
    parser.add_argument("--gap-every", type=int, default=0, metavar="N", help="leave out every Nth record")
    parser.add_argument("--repeat", action="store_true", help="send each record twice")
    parser.add_argument("--foreign", action="store_true", help="send the records from another port")
    args = parser.parse_args()
    with RdtServer(args.address, args.port, args.rate) as server:
        server.status, server.gap_every = args.status, args.gap_every
        server.is_repeating, server.is_foreign = args.repeat, args.foreign
        print("listens at {}, UDP port {}".format(*server.address), flush=True)
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            pass


if __name__ == "__main__":
    main()
