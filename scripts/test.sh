#!/usr/bin/env bash
# test.sh: runs all tests, including those on real vcan, on a fresh machine (Debian, a Rust toolchain).
#
# usage: scripts/test.sh [--no-install]
#
# Runs the tests that need no tool first. Then installs missing tools by scripts/setup.sh, which lists them and needs root
# or sudo, and the network. With --no-install, or if that fails, it runs the tests that can run, lists the missing tools,
# and exits with 1 if there are any.
#
# Runs the tests on the in-memory bus first, while the program and the link are built, then those on real vcan in virtual
# time (scripts/with_vcan.sh -v), in parallel with the campaigns. These use the profile `dist`, as packages have it.
# Prints the duration of each part at the end.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
case $* in
  "") installs=1 ;;
  --no-install) installs='' without_install=1 ;;
  *) echo "usage: scripts/test.sh [--no-install]" >&2; exit 2 ;;
esac
export VCAN_KERNEL=${VCAN_KERNEL:-${VCAN_UML_HOME:-${XDG_CACHE_HOME:-$HOME/.cache}/vcan-uml}/linux-timetravel}

work=$(mktemp -d)
ended() {
  # After a failure the builds beside the tests may still go on.
  [[ -z ${builds:-} ]] || kill -- "-$builds" 2>/dev/null || true
  echo "test: durations" >&2
  cat "$work/times" >&2
  rm -rf "$work"
}
trap ended EXIT
: >"$work/failed"
: >"$work/times"

# timed NAME COMMAND...: runs it, and records its output, its duration and whether it failed.
timed() {
  recorded "$@" 2>&1 | tee "$work/$1.log"
}

# lane NAME COMMAND...: as `timed`, for background jobs; its output is printed at the end.
lane() { recorded "$@" >"$work/$1.out" 2>&1 || true; }

recorded() {
  local name=$1 begin=$SECONDS status=0
  shift
  echo "test: $name"
  "$@" || status=$?
  printf '%5d s  %s\n' $((SECONDS - begin)) "$name" >>"$work/times"
  ((status == 0)) || echo "$name (exit code $status)" >>"$work/failed"
  return "$status"
}

# failures: each part that failed, and which of its tests, in its words.
failures() {
  local part
  while read -r part; do
    echo "test: FAILED: $part"
    grep -ahE -A 2 '^test .* \.\.\. .*FAILED|^FAIL |panicked at ' "$work/${part% (exit code *}".* | head -n 60 || true
  done <"$work/failed"
}

# of_all ARGUMENT...: `cargo test` of the whole workspace, always with the same features: what they change is built once.
of_all() { cargo test --workspace --features png --locked "$@"; }

# tests_of NAME: the executable of a test target.
tests_of() {
  of_all --test "$1" --no-run --message-format=json 2>/dev/null |
    sed -n 's/.*"executable":"\([^"]*\/'"$1"'-[0-9a-f]*\)".*/\1/p' | tail -n 1
}

# on_vcan CPU NAME: the tests of that target, in virtual time, on one CPU of this machine.
on_vcan() {
  local tests
  tests=$(tests_of "$2")
  [[ -x $tests ]] || { echo "test: the tests $2 did not build" >&2; return 1; }
  VCAN_UML_CPU=$1 scripts/with_vcan.sh -v -t 600 -i "vcan0 vcan1" -- "$tests" --test-threads=1 --show-output
}
# The link over a network is a workspace of its own: its build costs about as much as that of the tests here.
# clippy is the compiler, since a check of its own would read all of zenoh once more.
link() {
  RUSTC_WORKSPACE_WRAPPER=clippy-driver CLIPPY_ARGS=-Dwarnings \
    cargo test --locked --manifest-path link/Cargo.toml
}
link_peers() {
  local end python=$PWD/target/interop/venv/bin/python
  for end in far near; do
    FRHC=$FRHC_PROGRAM FRHC_LINK=$PWD/link/target/debug/frhc-link VCAN_UML_CPU=$1 scripts/with_vcan.sh -v -t 600 -i vcan0 -- \
      "$python" -B tests/interop/zenoh_peers.py "--$end" "$python -B tests/interop/link_end.py $end {keys} {port}" || return
  done
}
interop() { VCAN_UML_CPU=$1 scripts/interop.sh --bus; }
interop_without_a_bus() { OMP_NUM_THREADS=1 scripts/interop.sh --no-bus; }
interop_in_time() { scripts/interop.sh --timed; }
drives() {
  VCAN_UML_CPU=$1 scripts/with_vcan.sh -v -t 600 -i vcan0 -- scripts/drives_table.py --check
}
# Without its tools the rig is left out only where nothing is to be installed.
instructions() { scripts/icount.sh ${without_install:+--optional}; }
# Where the emulated machine is there: scripts/icount.sh says what is missing.
other_processors() {
  [[ -s target/icount/vmlinuz ]] || return 0
  local scripts=$PWD/scripts
  # Its /tmp is its own, and a checkout may be there.
  mkdir "$work/a folder" && (cd "$work/a folder" && "$scripts/with_icount.sh" -t 300 -- test -d "../a folder") &&
    target/dist/frhc -q demo --scenario contact_10s --seconds 10 --record "$work/session" >/dev/null 2>&1 &&
    scripts/replay_on_cpus.sh "$work/session" Nehalem Haswell
}
# A session in wall-clock time under load, and one in virtual time.
replayed() {
  local virtual
  for virtual in "" -v; do
    # shellcheck disable=SC2086
    VCAN_UML_CPU=$1 scripts/with_vcan.sh $virtual -t 600 -i vcan0 -- scripts/replay_under_load.sh 16 || return
  done
}
campaign() {
  target/dist/frhc -q campaign --seed 1 --faults 2000 --threads 1 &&
    target/dist/frhc -q campaign --seed 2 --faults 300 --threads 1 --verify-replay
}
soak() { scripts/soak.sh 1000000 1 --threads 1; }
# What needs the program and one processor each.
one_processor() {
  lane "campaign of two thousand faults" campaign
  lane "a million cycles without a false stop" soak
  lane "instructions of a cycle" instructions
  lane "a session on other processors" other_processors
}

