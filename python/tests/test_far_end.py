"""The state machine: sessions, epochs, echoes, silence."""
import math
import random
import unittest

from far import ARM, FAR, NODE, Node, ms
from frhc.capability import Capability
from frhc.far_end import FarEnd
from frhc.messages import NO_ECHO, Command, Echo, Feedback, Head, Measured, Rate
from frhc.peers import MAX_LEFT
from frhc.reasons import Reason, Reject

HOLD_AFTER = ms(100)
FORWARD = Rate((0.1, 0.0, 0.0, 0.0, 0.0, 0.0))


class Ends:
    """Both ends, and the time, which passes by 1 ms an exchange."""

    def __init__(self, armed=False):
        self.now, self.node, self.far = ms(5000), Node(), FarEnd(ARM, FAR, HOLD_AFTER)
        if armed:
            self.exchange(), self.exchange()
            self.node.epoch = 1
            self.exchange(FORWARD)

    def exchange(self, motion=None, node=None, **others):
        """The far side takes a command and sends a feedback, which `node` takes. Returns command and feedback."""
        node = node or self.node
        self.now += ms(1)
        self.far.on_message(self.now, node.command(motion, **others))
        acting = self.far.command(self.now)
        return acting, node.take(self.far.feedback(self.now, Measured()))

    def reject(self, message):
        return self.far.on_message(self.now, message)


