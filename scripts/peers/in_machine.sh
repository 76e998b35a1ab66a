#!/usr/bin/env bash
# in_machine.sh LAYOUT PERIOD_US CONFIG PRIORITY: the peers one after the other on the same drives, which have this priority of SCHED_FIFO, on the emulated machine (with_icount.sh).
#
# `frhc run` boots and configures the drives, and is killed. Each peer then starts them by NMT, and runs twice: once beside
# candump, which shows what it exchanges and when, and once alone, which is timed. `frhc run` itself comes last, as shipped.
#
# Prints the files of /dev/shm/out, each behind a line `== NAME`: PEER.txt of its output, PEER.log of candump, PEER.time with two moments of
# its threads. A peer that ends, or exchanges no frames, has only the first.
set -euo pipefail
layout=$1 period=$2 config=$3 priority=$4
mkdir -p /dev/shm/out /dev/shm/run /dev/shm/state
export XDG_RUNTIME_DIR=/dev/shm/run STATE_DIRECTORY=/dev/shm/state
# In memory: what is read from this machine's disk arrives in this machine's time.
cp target/dist/frhc target/peers/loop /dev/shm/
candump=$(command -v candump)
cat "$candump" "$(command -v sleep)" "$(command -v date)" >/dev/null

# frames: those on the bus so far.
frames() { cat /sys/class/net/vcan0/statistics/tx_packets; }

# moment FILE PID: the time used by each thread so far in ns, which is its instructions, and the frames on the bus so far.
moment() {
  local folder thread used rest
  echo "clock $(date +%s%N)" >>"$1"
  echo "frames $(frames)" >>"$1"
  for folder in /proc/"$2"/task/*; do
    read -r thread <"$folder/comm"
    read -r used rest <"$folder/schedstat"
    echo "$thread $used" >>"$1"
  done
}

# peer NAME COMMAND...: runs it beside candump, then alone.
peer() {
  local name=$1 pid watcher begun polls=0
  shift
  begun=$(frames)
  "$@" >/dev/shm/out/"$name".txt 2>&1 &
  pid=$!
  # An interpreter starts for seconds.
  until (($(frames) > begun + 5000 || polls++ > 300)) || ! kill -0 $pid 2>/dev/null; do sleep 0.2; done
  if (($(frames) <= begun + 5000)); then
    if kill -KILL $pid 2>/dev/null; then echo "no exchange within a minute"; else echo "ended"; fi >>/dev/shm/out/"$name".txt
    wait $pid 2>/dev/null || true
    return
  fi
  [[ $name != frhc ]] || /dev/shm/frhc ctl --wait arm >/dev/null
  "$candump" -L vcan0 >/dev/shm/out/"$name".log &
  watcher=$!
  sleep 0.6
  kill $watcher
  wait $watcher || true
  sleep 0.2
  moment /dev/shm/out/"$name".time $pid
  sleep 1
  moment /dev/shm/out/"$name".time $pid
  kill -KILL $pid 2>/dev/null || true
  wait $pid 2>/dev/null || true
  sleep 1
}

chrt --fifo "$priority" /dev/shm/frhc -q sim --config "$config" >/dev/null 2>&1 &
/dev/shm/frhc -q run --config "$config" >/dev/null 2>&1 &
node=$!
until /dev/shm/frhc ctl status 2>/dev/null | grep -q '^mode  *ready'; do sleep 0.1; done
kill -KILL $node
wait $node 2>/dev/null || true
sleep 1
if [[ -d target/interop/venv ]]; then
  # Debian's interpreter and its library, with the packages that the peer imports.
  (cd /usr/lib && tar -c --exclude test --exclude __pycache__ --exclude config-3.* python3.11) | tar -x -C /dev/shm
  packages=(target/interop/venv/lib/python3*/site-packages)
  (cd "${packages[0]}" && tar -c canopen can packaging typing_extensions.py wrapt* 2>/dev/null) | tar -x -C /dev/shm/python3.11 || true
  cp /usr/bin/python3.11 /dev/shm/python
  cp eds/frhc_drive.eds /dev/shm/
  export PYTHONHOME=/usr PYTHONPATH=/dev/shm/python3.11 PYTHONDONTWRITEBYTECODE=1
  ldd /dev/shm/python | sed -n 's|.* \(/[^ ]*\) (.*|\1|p' | xargs cat >/dev/null
  peer python-canopen chrt --fifo 80 /dev/shm/python -S scripts/peers/python_canopen.py vcan0 "$period" "$layout" /dev/shm/frhc_drive.eds 60
fi
peer plain /dev/shm/loop vcan0 "$period" "$layout" plain 60
peer guarded /dev/shm/loop vcan0 "$period" "$layout" guarded 60
peer drained /dev/shm/loop vcan0 "$period" "$layout" drained 60
if [[ -x target/peers/lely/lely ]]; then
  cp target/peers/lely/lely /dev/shm/
  # Its libraries, as above.
  ldd /dev/shm/lely | sed -n 's|.* \(/[^ ]*\) (.*|\1|p' | xargs cat >/dev/null
  peer lely chrt --fifo 80 /dev/shm/lely vcan0 "$period" "$layout" /dev/shm/lely.dcf 60
fi
# The run before was killed, and has left its latch in /dev/shm/state.
export STATE_DIRECTORY=/dev/shm/fresh
mkdir -p $STATE_DIRECTORY
peer frhc /dev/shm/frhc -q run --config "$config"
for file in /dev/shm/out/*; do
  echo "== ${file##*/}"
  cat "$file"
done
