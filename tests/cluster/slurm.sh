#!/usr/bin/env bash
# A private Slurm for tests: one controller and two nodes, node1 and node2, of one processor each, all on this machine.
#
#   slurm.sh start FOLDER             starts it, waits until both nodes are idle, prints `export SLURM_CONF=...` for the caller
#   slurm.sh stop FOLDER              ends everything that `start` and its jobs left running; may be repeated; the logs stay
#   slurm.sh kill-node FOLDER NAME    as if NAME lost its power: its daemon and all processes of its jobs are gone at once
#   slurm.sh start-node FOLDER NAME   starts NAME's daemon again and waits until the controller takes the node back
#
# Configuration, key, sockets, state, logs and pid files are in FOLDER; nothing outside is written, and neither /etc/slurm nor
# /run/munge is needed. It listens on free ports, so several may run side by side, of root or of an ordinary user. Partition
# `test`, array indices up to 40. Needs the Debian packages slurmctld, slurmd, slurm-client and munge (22.05, which is built for
# several slurmd on one host).
set -euo pipefail

nodes=(node1 node2)
all=(munged slurmctld "${nodes[@]}") # NAME.out is what one printed, NAME.log its log, NAME.pid its id
patience=30 # seconds until a start counts as failed

die() {
  echo "slurm: $*" >&2
  exit 1
}

# pids OPTIONS... FILE: ids of the processes whose /proc/ID/FILE grep finds; none is no error, and processes may end meanwhile.
pids() {
  local file=${*: -1}
  { grep -ls "${@:1:$#-1}" /proc/[0-9]*/"$file" || true; } | cut -d/ -f3
}

# daemons COMMAND ARGUMENT...: the running daemons of that name that were started with all these arguments. The arguments name
# FOLDER, so this finds no daemon of others, and finds ours where a pid file is stale or FOLDER was deleted.
daemons() {
  local command=$1 pid argument
  shift
  for pid in $(pids -x "$command" comm); do
    for argument in "$@"; do
      grep -qszxF -e "$argument" "/proc/$pid/cmdline" || continue 2
    done
    echo "$pid"
  done
}

# on_node NAME: all processes of a node, in three kinds.
on_node() {
  local pid
  daemons slurmd "$conf" "$1"
  # A slurmstepd has no telling arguments, but holds the node's log open.
  for pid in $(pids -x slurmstepd comm); do
    if { readlink "/proc/$pid/fd/"* 2> /dev/null || true; } | grep -F "$folder/$1.log" > /dev/null; then
      echo "$pid"
    fi
  done
  # What a job runs has both in its environment. (A job that clears its environment would be missed.)
  for pid in $(pids -zxF "SLURMD_NODENAME=$1" environ); do
    if grep -qszxF "SLURM_CONF=$conf" "/proc/$pid/environ"; then
      echo "$pid"
    fi
  done
}

