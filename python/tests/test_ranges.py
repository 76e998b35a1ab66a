"""Every range of docs/link.md at its bound, and the reasons of rejects."""
import math
import unittest

import far  # noqa: F401  the path of the package
from frhc import codec
from frhc.capability import Capability
from frhc.messages import Command, Feedback
from frhc.reasons import Reject, Rejected

HEAD = dict(version=1, arm=7, epoch=0, session=1, sequence=1, echoed_session=0, echoed_sequence=0)
REST = dict(pose=(0, 0, 0, 0, 0, 0, 1), gripper_position=0, gripper_force=0)
COMMAND = dict(**HEAD, **REST, kind=1, mode=0, engaged=0, asks_capability=0, has_gripper=0, rate=(0,) * 6)
FEEDBACK = dict(**HEAD, **REST, kind=2, state=1, reason=0, valid=0, obeyed_session=0, acted_sequence=0, wrench=(0,) * 6)
CAPABILITY = dict(**HEAD, kind=3, senses=0, follows=0, payload_removal=0, accommodation=(0,) * 6, deadband=(0,) * 6,
                  servo_lag=0, sample_period=0, hold_after=0, sensor_range=(0, 0), stiffest_contact=0, max_speed=(0, 0),
                  workspace_low=(0, 0, 0), workspace_high=(0, 0, 0))
KINDS = {1: (Command, codec.COMMAND, COMMAND), 2: (Feedback, codec.FEEDBACK, FEEDBACK),
         3: (Capability, codec.CAPABILITY, CAPABILITY)}
NAN, INFINITE = math.nan, math.inf


def message(of, /, **changes):
    _, layout, fields = KINDS[of]
    return codec.pack(layout, **{**fields, **changes})


def reject(data, kind):
    """Returns why a message is rejected, None if it is not."""
    try:
        KINDS[kind][0].decode(data)
        return None
    except Rejected as rejected:
        return rejected.reject


def beyond(value):
    """Returns the next number outwards."""
    return math.nextafter(value, math.copysign(INFINITE, value))


def at(place, value, count, rest=0.0):
    return tuple(value if one == place else rest for one in range(count))


