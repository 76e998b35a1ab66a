#!/usr/bin/env bash
# build_timetravel_kernel.sh [OUTPUT]
#
# Builds the User-Mode Linux kernel that with_vcan.sh uses for virtual time, from Debian's kernel
# source package (newest linux-source of its unstable suite), with SocketCAN, vcan, vxcan, slcan, the
# CAN gateway (cangw) and netem/tbf built in. About 8 minutes on two cores; OUTPUT (default:
# ~/.cache/vcan-uml/linux-timetravel) is one file of 7 MB that runs as an ordinary process.
set -euo pipefail
output=$(realpath -m "${1:-${VCAN_UML_HOME:-${XDG_CACHE_HOME:-$HOME/.cache}/vcan-uml}/linux-timetravel}")
"$(dirname "${BASH_SOURCE[0]}")/apt.sh" install gcc libc6-dev make flex bison bc libelf-dev xz-utils

work=$(mktemp -d) && chmod 755 "$work"
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir -p lists/partial cache/archives/partial
mirror=$(apt-get indextargets --format '$(ORIGIN) $(LABEL) $(REPO_URI)' | awk '$1 == "Debian" && $2 == "Debian" { print $3; exit }')
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $mirror unstable main" >sources.list
apt=(-q -o Dir::Etc::SourceList="$work/sources.list" -o Dir::Etc::SourceParts=/dev/null
     -o Dir::State::Lists="$work/lists" -o Dir::Cache="$work/cache" -o APT::Sandbox::User=root)
apt-get "${apt[@]}" update >/dev/null
package=$(apt-cache "${apt[@]}" depends linux-source | awk '$1 == "Depends:" { print $2; exit }')
apt-get "${apt[@]}" download "$package" >/dev/null
dpkg -x "$package"_*.deb root
tar xf root/usr/src/"$package".tar.xz && cd "$package"

make ARCH=um defconfig >/dev/null
./scripts/config \
  -e UML_TIME_TRAVEL_SUPPORT -e HOSTFS -e HIGH_RES_TIMERS -e PREEMPT -d PREEMPT_VOLUNTARY -d MODULES -e SECCOMP \
  -e DEBUG_INFO_NONE -d WERROR -e MAGIC_SYSRQ -e TMPFS -e DEVTMPFS -e UNIX98_PTYS -e PROC_FS -e SYSFS -e CGROUPS \
  -e NET -e UNIX -e INET -e PACKET -e NETDEVICES -e VETH -e TUN -e DUMMY -e NAMESPACES -e NET_NS \
  -e CAN -e CAN_RAW -e CAN_BCM -e CAN_GW -e CAN_NETLINK -e CAN_DEV -e CAN_VCAN -e CAN_VXCAN -e CAN_SLCAN \
  -e NET_SCHED -e NET_SCH_NETEM -e NET_SCH_TBF -e NET_SCH_PRIO -e NET_CLS -e NET_CLS_BASIC -e NET_EMATCH -e NET_EMATCH_CANID
make ARCH=um olddefconfig >/dev/null
make ARCH=um -j"$(nproc)" linux >/dev/null
strip linux
install -D -m 755 linux "$output"
echo "$output: $("$output" --version)"
