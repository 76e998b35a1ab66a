#!/usr/bin/env python3
"""mutants.py: mutation test: applies faults to the sources and reports which the tests detect.

A seeded sample of small changes ("mutants") of src/node, src/controller, src/bench/calibration/fit,
src/canopen/exchange and src/canopen/sdo. Each is a copy of its function behind a switch that is read once at the start of the program
(FRHC_MUTANT=17), so that one build serves all of them. Copies that do not compile are removed, and the build is
repeated: these mutants are not viable. Then the unit tests and the tests on the in-memory bus run once for each
mutant, up to the first failure or the time limit.

usage: lab/mutants.sh [--count N] [--seed N] [--only TEXT] [--edits FILE] [--list] [--limit SECONDS]
                          [--build] [--replay]

With --replay no test runs. A session is recorded without mutant, and `frhc replay` computes it with each of
lab/mutants_of_the_law.json (or of --edits): it must name the first cycle and intermediate that differ, or find that the
session does not exercise the mutant.
"""

import argparse
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "scripts"))
from rust_source import blanked, functions, test_files, tests

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "target" / "mutants"
TREE = WORK / "tree"
TARGET = WORK / "target"
WHERE = ["src/node", "src/controller", "src/bench/calibration/fit", "src/canopen/exchange", "src/canopen/sdo"]
LAW = "lab/mutants_of_the_law.json"
# Test targets that start no process and need no CAN interface.
IN_MEMORY = ["memory", "no_alloc"]
SWITCH = '''//! The switch of mutants: which of them is on, if any.
#![allow(unsafe_code, static_mut_refs, missing_docs, reason = "only in the copy that mutants live in")]

static mut MUTANT: u32 = 0;

pub const fn on(number: u32) -> bool {
    unsafe { MUTANT == number }
}

#[used]
#[unsafe(link_section = ".init_array")]
static READ: extern "C" fn() = read;

extern "C" fn read() {
    let number = std::env::var("FRHC_MUTANT").ok().and_then(|text| text.parse().ok());
    unsafe { MUTANT = number.unwrap_or(0) };
}
'''


# --- possible mutations ---------------------------------------------------------------------------------------

SWAPS = [(" < ", " <= "), (" <= ", " < "), (" > ", " >= "), (" >= ", " > "), (" == ", " != "), (" != ", " == "),
         (" + ", " - "), (" - ", " + "), (" * ", " / "), (" / ", " * "), (" % ", " * "), (" += ", " -= "),
         (" -= ", " += "), (" && ", " || "), (" || ", " && "), (" & ", " | "), (" << ", " >> "), (" >> ", " << "),
         (".min(", ".max("), (".max(", ".min("), (".any(", ".all("), (".all(", ".any("),
         (".is_some()", ".is_none()"), (".is_none()", ".is_some()"), (".is_empty()", ".is_empty().eq(&false)"),
         (".saturating_add(", ".saturating_sub("), (".saturating_sub(", ".saturating_add("),
         (".wrapping_sub(", ".saturating_sub("), (".wrapping_add(", ".wrapping_sub("), (".is_some_and(", ".is_none_or("),
         (".is_none_or(", ".is_some_and("), (".abs()", ""), (".signum()", ".abs()"), (".take()", ".clone()"),
         ("true", "false"), ("false", "true"), ("..=", "..")]
NUMBER = re.compile(r"(?<![\w.])(\d[\d_]*\.\d[\d_]*(?:e-?\d+)?|\d[\d_]*)((?:_?[iuf](?:8|16|32|64|size))?)(?![\w.]|\.\d)")


def numbers(text, suffix):
    """Returns replacements of a number."""
    value = float(text.replace("_", ""))
    if "." in text or suffix.startswith(("f", "_f")):
        return ["1.0" + suffix] if value == 0 else ["0.0" + suffix, "-" + text + suffix]
    whole = int(value)
    return [str(whole + 1) + suffix] + ([str(whole - 1) + suffix] if whole > 0 else [])


