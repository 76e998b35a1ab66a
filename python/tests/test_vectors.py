"""The test vectors of docs/link.md, byte for byte."""
import json
import re
import unittest

from far import ROOT
from frhc import codec
from frhc.capability import Capability, PayloadRemoval
from frhc.messages import Command, Feedback, Gripper, Pose, Rate
from frhc.reasons import Reason

LAYOUTS = {"Command": codec.COMMAND, "Feedback": codec.FEEDBACK, "Capability": codec.CAPABILITY}
PAGE = (ROOT / "docs/link.md").read_text()
BLOCKS = [json.loads(block) for block in re.findall(r"```json\n(.*?)```", PAGE, re.S)]
VECTORS = [(block["type"].split("/")[-1], block["fields"], bytes.fromhex("".join(block["bytes"]))) for block in BLOCKS]


def numbers(value):
    """Returns the numbers of a field, in order: interface files name x, y, z where the tables have arrays."""
    if isinstance(value, dict):
        value = list(value.values())
    return [n for one in value for n in numbers(one)] if isinstance(value, list) else [value]


def flat(fields):
    """Returns the fields as the codec has them."""
    values = {name: numbers(value) for name, value in {**fields, **fields["head"]}.items()}
    return {name: value if len(value) > 1 else value[0] for name, value in values.items()}


class Vectors(unittest.TestCase):
    def test_page_has_each_message(self):
        self.assertEqual([name for name, _, _ in VECTORS], ["Command", "Command", "Feedback", "Capability"])

    def test_fields_encode_to_the_bytes_of_the_page(self):
        for name, fields, message in VECTORS:
            self.assertEqual(codec.pack(LAYOUTS[name], **flat(fields)), message, name)

    def test_bytes_decode_to_the_fields_of_the_page(self):
        for name, fields, message in VECTORS:
            found, expected = vars(codec.unpack(LAYOUTS[name], message)), flat(fields)
            for field, value in found.items():
                self.assertEqual(numbers(list(value) if isinstance(value, tuple) else value),
                                 numbers(expected[field]), f"{name}.{field}")

    def test_messages_decode_and_encode_to_the_same_bytes(self):
        for name, _, message in VECTORS:
            if name == "Capability":
                head, capability = Capability.decode(message)
                self.assertEqual(capability.encode(head), message)
            else:
                kind = {"Command": Command, "Feedback": Feedback}[name]
                self.assertEqual(kind.decode(message).encode(), message)

    def test_values_are_those_of_the_page(self):
        rate, pose = (Command.decode(message) for name, _, message in VECTORS if name == "Command")
        self.assertEqual((rate.motion, rate.engaged), (Rate((0.1, -0.2, 0.3, -0.4, 0.5, -0.6)), True))
        self.assertEqual((rate.asks_capability, rate.gripper), (False, None))
        expected = Pose((0.5, -0.25, 0.125), (0.5, -0.5, 0.5, 0.5))
        self.assertEqual((pose.motion, pose.gripper), (expected, Gripper(0.04, 12.5)))
        feedback = Feedback.decode(VECTORS[2][2])
        self.assertEqual((feedback.reason, feedback.acted_sequence), (Reason.WRENCH_LIMIT, 38))
        self.assertEqual((feedback.measured.pose, feedback.measured.gripper), (expected, None))
        capability = Capability.decode(VECTORS[3][2])[1]
        self.assertIs(capability.payload_removal, PayloadRemoval.WEIGHT_AND_INERTIA)
        self.assertEqual((capability.senses_pose, capability.has_gripper, capability.follows_rates), (True, False, True))


if __name__ == "__main__":
    unittest.main()
