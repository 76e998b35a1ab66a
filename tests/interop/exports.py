"""Sessions of `frhc demo` as MCAP, read by other people's programs: PyPI mcap, mcap-ros2-support and rosbags.

Its wrenches are compared with `frhc decode`, its joint positions with cantools and the exported DBC, its transforms with its
poses, its JSON with its schemas, the layouts for the viewers with its fields.
"""

import collections
import functools
import json
import os
import re
import subprocess
import tempfile
import xml.etree.ElementTree
from pathlib import Path

import cantools
import jsonschema
import numpy
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

FRHC = os.environ["FRHC"]
ROOT = Path(__file__).resolve().parent.parent.parent
LAYOUTS = ROOT / "share/layouts"
CONFIG = "config/kraft_like.toml"
LINKS = [f"frhc/{name}" for name in "123456g"]
# Topics with a message for each cycle of a session that replays.
EACH_CYCLE = ["/frhc/measured_js", "/frhc/measured_cp", "/frhc/measured_cv", "/frhc/task/setpoint_cf",
              "/frhc/object/measured_cf", "/frhc/object/measured_cp", "/frhc/object/command", "/tf", "/frhc/status",
              "/frhc/torques"]

Message = collections.namedtuple("Message", "nanos data decoded schema")


class File:
    """An exported file: the messages of each topic, as PyPI mcap and mcap-ros2-support decode them."""

    def __init__(self, path):
        self.path = path
        self.topics = collections.defaultdict(list)
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            self.profile = reader.get_header().profile
            self.summary = reader.get_summary()
            self.metadata = {record.name: record.metadata for record in reader.iter_metadata()}
            self.attachments = {record.name: record.data for record in reader.iter_attachments()}
            sequences = collections.Counter()
            for schema, channel, message in reader.iter_messages(log_time_order=False):
                assert message.sequence == sequences[channel.topic], f"{channel.topic}: message {message.sequence}"
                assert message.publish_time == message.log_time
                sequences[channel.topic] += 1
                self.topics[channel.topic].append(Message(message.log_time, message.data, None, schema))
        with path.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            places = collections.Counter()
            ros = [topic for topic, found in self.topics.items() if found[0].schema.encoding == "ros2msg"]
            for _, channel, _, decoded in reader.iter_decoded_messages(ros, log_time_order=False):
                place = places[channel.topic]
                places[channel.topic] += 1
                self.topics[channel.topic][place] = self.topics[channel.topic][place]._replace(decoded=decoded)
        for topic, found in self.topics.items():
            if found[0].schema.encoding == "jsonschema":
                self.topics[topic] = [message._replace(decoded=json.loads(message.data)) for message in found]
        self.topics = dict(self.topics)


@functools.cache
def scratch():
    return tempfile.TemporaryDirectory(prefix="frhc-exports-")


@functools.cache
def exported(*args):
    """Records a session with these arguments, and exports it. Returns its folder and the file."""
    name = re.sub(r"\W+", "-", " ".join(args))
    session = Path(scratch().name) / name
    run = functools.partial(subprocess.run, check=True, stdout=subprocess.DEVNULL, cwd=ROOT)
    demo = subprocess.run([FRHC, "-q", "demo", "--out", session, *args], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=ROOT)
    assert demo.returncode in (0, 6), demo.stderr  # 6: a latched stop
    file = session.with_suffix(".mcap")
    run([FRHC, "export", "mcap", session, "--full-rate", "--out", file])
    return session, File(file)


def in_contact():
    return exported("--config", CONFIG, "--scenario", "contact_10s", "--seconds", "6")


def log_lines(session):
    """Returns the lines of bus.log as `frhc decode` decodes them."""
    command = [FRHC, "decode", "--config", CONFIG, "--json", session / "bus.log"]
    decoded = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout
    return [json.loads(line) for line in decoded.splitlines()]


def six(screw, *names):
    return [getattr(getattr(screw, name), axis) for name in names for axis in "xyz"]