def sites(code, body):
    """Returns (start, end, replacement) of every mutation of one body."""
    start, end, signature = body
    found = []
    for old, new in SWAPS:
        at = code.find(old, start, end)
        while at >= 0:
            word = old.isalpha() and (code[at - 1].isalnum() or code[at - 1] == "_" or code[at + len(old)].isalnum())
            if not word:
                found.append((at, at + len(old), new))
            at = code.find(old, at + 1, end)
    for match in NUMBER.finditer(code, start, end):
        found += [(match.start(), match.end(), new) for new in numbers(match[1], match[2])]
    for match in re.compile(r"!(?=[a-z(])").finditer(code, start, end):
        if not code[match.start() - 1].isalnum():
            found.append((match.start(), match.end(), ""))
    for match in re.compile(r"\bif (?!let\b)([^{};]*?) \{").finditer(code, start, end):
        if " let " not in match[1]:
            found.append((match.start(1), match.end(1), "!(%s)" % code[match.start(1):match.end(1)]))
    # A statement executed for its side effect: a call or an assignment.
    statement = re.compile(r"(?m)^ +(?!let\b|return\b|use\b|break\b|continue\b|const\b)[\w*&(][^;{}]*;$")
    for match in statement.finditer(code, start, end):
        found.append((match.start(), match.end(), ""))
    inner = code[start + 1:end].strip()
    if inner:
        returned = re.search(r"-> (.*?)\s*(?:where\b.*)?$", signature, re.S)
        kind = returned[1].strip() if returned else "()"
        whole = {"()": ["()"], "bool": ["true", "false"], "f64": ["0.0", "1.0"]}.get(kind, [])
        whole = ["None"] if kind.startswith("Option<") else whole
        whole = ["0", "1"] if re.fullmatch(r"[ui](8|16|32|64|size)", kind) else whole
        found += [(start + 1, end, " %s " % value) for value in whole if inner != value]
    return found


class Mutant:
    """One mutation of one file."""

    def __init__(self, number, path, body, change, text):
        self.number, self.path, self.body, self.change = number, path, body, change
        start, end, new = change
        self.line = text.count("\n", 0, start) + 1
        old = " ".join(text[start:end].split())
        if len(old) > 60:
            old = old[:57] + "..."
        self.what = "`%s` -> `%s`" % (old, " ".join(new.split()) or "nothing")
        self.result, self.by, self.name = None, "", ""

    def __str__(self):
        return "%s:%d: %s" % (self.path, self.line, self.what)


def every_site(paths):
    """Returns (path, body, change) of all possible mutations."""
    all_files = sorted(file for where in paths for file in (ROOT / where).rglob("*.rs"))
    all_files += [(ROOT / where).with_suffix(".rs") for where in paths if (ROOT / where).with_suffix(".rs").exists()]
    excluded = set()
    for file in all_files:
        excluded |= test_files(file)
    found = []
    for file in all_files:
        if file in excluded:
            continue
        text = file.read_text()
        code = blanked(text)
        spans, _ = tests(code)
        bodies = functions(code, spans)
        for body in bodies:
            # A function inside a function is copied with the outer one.
            outer = min(other for other in bodies if other[0] <= body[0] and body[1] <= other[1])
            if "-> impl" in body[2] or "macro_rules" in body[2]:
                continue
            inner = [other for other in bodies if body[0] < other[0] and other[1] < body[1]]
            for change in sites(code, body):
                if not any(low <= change[0] <= high for low, high, _ in inner):
                    found.append((file.relative_to(ROOT), outer, change))
    return found


def drawn(args):
    """Returns a random sample of the mutations, by the seed."""
    found = every_site(WHERE)
    found = [one for one in found if not args.only or args.only in str(one[0])]
    print("%d changes of %s" % (len(found), ", ".join(WHERE)), flush=True)
    sample = random.Random(args.seed).sample(found, min(args.count, len(found)))
    sample.sort(key=lambda one: (str(one[0]), one[2][0]))
    return [Mutant(number, path, body, change, (ROOT / path).read_text())
            for number, (path, body, change) in enumerate(sample, 1)]


def by_hand(file):
    """Returns the mutations listed in a file: [[name, path, old text, new text], ...], the name optional; the old text must
    occur once."""
    mutants = []
    for number, (*name, path, old, new) in enumerate(json.loads(Path(file).read_text()), 1):
        text = (ROOT / path).read_text()
        if text.count(old) != 1:
            sys.exit("%s: %r must occur once in %s, occurs %d times" % (file, old, path, text.count(old)))
        at = text.index(old)
        code = blanked(text)
        bodies = [body for body in functions(code, []) if body[0] < at < body[1]]
        if not bodies:
            sys.exit("%s: %r is in no function" % (file, old))
        mutants.append(Mutant(number, Path(path), min(bodies), (at, at + len(old), new), text))
        mutants[-1].name = name[0] if name else mutants[-1].what
    return mutants


