"""FarSide over a link in memory, in virtual time: every way in which a program ends, sleeps or sends nonsense."""
import gc
import math
import os
import subprocess
import sys
import threading
import unittest

import numpy as np

from far import ARM, ROOT, Feedback, MemoryLink, Node, VirtualClock, ms
from frhc import Capability, FarSide, Motion, Reason
from frhc.messages import Gripper, Pose, Rate

FORWARD = Rate((0.1, 0.0, 0.0, 0.0, 0.0, 0.0))
POSE = ([0.5, 0.0, 0.3], [0.0, 0.0, 0.0, 1.0])
END = Reason.END_OF_PROCESS


class Bench:
    """A far side, the node that leads it, and time."""

    def __init__(self, **figures):
        self.link, self.node, self.clock = MemoryLink(), Node(), VirtualClock()
        self.far = FarSide(ARM, link=self.link, clock=self.clock, capability=Capability(**figures))

    def cycle(self, wrench=(0.0,) * 6, pose=POSE, motion=FORWARD, **others):
        """Runs one cycle; the node answers. Returns the command."""
        command = next(self.far)
        self.far.send(wrench, pose)
        self.link.answer(self.node, motion, **others)
        return command

    def follow(self):
        """Runs until it follows."""
        for _ in range(3):
            self.cycle()
        self.node.epoch += 1
        self.cycle()
        command = self.cycle()
        assert command.motion is Motion.RATE, self.far.reason

    def reasons(self):
        """Returns the reasons of what was sent and not answered yet."""
        return [Feedback.decode(message).reason for message in self.link.sent]

    def newest(self):
        return self.node.feedbacks[-1]


class Ends(unittest.TestCase):
    def setUp(self):
        self.bench = Bench()
        self.bench.follow()

    def test_end_of_the_body_is_reported_five_times(self):
        start = self.bench.clock.now()
        with self.bench.far:
            pass
        self.assertEqual((self.bench.reasons(), self.bench.link.is_closed), ([END] * 5, True))
        self.assertEqual(self.bench.clock.now() - start, ms(4 * 2))

    def test_body_that_raises_is_a_fault_of_the_robot(self):
        with self.assertRaisesRegex(ZeroDivisionError, "division"):
            with self.bench.far as far:
                for _ in far:
                    1 / 0
        self.assertEqual((self.bench.reasons(), self.bench.link.is_closed), ([Reason.FAULT] * 5, True))

    def test_ctrl_c_and_exit_are_the_end_of_the_process(self):
        for kind in (KeyboardInterrupt, SystemExit):
            bench = Bench()
            bench.follow()
            with self.assertRaises(kind):
                with bench.far:
                    raise kind
            self.assertEqual(bench.reasons(), [END] * 5)

    def test_first_reason_stays_at_the_end(self):
        self.bench.far.hold(Reason.WRENCH_LIMIT)
        with self.assertRaises(KeyError):
            with self.bench.far:
                raise KeyError
        self.assertEqual(self.bench.reasons(), [Reason.WRENCH_LIMIT] * 5)

    def test_collected_object_reports_its_end(self):
        link = self.bench.link
        del self.bench.far
        self.assertEqual((self.bench.reasons(), link.is_closed), ([END] * 5, True))

    def test_object_in_a_cycle_of_references_reports_its_end_when_collected(self):
        holder = {"far": self.bench.far}
        holder["self"] = holder
        del self.bench.far, holder
        gc.collect()
        self.assertEqual((self.bench.reasons(), self.bench.link.is_closed), ([END] * 5, True))

    def test_later_epoch_does_not_end_the_last_hold(self):
        self.bench.node.epoch += 1
        for _ in range(5):
            self.bench.link.waiting.append(self.bench.node.command(FORWARD))
        self.bench.far.close()
        self.assertEqual(self.bench.reasons(), [END] * 5)

    def test_iteration_ends_once_closed_and_nothing_is_sent(self):
        self.bench.far.close()
        self.bench.link.sent.clear()
        self.assertEqual(list(self.bench.far), [])
        self.bench.far.send(None, None)
        self.bench.far.close()
        self.assertEqual(self.bench.link.sent, [])

    def test_last_values_are_those_of_the_present_cycle_or_none(self):
        next(self.bench.far)  # takes a message that its values would have to be younger than
        self.bench.far.close()
        last = Feedback.decode(self.bench.link.sent[-1])
        self.assertEqual((last.measured.wrench, last.measured.pose), (None, None))
        bench = Bench()
        bench.follow()
        next(bench.far)
        bench.far.send((1.0,) * 6, POSE)
        bench.far.close()
        self.assertEqual(Feedback.decode(bench.link.sent[-1]).measured.wrench, (1.0,) * 6)

    def test_end_of_the_interpreter_is_reported(self):
        for end, expected in (("", END), ("1 / 0", END), ("with far: 1 / 0", Reason.FAULT)):
            program = ("import sys; sys.path[:0] = sys.argv[1:]\n"
                       "from test_far_side import *\n"
                       "bench = Bench(); bench.follow(); far = bench.far\n"
                       "link, far.keep = bench.link, bench\n"  # nothing frees them before the end
                       "link.send = lambda now, message: print(int(Feedback.decode(message).reason), flush=True)\n")
            folders = [str(ROOT / "python"), str(ROOT / "python/tests")]
            done = subprocess.run([sys.executable, "-B", "-c", program + end, *folders], stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL, text=True, timeout=60)
            self.assertEqual(done.stdout.split(), [str(int(expected))] * 5, end)

    def test_forked_child_sends_nothing(self):
        child = os.fork()
        if child == 0:
            self.bench.far.close()
            os._exit(len(self.bench.link.sent))
        self.assertEqual(os.waitpid(child, 0)[1], 0)
        self.assertIsNotNone(self.bench.cycle().motion)