def every_cycle_has_its_messages_at_the_time_of_its_sync(_):
    session, file = in_contact()
    assert file.profile == "ros2"
    counts = {channel.topic: file.summary.statistics.channel_message_counts.get(place, 0)
              for place, channel in file.summary.channels.items()}
    assert counts == {topic: len(file.topics.get(topic, [])) for topic in counts}, counts
    lines = log_lines(session)
    numbers = [line["cycle"] for line in lines if line["kind"] == "cycle"]
    modes = [line["mode"] for line in lines if line["kind"] == "cycle"]
    assert len(numbers) == 6_000
    for topic in EACH_CYCLE:
        assert len(file.topics[topic]) == len(numbers), f"{topic}: {len(file.topics[topic])} messages"
    assert len(file.topics["/tf_static"]) == 1
    status = [message.decoded for message in file.topics["/frhc/status"]]
    assert [it["cycle"] for it in status] == numbers and [it["mode"] for it in status] == modes
    # The last SYNC before the line of each cycle, from time zero of the session: its end on the wire, after it was sent.
    stamps, sync = [], None
    for line in lines:
        if line["kind"] == "sync":
            sync = round(line["t"] * 1e9)
        elif line["kind"] == "cycle":
            stamps.append(sync)
    times = [message.nanos for message in file.topics["/frhc/status"]]
    after = [on_the_wire - sent for on_the_wire, sent in zip(stamps, times, strict=True)]
    assert 0 < min(after) and max(after) < 150_000, (min(after), max(after))
    for topic in EACH_CYCLE:
        assert [message.nanos for message in file.topics[topic]] == times, topic
    for topic in file.topics:
        found = file.topics[topic][-1]
        if hasattr(found.decoded, "header"):
            stamp = found.decoded.header.stamp
            assert stamp.sec * 1_000_000_000 + stamp.nanosec == found.nanos, topic


def every_wrench_is_that_of_the_log(_):
    session, file = in_contact()
    logged = [line["f_s"] for line in log_lines(session) if line["kind"] == "wrench"]
    found = [six(message.decoded.wrench, "force", "torque") for message in file.topics["/frhc/object/measured_cf"]]
    assert len({tuple(wrench) for wrench in logged}) > 1_000, "the object has met the wall"
    assert found == logged
    assert {message.decoded.header.frame_id for message in file.topics["/frhc/object/measured_cf"]} == {"frhc/s"}


def joint_positions_are_those_of_cantools(_):
    session, file = in_contact()
    dbc = subprocess.run([FRHC, "export", "dbc", "--config", CONFIG], check=True, capture_output=True, text=True, cwd=ROOT)
    database = cantools.database.load_string(dbc.stdout, "dbc")
    names = json.loads((session / "session.json").read_text())["joints"]
    newest, cycles = {}, []
    for line in (session / "bus.log").read_text().splitlines():
        if found := re.match(r"\(\S+\) vcan0 ([0-9A-F]{3})#([0-9A-F]*)$", line):
            message = int(found[1], 16)
            if 0x181 <= message <= 0x186:
                newest.update(database.decode_message(message, bytes.fromhex(found[2])))
        elif " node0 " in line:
            cycles.append([newest[f"{name}_position"] for name in names])
    found = [message.decoded for message in file.topics["/frhc/measured_js"]]
    assert all(state.name == names and len(state.effort) == 6 and not state.velocity for state in found)
    difference = numpy.abs(numpy.array([state.position for state in found]) - numpy.array(cycles)).max()
    assert difference < 1e-12, f"{difference} rad"
    assert numpy.ptp(numpy.array(cycles), axis=0).max() > 0.01, "the arm has moved"