# end COMMAND...: SIGKILL to all processes whose ids COMMAND prints. First all are stopped, until no new one appears: otherwise a
# batch script would notice the end of its child, and go on to its next line before its own turn comes. Then jobs
# before what started them: a stopped process whose parent ends is sent SIGHUP and goes on.
end() {
  local found=() before='' until=$((SECONDS + 10))
  while mapfile -t found < <("$@") && [ "${found[*]}" != "$before" ]; do
    kill -STOP "${found[@]}" 2> /dev/null || true
    before=${found[*]}
  done
  while [ ${#found[@]} -gt 0 ]; do
    kill -KILL $(printf '%s\n' "${found[@]}" | tac) 2> /dev/null || true
    sleep 0.05
    mapfile -t found < <("$@")
    [ $SECONDS -lt $until ] || die "these processes do not end: ${found[*]}"
  done
}

# launch LOG COMMAND...: in the background, apart from the caller's terminal, standard streams and working folder.
launched=0
launch() {
  local log=$1
  shift
  (cd "$folder" && exec setsid "$@" < /dev/null >> "$log" 2>&1) &
  launched=$((launched + 1))
}

launch_node() {
  launch "$folder/$1.out" slurmd -D -f "$conf" -N "$1"
}

# await COMMAND...: until it succeeds. After `patience`, or once a daemon has ended, shows the logs, stops everything and fails.
await() {
  local until=$((SECONDS + patience)) log
  until "$@"; do
    if [ $SECONDS -ge $until ] || [ "$(jobs -rp | wc -l)" -lt $launched ]; then
      for log in "${all[@]/%/.out}"; do
        log=$folder/$log
        [ ! -s "$log" ] || { echo "== $log" && tail -n 40 "$log"; } >&2
      done
      stop
      die "failed to get ready (the logs are above): $*"
    fi
    sleep 0.1
  done
}

# in_state STATES NAME...: is each node in one of these states (an extended regular expression)? A trailing * would mean that
# the node does not answer, so it must not match.
in_state() {
  local states=$1 name state
  shift
  for name in "$@"; do
    state=$(timeout 5 sinfo --noheader --nodes="$name" --format=%T 2> /dev/null) || return 1
    [[ $state =~ ^($states)$ ]] || return 1
  done
}

# free_ports COUNT: the first of so many successive ports that nobody listens on, below those that systems hand out themselves.
free_ports() {
  local first port
  while true; do
    first=$((20000 + RANDOM % 10000))
    for ((port = first; port < first + $1; port++)); do
      if (exec 3<> "/dev/tcp/127.0.0.1/$port") 2> /dev/null; then
        continue 2
      fi
    done
    echo "$first"
    return
  done
}

# Why some of these values:
# - cgroup/v1 is loaded because slurmd 22.05 wants one such plugin, but nothing below uses it: it does for v1, v2 and neither.
# - cred_expire is also how long a requeued job waits before it may start again (default: 2 minutes).
# - With a SlurmdTimeout this short, a dead node is noticed after up to three times MessageTimeout (default: 10 s); then its jobs
#   are requeued.
# - Finished jobs are forgotten MinJobAge after their end, or later.
configure() {
  local host port index
  host=$(uname -n)
  host=${host%%.*}
  port=$(free_ports $((1 + ${#nodes[@]})))
  printf 'CgroupPlugin=cgroup/v1\nCgroupAutomount=no\n' > "$folder/cgroup.conf"
  cat > "$conf" << END
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket=$folder/munge.socket,cred_expire=5
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/%n.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/%n.log
MailProg=/bin/true
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
SchedulerParameters=batch_sched_delay=0,sched_interval=1,sched_min_interval=0,bf_interval=1
MaxArraySize=41
JobRequeue=1
ReturnToService=2
SlurmdTimeout=5
KillWait=5
MessageTimeout=5
MinJobAge=30
END
  for index in "${!nodes[@]}"; do
    echo "NodeName=${nodes[index]} NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 1 + index)) CPUs=1 RealMemory=16000"
  done >> "$conf"
  echo "PartitionName=test Nodes=$(IFS=, && echo "${nodes[*]}") Default=YES MaxTime=INFINITE State=UP" >> "$conf"
}

start() {
  local command name
  for command in munged slurmctld slurmd sinfo; do
    command -v "$command" > /dev/null || die "no $command; install the packages slurmctld, slurmd, slurm-client and munge"
  done
  [[ $folder != *[[:space:],=#\"\'\\%]* ]] || die "slurm.conf cannot name this folder: $folder"
  [ ${#folder} -le 70 ] || die "sockets would have too long names in this folder, take one of at most 70 characters: $folder"
  stop
  mkdir -p "$folder"
  # What an earlier test left: its jobs must not come back.
  for name in "${all[@]}"; do
    rm -f "$folder/$name".{out,log}
  done
  rm -rf "$folder/state" "${nodes[@]/#/$folder/}"
  mkdir "$folder/state" "${nodes[@]/#/$folder/}"
  configure
  (umask 077 && head -c 128 /dev/urandom > "$folder/munge.key")

  # By --force it takes a folder that others may not enter, or one under a folder that others may write to.
  launch "$folder/munged.out" munged --foreground --force --origin=127.0.0.1 --socket="$folder/munge.socket" \
    --key-file="$folder/munge.key" --seed-file="$folder/munge.seed" --pid-file="$folder/munged.pid"
  await test -S "$folder/munge.socket"
  launch "$folder/slurmctld.out" slurmctld -D -f "$conf"
  for name in "${nodes[@]}"; do
    launch_node "$name"
  done
  await in_state idle "${nodes[@]}"
  printf 'export SLURM_CONF=%q\n' "$conf"
}

stop() {
  local name
  end daemons slurmctld "$conf" # first, so that it sees none of its nodes go
  for name in "${nodes[@]}"; do
    end on_node "$name"
  done
  end daemons munged "--socket=$folder/munge.socket"
  for name in "${all[@]}"; do
    rm -f "$folder/$name.pid"
  done
  rm -f "$folder"/munge.socket*
}

usage() {
  sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" >&2
  exit 2
}

[ $# -ge 2 ] || usage
folder=$(realpath --canonicalize-missing -- "$2")
conf=$folder/slurm.conf
PATH=$PATH:/usr/sbin:/sbin
unset "${!SLURM@}" "${!SINFO@}" # the caller may be a job of another Slurm, or prefer other formats
export SLURM_CONF=$conf
case $1/$# in
  start/2 | stop/2) "$1" ;;
  kill-node/3 | start-node/3)
    [[ " ${nodes[*]} " == *" $3 "* ]] || die "no node of this name: $3 (there are ${nodes[*]})"
    if [ "$1" = kill-node ]; then
      end on_node "$3"
      rm -f "$folder/$3.pid"
    else
      [ -n "$(daemons slurmctld "$conf")" ] || die "not started: $folder"
      [ -n "$(daemons slurmd "$conf" "$3")" ] || launch_node "$3"
      await in_state 'idle|mixed|allocated|completing' "$3"
    fi
    ;;
  *) usage ;;
esac
