"""`frhc top` on the screens of tmux, a terminal that shares no code with the program, against a node that only sends lines."""

import json
import os
import re
import signal
import socket
import subprocess
import tempfile
import threading
import time
from contextlib import contextmanager
from pathlib import Path

FRHC = os.environ["FRHC"]
FEED = Path(__file__).resolve().parent.parent / "golden/telemetry.jsonl"
SIZES = [(80, 24), (40, 12)]
SCREEN_TIMEOUT_S = 20
PERIOD_S = 0.02
# Position of the first joint: the snapshot is on the screen.
FIRST_VALUE = "0.021 rad"
COLOUR = re.compile("\x1b\\[[0-9;]*(?<![0-9])(?:3[0-8]|4[0-8]|9[0-7]|10[0-7])(?![0-9])[0-9;]*m")
ENDED = "exit code:"


class Node:
    """A node at a socket: sends its description and mode to each reader, and then a snapshot every 20 ms."""

    def __init__(self, path, **changed):
        self.description, self.mode, self.snapshot = map(json.loads, FEED.read_text().splitlines())
        for line in self.lines():
            line.update((key, value) for key, value in changed.items() if key in line)
        self.path = path
        self.is_ending = False
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(str(path))
        self.listener.listen()
        self.thread = threading.Thread(target=self.serve)
        self.thread.start()

    def lines(self):
        return self.description, self.mode, self.snapshot

    def serve(self):
        self.listener.settimeout(PERIOD_S)
        readers = []
        while not self.is_ending:
            try:
                reader, _ = self.listener.accept()
                readers.append(reader)
                self.send([reader], *self.lines())
            except TimeoutError:
                self.snapshot["cycle"] += 20
                self.snapshot["at_us"] += 20_000
                readers = self.send(readers, self.snapshot)
        for end in [*readers, self.listener]:
            end.close()
        self.path.unlink()

    @staticmethod
    def send(readers, *lines):
        """Sends lines to readers; returns those that are left."""
        left = []
        for reader in readers:
            try:
                reader.sendall("".join(json.dumps(line) + "\n" for line in lines).encode())
                left.append(reader)
            except OSError:
                reader.close()
        return left

    def end(self):
        self.is_ending = True
        self.thread.join()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()


class Terminal:
    """A shell in a terminal of tmux, on a server of its own."""

    def __init__(self, folder, width, height, **environment):
        self.tmux = ["tmux", "-S", f"{folder}/tmux", "-f", "/dev/null"]
        kept = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "TMUX")}
        shell = "env PS1='shell> ' bash --norc --noprofile"
        command = [*self.tmux, "new-session", "-d", "-x", str(width), "-y", str(height), shell]
        subprocess.run(command, check=True, env={**kept, "LC_ALL": "C.UTF-8", **environment})
        self.wait("shell>")

    def call(self, *args):
        return subprocess.run([*self.tmux, *args], check=True, capture_output=True, text=True).stdout

    def run(self, command):
        self.call("send-keys", f"{command}; echo {ENDED} $?", "Enter")

    def press(self, key):
        self.call("send-keys", key)

    def text(self, with_escapes=False):
        return self.call("capture-pane", "-p", *(["-e"] if with_escapes else []))

    def pid(self):
        """Returns the process that the shell has started."""
        shell = self.call("display-message", "-p", "#{pane_pid}").strip()
        found = subprocess.run(["ps", "--ppid", shell, "-o", "pid="], capture_output=True, text=True).stdout
        return int(found.split()[0])

    def wait(self, *wanted, absent=()):
        """Returns the screen that has all these words and none of those; fails if it does not come."""
        end = time.monotonic() + SCREEN_TIMEOUT_S
        while True:
            text = self.text()
            if all(word in text for word in wanted) and not any(word in text for word in absent):
                return text
            assert time.monotonic() < end, f"{wanted}, but not {absent}:\n{text}"
            time.sleep(PERIOD_S)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        # A server without terminals has ended by itself.
        subprocess.run([*self.tmux, "kill-server"], capture_output=True)


@contextmanager
def shown(width, height, changed=None, **environment):
    """Yields a terminal that shows `frhc top`, the node and the path of its socket."""
    with tempfile.TemporaryDirectory() as folder, Terminal(folder, width, height, **environment) as terminal:
        path = Path(folder) / "telemetry.sock"
        with Node(path, **(changed or {})) as node:
            terminal.run(f"{FRHC} top --socket {path}")
            yield terminal, node, path


