#!/usr/bin/env bash
# A Slurm of this one Debian machine, for trying workflow/profiles/slurm: slurm_here.sh COMMAND
#   install     the packages (as root), once
#   start       configure and start munged, slurmctld and slurmd; nothing where they run
#   restart     the controller alone, as after a failure of its host
#   stop        end what start has started
# No accounting, one node of all cores, one partition. State and logs: /var/lib/slurm-here.
set -euo pipefail
home=/var/lib/slurm-here conf=/etc/slurm/slurm.conf mark='# written by slurm_here.sh'
fail() { echo "slurm_here.sh: $*" >&2; exit 2; }
[ "$(id -u)" = 0 ] || fail "only root can start Slurm's daemons; run it as root, or with sudo"
running() { [ -f "$1" ] && kill -0 "$(cat "$1" 2> /dev/null)" 2> /dev/null; }
ended() { # the process of a file: told to end, waited for
    running "$1" || return 0
    kill "$(cat "$1")"
    for _ in {1..50}; do running "$1" || return 0; sleep 0.2; done
}
controller() {
    slurmctld
    for _ in {1..50}; do ! scontrol ping 2> /dev/null | grep -q 'is UP' || return 0; sleep 0.2; done
    fail "the controller does not answer; see $home/slurmctld.log"
}
configuration() {
    local host memory; host=$(hostname -s) memory=$(awk '/^MemTotal/ {print int($2 / 1024)}' /proc/meminfo)
    cat <<CONF
$mark
ClusterName=here
SlurmctldHost=$host(127.0.0.1)
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
AuthType=auth/munge
SlurmUser=root
StateSaveLocation=$home/state
SlurmdSpoolDir=$home/spool
SlurmctldPidFile=$home/slurmctld.pid
SlurmdPidFile=$home/slurmd.pid
SlurmctldLogFile=$home/slurmctld.log
SlurmdLogFile=$home/slurmd.log
# Without control groups, which containers and this test do not need.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
# A finished job is remembered for an hour: squeue is asked for it.
MinJobAge=3600
ReturnToService=2
# A job past its time limit, or cancelled, has so many seconds to end.
KillWait=5
OverTimeLimit=0
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$memory State=UNKNOWN
PartitionName=main Nodes=$host Default=YES MaxTime=UNLIMITED State=UP
CONF
}
case "${1:-}" in
    install) apt-get update -q
        DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
            slurm-wlm slurmctld slurmd munge ;;
    start) command -v slurmctld slurmd munged > /dev/null || fail "not installed; run: $0 install"
        [ ! -e $conf ] || grep -qxF "$mark" $conf || fail "$conf is another Slurm's; leave it alone"
        install -d $home/state $home/spool /etc/slurm
        configuration > $conf
        install -d -o munge -g munge /run/munge /var/log/munge /var/lib/munge
        [ -f /etc/munge/munge.key ] || fail "/etc/munge/munge.key is missing; run: mungekey --create"
        running /run/munge/munged.pid || runuser -u munge -- munged --pid-file=/run/munge/munged.pid
        running $home/slurmctld.pid || controller
        running $home/slurmd.pid || slurmd
        for _ in {1..50}; do
            [ "$(sinfo --noheader --format=%T 2> /dev/null)" != idle ] || exit 0; sleep 0.2
        done
        sinfo >&2; fail "the node is not idle; see $home/slurmd.log" ;;
    restart) ended $home/slurmctld.pid; sleep "${2:-0}"; controller ;;
    stop) scancel --user root 2> /dev/null || true
        for name in slurmd slurmctld; do ended $home/$name.pid; done
        ended /run/munge/munged.pid
        [ ! -e $conf ] || ! grep -qxF "$mark" $conf || rm $conf
        rm -rf $home ;;
    *) fail "which of install, start, restart, stop?" ;;
esac