# --- build of all mutants ----------------------------------------------------------------------------------------

def copied():
    """Copies the sources, adds the switch and removes the lints."""
    if TREE.exists():
        shutil.rmtree(TREE)
    listed = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in listed.splitlines():
        if (ROOT / name).is_file():
            (TREE / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, TREE / name)
    # Every room depends on `units`.
    (TREE / "src/units/mutants.rs").write_text(SWITCH)
    lib = (TREE / "src/units/lib.rs").read_text().replace("#![forbid(unsafe_code)]\n", "")
    (TREE / "src/units/lib.rs").write_text(lib + "\n#[doc(hidden)]\npub mod mutants;\n")
    for manifest in [TREE / "Cargo.toml", *TREE.glob("src/**/Cargo.toml")]:
        cargo = manifest.read_text().replace("[lints]\nworkspace = true\n", "")
        cargo = re.sub(r"(?ms)^\[workspace\.lints\.[^\]]*\]\n.*?(?=^\[(?!workspace\.lints)|\Z)", "", cargo)
        manifest.write_text(cargo)
    if not TARGET.exists() and (ROOT / "target/debug/deps").exists():
        TARGET.mkdir(parents=True)
        for part in ["deps", "build", ".fingerprint"]:
            subprocess.run(["cp", "-a", str(ROOT / "target/debug" / part), str(WORK / part)], check=True)
        (TARGET / "debug").mkdir()
        for part in ["deps", "build", ".fingerprint"]:
            shutil.move(WORK / part, TARGET / "debug" / part)


def written(mutants):
    """Writes the mutated files; returns the lines of each copy: path -> [(first line, last line, mutant)]."""
    places = {}
    for path in sorted({mutant.path for mutant in mutants}):
        text = (ROOT / path).read_text()
        mine = [mutant for mutant in mutants if mutant.path == path]
        bodies = sorted({mutant.body for mutant in mine}, reverse=True)
        marks = []
        for start, end, _ in bodies:
            arms = []
            for mutant in mine:
                if mutant.body[0] != start:
                    continue
                low, high, new = mutant.change
                arms.append((mutant, text[start:low] + new + text[high:end + 1]))
            body = text[start:end + 1]
            new = "{\n"
            for mutant, arm in arms:
                new += "if ::units::mutants::on(%d) /*from %d*/ %s else " % (mutant.number, mutant.number, arm)
                new += "/*to %d*/" % mutant.number
            marks.append((start, end, new + body + "\n}"))
        for start, end, new in marks:
            text = text[:start] + new + text[end + 1:]
        (TREE / path).write_text(text)
        for mutant in mine:
            low, high = text.find("/*from %d*/" % mutant.number), text.find("/*to %d*/" % mutant.number)
            if low >= 0 and high >= 0:
                first, last = text.count("\n", 0, low) + 1, text.count("\n", 0, high) + 1
                places.setdefault(str(path), []).append((first, last, mutant))
    return places


def cargo(arguments):
    """Runs cargo in the copy; returns the errors and the executables."""
    # opt-level 1: the build takes half as long again, but each test run a fraction.
    # A mutant may violate a deny-by-default lint, such as overflow in a constant.
    environment = dict(os.environ, CARGO_TARGET_DIR=str(TARGET), RUSTFLAGS="--cap-lints=allow", CARGO_PROFILE_DEV_OPT_LEVEL="1",
                       CARGO_PROFILE_DEV_DEBUG="0")
    command = ["cargo"] + arguments + ["--message-format=json", "--locked"]
    done = subprocess.run(command, cwd=TREE, env=environment, capture_output=True, text=True)
    errors, executables = [], {}
    for line in done.stdout.splitlines():
        try:
            message = json.loads(line)
        except ValueError:
            continue
        if message.get("reason") == "compiler-message" and message["message"]["level"] == "error":
            errors.append(message["message"])
        if message.get("reason") == "compiler-artifact" and message.get("executable"):
            executables[message["target"]["name"], message["profile"]["test"]] = message["executable"]
    return done, errors, executables


