#!/usr/bin/env bash
# carriers.sh [--quick]: measures the carriers of the link, and prints the tables of docs/carriers.md.
#
# Each row is two processes over loopback in a User-Mode Linux kernel in virtual time (with_vcan.sh -v), with netem as
# the network: it delays, shuffles and drops each packet once on its way. CARRIERS_SECONDS is the length of a
# measurement (default 5), CARRIERS_WINDOW the flow rule's number of messages (default 32). --quick measures a row per carrier.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
seconds=${CARRIERS_SECONDS:-5} window=${CARRIERS_WINDOW:-32}
carriers=(quic-mixed quic-datagram tls udp-sealed)
program=link/target/release/carriers

# row DELAY JITTER LOSS CARRIER RATE WINDOW [OPTION...]: delay and jitter one way in ms, loss in per cent.
row() {
  local delay=$1 jitter=$2 loss=$3 carrier=$4 rate=$5 window=$6 limit=100 network
  shift 6
  case $delay in 0 | 0.2 | 2 | 5 | 8) limit=20 ;; *) ;; esac
  network="delay ${delay}ms"
  [[ $jitter == 0 ]] || network+=" ${jitter}ms"
  [[ $loss == 0 ]] || network+=" loss ${loss}%"
  # shellcheck disable=SC2086 # words
  tc qdisc replace dev lo root netem $network limit 100000
  timeout 100 "$program" carrier="$carrier" rate="$rate" seconds="$seconds" window="$window" limit="$limit" \
    label="$delay | $jitter | $loss | " "$@" || echo "| $delay | $jitter | $loss | $carrier | $rate | failed | – | – | – | – | – |"
  tc qdisc del dev lo root
}

head() {
  echo "| delay | jitter | loss | carrier | Hz | first ms | sent Hz | received % | age ms p50 / p99 / max | round trip ms p50 / p99 / max | trips |"
  echo "|---|---|---|---|---|---|---|---|---|---|---|"
}

tenth() { awk -v delay="$1" 'BEGIN { print delay / 10 }'; }

# The rows of issue 31: which carriers never trip.
figure() {
  local delay carrier
  printf '\n## No trip\n\n' && head
  for delay in 0 2 5 8 20 40; do
    for carrier in "${carriers[@]}"; do row "$delay" 0 0 "$carrier" 1000 "$window"; done
  done
  for carrier in "${carriers[@]}"; do row 2 0.2 1 "$carrier" 1000 "$window"; done
}

grid() {
  local rate delay loss jitter carrier
  for rate in 1000 500; do
    printf '\n## Grid at %s Hz\n\n' "$rate" && head
    for delay in 0.2 2 8 20 40; do
      for jitter in 0 "$(tenth "$delay")"; do
        for loss in 0 0.1 1 5; do
          for carrier in "${carriers[@]}"; do row "$delay" "$jitter" "$loss" "$carrier" "$rate" "$window"; done
        done
      done
    done
  done
}

# Without the flow rule, and with other numbers of messages.
rule() {
  local carrier count
  printf '\n## The flow rule\n\nLast column of the label: maximum number of messages; 0 is without the rule.\n\n' && head
  for carrier in "${carriers[@]}"; do
    for count in 0 16 32 64 128; do
      row 8 0 5 "$carrier" 1000 "$count" && row 40 0 5 "$carrier" 1000 "$count" && row 40 4 1 "$carrier" 1000 "$count"
    done
  done
}

case ${1:-} in
  --inside)
    case $2 in
      quick) head && for carrier in "${carriers[@]}"; do row 2 0.2 1 "$carrier" 1000 "$window"; done ;;
      *) "$2" ;;
    esac
    ;;
  --quick) exec scripts/with_vcan.sh -v -- "$0" --inside quick ;;
  *)
    cargo build --quiet --release --manifest-path link/Cargo.toml
    for part in figure grid rule; do scripts/with_vcan.sh -v -- "$0" --inside "$part"; done
    ;;
esac