class Cycles(unittest.TestCase):
    def setUp(self):
        self.bench = Bench()
        self.bench.follow()

    def test_body_that_sleeps_holds_with_silence(self):
        bench, sequence = self.bench, self.bench.node.sequence
        next(bench.far)
        for _ in range(1500):
            bench.link.waiting.append(bench.node.command(FORWARD))
        bench.clock.time += ms(3000)
        bench.far.send((0.0,) * 6, POSE)
        self.assertEqual(bench.reasons(), [Reason.SILENCE], "the sample of before the pause is not one of following")
        commands = [next(bench.far) for _ in range(70)]
        self.assertEqual({command.motion for command in commands}, {None})
        self.assertFalse(bench.link.waiting, "the queue is read")
        self.assertIs(bench.far.reason, Reason.SILENCE)
        bench.link.sent.clear()
        bench.far.send((0.0,) * 6, POSE)
        self.assertEqual(Feedback.decode(bench.link.sent[0]).head.echo.sequence, sequence + 1500)
        bench.node.epoch += 1
        bench.link.answer(bench.node, FORWARD)
        self.assertIs(bench.cycle().motion, Motion.RATE, "a later epoch begins anew")

    def test_missed_cycles_are_skipped(self):
        bench, start = self.bench, self.bench.clock.now()
        bench.clock.time += ms(3000)
        bench.cycle()
        self.assertEqual(bench.clock.now() - start, ms(3000))
        bench.cycle()
        self.assertEqual(bench.clock.now() - start, ms(3002))

    def test_cycles_do_not_drift(self):
        bench, start = self.bench, self.bench.clock.now()
        for _ in range(100):
            bench.cycle()
            bench.clock.time += ms(1)
        self.assertEqual(bench.clock.now() - start, ms(201))

    def test_period_is_that_of_the_capability(self):
        bench = Bench(sample_period=0.02)
        self.assertEqual(bench.far.period, 0.02)
        start = bench.clock.now()
        bench.follow()
        self.assertEqual(bench.clock.now() - start, ms(4 * 20))

    def test_cycle_without_a_send_reports_no_values(self):
        next(self.bench.far)
        next(self.bench.far)
        self.assertEqual(Feedback.decode(self.bench.link.sent[-1]).measured.wrench, None)
        self.assertEqual(len(self.bench.link.sent), 1)

    def test_flood_is_taken_in_parts(self):
        for _ in range(1000):
            self.bench.link.waiting.append(b"noise")
        next(self.bench.far)
        self.assertGreater(len(self.bench.link.waiting), 970)

    def test_capability_is_sent_where_asked_for(self):
        self.bench.cycle(asks_capability=True)
        next(self.bench.far)
        self.bench.far.send(None, None)
        self.assertEqual([message[4] for message in self.bench.link.sent], [2, 3])

    def test_commands_have_what_the_node_commands(self):
        bench = self.bench
        bench.cycle(motion=Pose((0.1, 0.2, 0.3), (0.0, 0.0, 1.0, 0.0)), engaged=True, gripper=Gripper(0.04, 10.0))
        command = bench.cycle(motion=None)
        self.assertEqual((command.motion, command.rate, command.engaged), (Motion.POSE, None, True))
        np.testing.assert_array_equal(command.pose[0], [0.1, 0.2, 0.3])
        np.testing.assert_array_equal(command.pose[1], [0.0, 0.0, 1.0, 0.0])
        self.assertEqual(command.gripper, (0.04, 10.0))
        command = bench.cycle()
        self.assertEqual((command.motion, command.rate, command.pose, command.gripper), (None,) * 4)
        self.assertIs(bench.far.reason, Reason.NONE, "it follows a command to hold")
        command = bench.cycle()
        np.testing.assert_array_equal(command.rate, FORWARD.twist)

    def test_rejects_are_counted_by_reason(self):
        self.bench.link.waiting.append(b"noise")
        next(self.bench.far)
        self.assertEqual({reject.value: count for reject, count in self.bench.far.rejects.items()}, {"foreign": 1})