def spans_of(message):
    """Returns every place that an error names, including its notes."""
    for span in message["spans"]:
        while span:
            yield span["file_name"], span["line_start"]
            span = (span.get("expansion") or {}).get("span")
    for child in message["children"]:
        yield from spans_of(child)


def built(mutants, arguments):
    """Builds all viable mutants and removes the others; returns the executables."""
    alive = list(mutants)
    for _ in range(12):
        for path in {mutant.path for mutant in mutants}:
            shutil.copy2(ROOT / path, TREE / path)
            os.utime(TREE / path)
        places = written(alive)
        done, errors, _ = cargo(["check", "--workspace", "--lib"])
        if done.returncode == 0:
            break
        broken = set()
        for error in errors:
            for name, line in spans_of(error):
                inside = [(last - first, mutant) for first, last, mutant in places.get(name, [])
                          if first <= line <= last]
                broken |= {mutant for _, mutant in inside}
        if not broken:
            sys.exit("does not compile, and not because of a mutant:\n" + done.stderr[-4000:] +
                     "\n".join(error["rendered"] for error in errors[:3]))
        for mutant in broken:
            mutant.result = "not viable"
        alive = [mutant for mutant in alive if mutant not in broken]
    done, errors, executables = cargo(arguments)
    if done.returncode != 0:
        sys.exit(done.stderr[-4000:] + "\n".join(error["rendered"] for error in errors[:3]))
    return executables


# --- the tests ------------------------------------------------------------------------------------------------

