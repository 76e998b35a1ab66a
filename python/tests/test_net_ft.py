"""The reader of a Net F/T sensor: its rules without a socket, and a sensor of the test on the loopback interface.

    PYTHONPATH=python python3 -m unittest python/tests/test_net_ft.py
"""
import random
import socket
import unittest

import numpy as np

from frhc.net_ft import BIAS, RECORD, STOP, STREAM, Condition, NetFT, Reader, request

SENSOR = "192.168.1.1", 49152
MS = 1_000_000
TOP = (1 << 32) - 1


def record(sequence, sample=None, status=0, counts=None):
    """Returns a record whose force along x is its number, in N."""
    counts = counts or (1_000_000 * (sequence % 1000), 0, 0, 0, 0, 0)
    return RECORD.pack(sequence, sequence if sample is None else sample, status, *counts)


class Cycles:
    """A reader that has requested records, and its time."""

    def __init__(self):
        self.now = 0
        self.reader = Reader(SENSOR, (1e6, 2e6), 3 * MS, 0)
        assert self.reader.due(0) == [request(STREAM)]

    def read(self, *datagrams, after=MS):
        """Reads records, or records with these RDT sequences, in a cycle; returns the number of the reading."""
        self.now += after
        for datagram in datagrams:
            self.reader.take(self.now, SENSOR, datagram if isinstance(datagram, bytes) else record(datagram))
        self.reader.empty(self.now)
        return self.reader.number

    @property
    def force(self):
        return None if self.reader.wrench is None else self.reader.wrench[0]

    @property
    def condition(self):
        return self.reader.condition(self.now)


class TestReader(unittest.TestCase):
    def test_newest_record_of_a_read_is_the_reading(self):
        cycles = Cycles()
        self.assertEqual((cycles.reader.number, cycles.force), (0, None))
        self.assertEqual((cycles.read(*range(1, 8)), cycles.force), (6, 7.0))
        self.assertEqual(cycles.read(), 6)
        self.assertEqual((cycles.read(8, 9), cycles.force), (8, 9.0))

    def test_counts_become_newton_and_newton_metre(self):
        cycles = Cycles()
        cycles.read(record(1), record(2, counts=(1_500_000, -2_000_000, 0, 1_000_000, 0, -500_000)))
        np.testing.assert_array_equal(cycles.reader.wrench, [1.5, -2.0, 0.0, 0.5, 0.0, -0.25])

    def test_sequence_wraps_around(self):
        cycles = Cycles()
        self.assertEqual(cycles.read(TOP - 1, TOP, 0, 1), 3)
        self.assertEqual((cycles.read(TOP, 0), cycles.force), (3, 1.0))
        self.assertEqual((cycles.reader.counts["lost"], cycles.reader.counts["overtaken"]), (0, 2))

    def test_repeated_and_overtaken_records_have_no_effect(self):
        cycles = Cycles()
        cycles.read(1, 2, 3)
        self.assertEqual((cycles.read(3, 2, 1, 3), cycles.force), (2, 3.0))
        self.assertEqual(cycles.reader.counts["overtaken"], 4)

    def test_first_record_behind_a_gap_is_no_reading(self):
        cycles = Cycles()
        cycles.read(1, 2)
        self.assertEqual((cycles.read(5), cycles.force), (1, 2.0))
        self.assertEqual((cycles.read(6), cycles.force), (2, 6.0))
        self.assertEqual(cycles.reader.counts["lost"], 2)

    def test_status_other_than_zero_makes_the_reading_invalid(self):
        cycles = Cycles()
        cycles.read(1, 2)
        self.assertEqual((cycles.read(record(3, status=0x80010000)), cycles.force), (2, None))
        self.assertEqual((cycles.condition, cycles.reader.status), (Condition.INVALID, 0x80010000))
        self.assertEqual((cycles.read(4), cycles.force, cycles.condition), (3, 4.0, Condition.VALID))

    def test_record_without_a_new_measurement_is_no_reading(self):
        cycles = Cycles()
        cycles.read(1, 2)
        self.assertEqual((cycles.read(record(3, sample=2)), cycles.force), (1, 2.0))
        self.assertEqual(cycles.reader.counts["frozen"], 1)

    def test_datagrams_of_others_and_of_another_length_are_dropped(self):
        cycles = Cycles()
        cycles.read(1, 2, b"", record(3)[:-1], record(3) + b"\0")
        for source in ("192.168.1.1", 49153), ("192.168.1.2", 49152):
            cycles.reader.take(cycles.now, source, record(3))
        counts = cycles.reader.counts
        self.assertEqual((cycles.force, counts["foreign"], counts["malformed"]), (2.0, 2, 3))

    def test_records_that_waited_for_a_stopped_process_are_no_reading(self):
        cycles = Cycles()
        cycles.read(1, 2)
        self.assertEqual((cycles.read(*range(3, 250), after=3000 * MS), cycles.force), (1, 2.0))
        self.assertEqual((cycles.reader.counts["waited"], cycles.condition), (247, Condition.SILENT))
        self.assertEqual(cycles.read(21_000, 21_001), 2)

    def test_silent_sensor_is_requested_every_100_ms_and_counts_anew(self):
        cycles = Cycles()
        asked = []
        for milli in range(1, 351):
            cycles.read()
            asked += [milli for _ in cycles.reader.due(cycles.now)]
        self.assertEqual(asked, [100, 200, 300])
        cycles.read(9000, 9001)
        cycles.read(after=100 * MS)
        self.assertEqual(cycles.reader.due(cycles.now), [request(STREAM)])
        self.assertEqual((cycles.read(1, 2), cycles.force), (2, 2.0))

    def test_sensor_that_streams_gets_no_request(self):
        cycles = Cycles()
        for sequence in range(1, 1000):
            cycles.read(sequence)
            self.assertEqual(cycles.reader.due(cycles.now), [])

    def test_scale_that_is_not_above_zero_is_refused_by_its_name(self):
        for scale, name in ((0.0, 1.0), "counts_per_n "), ((1.0, -1.0), "counts_per_nm "), \
                ((float("nan"), 1.0), "counts_per_n "), ((1.0, float("inf")), "counts_per_nm "):
            with self.assertRaisesRegex(ValueError, name):
                Reader(SENSOR, scale, MS, 0)

    def test_any_datagrams_leave_a_reading_just_behind_its_predecessor(self):
        for seed in range(200):
            draw, cycles, before = random.Random(seed), Cycles(), None
            for _ in range(100):
                number = cycles.reader.number
                sequence, sample = (draw.randrange(-9, 30) % (1 << 32) for _ in range(2))
                datagram = draw.randbytes(draw.choice((0, 35, 36, 37))) if draw.random() < 0.2 else \
                    record(sequence, sample, draw.randrange(2))
                cycles.read(datagram, after=draw.randrange(5 * MS))
                if cycles.reader.number > number:
                    sequence, sample, status, *_ = RECORD.unpack(datagram)
                    self.assertEqual((sequence - before[0]) % (1 << 32), 1)
                    self.assertNotEqual(sample, before[1])
                    self.assertEqual(cycles.force is None, status != 0)
                before = cycles.reader._newest


