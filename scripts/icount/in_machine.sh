#!/usr/bin/env bash
# in_machine.sh CASE PRIORITY CONFIG [ARG...]: what the threads of `frhc run` with these arguments cost in two seconds of contact; on the
# emulated machine (with_icount.sh).
#
# The simulated drives have this priority of SCHED_FIFO. Below the node's 80 each of their frames ends a wait of the node, as on a
# wire; at 80 the frames of a cycle lie in its socket before it runs.
#
# In the case `watched` 20 readers look at its telemetry, of which 5 are stopped.
#
# Prints for each of nine moments the time used by each thread so far, the wall clock at which it was read, and how often the thread has
# run: CASE MOMENT THREAD NS CLOCK_US RUNS. One nanosecond is one instruction.
set -euo pipefail
# In memory: a page that is read from this machine's disk arrives in this machine's time.
work=$(mktemp -d) # no name that a checkout below /tmp may have
cp target/dist/frhc "$work/frhc"
frhc=$work/frhc
ldd "$frhc" "$(command -v sleep)" "$(command -v sed)" "$BASH" | sed -n 's|.* \(/[^ ]*\) (.*|\1|p' | xargs cat >/dev/null
cat "$(command -v sleep)" "$(command -v sed)" >/dev/null

# moment CASE MOMENT PID
moment() {
  local folder thread used rest before after
  for folder in /proc/"$3"/task/*; do
    read -r thread <"$folder/comm"
    while # another program may run between the two: then again
      before=${EPOCHREALTIME/./}
      read -r used rest <"$folder/schedstat" # ns on a processor, ns waiting for one, number of runs
      after=${EPOCHREALTIME/./}
      ((after - before > 200))
    do :; done
    echo "$1 $2 $thread $used $after ${rest##* }"
  done
}

export XDG_RUNTIME_DIR=$work/run STATE_DIRECTORY=$work/state
mkdir -p "$XDG_RUNTIME_DIR" "$STATE_DIRECTORY"
name=$1 priority=$2 config=$3
shift 3
chrt --fifo "$priority" "$frhc" -q sim --config "$config" --scenario contact_10s &
"$frhc" -q run --config "$config" "$@" >/dev/null &
node=$!
if [[ $name == watched ]]; then
  scripts/icount/readers.py 15 "$XDG_RUNTIME_DIR/frhc-view/telemetry.sock" &
  scripts/icount/readers.py 5 "$XDG_RUNTIME_DIR/frhc-view/telemetry.sock" &
  stopped=$!
fi
until "$frhc" ctl --wait arm >/dev/null 2>&1; do sleep 0.1; done
sleep 4 # the object is pressed against the wall
[[ $name != watched ]] || { kill -STOP $stopped && sleep 2; }
moment "$name" 0 $node
for number in {1..8}; do
  sleep 0.25
  moment "$name" "$number" $node
done
"$frhc" ctl status | sed -n "s/^\(mode\|overruns\|missing_samples\) */$name 8 \1 /p"