def ran(command, number, limit, folder="."):
    """Runs tests up to the first failure or the limit in s; returns (is_failed, reason)."""
    environment = dict(os.environ, FRHC_MUTANT=str(number), CARGO_MANIFEST_DIR=str(TREE), RUST_BACKTRACE="0",
                       PROPTEST_FAILURE_PERSISTENCE="off")
    process = subprocess.Popen(command, cwd=TREE / folder, env=environment, stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL, text=True, start_new_session=True)
    is_over = threading.Event()

    def end():
        is_over.set()
        os.killpg(process.pid, signal.SIGKILL)

    timer = threading.Timer(limit, end)
    timer.start()
    failed, found = None, None
    try:
        for line in process.stdout:
            if found := re.match(r"test (.*?)(?: - should panic)? \.\.\. FAILED", line):
                failed = found[1]
                break
    finally:
        timer.cancel()
        if process.poll() is None:
            try:
                os.killpg(process.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        process.stdout.close()
        process.wait()
    if failed:
        return True, failed
    if is_over.is_set():
        return True, "time limit of %d s" % limit
    return process.returncode != 0, "exit code %d" % process.returncode


def judged(mutant, steps):
    """Runs the steps until one fails."""
    for name, command, limit, folder in steps:
        is_killed, why = ran(command, mutant.number, limit, folder)
        if is_killed:
            mutant.result, mutant.by = "killed", "%s: %s" % (name, why)
            return
    mutant.result = "survived"


def replayed(mutants, program):
    """Replays one session with each mutant, and prints a table. Returns how many are neither named nor not exercised."""
    def run(number, *arguments):
        environment = dict(os.environ, FRHC_MUTANT=str(number))
        return subprocess.run([program, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True)

    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        session = folder + "/session"
        recorded = run(0, "-q", "demo", "--out", session)
        original = run(0, "replay", session, "--verify")
        if recorded.returncode != 0 or original.returncode != 0:
            sys.exit("without any mutant: %s%s%s" % (recorded.stderr, original.stdout, original.stderr))
        print(original.stdout)
        print("| mutant | function in | first intermediate that differs | other frames |\n|---|---|---|---|")
        for mutant in mutants:
            if mutant.result:
                print("| %s | `%s` | %s | |" % (mutant.name, mutant.path, mutant.result))
                failed += 1
                continue
            found = json.loads(run(mutant.number, "replay", session, "--json").stdout)
            law, frame = found["intermediate"], re.search(r"in cycle (\d+)", found["end"])
            is_before = "before the first cycle" in found["end"]  # a boot computes no law
            is_named = is_before or law is not None and (found["is_equal"] or frame and law["cycle"] <= int(frame[1]))
            is_unused = law is None and found["is_equal"] and found["is_complete"]
            failed += not (is_named or is_unused)
            first = "`%s`, cycle %d" % (law["name"], law["cycle"]) if law else "none: in the boot" if is_before else "none: not exercised"
            print("| %s | `%s` | %s | %s |" % (mutant.name, mutant.path, first, "none" if found["is_equal"] else found["end"]))
    return failed


def own(mutant):
    """Returns the room of the mutant and its module path there, whose own tests run first."""
    room, *parts = mutant.path.with_suffix("").relative_to("src/bench" if "src/bench" in map(str, mutant.path.parents) else "src").parts
    return room, "::".join(parts[:-1] if parts[-1] in ("mod", "lib") else parts)


def main():
    parser = argparse.ArgumentParser(prog="lab/mutants.sh", description=__doc__.split("\n\n")[0])
    parser.add_argument("--count", type=int, default=120, help="number of mutants (120)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the sample (1)")
    parser.add_argument("--only", default="", help="only files whose path contains this")
    parser.add_argument("--edits", help="file of mutations instead of a sample, JSON: [[path, old, new], ...]")
    parser.add_argument("--list", action="store_true", help="print the sample without building or running")
    parser.add_argument("--build", action="store_true", help="build the program with all mutants without running")
    parser.add_argument("--limit", type=float, default=0, help="time limit of a test run in s (3 times that without mutant)")
    parser.add_argument("--replay", action="store_true", help="replay a session with each mutant instead of the tests")
    args = parser.parse_args()
    edits = args.edits or (LAW if args.replay else None)
    mutants = by_hand(ROOT / edits) if edits else drawn(args)
    if args.list:
        print("\n".join("%4d %s" % (mutant.number, mutant) for mutant in mutants))
        return 0
    begun = time.monotonic()
    copied()
    if args.build:
        executables = built(mutants, ["build"])
        print("\n".join("%4d %s%s" % (m.number, m, " (not viable)" if m.result else "") for m in mutants))
        print("FRHC_MUTANT=N %s" % executables["frhc", False])
        return 0
    if args.replay:
        failed = replayed(mutants, built(mutants, ["build"])["frhc", False])
        print("%d of %d mutants named, or not exercised, in %.0f s" % (len(mutants) - failed, len(mutants), time.monotonic() - begun))
        return 1 if failed else 0
    targets = IN_MEMORY
    rooms = {manifest.parent.name: str(manifest.parent.relative_to(ROOT)) for manifest in sorted(ROOT.glob("src/**/Cargo.toml"))}
    executables = built(mutants, ["test", "--no-run", "--workspace", "--lib"] + [word for name in targets for word in ("--test", name)])
    print("built in %.0f s" % (time.monotonic() - begun), flush=True)
    steps = []
    for name in [*sorted(rooms), *targets]:
        command, folder = [executables[name, True]], rooms.get(name, ".")
        start = time.monotonic()
        is_failed, why = ran(command, 0, 3600, folder)
        if is_failed:
            sys.exit("without any mutant: %s: %s" % (name, why))
        seconds = time.monotonic() - start
        steps.append((name, command, args.limit or max(20.0, 3 * seconds), folder))
    print("without any mutant: %s" % ", ".join("%s %.0f s" % (name, limit / 3) for name, _, limit, _ in steps), flush=True)
    # In random order, so that an interrupted run is a fair sample, too.
    for mutant in random.Random(args.seed).sample(mutants, len(mutants)):
        if not mutant.result:
            room, module = own(mutant)
            first = (module, [executables[room, True], module], 60.0, rooms[room])
            judged(mutant, [first] + steps)
        print("%4d %s: %s%s" % (mutant.number, mutant.result, mutant, " by " + mutant.by if mutant.by else ""), flush=True)
    viable = [mutant for mutant in mutants if mutant.result != "not viable"]
    killed = [mutant for mutant in viable if mutant.result == "killed"]
    share = 100.0 * len(killed) / max(1, len(viable))
    print("%d of %d viable mutants killed (%.0f %%), %d not viable, in %.0f s" %
          (len(killed), len(viable), share, len(mutants) - len(viable), time.monotonic() - begun))
    return 0


if __name__ == "__main__":
    sys.exit(main())
