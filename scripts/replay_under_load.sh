#!/usr/bin/env bash
# replay_under_load.sh [SECONDS [CONFIG]]: records a session of `frhc run` against `frhc sim`, with three injected faults,
# resets and new armings between them, and replays it: no byte may differ. On vcan0, so run by with_vcan.sh:
#
#   scripts/with_vcan.sh -- scripts/replay_under_load.sh 60       wall-clock time, under CPU load
#   scripts/with_vcan.sh -v -- scripts/replay_under_load.sh 60    virtual time, where nothing is late
#
# In wall-clock time two busy loops take the only processor from node and drives, for half a millisecond and for some hundred.
# Cycles are late, and the node stops for that, too: only the replay is judged. In virtual time each fault must have left its fault record. The program is $FRHC_PROGRAM, or that of the release build.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
seconds=${1:-60} config=${2:-config/kraft_like.toml}
frhc=${FRHC_PROGRAM:-$PWD/target/dist/frhc}
work=$(mktemp -d)
export XDG_RUNTIME_DIR=$work STATE_DIRECTORY=$work/state
mkdir -p "$STATE_DIRECTORY"
busy=()
ended() {
  kill -KILL ${busy[@]+"${busy[@]}"} "${drives:-}" 2>/dev/null || true
  wait 2>/dev/null || true
  rm -rf "$work"
}
trap ended EXIT

# Every five seconds the operator engages anew, presses into the wall and comes back; faults at a quarter, half and three quarters.
{
  echo "seconds = $((seconds + 60)).0"
  for ((at = 2; at < seconds; at += 5)); do
    for press in 0:deadman 2:reflection 4:reference; do
      printf '[[switch]]\nat_s = %s\n%s = %s\n' "$at.${press%:*}" "${press#*:}" true
      [[ $press == *:deadman ]] || printf '[[switch]]\nat_s = %s\n%s = false\n' "$at.$((${press%:*} + 1))" "${press#*:}"
    done
    printf '[[switch]]\nat_s = %s.0\ndeadman = false\n' $((at + 4))
    printf '[[move]]\nat_s = %s\nduration_s = 0.5\nto_m = [%s, 0.0, 0.0]\n' "$at.6" 0.045 $((at + 3)).0 0.0
  done
  printf '[[fault]]\nat_s = %s.0\n%s\n' \
    $((seconds / 4)) $'kind = "drop"\njoint = 3\nframe = "tpdo1"\nfor_s = 0.1' \
    $((seconds / 2)) $'kind = "fault"\njoint = 2\ncode = 0x3210' \
    $((seconds * 3 / 4)) $'kind = "reset"\njoint = 5'
} >"$work/scenario.toml"

mode() { "$frhc" ctl status 2>/dev/null | sed -n 's/^mode *//p'; }

# On a busy machine a first boot may be too late, which ends `run`: its session is replayed, and another one begins.
for attempt in $(seq 40); do
  chrt --fifo 70 "$frhc" -q sim --config "$config" --scenario "$work/scenario.toml" >/dev/null 2>&1 &
  drives=$!
  "$frhc" -q run --config "$config" --record "$work/sessions" >"$work/summary" 2>"$work/log" &
  node=$!
  # Ready, or waiting for a reset since the boot before has failed.
  until [[ $(mode) =~ ready|drives-off ]] || ! kill -0 $node 2>/dev/null; do sleep 0.1; done
  if kill -0 $node 2>/dev/null; then break; fi
  kill -KILL $drives && wait 2>/dev/null || true
done
if [[ ${WITH_VCAN:-} != virtual-uml ]]; then
  # Pauses without a process of their own: each start of one stalls this kernel for milliseconds.
  mkfifo "$work/never" && exec 9<>"$work/never"
  for load in "0.02 300" "7 200000"; do # pause in s, steps of work: half a millisecond, and some hundred
    read -r pause steps <<<"$load"
    (while ! read -rt "$pause" -u 9; do for ((i = 0; i < steps; i++)); do :; done; done) &
    busy+=($!)
  done
fi
# Leaves each stop by a reset, and arms anew.
end=$((SECONDS + seconds))
while ((SECONDS < end)); do
  case $(mode) in
    ready) "$frhc" ctl arm >/dev/null 2>&1 || true ;;
    zero-torque | drives-off | reflection-off) { "$frhc" ctl reset && "$frhc" ctl arm; } >/dev/null 2>&1 || true ;;
  esac
  sleep 3
done
kill -INT $node 2>/dev/null || true
status=0
wait $node || status=$?

sessions=("$work"/sessions/*)
session=${sessions[-1]}
[[ -f $session/inputs.bin ]] || { echo "replay_under_load: no session; run ended with $status:" >&2; cat "$work/log" >&2; exit 1; }
records=$(find "$session/faults" -name fault.json 2>/dev/null | wc -l)
echo "recorded  $(du -sh --apparent-size "$session" | cut -f 1) in $seconds s at boot $attempt, $records fault records; run ended with $status"
sed -n 's/^  "\(overruns\|missing_samples\|cycles\)": \([0-9]*\),$/\1 \2/p' "$session/summary.json" | paste -sd ',' | sed 's/^/          /'
ls "$session/faults" 2>/dev/null | sed 's/^[0-9]*-[0-9]*-//' | sort | uniq -c | sed 's/^/          /' || true
# Beside other programs the recorder may lose inputs, which it counts: the replay is then judged as far as it goes.
verify=()
[[ ${WITH_VCAN:-} != virtual-uml ]] || verify=(--verify)
for session in "${sessions[@]}"; do "$frhc" replay "$session" ${verify[@]+"${verify[@]}"}; done
if [[ ${WITH_VCAN:-} == virtual-uml ]]; then
  for cause in samples-missing emergency rebooted; do
    ls "$session/faults" | grep -q "$cause" || { echo "replay_under_load: no fault record of $cause" >&2; exit 1; }
  done
fi