class TestNetFT(unittest.TestCase):
    def setUp(self):
        self.sensor = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sensor.bind(("127.0.0.1", 0))
        self.sensor.settimeout(5)
        self.addCleanup(self.sensor.close)

    def opened(self, max_wait_s=60.0):
        """Returns a reader that no busy machine makes late, and its address."""
        net_ft = NetFT("127.0.0.1", 1e6, 1e6, port=self.sensor.getsockname()[1], max_wait_s=max_wait_s)
        self.assertIsNone(net_ft.read())
        datagram, address = self.sensor.recvfrom(64)
        self.assertEqual(datagram, request(STREAM))
        return net_ft, address

    def send(self, address, *sequences):
        for sequence in sequences:
            self.sensor.sendto(record(sequence), address)

    def test_read_returns_each_reading_once(self):
        net_ft, address = self.opened()
        with net_ft:
            self.send(address, 1, 2, 3)
            np.testing.assert_array_equal(net_ft.read(), [3.0, 0, 0, 0, 0, 0])
            self.assertIsNone(net_ft.read())
            self.assertIs(net_ft.condition, Condition.VALID)
        self.assertEqual(self.sensor.recv(64), request(STOP))

    def test_read_takes_256_datagrams(self):
        net_ft, address = self.opened()
        with net_ft:
            net_ft._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 212_992)  # room for some 500
            self.send(address, *range(1, 261))
            net_ft.read()
            self.assertEqual(net_ft.counts["records"], 256)
            net_ft.read()
            self.assertEqual(net_ft.counts["records"], 260)

    def test_bias_is_sent_by_its_call_alone_and_to_a_valid_sensor(self):
        net_ft, address = self.opened()
        with net_ft:
            with self.assertRaisesRegex(RuntimeError, "the sensor is silent"):
                net_ft.bias()
            self.send(address, 1, 2)
            net_ft.read()
            net_ft.bias()
            self.assertEqual([self.sensor.recv(64) for _ in range(2)], [request(BIAS), request(STREAM)])

    def test_source_of_another_port_is_dropped(self):
        net_ft, address = self.opened()
        with net_ft, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.sendto(record(1), address)
            self.assertIsNone(net_ft.read())
            self.assertEqual((net_ft.counts["foreign"], net_ft.counts["records"]), (1, 0))

    def test_name_instead_of_an_address_is_refused(self):
        with self.assertRaises(ValueError):
            NetFT("netft.local", 1e6, 1e6)


if __name__ == "__main__":
    unittest.main()