def force(wrench):
    return f"{sum(part * part for part in wrench[:3]) ** 0.5:.2f} N"


def is_whole(text, node):
    """Checks what every screen shows: mode, joints with position, torque and share, forces, load, and keys."""
    rows = text.splitlines()
    assert rows[0].split()[0] == node.mode["mode"], rows[0]
    for place, joint in enumerate(node.description["hand"]["joints"]):
        row = next(row for row in rows if row.startswith(joint["name"]))
        position, torque = f"{node.snapshot['q'][place]:.3f} rad", f"{node.snapshot['tau'][place]:.2f} N·m"
        share = f"{100 * node.snapshot['limit_used'][place]:.0f} %"
        assert all(part in row for part in (position, torque, share)), (row, position, torque, share)
    for key in ("f_s", "f_g"):
        assert force(node.snapshot[key]).removesuffix(" N") in text, (key, text)
    assert f"{node.snapshot['buses'][0]['load_percent']:.1f} %" in text, text
    assert f"sample age{node.snapshot['sample_age_us'] / 1e3:9.2f} ms" in text, text
    assert rows[-1].startswith("q quit"), rows[-1]


def top_shows_a_node_at_both_sizes_and_after_a_resize(_):
    for (width, height), (other_width, other_height) in zip(SIZES, reversed(SIZES)):
        with shown(width, height) as (terminal, node, _):
            is_whole(terminal.wait("engaged", "q quit", FIRST_VALUE), node)
            assert terminal.call("display-message", "-p", "#{alternate_on}").strip() == "1"
            terminal.call("resize-window", "-x", str(other_width), "-y", str(other_height))
            # Only the wide screen has bars of the joints.
            wanted, absent = (["of its limit"], []) if other_width == 80 else ([], ["of its limit"])
            is_whole(terminal.wait("q quit", FIRST_VALUE, *wanted, absent=absent), node)
            terminal.call("resize-window", "-x", "20", "-y", "5")
            terminal.wait("needs 40 × 12")


def top_follows_a_node_that_ends_and_comes_again(_):
    with shown(80, 24) as (terminal, node, path):
        terminal.wait("engaged")
        node.end()
        terminal.wait("no node", f"No node offers {path}. Waiting", "last ones received")
        with Node(path, mode="ready", program="frhc 0.1.1"):
            terminal.wait("ready", "frhc 0.1.1", absent=["no node", "engaged"])
        terminal.wait("no node")
        with Node(path, version=2):
            text = terminal.wait("version 2")
            assert "use both of one" in text, text


def top_shows_a_stop_with_its_cause_and_the_way_out(_):
    cause = "joint 3 (elbow): no sample for 3 cycles"
    stop = {"mode": "drives-off", "stopped_by": cause, "not_off": ["elbow", "roll"], "way_out": ["Press the red button.", "frhc ctl reset"]}
    for width, height in SIZES:
        with shown(width, height, stop) as (terminal, node, _):
            text = terminal.wait("drives-off", "q quit", FIRST_VALUE)
            assert "NOT OFF, do not touch: elbow, roll" in text, text
            assert "stopped by: joint 3 (elbow)" in text, text
            is_whole(text, node)
            if width == 80:
                assert cause in text and "→ Press the red button." in text and "→ frhc ctl reset" in text, text


def top_leaves_the_shell_as_it_was(_):
    ends = {"q": lambda terminal: terminal.press("q"), "Esc": lambda terminal: terminal.press("Escape"),
            "Ctrl-C": lambda terminal: terminal.press("C-c"), "SIGTERM": lambda terminal: os.kill(terminal.pid(), signal.SIGTERM),
            "SIGHUP": lambda terminal: os.kill(terminal.pid(), signal.SIGHUP)}
    for name, end in ends.items():
        with shown(80, 24) as (terminal, _, _):
            terminal.wait("engaged")
            end(terminal)
            text = terminal.wait(f"{ENDED} 0")
            assert text.startswith("shell>") and "azimuth" not in text, (name, text)
            state = terminal.call("display-message", "-p", "#{alternate_on} #{cursor_flag}").split()
            assert state == ["0", "1"], (name, state)
            # The terminal shows what is typed, line by line.
            terminal.call("send-keys", "stty -a", "Enter")
            modes = terminal.wait("icanon", "echo").split()
            assert "-icanon" not in modes and "-echo" not in modes, (name, modes)


