"""The link over a real Unix socket: connects, loses, connects again. Time is virtual, and nothing waits."""
import os
import socket
import tempfile
import unittest

from far import ARM, Feedback, Node, VirtualClock, ms
from frhc import Capability, FarSide, Reason
from frhc.local import LocalLink
from frhc.messages import Rate

FORWARD = Rate((0.1, 0.0, 0.0, 0.0, 0.0, 0.0))


class Listener:
    """Socket of a node, with the connection of its far side."""

    def __init__(self, path):
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.listener.bind(path)
        self.listener.listen(1)
        self.listener.setblocking(False)
        self.connection = None

    def accept(self):
        self.connection, _ = self.listener.accept()
        self.connection.setblocking(False)

    def received(self):
        """Returns the messages that wait."""
        messages = []
        while True:
            try:
                message = self.connection.recv(4096)
            except BlockingIOError:
                return messages
            except ConnectionResetError:
                continue  # the far side closed with commands unread; its last messages still follow
            if not message:
                return messages
            messages.append(message)

    def close(self):
        for end in (self.connection, self.listener):
            if end:
                end.close()


class Local(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path, self.clock, self.node = os.path.join(folder.name, "s"), VirtualClock(), Node()
        self.far = FarSide(ARM, socket=self.path, clock=self.clock, capability=Capability())
        self.addCleanup(lambda: self.far.close())

    def listen(self):
        listener = Listener(self.path)
        self.addCleanup(listener.close)
        return listener

    def cycles(self, count, listener=None, motion=None):
        """Runs cycles, in each of which the node answers. Returns the newest feedback."""
        newest = None
        for _ in range(count):
            command = next(self.far)
            self.far.send((0.0,) * 6, None)
            if listener:
                for message in listener.received():
                    newest = self.node.take(message) or newest
                listener.connection.send(self.node.command(motion))
                self.motion = command.motion
        return newest

    def follow(self, listener):
        self.cycles(3, listener)
        self.node.epoch += 1
        self.assertIs(self.cycles(3, listener, FORWARD).reason, Reason.NONE)
        self.assertIsNotNone(self.motion)

    def test_far_side_waits_for_a_node_and_follows_it(self):
        self.cycles(100)
        listener = self.listen()
        self.cycles(51)  # it tries every 100 ms
        listener.accept()
        self.follow(listener)

    def test_socket_that_does_not_exist_is_named_once_as_a_warning(self):
        with self.assertLogs("frhc", "WARNING") as logged:
            self.cycles(200)
        [line] = logged.output
        self.assertIn(f"{self.path}: waits for a node: no such socket; start `frhc run`", line)
        folder = os.path.join(os.path.dirname(self.path), "absent")
        for path, reason in ((os.path.join(folder, "s"), f"no such folder: {folder}"), (__file__, "not a socket")):
            with self.assertLogs("frhc", "WARNING") as logged:
                LocalLink(path).receive(0)
            self.assertIn(f"{path}: waits for a node: {reason}", logged.output[0])
        self.listen().listener.close()
        with self.assertLogs("frhc", "WARNING") as logged:
            self.cycles(51)
        self.assertIn("no process listens on this socket", logged.output[0])

    def test_node_that_starts_again_is_found_and_the_session_stays(self):
        listener = self.listen()
        self.cycles(1)
        listener.accept()
        self.follow(listener)
        listener.close()
        os.unlink(self.path)
        self.cycles(100)
        self.assertIs(self.far.reason, Reason.SILENCE)
        session, listener = self.far.session, self.listen()
        self.cycles(51)
        listener.accept()
        self.node = Node(session=33)
        self.assertIs(self.cycles(3, listener).reason, Reason.NOT_ARMED)
        self.assertEqual((self.far.leader, self.far.session), (33, session))
        self.follow(listener)

    def test_node_that_closes_at_once_is_tried_every_2_s(self):
        listener = self.listen()
        self.cycles(1)
        listener.accept()
        listener.connection.close()
        self.cycles(900)
        with self.assertRaises(BlockingIOError):
            listener.accept()
        self.cycles(150)
        listener.accept()

    def test_node_that_does_not_read_blocks_nothing(self):
        listener = self.listen()
        self.cycles(2000)
        listener.accept()
        numbers = [Feedback.decode(message).head.own.sequence for message in listener.received()]
        self.assertEqual(numbers, list(range(1, len(numbers) + 1)))
        self.assertLess(len(numbers), 1500, "the socket was never full: the test is too short")
        self.cycles(1)
        self.assertEqual(Feedback.decode(listener.received()[0]).head.own.sequence, 2001)

    def test_end_is_read_after_the_connection_is_closed(self):
        listener = self.listen()
        self.cycles(1)
        listener.accept()
        self.follow(listener)
        with self.assertRaises(ZeroDivisionError):
            with self.far:
                1 / 0
        reasons = [Feedback.decode(message).reason for message in listener.received()]
        self.assertEqual(reasons[-5:], [Reason.FAULT] * 5)
        self.assertEqual(self.far.leader, self.node.session)

    def test_longer_packet_is_not_a_message(self):
        listener = self.listen()
        self.cycles(1)
        listener.accept()
        good = self.node.command(FORWARD)
        for packet in (good + b"\0", good * 20, good + bytes(4000), bytes(5000)):
            listener.connection.send(packet)
        self.cycles(1)
        self.assertEqual({reject.value: count for reject, count in self.far.rejects.items()},
                         {"length": 3, "foreign": 1})

    def test_two_far_sides_each_with_a_node(self):
        listener, other_path = self.listen(), self.path + "2"
        other_listener = Listener(other_path)
        self.addCleanup(other_listener.close)
        other = FarSide(ARM + 1, socket=other_path, clock=self.clock)
        self.addCleanup(other.close)
        self.cycles(1)
        next(other)
        listener.accept(), other_listener.accept()
        self.follow(listener)
        next(other)
        self.assertIs(other.reason, Reason.NOT_ARMED)
        self.assertEqual((self.far.rejects, other.rejects), ({}, {}))

    def test_second_far_side_takes_no_message_of_the_first(self):
        listener = self.listen()
        self.cycles(1)
        listener.accept()
        second = LocalLink(self.path)
        self.addCleanup(second.close)
        self.follow(listener)
        self.assertIsNone(second.receive(self.clock.now() + ms(1)))


if __name__ == "__main__":
    unittest.main()