def transforms_lead_to_the_poses(_):
    _, file = in_contact()

    def matrix(translation, rotation):
        x, y, z, w = (getattr(rotation, name) for name in "xyzw")
        found = numpy.eye(4)
        found[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
        found[:3, 3] = [translation.x, translation.y, translation.z]
        return found

    def worst(topic, base, chain):
        error = 0
        for transforms, pose in zip(file.topics["/tf"], file.topics[topic], strict=True):
            found = {it.child_frame_id: it for it in transforms.decoded.transforms}
            product, parent = numpy.eye(4), base
            for child in chain:
                assert found[child].header.frame_id == parent, f"{child} is in {found[child].header.frame_id}"
                product = product @ matrix(found[child].transform.translation, found[child].transform.rotation)
                parent = child
            expected = matrix(pose.decoded.pose.position, pose.decoded.pose.orientation)
            assert pose.decoded.header.frame_id == base
            error = max(error, numpy.abs(product - expected).max())
        return error

    assert worst("/frhc/measured_cp", "frhc/0", LINKS) < 1e-12
    assert worst("/frhc/object/measured_cp", "frhc/b", ["frhc/m"]) < 1e-12
    fixed = file.topics["/tf_static"][0].decoded.transforms
    assert [(it.header.frame_id, it.child_frame_id) for it in fixed] == [("frhc/m", "frhc/s")]


def rosbags_encodes_messages_of_every_type_to_the_same_bytes(_):
    kinds = collections.Counter()
    posed = in_pose_mode()[1].topics["/frhc/object/setpoint_cp"]
    for topic, found in [*in_contact()[1].topics.items(), ("/frhc/object/setpoint_cp", posed)]:
        schema = found[0].schema
        if schema.encoding != "ros2msg":
            continue
        # The definition in the file is that of ROS 2 Jazzy, and of share/frhc_msgs.
        own, jazzy = get_typestore(Stores.EMPTY), get_typestore(Stores.ROS2_JAZZY)
        own.register(get_types_from_msg(schema.data.decode(), schema.name))
        types = {}
        for path in sorted((ROOT / "share/frhc_msgs/msg").glob("*.msg")):
            types.update(get_types_from_msg(path.read_text(), f"frhc_msgs/msg/{path.stem}"))
        jazzy.register(types)
        assert own.hash_rihs01(schema.name) == jazzy.hash_rihs01(schema.name), schema.name
        for message in found[::5]:
            decoded = jazzy.deserialize_cdr(message.data, schema.name)
            assert bytes(jazzy.serialize_cdr(decoded, schema.name)) == message.data, f"{topic} at {message.nanos}"
        kinds[schema.name] += len(found)
    assert set(kinds) == {
        "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/TwistStamped", "tf2_msgs/msg/TFMessage", "diagnostic_msgs/msg/DiagnosticArray",
        "frhc_msgs/msg/Command"}, kinds


def in_pose_mode():
    return exported("--config", CONFIG, "--scenario", "stretched", "--seconds", "6")


def rosbags_reads_a_file_of_ros_types_as_a_bag(_):
    session, file = in_contact()
    only = session.with_suffix(".ros.mcap")
    subprocess.run([FRHC, "export", "mcap", session, "--ros-only", "--full-rate", "-o", only], check=True, stdout=subprocess.DEVNULL, cwd=ROOT)
    ros = {topic: found for topic, found in file.topics.items() if found[0].schema.encoding == "ros2msg"}
    with AnyReader([only]) as reader:
        assert {connection.topic: connection.msgcount for connection in reader.connections if connection.msgcount} == {
            topic: len(found) for topic, found in ros.items()}
        read = collections.defaultdict(list)
        for connection, nanos, data in reader.messages():
            read[connection.topic].append((nanos, data))
        for connection in reader.connections:
            if connection.topic in read:
                reader.deserialize(read[connection.topic][-1][1], connection.msgtype)
    assert read == {topic: [(message.nanos, message.data) for message in found] for topic, found in ros.items()}


def reduced_file_has_the_same_messages_fewer_times(_):
    session, full = in_contact()
    path = session.with_suffix(".reduced.mcap")
    subprocess.run([FRHC, "export", "mcap", session, "-o", path], check=True, stdout=subprocess.DEVNULL, cwd=ROOT)
    reduced = File(path)
    assert {chunk.compression for chunk in reduced.summary.chunk_indexes} == {"lz4"}
    assert path.stat().st_size < 4_500_000, path.stat().st_size
    slow = {"/tf", "/frhc/status", "/frhc/torques"}
    assert reduced.topics.keys() == full.topics.keys()
    for topic, found in reduced.topics.items():
        messages = [(it.nanos, it.data) for it in found]
        expected = [(it.nanos, it.data) for it in full.topics[topic]]
        if topic in slow:
            assert 600 <= len(messages) < 620 and set(messages) <= set(expected), f"{topic}: {len(messages)}"
        else:
            assert messages == expected, topic
    modes = [message.decoded["mode_number"] for message in full.topics["/frhc/status"]]
    changes = [place for place in range(1, len(modes)) if modes[place] != modes[place - 1]]
    times = {message.nanos for message in reduced.topics["/frhc/status"]}
    assert changes and all(full.topics["/frhc/status"][place].nanos in times for place in changes)
    # Without an index, from the start to the end, with the checksum of all bytes before the summary.
    with path.open("rb") as stream:
        count = sum(1 for _ in NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False))
    assert count == reduced.summary.statistics.message_count