class Machine(unittest.TestCase):
    def follows(self, ends):
        acting, feedback = ends.exchange(FORWARD)
        return acting is not None and acting.motion == FORWARD and feedback.reason is Reason.NONE

    def test_first_messages_lead_to_a_current_session(self):
        ends = Ends()
        feedback = Feedback.decode(ends.far.feedback(ends.now, Measured()))
        self.assertEqual((feedback.reason, feedback.head.epoch, feedback.obeyed_session, feedback.acted_sequence,
                          feedback.head.echo), (Reason.NOT_ARMED, 0, 0, 0, NO_ECHO))
        _, first = ends.exchange()
        self.assertEqual((first.obeyed_session, first.head.echo), (0, Echo(NODE, 1)))
        _, second = ends.exchange()
        self.assertEqual((second.obeyed_session, second.head.echo), (NODE, Echo(NODE, 2)))
        self.assertEqual(ends.far.rejects, {})

    def test_present_epoch_moves_nothing_and_a_later_one_does(self):
        ends = Ends()
        ends.node.epoch = 5
        for _ in range(10):
            self.assertFalse(self.follows(ends))
        self.assertIs(ends.far.reason, Reason.NOT_ARMED)
        ends.node.epoch = 6
        self.assertTrue(self.follows(ends))
        self.assertEqual((ends.far.epoch, ends.far.acted), (6, ends.node.sequence))

    def test_epoch_of_before_is_echoed_and_left(self):
        ends = Ends(armed=True)
        ends.node.epoch = 3
        self.assertTrue(self.follows(ends))
        acted = ends.far.acted
        ends.node.epoch = 2
        _, feedback = ends.exchange(Rate((9.0,) * 6))
        self.assertEqual((feedback.head.echo.sequence, feedback.acted_sequence), (ends.node.sequence, acted))
        self.assertEqual(ends.far.rejects, {Reject.LEFT: 1})

    def test_silence_holds_after_the_limit_until_a_later_epoch(self):
        ends = Ends(armed=True)
        # The echo of the newest command is of the feedback 1 ms before it.
        self.assertIsNotNone(ends.far.command(ends.now + ms(99)))
        self.assertIsNone(ends.far.command(ends.now + ms(99) + 1))
        self.assertIs(ends.far.reason, Reason.SILENCE)
        for _ in range(300):
            self.assertFalse(self.follows(ends))
        ends.node.epoch = 2
        self.assertTrue(self.follows(ends))

    def test_silence_does_not_replace_not_armed(self):
        ends = Ends()
        ends.exchange(), ends.exchange()
        ends.far.command(ends.now + ms(500))
        self.assertIs(ends.far.reason, Reason.NOT_ARMED)

    def test_first_reason_stays_until_a_later_epoch(self):
        ends = Ends(armed=True)
        ends.far.hold(Reason.WRENCH_LIMIT)
        ends.far.hold(Reason.SENSOR_INVALID)
        self.assertFalse(self.follows(ends))
        self.assertIs(ends.far.reason, Reason.WRENCH_LIMIT)
        ends.node.epoch = 2
        self.assertTrue(self.follows(ends))

    def test_not_armed_gives_way_to_a_reason_of_the_robot(self):
        ends = Ends()
        ends.far.hold(Reason.FAULT)
        self.assertIs(ends.far.reason, Reason.FAULT)

    def test_backlog_of_three_seconds_moves_nothing(self):
        ends = Ends(armed=True)
        backlog = [ends.node.command(FORWARD) for _ in range(3000)]
        ends.now += ms(3000)
        for message in backlog:
            self.assertIs(ends.reject(message), Reject.OLD)
            self.assertIsNone(ends.far.command(ends.now))
        self.assertIs(ends.far.reason, Reason.SILENCE)
        self.assertEqual(ends.far.echo.sequence, ends.node.sequence, "old commands are echoed")

    def test_wrong_echoes_do_not_lead(self):
        ends = Ends()
        ends.far.feedback(ends.now, Measured())
        for echo, expected in ((Echo(FAR, 2), Reject.NEVER_SENT), (Echo(FAR, 0), Reject.NEVER_SENT),
                               (Echo(FAR + 1, 1), Reject.SESSION), (Echo(0, 1), Reject.SESSION), (NO_ECHO, None)):
            ends.node.echo = echo
            self.assertIs(ends.reject(ends.node.command(FORWARD)), expected, echo)
            self.assertEqual((ends.far.leader, ends.far.echo), (0, Echo(NODE, ends.node.sequence)))

    def test_first_message_without_an_echo_is_no_reject_but_later_ones_are(self):
        ends = Ends(armed=True)
        ends.node.echo = NO_ECHO
        self.assertIs(ends.reject(ends.node.command(FORWARD)), Reject.SESSION)

    def test_second_node_does_not_lead_while_the_first_is_fresh(self):
        ends, other = Ends(armed=True), Node(session=33)
        other.epoch = 9
        for _ in range(200):
            other.echo = ends.node.echo
            self.assertIs(ends.reject(other.command(FORWARD)), Reject.NOT_LEADER)
            self.assertTrue(self.follows(ends))
        self.assertEqual((ends.far.leader, ends.far.echo.session), (NODE, NODE))

    def test_session_that_was_left_never_leads_again(self):
        ends, other = Ends(armed=True), Node(session=33)
        ends.now += ms(101)
        ends.exchange(node=other), ends.exchange(node=other)
        self.assertEqual((ends.far.leader, ends.far.reason, ends.far.acted), (33, Reason.NOT_ARMED, 0))
        ends.now += ms(300)
        ends.node.echo, ends.node.epoch = other.echo, 7
        self.assertIs(ends.reject(ends.node.command(FORWARD)), Reject.LEFT)
        self.assertEqual((ends.far.leader, ends.far.echo.session), (33, 33))

    def test_silent_session_stays_current_and_continues(self):
        ends = Ends(armed=True)
        ends.now += ms(5000)
        ends.exchange(FORWARD), ends.exchange(FORWARD)
        self.assertEqual((ends.far.leader, ends.far.reason), (NODE, Reason.SILENCE))

    def test_sessions_beyond_those_remembered_do_not_lead(self):
        ends = Ends()
        for session in range(1, MAX_LEFT + 10):
            node = Node(session=1000 + session)
            ends.now += ms(200)
            ends.exchange(node=node), ends.exchange(node=node)
        self.assertEqual(ends.far.leader, 1000 + MAX_LEFT + 1)
        self.assertGreater(ends.far.rejects[Reject.LEFT], 0)

    def test_overtaken_and_repeated_messages_have_no_effect(self):
        ends = Ends(armed=True)
        early, late = ends.node.command(Rate((9.0,) * 6)), ends.node.command(FORWARD)
        self.assertIsNone(ends.reject(late))
        self.assertIs(ends.reject(early), Reject.OVERTAKEN)
        self.assertIs(ends.reject(early), Reject.REPLAYED)
        self.assertIs(ends.reject(late), Reject.REPLAYED)
        self.assertEqual(ends.far.command(ends.now).motion, FORWARD)
        self.assertEqual(ends.far.echo.sequence, ends.node.sequence)

    def test_repeated_message_of_a_session_that_does_not_lead_is_overtaken(self):
        ends = Ends()
        first, second = ends.node.command(), ends.node.command()
        self.assertIsNone(ends.reject(second))
        self.assertIs(ends.reject(second), Reject.OVERTAKEN)
        self.assertIs(ends.reject(first), Reject.OVERTAKEN)
        self.assertEqual(ends.far.echo, Echo(NODE, 2))

    def test_numbers_of_the_newest_128_are_overtaken_and_older_ones_repeated(self):
        ends = Ends(armed=True)
        late = [ends.node.command() for _ in range(200)]
        self.assertIsNone(ends.reject(late[-1]))
        self.assertIs(ends.reject(late[-1 - 127]), Reject.OVERTAKEN)
        self.assertIs(ends.reject(late[-1 - 128]), Reject.REPLAYED)
        self.assertIs(ends.reject(late[-1 - 127]), Reject.REPLAYED)

    def test_number_far_ahead_makes_all_others_repeated(self):
        ends = Ends(armed=True)
        number, ends.node.sequence = ends.node.sequence, 2**64 - 2
        self.assertIsNone(ends.reject(ends.node.command(FORWARD)))
        ends.node.sequence = number
        self.assertIs(ends.reject(ends.node.command(FORWARD)), Reject.REPLAYED)

    def test_messages_of_another_arm_and_impossible_ones_are_counted(self):
        ends, other = Ends(armed=True), Node(arm=ARM + 1)
        nan = Head(ARM, 9, Echo(NODE, 1000), ends.node.echo)
        for message, expected in ((other.command(FORWARD), Reject.ARM), (b"", Reject.FOREIGN),
                                  (ends.node.command(FORWARD)[:-1], Reject.LENGTH),
                                  (Command(nan, Rate((math.nan,) * 6)).encode(), Reject.IMPOSSIBLE),
                                  (ends.far.feedback(ends.now, Measured()), Reject.FOREIGN)):
            self.assertIs(ends.reject(message), expected)
        self.assertEqual(ends.far.rejects, {Reject.ARM: 1, Reject.FOREIGN: 2, Reject.LENGTH: 1, Reject.IMPOSSIBLE: 1})
        self.assertTrue(self.follows(ends))

    def test_capability_answers_a_fresh_command_that_asks_once(self):
        ends = Ends()
        ends.exchange(asks_capability=True)
        self.assertIsNone(ends.far.capability(ends.now, Capability()), "no fresh echo yet")
        ends.exchange(asks_capability=True)
        self.assertIsNotNone(ends.far.capability(ends.now, Capability()))
        self.assertIsNone(ends.far.capability(ends.now, Capability()))

    def test_numbers_of_all_kinds_count_together(self):
        ends = Ends()
        ends.exchange(), ends.exchange(asks_capability=True)
        message = ends.far.capability(ends.now, Capability())
        self.assertEqual(Capability.decode(message)[0].own, Echo(FAR, 3))
        self.assertEqual(ends.exchange()[1].head.own, Echo(FAR, 4))

    def test_echo_is_fresh_until_the_limit(self):
        for late, expected in ((0, None), (1, Reject.OLD)):
            ends = Ends(armed=True)
            # The newest feedback was sent now.
            self.assertIs(ends.far.on_message(ends.now + HOLD_AFTER + late, ends.node.command()), expected)

    def test_echo_of_more_than_4096_messages_before_is_old(self):
        far, node = FarEnd(ARM, FAR, HOLD_AFTER), Node()
        for _ in range(4097):
            far.feedback(0, Measured())
        node.echo = Echo(FAR, 1)
        self.assertIs(far.on_message(0, node.command()), Reject.OLD)
        node.echo = Echo(FAR, 2)
        self.assertIsNone(far.on_message(0, node.command()))