joined() { paste -sd , | sed 's/,/, /g'; }
# announce: says what will be installed and built, and about how long all takes.
announce() {
  # In minutes of processor time, measured on two processors from a bare machine.
  local tests=47 total=47 installed="" builds=()
  add() { [[ -e $1 ]] || { builds+=("$2 ($3 min)"); total=$((total + $3)); }; }
  add target/dist/frhc "the program" 7
  add target/debug/deps "the tests" 9
  add target/debug/frhc-lab "the lab" 4
  add link/target/debug "the link over a network" 13
  if [[ -n $installs ]]; then
    add "$VCAN_KERNEL" "a kernel for the tests on vcan" 8
    installed=$(scripts/setup.sh --missing tools browser icount | joined) || true
  fi
  echo "test: installs ${installed:-nothing}; builds $(printf '%s\n' "${builds[@]:-what has changed}" | joined);" \
    "tests ($tests min): $total minutes of processor time, about $((total / ($(nproc) > 1 ? 2 : 1))) minutes here" >&2
}

missing=
announce
timed "build the tests" of_all --no-run
# One processor links the program while the other tests.
builds() {
  lane "build the program" cargo build --locked --profile dist --features png
  lane "experiments in short" lab/test.sh --smoke
  lane "link over a network" link
}
set -m # a group of its own, which ends as a whole
builds &
builds=$!
set +m
timed "unit tests and tests on the in-memory bus" of_all --no-fail-fast || true
wait "$builds"
builds=
if grep -q "build the program" "$work/failed"; then
  cat "$work/build the program.out" >&2
  exit 1
fi
# Without the tools only the tests on real vcan are left out.
[[ -z $installs ]] || timed "install tools" scripts/setup.sh tools browser || true
timed "demo" scripts/test_demo.sh
[[ -z $installs ]] || timed "install the kernel of the tests on vcan, and what counts instructions" scripts/setup.sh kernel icount || true
missing=$(scripts/setup.sh --missing | paste -sd ' ') || true

export FRHC_PROGRAM=$PWD/target/dist/frhc
last=$(($(nproc) - 1))
if [[ -z $missing ]]; then
  timed "build the tests on vcan" of_all --no-run --test vcan --test vcan_faults --test network
  { lane "two processes on real vcan" on_vcan 0 vcan; lane "third-party programs on real vcan" interop 0
    lane "drives by their data sheets on real vcan" drives 0
    lane "sessions under load, replayed" replayed 0; } &
  first=$!
  # Two lanes of about the same length.
  { lane "faults on real vcan" on_vcan "$last" vcan_faults
    lane "third-party programs without a bus" interop_without_a_bus; one_processor; } &
  second=$!
  wait "$first"
fi
if [[ -z $missing ]]; then
  { lane "five processes on real vcan" on_vcan 0 network; lane "Python peers of the link" link_peers 0; } &
  third=$!
fi
[[ -z $missing ]] || one_processor
wait ${second:-} ${third:-}
# Alone: their result is a time.
[[ -n $missing ]] || lane "third-party programs and time" interop_in_time
for output in "$work"/*.out; do
  echo "--- $(basename "$output" .out)"
  cat "$output"
done

status=0
if [[ -s $work/failed ]]; then
  failures >&2
  status=1
fi
if [[ -n $missing ]]; then
  echo "test: tests on real vcan not run; missing: $missing (scripts/setup.sh installs it)" >&2
  status=1
fi
exit "$status"