class Ranges(unittest.TestCase):
    def is_bound(self, kind, bound, fields):
        """`fields(value)` is accepted at the bound, and neither beyond it nor as NaN or infinity."""
        self.assertIsNone(reject(message(kind, **fields(bound)), kind), f"{fields(bound)}")
        for value in (beyond(bound), NAN, math.copysign(INFINITE, bound)):
            self.assertIs(reject(message(kind, **fields(value)), kind), Reject.IMPOSSIBLE, f"{fields(value)}")

    def test_rates_are_at_most_100(self):
        for place in range(6):
            for bound in (100.0, -100.0):
                self.is_bound(1, bound, lambda v: dict(mode=1, rate=at(place, v, 6)))

    def test_positions_are_at_most_1000_m(self):
        for place in range(3):
            for bound in (1000.0, -1000.0):
                pose = lambda v: at(place, v, 3) + (0, 0, 0, 1)
                self.is_bound(1, bound, lambda v: dict(mode=2, pose=pose(v)))
                self.is_bound(2, bound, lambda v: dict(valid=2, pose=pose(v)))

    def test_norms_are_1_within_a_millionth(self):
        for place in range(4):
            for norm, expected in ((1 + 0.99e-6, None), (1 - 0.99e-6, None), (-1 - 0.99e-6, None),
                                   (1 + 1.01e-6, Reject.IMPOSSIBLE), (1 - 1.01e-6, Reject.IMPOSSIBLE),
                                   (0.0, Reject.IMPOSSIBLE), (NAN, Reject.IMPOSSIBLE), (1e200, Reject.IMPOSSIBLE)):
                pose = (0, 0, 0) + at(place, norm, 4)
                self.assertIs(reject(message(1, mode=2, pose=pose), 1), expected, f"{pose}")
                self.assertIs(reject(message(2, valid=2, pose=pose), 2), expected, f"{pose}")

    def test_grippers_are_at_most_1000(self):
        for name in ("gripper_position", "gripper_force"):
            for bound in (1000.0, -1000.0):
                self.is_bound(1, bound, lambda v: {"has_gripper": 1, name: v})
                self.is_bound(2, bound, lambda v: {"valid": 4, name: v})

    def test_wrenches_are_at_most_100000(self):
        for place in range(6):
            for bound in (1e5, -1e5):
                self.is_bound(2, bound, lambda v: dict(valid=1, wrench=at(place, v, 6)))

    def test_figures_are_from_0_to_1e9(self):
        counts = dict(accommodation=6, deadband=6, sensor_range=2, max_speed=2, servo_lag=1, sample_period=1,
                      hold_after=1, stiffest_contact=1)
        for name, count in counts.items():
            for place in range(count):
                fields = lambda v: {name: at(place, v, count) if count > 1 else v}
                self.is_bound(3, 1e9, fields)
                self.is_bound(3, -0.0, fields)

    def test_workspace_is_within_1e9(self):
        for place in range(3):
            for bound in (1e9, -1e9):
                self.is_bound(3, bound, lambda v: dict(workspace_low=at(place, v, 3, -1e9), workspace_high=(1e9,) * 3))
                self.is_bound(3, bound, lambda v: dict(workspace_low=(-1e9,) * 3, workspace_high=at(place, v, 3, 1e9)))

    def test_workspace_has_no_low_above_its_high(self):
        for place in range(3):
            for low, high, expected in ((0.5, 0.5, None), (0.5, math.nextafter(0.5, 0), Reject.IMPOSSIBLE),
                                        (-1.0, -2.0, Reject.IMPOSSIBLE)):
                fields = dict(workspace_low=at(place, low, 3, -3.0), workspace_high=at(place, high, 3, 3.0))
                self.assertIs(reject(message(3, **fields), 3), expected, f"{fields}")

    def test_codes_have_a_meaning(self):
        cases = [(1, name, top) for name, top in (("mode", 2), ("engaged", 1), ("asks_capability", 1), ("has_gripper", 1))]
        cases += [(2, "valid", 7), (3, "senses", 7), (3, "follows", 3), (3, "payload_removal", 2)]
        for kind, name, top in cases:
            for code in range(256):
                expected = None if code <= top else Reject.IMPOSSIBLE
                self.assertIs(reject(message(kind, **{name: code}), kind), expected, f"{name} {code}")

    def test_state_is_that_of_the_reason(self):
        for state in range(256):
            for reason in range(256):
                is_valid = (state, reason == 0) in ((1, True), (0, False)) and reason <= 8
                found = reject(message(2, state=state, reason=reason), 2)
                self.assertIs(found, None if is_valid else Reject.IMPOSSIBLE, f"{state} {reason}")

    def test_excluded_values_are_not_read(self):
        odd = dict(pose=(NAN,) * 7, gripper_position=NAN, gripper_force=INFINITE)
        self.assertIsNone(reject(message(1, rate=(NAN,) * 6, **odd), 1))
        self.assertIsNone(reject(message(1, mode=1, **odd), 1))
        self.assertIsNone(reject(message(1, mode=2, rate=(NAN,) * 6), 1))
        self.assertIsNone(reject(message(2, wrench=(NAN,) * 6, **odd), 2))

    def test_reserved_bytes_are_not_read(self):
        for kind, places in ((1, (48, 49, 50, 51, 172, 187)), (2, (47, 51, 188, 195)), (3, (47, 51, 260, 275))):
            for place in places:
                data = bytearray(message(kind))
                self.assertEqual(data[place], 0)
                data[place] = 255
                self.assertIsNone(reject(bytes(data), kind), f"{kind} {place}")

    def test_heads_are_rejected_by_their_first_fault(self):
        for kind in KINDS:
            good = message(kind)
            other = kind % 3 + 1
            for data, expected in (
                    (b"", Reject.FOREIGN), (good[:3], Reject.FOREIGN), (bytes(4) + good[4:], Reject.FOREIGN),
                    (good[:4], Reject.LENGTH), (good[:5], Reject.LENGTH), (good[:6], Reject.LENGTH),
                    (good[:-1], Reject.LENGTH), (good + b"\0", Reject.LENGTH), (good[:4] + b"\x09\x01", Reject.FOREIGN),
                    (good[:5] + b"\x02" + good[6:-1], Reject.VERSION), (message(kind, kind=other), Reject.FOREIGN),
                    (message(kind, kind=0, version=2), Reject.VERSION), (message(kind, session=0), Reject.IMPOSSIBLE),
                    (message(kind, sequence=0), Reject.IMPOSSIBLE)):
                self.assertIs(reject(data, kind), expected, data.hex())


class Figures(unittest.TestCase):
    def test_infinity_is_sent_as_no_limit(self):
        capability = Capability()
        self.assertEqual((capability.stiffest_contact, capability.max_speed), (1e9, (1e9, 1e9)))
        self.assertEqual(capability.workspace_low, (-1e9,) * 3)

    def test_wrong_figures_name_themselves(self):
        for name, value, words in (("servo_lag", -1.0, "at least 0"), ("max_speed", (1.0, NAN), "at least 0"),
                                   ("workspace_low", (0, 0, NAN), "a number"), ("deadband", (1.0,), "6 numbers")):
            with self.assertRaisesRegex(ValueError, f"^{name} must .*{words}"):
                Capability(**{name: value})
        with self.assertRaisesRegex(ValueError, "^workspace_high must be at least workspace_low"):
            Capability(workspace_low=(0, 0, 0.5), workspace_high=(1, 1, 0.4))


if __name__ == "__main__":
    unittest.main()
