#!/usr/bin/env bash
# with_icount.sh [-i "vcan0 vcan1"] [-t SECONDS] [-c CPU] [--] COMMAND [ARG...]
#
# Runs COMMAND on an emulated machine on which every instruction takes one nanosecond, and exits with its status. Times
# and costs are then counts of instructions, the kernel's included: a run repeats whatever else this machine does.
#   -i NAMES    vcan interfaces that are up (default vcan0)
#   -t SECONDS  kill the machine after this much wall-clock time (default 600; exit 124)
#   -c CPU      model of its processor, as qemu-system-x86_64 -cpu help lists them (default max: all that QEMU can emulate)
#
# The machine is QEMU's with one CPU, without caches and pipelines; its kernel is Debian's, with Debian's modules for CAN.
# Its root is this machine's file system, read only, so COMMAND finds the same paths and working directory. /tmp, /run
# and /dev/shm are empty but for the working directory and this checkout where these are below them, and end with it. Idle time is skipped.
#
# Needs Debian's qemu-system-x86, busybox-static and cpio. The package of the kernel is fetched once into target/icount and
# not installed. What is missing is said, with exit 69.
set -euo pipefail

interfaces=vcan0 limit=600 cpu=max
while [[ $# -gt 0 ]]; do
  case $1 in
    -i) interfaces=$2; shift 2 ;;
    -t) limit=$2; shift 2 ;;
    -c) cpu=$2; shift 2 ;;
    --) shift; break ;;
    -*) echo "with_icount: unknown option $1" >&2; exit 64 ;;
    *) break ;;
  esac
done
[[ $# -gt 0 ]] || { echo "usage: with_icount.sh [-i \"vcan0 vcan1\"] [-t SECONDS] [-c CPU] [--] COMMAND [ARG...]" >&2; exit 64; }

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
home=$here/../target/icount
fail() { echo "with_icount: $*" >&2; exit 69; }

missing=()
for pair in qemu-system-x86_64:qemu-system-x86 busybox:busybox-static cpio:cpio dpkg-deb:dpkg ip:iproute2; do
  PATH=$PATH:/usr/sbin:/sbin command -v "${pair%%:*}" >/dev/null || missing+=("${pair##*:}")
done
((${#missing[@]} == 0)) || fail "missing: ${missing[*]} (scripts/apt.sh install ${missing[*]})"

# In the order in which the kernel can load them.
readonly MODULES="drivers/virtio/virtio_ring drivers/virtio/virtio drivers/virtio/virtio_pci_legacy_dev
  drivers/virtio/virtio_pci_modern_dev drivers/virtio/virtio_pci fs/netfs/netfs fs/fscache/fscache net/9p/9pnet
  net/9p/9pnet_virtio fs/9p/9p net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/vcan"

# fetch_kernel: Debian's kernel of the installed release, and the modules, into $home.
fetch_kernel() {
  local package work
  package=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/^ *Depends: //p' | head -n 1)
  [[ -n $package ]] || fail "apt knows no linux-image-amd64 (scripts/apt.sh update)"
  work=$(mktemp -d)
  (cd "$work" && apt-get -q -o APT::Sandbox::User=root download "$package" >/dev/null) || fail "$package cannot be fetched"
  dpkg-deb -x "$work"/*.deb "$work/root"
  rm -rf "$home" && mkdir -p "$home/modules"
  local number=10 module
  for module in $MODULES; do # numbered: the machine loads them by name
    cp "$work"/root/lib/modules/*/kernel/"$module.ko" "$home/modules/$((number++))-${module##*/}.ko"
  done
  dpkg-deb -W --showformat='${Package} ${Version}\n' "$work"/*.deb >"$home/version"
  cp "$work"/root/boot/vmlinuz-* "$home/vmlinuz" # last: its presence says that all is there
  rm -rf "$work"
}
[[ -s $home/vmlinuz ]] || fetch_kernel

run=$(mktemp -d)
trap 'rm -rf "$run"' EXIT
mkdir -p "$run/initrd"/{bin,dev,host}
cp "$(command -v busybox)" "$run/initrd/bin/busybox"
cp -r "$home/modules" "$run/initrd/modules"
cat >"$run/initrd/init" <<'INIT'
#!/bin/busybox sh
box=/bin/busybox
$box mount -t devtmpfs dev /dev
for module in /modules/*.ko; do $box insmod $module; done
$box mount -t 9p -o trans=virtio,version=9p2000.L,ro,cache=loose files /host
$box mount -t proc proc /host/proc
$box mount -t sysfs sys /host/sys
$box mount -t devtmpfs dev /host/dev
# A checkout may be below one of the folders that are covered.
number=0
while read -r folder; do
  number=$((number + 1))
  $box mkdir -p /kept/$number
  $box mount -o bind "/host$folder" /kept/$number
done </folders
for folder in tmp run dev/shm; do
  $box mkdir -p /host/$folder
  $box mount -t tmpfs memory /host/$folder
done
$box cp /command /host/run/command
number=0
while read -r folder; do
  number=$((number + 1))
  [ -d "/host$folder" ] && continue
  $box mkdir -p "/host$folder"
  $box mount -o bind /kept/$number "/host$folder"
done </folders
exec $box chroot /host /bin/bash /run/command
INIT
chmod +x "$run/initrd/init"
printf '%s\n' "$(realpath "$here/..")" "$(realpath .)" >"$run/initrd/folders"
cat >"$run/initrd/command" <<COMMAND
export PATH=$(printf '%q' "$PATH"):/usr/sbin:/sbin HOME=/tmp TERM=dumb WITH_ICOUNT=yes
stty -onlcr -echo 2>/dev/null
ip link set lo up
for name in $interfaces; do ip link add dev \$name type vcan; ip link set \$name up; done
ulimit -l unlimited
cd $(printf '%q' "$(realpath .)")
echo "with_icount: begin"
bash -c $(printf '%q' "$(printf '%q ' "$@")") </dev/null
echo "with_icount: status \$?"
echo b >/proc/sysrq-trigger
sleep 10
COMMAND
(cd "$run/initrd" && find . | cpio --quiet -o -H newc | gzip -1) >"$run/initrd.gz"

status=0
timeout "$limit" qemu-system-x86_64 -machine q35,accel=tcg -cpu "$cpu" -smp 1 -m 2048 -icount shift=0,sleep=off \
  -nographic -no-reboot -net none -kernel "$home/vmlinuz" -initrd "$run/initrd.gz" \
  -append "console=ttyS0 quiet mitigations=off clocksource=tsc tsc=reliable panic=-1" \
  -virtfs "local,path=/,mount_tag=files,security_model=none,readonly=on,multidevs=remap" \
  </dev/null >"$run/console" 2>&1 || status=$?
tr -d '\r' <"$run/console" | sed -n '/with_icount: begin/,/^with_icount: status /{//!p}'
((status != 124)) || { echo "with_icount: ended after $limit s" >&2; exit 124; }
ended=$(sed -n 's/^with_icount: status \([0-9]*\).*/\1/p' "$run/console" | tail -n 1)
[[ -n $ended ]] || { tail -n 20 "$run/console" >&2; fail "the machine stopped before the command ended"; }
exit "$ended"