def commands_are_rates_poses_or_none(_):
    session, file = in_contact()
    rates = {message.nanos: six(message.decoded.twist, "linear", "angular")
             for message in file.topics["/frhc/object/setpoint_cv"]}
    assert any(any(rate) for rate in rates.values()) and "/frhc/object/setpoint_cp" not in file.topics
    for number, message in zip(file.topics["/frhc/status"], file.topics["/frhc/object/command"], strict=True):
        command = message.decoded
        assert command.head.sequence == number.decoded["cycle"]
        assert six(command.rate, "linear", "angular") == rates[message.nanos]
    _, file = in_pose_mode()
    poses = {message.nanos: message.decoded.pose for message in file.topics["/frhc/object/setpoint_cp"]}
    assert len(poses) > 100
    for message in file.topics["/frhc/object/command"]:
        command = message.decoded
        assert (command.mode == 2) == (message.nanos in poses)
        if message.nanos in poses:
            assert six(command.pose, "position") == six(poses[message.nanos], "position")


def json_is_that_of_its_schemas(_):
    for _, file in (in_contact(), in_pose_mode()):
        for topic in ("/frhc/status", "/frhc/torques"):
            found = file.topics[topic]
            schema = json.loads(found[0].schema.data)
            jsonschema.Draft202012Validator.check_schema(schema)
            validator = jsonschema.Draft202012Validator(schema)
            for message in found[::7]:
                validator.validate(message.decoded)
            names = {name for message in found for name in message.decoded}
            # Nothing was left out because it is not finite, and no field is in no message without a reason.
            unseen = set(schema["properties"]) - names
            assert unseen <= {"stopped_by", "confirmed_us", "energy_j", "tank_j", "limiting_joint", "slewing_joint",
                              "self_driven_joint", "inputs", "gripper_m", "gripper_n"}, f"{topic}: {unseen}"


def torques_are_the_sum_of_their_budget(_):
    _, file = in_contact()
    worst = 0
    for message in file.topics["/frhc/torques"]:
        torques = message.decoded
        part = {name: numpy.array(torques[name]) for name in
                ("tau", "task", "gravity", "centring", "damping", "passivity", "soft_stops", "friction", "hold")}
        assist = (part["centring"] + part["damping"]) * torques["assist_scale"]
        rest = part["task"] + part["passivity"] + part["soft_stops"] + part["friction"] + assist
        total = part["gravity"] + part["hold"] + rest * torques["rest_scale"] * torques["share"]
        if "slewing_joint" not in torques:
            worst = max(worst, numpy.abs(total - part["tau"]).max())
    assert worst < 1e-9, f"{worst} N·m"


def session_and_files_are_in_the_file(_):
    session, file = in_contact()
    description = json.loads((session / "session.json").read_text())
    facts = file.metadata["frhc.session"]
    assert facts["program"] == description["program"] and facts["configuration"] == CONFIG
    assert json.loads(facts["joints"]) == description["joints"]
    assert file.metadata["frhc.sha256"] == {it["copy"]: it["sha256"] for it in description["files"]}
    assert file.attachments == {it["copy"]: (session / it["copy"]).read_bytes() for it in description["files"]}
    found = file.metadata["frhc.findings"]
    assert found["cycles"] == "6000" and found["cycles_without_replay"] == "0", found
    assert not [key for key in found if key.startswith("warning")], found


def diagnostics_come_once_a_second_and_at_changes(_):
    session, file = in_contact()
    found = [message.decoded for message in file.topics["/diagnostics"]]
    modes = [dict((it.key, it.value) for it in message.status[0].values)["mode"] for message in found]
    logged = [line["mode"] for line in log_lines(session) if line["kind"] == "cycle"]
    changes = [mode for place, mode in enumerate(logged) if place == 0 or logged[place - 1] != mode]
    assert [mode for place, mode in enumerate(modes) if place == 0 or modes[place - 1] != mode] == changes
    assert 6 <= len(found) <= 7 + len(changes), len(found)
    names = [status.name for status in found[-1].status]
    joints = json.loads((session / "session.json").read_text())["joints"]
    assert names == ["node", "bus joints", *[f"joint {name}" for name in joints]], names