class Measurements(unittest.TestCase):
    def setUp(self):
        self.bench = Bench(sensor_range=(200.0, 10.0))
        self.bench.follow()

    def test_wrong_wrench_holds_and_is_not_sent(self):
        for value, place, expected in ((math.nan, 0, Reason.SENSOR_INVALID), (math.inf, 5, Reason.SENSOR_INVALID),
                                       (200.0, 2, Reason.SENSOR_SATURATED), (-10.0, 4, Reason.SENSOR_SATURATED)):
            bench = Bench(sensor_range=(200.0, 10.0))
            bench.follow()
            wrench = np.zeros(6)
            wrench[place] = value
            bench.cycle(wrench)
            self.assertIs(bench.newest().reason, expected)
            self.assertIsNone(bench.newest().measured.wrench)
            self.assertIsNotNone(bench.newest().measured.pose)

    def test_cause_that_persists_holds_again_in_the_same_cycle(self):
        bench, wrong = self.bench, (math.nan,) * 6
        bench.cycle(wrong)
        for _ in range(5):
            bench.node.epoch += 1
            bench.cycle(wrong)
            self.assertIsNone(bench.cycle(wrong).motion)
            self.assertIs(bench.newest().reason, Reason.SENSOR_INVALID)
        bench.cycle()
        self.assertIsNone(bench.cycle().motion, "it holds until a later epoch")
        bench.node.epoch += 1
        bench.cycle()
        self.assertIs(bench.cycle().motion, Motion.RATE)

    def test_absent_values_are_not_valid_and_hold_nothing(self):
        self.bench.cycle(None, None)
        measured = self.bench.newest().measured
        self.assertEqual((measured.wrench, measured.pose, measured.gripper), (None, None, None))
        self.assertIs(self.bench.cycle().motion, Motion.RATE)

    def test_wrong_pose_is_a_fault_of_the_robot(self):
        skewed = np.eye(4)
        skewed[0, 1] = 0.1
        mirrored = np.diag([1.0, 1.0, -1.0, 1.0])
        wrong = np.eye(4)
        wrong[0, 3] = math.nan
        for pose in (([math.nan, 0, 0], [0, 0, 0, 1]), ([1001, 0, 0], [0, 0, 0, 1]), ([0, 0, 0], [0, 0, 0, 1.01]),
                     ([0, 0, 0], [0, 0, 0, 0]), skewed, mirrored, wrong):
            bench = Bench()
            bench.follow()
            bench.cycle(pose=pose)
            self.assertIs(bench.newest().reason, Reason.FAULT)
            self.assertIsNone(bench.newest().measured.pose)

    def test_matrices_are_sent_as_quaternions(self):
        rng = np.random.default_rng(1)
        for _ in range(200):
            quaternion = rng.normal(size=4)
            x, y, z, w = quaternion = quaternion / np.linalg.norm(quaternion)
            matrix = np.eye(4)
            matrix[:3, 3] = 1.0, 2.0, 3.0
            matrix[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                              [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                              [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
            self.bench.cycle(pose=matrix)
            position, orientation = self.bench.newest().measured.pose
            self.assertEqual(position, (1.0, 2.0, 3.0))
            self.assertGreater(abs(np.dot(orientation, quaternion)), 1 - 1e-12)

    def test_quaternions_of_single_precision_are_sent_as_units(self):
        quaternion = np.array([0.1, 0.2, 0.3, 0.927], dtype=np.float32)
        self.bench.cycle(pose=([0, 0, 0], quaternion / np.linalg.norm(quaternion)))
        self.assertIs(self.bench.newest().reason, Reason.NONE)

    def test_gripper_is_sent(self):
        next(self.bench.far)
        self.bench.far.send((0.0,) * 6, POSE, gripper=(0.02, 5.0))
        self.assertEqual(Feedback.decode(self.bench.link.sent[-1]).measured.gripper, Gripper(0.02, 5.0))

    def test_wrong_shapes_raise(self):
        for arguments, words in ((((0.0,) * 5, POSE), "wrench"), ((None, np.eye(3)), "pose"),
                                 ((None, ([0, 0], [0, 0, 0, 1])), "position"), ((None, POSE, (1.0,)), "gripper")):
            with self.assertRaisesRegex(ValueError, f"^{words} must have the shape"):
                self.bench.far.send(*arguments)

    def test_reasons_of_the_machine_are_refused_as_own_ones(self):
        for reason in (Reason.NONE, Reason.NOT_ARMED, Reason.SILENCE):
            with self.assertRaisesRegex(ValueError, "reason must be of the robot's own"):
                self.bench.far.hold(reason)
        self.bench.far.hold(Reason.SENSOR_SILENT)
        self.bench.cycle()
        self.assertIs(self.bench.newest().reason, Reason.SENSOR_SILENT)


class Two(unittest.TestCase):
    """Two far sides in one process."""

    def test_fault_of_one_does_not_stop_the_other(self):
        one, other = Bench(), Bench()
        one.follow(), other.follow()
        for number in range(200):
            one.cycle(), other.cycle()
            if number == 100:
                with self.assertRaises(RuntimeError):
                    with one.far:
                        raise RuntimeError
                self.assertEqual(one.reasons(), [Reason.FAULT] * 5)
                one = Bench()
                one.follow()
            self.assertIs(other.newest().reason, Reason.NONE)
        self.assertNotEqual(one.far.session, other.far.session)
        self.assertEqual((one.far.rejects, other.far.rejects), ({}, {}))

    def test_two_threads_each_with_a_far_side(self):
        benches, failures = [Bench(), Bench(sample_period=0.001)], []

        def play(bench, value):
            try:
                bench.follow()
                for _ in range(2000):
                    command = bench.cycle((value,) * 6, motion=Rate((value,) * 6))
                    assert command.motion is Motion.RATE and bench.newest().measured.wrench == (value,) * 6
            except BaseException as error:  # a thread's error is not that of the test
                failures.append(error)

        threads = [threading.Thread(target=play, args=(bench, 1.0 + n)) for n, bench in enumerate(benches)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(failures, [])


class Arguments(unittest.TestCase):
    def test_arms_are_numbers_or_names(self):
        for arm, number in ((0, 0), (65535, 65535), ("arm0", 0), ("arm12", 12), ("7", 7)):
            link, node = MemoryLink(), Node(arm=number)
            far = FarSide(arm, link=link, clock=VirtualClock())
            next(far)
            far.send(None, None)
            self.assertEqual(Feedback.decode(link.sent[0]).head.arm, number)
        for arm in (-1, 65536, "arm", "left", "arm70000", 1.5, "arm-1"):
            with self.assertRaisesRegex(ValueError, "^arm must be"):
                FarSide(arm, link=MemoryLink())

    def test_wrong_arguments_raise(self):
        for arguments, words in ((dict(socket="/a", link=MemoryLink()), "one of socket, keys and link"),
                                 (dict(listen="a:1"), "need keys"), (dict(socket="x" * 108), "107 bytes"),
                                 (dict(socket=""), "107 bytes"),
                                 (dict(capability=Capability(sample_period=0.0)), "sample_period"),
                                 (dict(capability=Capability(sample_period=0.2)), "sample_period"),
                                 (dict(capability=Capability(hold_after=0.001)), "hold_after")):
            with self.assertRaisesRegex(ValueError, words):
                FarSide(1, **arguments)

    def test_zenoh_is_not_imported_for_a_local_far_side(self):
        program = ("import sys; sys.path.insert(0, sys.argv[1]); import frhc; frhc.FarSide(socket='/nowhere')\n"
                   "print('zenoh' in sys.modules)")
        done = subprocess.run([sys.executable, "-B", "-c", program, str(ROOT / "python")], stdout=subprocess.PIPE,
                              text=True, timeout=60, check=True)
        self.assertEqual(done.stdout, "False\n")


if __name__ == "__main__":
    unittest.main()
