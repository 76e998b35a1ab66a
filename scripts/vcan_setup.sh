#!/usr/bin/env bash
# vcan_setup.sh [--down] [INTERFACE...]
#
# Creates the virtual CAN interfaces (default vcan0 and vcan1) on a machine whose kernel has CAN, for classical frames
# (MTU 16) and with a short transmit queue: a long one would hold stale torques. --down removes them. Idempotent.
# Needs root or sudo.
#
# For a kernel without CAN see with_vcan.sh.
set -euo pipefail

as_root() { if [[ $EUID -eq 0 ]]; then "$@"; else sudo -n "$@"; fi; }

action=up
if [[ ${1:-} == --down ]]; then action=down; shift; fi
if [[ ${1:-} == -* ]]; then echo "usage: vcan_setup.sh [--down] [INTERFACE...]" >&2; exit 64; fi
interfaces=("$@")
((${#interfaces[@]})) || interfaces=(vcan0 vcan1)
command -v ip >/dev/null || { echo "vcan_setup: ip is missing: install iproute2" >&2; exit 69; }

if [[ $action == down ]]; then
  for name in "${interfaces[@]}"; do
    if ip link show "$name" >/dev/null 2>&1; then as_root ip link delete "$name"; fi
  done
  exit 0
fi

# The module may be built in, or loaded by the first "ip link add".
as_root modprobe vcan 2>/dev/null || true
for name in "${interfaces[@]}"; do
  if ! ip link show "$name" >/dev/null 2>&1; then
    as_root ip link add dev "$name" type vcan || {
      echo "vcan_setup: this kernel ($(uname -r)) has no vcan; run commands under scripts/with_vcan.sh instead" >&2
      exit 69
    }
  fi
  if [[ $(<"/sys/class/net/$name/mtu") != 16 ]]; then # changed only while the interface is down
    as_root ip link set dev "$name" down
    as_root ip link set dev "$name" mtu 16
  fi
  as_root ip link set dev "$name" txqueuelen 16
  as_root ip link set dev "$name" up
done
ip -brief link show type vcan