def stop_is_named_with_its_cause(_):
    session, file = exported("--config", CONFIG, "--scenario", "faults/unplug")
    fault = json.loads(next(session.glob("faults/*/fault.json")).read_text())
    number, name = fault["joint"], fault["joint_name"]
    cause = fault["cause"].replace(f"joint {number}", f"joint {number} ({name})", 1)
    stopped = [message.decoded for message in file.topics["/frhc/status"] if "stopped_by" in message.decoded]
    assert stopped[0]["cycle"] == fault["cycle"] and {it["stopped_by"] for it in stopped} == {cause}, stopped[0]
    statuses = [message.decoded.status for message in file.topics["/diagnostics"]]
    levels = [int.from_bytes(status[0].level, "little") if isinstance(status[0].level, bytes) else status[0].level
              for status in statuses]
    assert levels[0] == 0 and levels[-1] == 2 and statuses[-1][0].message == cause, statuses[-1][0]
    joint = next(it for it in statuses[-1] if it.name == f"joint {name}")
    assert int({it.key: it.value for it in joint.values}["missing_samples"]) > 0, joint


def field(decoded, path):
    """Returns the field of a decoded message: `wrench.force.x` or `tau[3]`."""
    for name, place in re.findall(r"([A-Za-z_]\w*)|\[(\d+)\]", path):
        if place:
            decoded = decoded[int(place)]
        else:
            decoded = decoded[name] if isinstance(decoded, dict) else getattr(decoded, name)
    return decoded


def topic_and_field(path, topics, separator):
    """Splits the path of a viewer at the longest topic that it begins with."""
    found = [topic for topic in topics if path.startswith(topic + separator)]
    assert found, f"{path}: no such topic"
    topic = max(found, key=len)
    return topic, path[len(topic) + 1:].replace("/", ".")


def layouts_name_topics_and_fields_of_the_file(_):
    _, file = in_contact()
    paths, seen = [], []
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    for panel in layout["configById"].values():
        paths += [topic_and_field(path["value"], file.topics, ".") for path in panel.get("paths", [])]
        seen += panel.get("topics", {}).keys()
        seen += [panel["topicToRender"]] if "topicToRender" in panel else []
        frame = panel.get("followTf")
        frames = {it.header.frame_id for it in file.topics["/tf"][-1].decoded.transforms}
        assert frame is None or frame in frames, frame

    def panels(node):
        return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])

    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
    juggler = xml.etree.ElementTree.parse(LAYOUTS / "plotjuggler.xml")
    curves = [curve.get("name") for curve in juggler.iter("curve")]
    paths += [topic_and_field(curve, file.topics, "/") for curve in curves]
    assert len(paths) > 60 and set(seen) <= set(file.topics), (len(paths), seen)
    for topic, path in paths:
        value = field(file.topics[topic][-1].decoded, path)
        assert isinstance(value, (float, int, str)), f"{topic} {path}: {value}"
    # Positions, torques, wrenches and modes are shown by both.
    for shown in (curves, json.dumps(layout)):
        for topic in ("/frhc/status", "/frhc/torques", "/frhc/object/measured_cf", "/frhc/setpoint_cf"):
            assert topic in str(shown), topic


TESTS = [
    every_cycle_has_its_messages_at_the_time_of_its_sync,
    every_wrench_is_that_of_the_log,
    joint_positions_are_those_of_cantools,
    transforms_lead_to_the_poses,
    rosbags_encodes_messages_of_every_type_to_the_same_bytes,
    rosbags_reads_a_file_of_ros_types_as_a_bag,
    reduced_file_has_the_same_messages_fewer_times,
    commands_are_rates_poses_or_none,
    json_is_that_of_its_schemas,
    torques_are_the_sum_of_their_budget,
    session_and_files_are_in_the_file,
    diagnostics_come_once_a_second_and_at_changes,
    stop_is_named_with_its_cause,
    layouts_name_topics_and_fields_of_the_file,
]