class Network(unittest.TestCase):
    """A network that delays, loses, repeats and reorders, with random numbers of a seed."""

    def test_motion_follows_fresh_commands_of_the_present_epoch_alone(self):
        for seed in range(20):
            moves = self.play(random.Random(seed), seed)
            self.assertGreater(moves, 50, f"seed {seed}: it hardly moves")

    def play(self, draw, seed):
        far, nodes, now = FarEnd(ARM, FAR, HOLD_AFTER), [Node(session=100 + n) for n in range(3)], 0
        sent, there, back, leaders, moves = {}, [], [], [], 0
        for _ in range(1500):
            now += draw.choice((ms(0.5), ms(2), ms(2), ms(30) if draw.random() < 0.02 else ms(1)))
            node = nodes[0] if draw.random() < 0.9 else draw.choice(nodes)
            if draw.random() < 0.03:
                node.epoch += 1
            there.append((now + draw.randrange(ms(60)), node.command(Rate((node.sequence % 50, 0, 0, 0, 0, 0)))))
            if draw.random() < 0.1:
                there.append((now + draw.randrange(ms(500)), draw.choice(there)[1]))
            if draw.random() < 0.002:  # a node that starts again
                nodes[0] = Node(session=nodes[0].session + 1000)
            due = [item for item in there if item[0] <= now]
            there = [item for item in there if item[0] > now]
            before = far.leader, far.epoch
            for _, message in draw.sample(due, len(due)):
                if draw.random() < 0.9:
                    far.on_message(now, message)
            if draw.random() < 0.01:
                far.hold(draw.choice((Reason.FAULT, Reason.WRENCH_LIMIT)))
            acting = far.command(now)
            if far.leader != before[0]:
                self.assertNotIn(far.leader, leaders, f"seed {seed}: a session leads again")
                leaders.append(far.leader)
            elif far.leader:
                self.assertGreaterEqual(far.epoch, before[1], f"seed {seed}: an epoch of before")
            if acting is not None:
                head = acting.head
                self.assertEqual((head.own.session, head.epoch), (far.leader, far.epoch), f"seed {seed}")
                age = now - sent[head.echo.sequence]
                self.assertTrue(head.echo.session == FAR and age <= HOLD_AFTER, f"seed {seed}: {age} ns")
                self.assertEqual((far.acted, far.reason), (head.own.sequence, Reason.NONE))
                moves += 1
            feedback = far.feedback(now, Measured())
            sent[far.sequence] = now
            back.append((now + draw.randrange(ms(60)), feedback))
            for at, message in [item for item in back if item[0] <= now]:
                back.remove((at, message))
                for one in nodes:
                    one.take(message)
        return moves


if __name__ == "__main__":
    unittest.main()