def top_ends_with_its_terminal(_):
    with shown(80, 24) as (terminal, _, _):
        terminal.wait("engaged")
        process = Path(f"/proc/{terminal.pid()}")
        terminal.call("kill-session")
        end = time.monotonic() + SCREEN_TIMEOUT_S
        while process.exists():
            assert time.monotonic() < end, process.joinpath("stat").read_text()
            time.sleep(PERIOD_S)


def top_keys_change_the_view(_):
    with shown(80, 24) as (terminal, node, _):
        terminal.wait("timing, µs")
        terminal.press("b")
        terminal.wait("torque budget", "passivity", absent=["timing, µs"])
        terminal.press("b")
        terminal.wait("timing, µs", absent=["passivity"])
        terminal.press("Up")
        terminal.press("p")
        paused = terminal.wait("PAUSED")
        before = node.snapshot["cycle"]
        while node.snapshot["cycle"] < before + 1_000:
            time.sleep(PERIOD_S)
        assert terminal.text() == paused
        terminal.press("p")
        terminal.wait("engaged", absent=["PAUSED"])


def top_uses_no_colour_under_no_color(_):
    changed = {"mode": "drives-off", "stopped_by": "a test"}
    for is_plain in (False, True):
        with shown(80, 24, changed, **({"NO_COLOR": "1"} if is_plain else {})) as (terminal, _, _):
            terminal.wait("drives-off", "stopped by: a test")
            escapes = terminal.text(with_escapes=True)
            assert (COLOUR.search(escapes) is None) == is_plain, escapes
            assert re.search("7m(?:\x1b\\[[0-9;]*m)* drives-off ", escapes), "its badge is reversed"


def hostile_names_do_not_reach_the_terminal(_):
    names = ["\x1b[31mred", "<b>bold</b>", "x" * 1_000, "関節関節関節関節関節", "a\r\nb\x07\x9b2J", "\x1b]0;title\x07z"]
    changed = {"stopped_by": "\x1b[2J\x1b[31mcause", "mode": "\x1b[31mmode", "program": names[2], "not_off": names}
    for width, height in SIZES:
        with shown(width, height, changed, NO_COLOR="1") as (terminal, node, path):
            terminal.wait("q quit")
            node.end()
            terminal.wait("no node")
            with Node(path, **changed) as hostile:
                for joint, name in zip(hostile.description["hand"]["joints"], names):
                    joint["name"] = name
                hostile.description["buses"][0]["name"] = names[0]
                # A reader that comes now gets these names.
                terminal.wait("[31mmode", absent=["no node"])
                terminal.press("q")
                terminal.wait(f"{ENDED} 0")
                terminal.run(f"clear; {FRHC} top --socket {path}")
                text = terminal.wait("[31mmode", "<b>bold", "関節", "[31mred")
                assert COLOUR.search(terminal.text(with_escapes=True)) is None
                rows = text.splitlines()
                assert len([row for row in rows if " rad " in row]) == 6, text
                assert rows[-1].startswith("q quit"), text
                assert terminal.call("display-message", "-p", "#{pane_title}").strip() != "title"


def top_without_a_terminal_says_so_and_once_prints(_):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "telemetry.sock"
        top = [FRHC, "top", "--socket", str(path)]
        done = subprocess.run(top, capture_output=True, text=True, stdin=subprocess.DEVNULL)
        assert (done.returncode, done.stdout) == (2, ""), done
        assert done.stderr.startswith("frhc: top needs a terminal") and done.stderr.count("\n") == 1, done.stderr
        done = subprocess.run([*top, "--once"], capture_output=True, text=True)
        assert (done.returncode, done.stdout, done.stderr) == (4, "", f"frhc: No node offers {path}.\n"), done
        with Terminal(folder, 80, 24) as terminal:
            terminal.run(f"TERM=dumb {' '.join(top)}")
            terminal.wait("top needs a terminal", f"{ENDED} 2")
        with Node(path) as node:
            done = subprocess.run([*top, "--once"], capture_output=True, text=True, check=True)
            assert "\x1b" not in done.stdout and done.stderr == "", done
            is_whole(done.stdout + "q quit", node)
            assert "torque budget" in done.stdout, done.stdout


TESTS = [
    top_shows_a_node_at_both_sizes_and_after_a_resize,
    top_follows_a_node_that_ends_and_comes_again,
    top_shows_a_stop_with_its_cause_and_the_way_out,
    top_leaves_the_shell_as_it_was,
    top_ends_with_its_terminal,
    top_keys_change_the_view,
    top_uses_no_colour_under_no_color,
    hostile_names_do_not_reach_the_terminal,
    top_without_a_terminal_says_so_and_once_prints,
]
