#!/usr/bin/env bash
# with_vcan.sh [-i "vcan0 vcan1"] [-t SECONDS] [-v] [--] COMMAND [ARG...]
#
# Runs COMMAND with real Linux vcan interfaces up, and exits with its status.
#   -i NAMES    the interfaces (default vcan0)
#   -t SECONDS  kill COMMAND after this much wall-clock time without output (exit 124): a hung command fails, a
#               slow machine does not
#   -v          virtual time: sleeping costs nothing and computing takes no time, so a 1 kHz loop
#               keeps every deadline exactly and a run repeats (busy-waiting on a clock hangs)
#
# A kernel with CAN: the interfaces are made on this machine (root, or sudo) and COMMAND runs on it.
# A kernel without (containers, micro-VMs), or -v: a User-Mode Linux kernel is booted for the length
# of COMMAND. It is an ordinary process; its root is this machine's file system (hostfs), so COMMAND
# finds the same paths, working directory and environment. It boots in about 1.5 s and has one CPU; it
# runs on one of this machine's, $VCAN_UML_CPU or any.
# Its kernel is, in this order: $VCAN_KERNEL; the one that build_timetravel_kernel.sh leaves in
# $VCAN_UML_HOME (default ~/.cache/vcan-uml; the only one that can do -v); or Debian's package
# user-mode-linux from its unstable suite, fetched once into the same folder through this machine's
# own apt mirror and keyring.
set -euo pipefail

interfaces="vcan0" limit="" virtual=""
while [[ $# -gt 0 ]]; do
  case $1 in
    -i) interfaces=$2; shift 2 ;;
    -t) limit=$2; shift 2 ;;
    -v) virtual=yes; shift ;;
    --) shift; break ;;
    -*) echo "with_vcan: unknown option $1" >&2; exit 64 ;;
    *) break ;;
  esac
