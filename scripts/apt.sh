#!/usr/bin/env bash
# apt.sh: installs Debian packages, and waits while another apt or dpkg holds a lock (ten minutes at most).
#
# usage: scripts/apt.sh update | install PACKAGE...
#
# `install` updates the package lists first. Needs root or sudo.
set -euo pipefail
readonly WAIT_S=600 RETRY_S=2
as_root() { if [[ $EUID -eq 0 ]]; then "$@"; else sudo -n "$@"; fi; }

# apt COMMAND...: runs apt-get. Only dpkg's locks have a time-out; for those of the lists and the archives it is tried again.
apt() {
  local end=$((SECONDS + WAIT_S)) is_waiting= said
  until said=$(as_root env LC_ALL=C DEBIAN_FRONTEND=noninteractive apt-get -q "$@" 2>&1 >/dev/null); do
    if [[ $said != *"Could not get lock"* && $said != *"Unable to lock directory"* ]] || ((SECONDS >= end)); then
      printf '%s\n' "$said" >&2
      return 1
    fi
    [[ -n $is_waiting ]] || echo "apt: waiting for another apt: ${said%%$'\n'*}" >&2
    is_waiting=1
    sleep "$RETRY_S"
  done
}

case ${1-} in
  update) apt update ;;
  install)
    apt update
    apt install -y --no-install-recommends -o DPkg::Lock::Timeout="$WAIT_S" "${@:2}"
    ;;
  *) sed -n '2,/^set/{/^set/d;s/^# \?//p}' "$0" >&2; exit 2 ;;
esac
