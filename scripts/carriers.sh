#!/usr/bin/env bash
# carriers.sh [--quick | PART...]: measures the carriers of the link, and prints the tables of docs/carriers.md.
#
# Each row is two processes over loopback in a User-Mode Linux kernel in virtual time (with_vcan.sh -v), with netem as
# the network: it delays, shuffles and drops each packet once on its way. --quick measures a row per carrier;
# a PART is one of figure, start, fast, slow, wide, rule.
#
#   CARRIERS_SECONDS   length of a measurement (default 2)
#   CARRIERS_WINDOW    maximum number of messages that are not echoed (default 32)
#   CARRIERS_JOBS      kernels at a time (default: one per CPU); virtual time does not see the difference
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
seconds=${CARRIERS_SECONDS:-2} window=${CARRIERS_WINDOW:-32}
carriers=(quic-mixed quic-datagram tls udp)
program=link/target/release/carriers

# row DELAY JITTER LOSS CARRIER RATE [OPTION...]: delay and jitter one way in ms, loss in per cent.
row() {
  local delay=$1 jitter=$2 loss=$3 carrier=$4 rate=$5 limit=100 network
  shift 5
  case $delay in 0 | 0.2 | 2 | 5 | 8) limit=20 ;; *) ;; esac
  network="delay ${delay}ms"
  [[ $jitter == 0 ]] || network+=" ${jitter}ms"
  [[ $loss == 0 ]] || network+=" loss ${loss}%"
  # shellcheck disable=SC2086 # words
  tc qdisc replace dev lo root netem $network limit 100000
  timeout 100 "$program" carrier="$carrier" rate="$rate" seconds="$seconds" window="$window" limit="$limit" \
    redeclare=true label="${column:-}$delay | $jitter | $loss | " "$@" \
    || echo "| ${column:-}$delay | $jitter | $loss | $carrier | $rate | failed | – | – | – | – | – | – |"
  tc qdisc del dev lo root
}

head() { # head TITLE [COLUMN]: of a table, with a first column of its own
  printf '\n### %s\n\n' "$1"
  echo "|${2:+ $2 |} delay ms | jitter ms | loss % | carrier | Hz | first ms | sent Hz | received % | age ms | round trip ms | put ms | trips |"
  echo "|${2:+---|}---|---|---|---|---|---|---|---|---|---|---|---|"
}

figure() { # rows in which no trip is allowed; at 40 ms 83 messages are under way
  local delay carrier window=128
  head "Rows without a trip"
  for delay in 0 2 5 8 20 40; do
    for carrier in "${carriers[@]}"; do row "$delay" 0 0 "$carrier" 1000; done
  done
  for carrier in "${carriers[@]}"; do seconds=20 row 2 0.2 1 "$carrier" 1000; done
}

grid() { # grid RATE TITLE DELAY...
  local rate=$1 delay loss carrier tenth
  head "$2"
  for delay in "${@:3}"; do
    for loss in 0 0.1 1 5; do
      for carrier in "${carriers[@]}"; do row "$delay" 0 "$loss" "$carrier" "$rate"; done
    done
    tenth=$(awk -v delay="$delay" 'BEGIN { print delay / 10 }')
    for carrier in "${carriers[@]}"; do row "$delay" "$tenth" 0 "$carrier" "$rate"; done
  done
}

fast() { grid 1000 "Grid at 1000 Hz" 0.2 2 8 20 40; }
slow() { grid 500 "Grid at 500 Hz" 0.2 2 8 20 40; }
wide() { local window=128; grid 1000 "Long ways with N of 128" 20 40; }

rule() { # the flow rule with other numbers of messages, beside those of the grid; 0 is without the rule
  local carrier window column
  head "Flow rule" N
  for carrier in "${carriers[@]}"; do
    for window in 0 16 32 64; do
      column="$window | "
      [[ $window == 32 ]] || row 8 0 5 "$carrier" 1000
      [[ $window == 32 ]] || row 40 0 5 "$carrier" 1000
      [[ $window == 16 ]] || row 40 4 1 "$carrier" 1000
    done
  done
}

start() { # starts with a jitter that lets packets overtake each other
  local seconds=1 carrier try column timeout
  head "Starts" "timeout ms"
  for carrier in "${carriers[@]}"; do
    for timeout in 0 1000; do
      column="$timeout | "
      for try in {1..5}; do
        row 8 0.8 1 "$carrier" 500 open_timeout="$timeout"
      done
    done
  done
}

quick() {
  head "One row of each carrier"
  for carrier in "${carriers[@]}"; do row 2 0.2 1 "$carrier" 1000; done
}

parts=(figure start fast slow wide rule)
case ${1:-} in
  --inside) # a folder of its own: processes of two kernels have equal numbers
    TMPDIR=$(mktemp -d) && export TMPDIR
    "$2"
    rm -rf "$TMPDIR"
    exit
    ;;
  --quick) parts=(quick) ;;
  -*) echo "usage: carriers.sh [--quick | PART...]" >&2; exit 64 ;;
  "") ;;
  *) parts=("$@") ;;
esac
cargo build --quiet --release --features carriers --manifest-path link/Cargo.toml
folder=${CARRIERS_FOLDER:-$(mktemp -d)}
printf '%s\n' "${parts[@]}" | nl -w 1 -s ' ' | xargs --process-slot-var=SLOT -P "${CARRIERS_JOBS:-$(nproc)}" -I{} bash -c '
  number=${1%% *} part=${1#* }
  VCAN_UML_CPU=$((SLOT % $(nproc))) scripts/with_vcan.sh -v -- "$2" --inside "$part" >"$3/$number"' _ {} "$0" "$folder"
cat "$folder"/[0-9]