done
[[ $# -gt 0 ]] || { echo "usage: with_vcan.sh [-i \"vcan0 vcan1\"] [-t SECONDS] [-v] COMMAND [ARG...]" >&2; exit 64; }

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
home=${VCAN_UML_HOME:-${XDG_CACHE_HOME:-$HOME/.cache}/vcan-uml}

as_root() { if [[ $EUID -eq 0 ]]; then "$@"; else sudo -n "$@"; fi; }

native_vcan() {
  local name
  for name in $interfaces; do
    ip link show "$name" >/dev/null 2>&1 || as_root ip link add dev "$name" type vcan 2>/dev/null \
      || { as_root modprobe vcan 2>/dev/null && as_root ip link add dev "$name" type vcan 2>/dev/null; } || return 1
    as_root ip link set "$name" up || return 1
  done
}

need() { # need TOOL:PACKAGE...: installs the packages whose tools are missing
  local pair missing=()
  for pair; do
    command -v "${pair%%:*}" >/dev/null || [[ -x /usr/sbin/${pair%%:*} ]] || missing+=("${pair##*:}")
  done
  if ((${#missing[@]})); then "$here/apt.sh" install "${missing[@]}"; fi
}

# limited COMMAND...: runs it; returns 124 when it was killed because it printed nothing for $limit seconds.
limited() {
  [[ -n $limit ]] || { "$@"; return; }
  local folder pid watcher tee status=0
  folder=$(mktemp -d)
  mkfifo "$folder/output" && : >"$folder/printed"
  tee "$folder/printed" <"$folder/output" &
  tee=$!
  setsid "$@" >"$folder/output" & # a process group of its own, to be killed as a whole
  pid=$!
  # shellcheck disable=SC2064 # the group of now
  trap "kill -TERM -- -$pid 2>/dev/null" INT TERM
  while sleep 2; do
    (($(date +%s) - $(stat -c %Y "$folder/printed") <= limit)) || { touch "$folder/silent"; kill -KILL -- "-$pid"; }
  done >/dev/null 2>&1 &
  watcher=$!
  wait "$pid" || status=$?
  kill "$watcher" && wait "$watcher" "$tee" || true
  [[ ! -e $folder/silent ]] || status=124
  rm -rf "$folder"
  return "$status"
}

fetch_debian_kernel() { # into $home: linux.uml, its modules, and the newer C library it wants
  [[ -x $home/linux.uml ]] && return
  need patchelf:patchelf insmod:kmod
  local work mirror
  work=$(mktemp -d) && chmod 755 "$work"
  mkdir -p "$work/lists/partial" "$work/cache/archives/partial" "$work/root"
  mirror=$(apt-get indextargets --format '$(ORIGIN) $(LABEL) $(REPO_URI)' | awk '$1 == "Debian" && $2 == "Debian" { print $3; exit }')
  [[ -n $mirror ]] || { echo "with_vcan: no Debian mirror among apt's sources (run apt-get update)" >&2; return 1; }
  echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $mirror unstable main" >"$work/sources.list"
  local apt=(-q -o Dir::Etc::SourceList="$work/sources.list" -o Dir::Etc::SourceParts=/dev/null
             -o Dir::State::Lists="$work/lists" -o Dir::Cache="$work/cache" -o APT::Sandbox::User=root)
  (
    cd "$work"
    apt-get "${apt[@]}" update >/dev/null
    apt-get "${apt[@]}" download user-mode-linux libc6 >/dev/null
    for package in *.deb; do dpkg -x "$package" root; done
  )
  mkdir -p "$home" && rm -rf "$home/lib" "$home/modules"
  cp -r "$(dirname "$(find "$work/root" -name ld-linux-x86-64.so.2 -type f | head -n 1)")" "$home/lib"
  cp -r "$work/root/usr/lib/uml/modules" "$home/modules"
  cp "$work/root/usr/bin/linux.uml" "$home/linux.uml.new"
  patchelf --set-interpreter "$home/lib/ld-linux-x86-64.so.2" --set-rpath "$home/lib" "$home/linux.uml.new"
  mv "$home/linux.uml.new" "$home/linux.uml"
  rm -rf "$work"
}

run_in_uml() { # run_in_uml KERNEL COMMAND...
  local kernel=$1 options="quiet vcan.echo=1 seccomp=auto" # echo=1: netem and tbf act on vcan as on real hardware
  shift
  need ip:iproute2
  [[ -z $virtual ]] || options+=" time-travel=inf-cpu"
  run=$(mktemp -d) # global: the trap outlives this function
  trap 'rm -rf "$run"' EXIT
  export -p >"$run/env"
  printf '%q ' "$@" >"$run/command"
  cat >"$run/init" <<INIT
#!/bin/bash
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
mount -t proc proc /proc; mount -t sysfs sys /sys; mount -t tmpfs run /run
mount -t devtmpfs dev /dev 2>/dev/null
mkdir -p /dev/shm /dev/pts; mount -t tmpfs shm /dev/shm; mount -t devpts pts /dev/pts -o ptmxmode=666 2>/dev/null
exec >/dev/tty0 2>&1 # the kernel's own messages go to another console
stty -onlcr -echo </dev/tty0
modules=$home/modules/\$(uname -r)/kernel
if [[ -d \$modules ]]; then
  for m in net/can/can net/can/can-raw net/can/can-bcm net/can/can-gw drivers/net/can/dev/can-dev drivers/net/can/vcan; do
    case \$m in */vcan) insmod \$modules/\$m.ko echo=1 ;; *) insmod \$modules/\$m.ko ;; esac
  done
fi
ip link set lo up
for name in $interfaces; do ip link add dev \$name type vcan; ip link set \$name up; done
. $run/env
export WITH_VCAN=${virtual:+virtual-}uml
cd $(printf '%q' "$PWD")
bash $run/command </dev/null
echo \$? >$run/status
sync
echo o >/proc/sysrq-trigger
sleep 10
INIT
  chmod +x "$run/init"
  # The kernel and its processes hand over to each other, and a wake-up across CPUs costs a virtual machine some
  # hundred microseconds (the 17 tests of vcan: 470 s on two CPUs, 88 s on one).
  local cpu=${VCAN_UML_CPU:-$(($$ % $(nproc)))} pin="" status=0
  taskset -c "$cpu" true 2>/dev/null && pin="taskset -c $cpu"
  # shellcheck disable=SC2086
  limited $pin "$kernel" mem="${VCAN_UML_MEM:-2G}" umid="vcan$$" uml_dir="$run/" \
    root=/dev/root rootfstype=hostfs rootflags=/ rw init="$run/init" \
    con=null con0=fd:0,fd:1 ssl=null console=ttyS0 $options </dev/null 2>"$run/kernel.log" || status=$?
  if [[ ! -s $run/status ]]; then
    local why="the kernel stopped before the command ended"
    ((status != 124)) || why="the command printed nothing for $limit s"
    echo "with_vcan: $why" >&2
    tail -n 5 "$run/kernel.log" >&2
    return 124
  fi
  return "$(<"$run/status")"
}

if [[ -z $virtual ]] && native_vcan; then
  limited "$@"
  exit
fi
kernel=${VCAN_KERNEL:-$home/linux-timetravel}
if [[ ! -x $kernel ]]; then
  [[ -z $virtual ]] || { echo "with_vcan: -v needs a time-travel kernel: $here/build_timetravel_kernel.sh, or set VCAN_KERNEL" >&2; exit 69; }
  fetch_debian_kernel
  kernel=$home/linux.uml
fi
run_in_uml "$kernel" "$@"
