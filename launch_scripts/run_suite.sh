#!/usr/bin/env bash
# Starts the suite without a ROS installation: the same nodes, remaps and parameters as gripsight.launch.py.
set -euo pipefail

usage() {
    cat <<'TEXT'
Usage: launch_scripts/run_suite.sh --vehicle FILE [options]

  --vehicle FILE    the car, a ROS 2 parameter file (params/vehicles/)
  --stack NAME      topic names: a file of params/stacks/ or a path to one like it   [gripsight]
  --params FILE     parameters of the nodes                                            [params/suite.yaml]
  --bag BAG         play a bag into the suite, then stop
  --rate RATE       speed of the replay                                                [1.0]
  --linger SECONDS  time for the last run after the bag's end                          [20]
  --prior-mu MU     publish this friction prior (else the camera_prior node has none)
  --camera          use the camera's pictures for the friction prior (params/camera_prior.yaml)
  --namespace NAME  the car's name, where several share a domain: nodes and the stack's topics are below it (/NAME/odom)
  --gap             diagnose the gap too (node gap_diagnosis)
  --drive FILE      drive the car, too: parameters of the node driver (its track among them)
  --bin FOLDER      where the nodes' binaries are                                      [target/release]
  -h, --help        this text

Results arrive on /identifier/pacejka (/NAME/identifier/pacejka). Ctrl-C stops every node, and so does the end of one of them: the suite runs whole or not at all.
The environment counts as for any ROS 2 node: ROS_DOMAIN_ID, ROS_LOCALHOST_ONLY, ROS_AUTOMATIC_DISCOVERY_RANGE.

Examples:
  launch_scripts/run_suite.sh --vehicle params/vehicles/f1tenth.yaml --stack f1tenth
  launch_scripts/run_suite.sh --vehicle bags/demo_f1tenth.vehicle.yaml --bag bags/demo_f1tenth.mcap --rate 10
TEXT
}

root=$(cd "$(dirname "$0")/.." && pwd)
vehicle='' stack=gripsight params=$root/params/suite.yaml bag='' rate=1.0 linger=20 prior='' camera=false gap=false drive=''
bin=$root/target/release space=''
fail() { printf 'run_suite: %s\n' "$1" >&2; exit "${2:-2}"; }
while (($#)); do
    case $1 in
        --camera) camera=true; shift; continue ;;
        --gap) gap=true; shift; continue ;;
        -h | --help) usage; exit 0 ;;
    esac
    (($# > 1)) || fail "option '$1' is unknown or lacks its value (see --help)"
    case $1 in
        --vehicle) vehicle=$2 ;;
        --stack) stack=$2 ;;
        --params) params=$2 ;;
        --bag) bag=$2 ;;
        --rate) rate=$2 ;;
        --linger) linger=$2 ;;
        --prior-mu) prior=$2 ;;
        --drive) drive=$2 ;;
        --namespace) space=${2#/} ;;
        --bin) bin=$2 ;;
        *) fail "unknown option '$1' (see --help)" ;;
    esac
    shift 2
done
[[ -n $vehicle ]] || fail "--vehicle is missing: params/vehicles holds examples"
if [[ ! -f $stack ]]; then stack=$root/params/stacks/$stack.yaml; fi
for file in "$vehicle" "$stack" "$params"; do [[ -f $file ]] || fail "no file '$file'"; done
if [[ -n $drive && ! -f $drive ]]; then fail "no file '$drive'"; fi
if [[ -n $bag && ! -e $bag ]]; then fail "no bag '$bag'"; fi

# A stack's file maps the suite's topic names to the car's: `odom: /car_state/odom`. What it maps signal by signal, telemetry reads itself.
# In a namespace the stack's topics are relative to it.
slash=/
if [[ -n $space ]]; then slash=''; fi
remaps() {
    local name
    for name in "$@"; do
        sed -n -e "s|^$name: *{topic: */\([^ ,}]*\).*|-r\n$name:=$slash\1|p" -e "s|^$name: */\([^ #]*\).*|-r\n$name:=$slash\1|p" "$stack"
    done
}
# Every topic of the stack's file, moved into the namespace.
moved() {
    if [[ -n $space ]]; then
        sed -n -e 's|.*topic: */\([^ ,}]*\).*|-r\n/\1:=\1|p' -e 's|^[^:#]*: */\([^ #]*\).*|-r\n/\1:=\1|p' "$stack"
    fi
}

nodes=(telemetry s4_residual identifier)
if $camera || [[ -n $prior ]]; then nodes+=(camera_prior); fi
if $gap; then nodes+=(gap_diagnosis); fi
if [[ -n $drive ]]; then nodes+=(driver); fi
if [[ -n $bag ]]; then nodes+=(bag_player); fi
# What is missing is told before anything has started.
for node in "${nodes[@]}"; do
    [[ -x $bin/$node ]] || fail "no binary '$bin/$node': build it with cargo build --release" 1
done

pids=()
declare -A name_of
prefix=()
# Where the shell itself is killed its nodes end, too.
if command -v setpriv >/dev/null; then prefix=(setpriv --pdeathsig TERM); fi
spawn() {
    local node=$1
    shift
    "${prefix[@]}" "$@" &
    pids+=($!)
    name_of[$!]=$node
}
priority=()
defaults=()
below=()
if [[ -n $space ]]; then below=(-r "__ns:=/$space"); fi
start() {
    local node=$1
    shift
    spawn "$node" "${priority[@]}" "$bin/$node" --ros-args "${defaults[@]}" --params-file "$params" --params-file "$vehicle" "${below[@]}" "$@"
}
# A node ends within two seconds of the signal; what is stopped (SIGSTOP) takes none, and is killed.
# shellcheck disable=SC2329
stop() {
    local pid tries
    trap - EXIT
    trap '' INT TERM
    for pid in "${pids[@]}"; do kill -TERM "$pid" 2>/dev/null || true; done
    for ((tries = 0; tries < 25; tries++)); do
        [[ -n $(jobs -rp) ]] || break
        sleep 0.1
    done
    for pid in $(jobs -p); do kill -KILL "$pid" 2>/dev/null || true; done
    wait 2>/dev/null || true
}
trap stop EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# Waits until the process $1 ends; the end of any other ends the suite.
wait_for() {
    local ended status
    while true; do
        status=0
        wait -n -p ended "${pids[@]}" || status=$?
        if [[ $ended == "$1" ]]; then return "$status"; fi
        fail "${name_of[$ended]} ended (exit code $status): the suite stops" 1
    done
}

replay=()
if [[ -n $bag ]]; then replay=(-p reliable_inputs:=true -p use_sim_time:=true); fi
mapfile -t car < <(remaps odom drive imu wheels)
mapfile -t motion < <(remaps odom drive)
mapfile -t eyes < <(remaps odom image image/compressed)
mapfile -t all < <(moved)

start telemetry "${car[@]}" "${all[@]}" -p "topics_file:=$stack" "${replay[@]}"
start s4_residual "${motion[@]}" -r sequence:=telemetry/sequence -r candidate:=identifier/candidate "${replay[@]}"
start identifier "${motion[@]}" -r sequence:=telemetry/sequence -r model:=s4_residual/model -r friction:=camera_prior/friction "${replay[@]}"
if $camera; then
    defaults=(--params-file "$root/params/camera_prior.yaml")
    start camera_prior "${eyes[@]}" -r pacejka:=identifier/pacejka "${replay[@]}"
    defaults=()
elif [[ -n $prior ]]; then
    start camera_prior -p input:=none -p "configured_mu:=$prior" "${replay[@]}"
fi
if $gap; then
    # The diagnosis never stands in the way of the other nodes.
    priority=(nice -n 10)
    start gap_diagnosis -r sequence:=telemetry/sequence -r posterior:=identifier/posterior "${replay[@]}"
fi
if [[ -n $drive ]]; then
    # The car waits for nobody.
    priority=()
    start driver --params-file "$drive" "${motion[@]}" -r pacejka:=identifier/pacejka -r grip:=identifier/grip -r progress:=identifier/progress -r extended_model:=gap_diagnosis/extended_model
fi
if [[ -z $bag ]]; then
    wait_for none
else
    spawn bag_player "$bin/bag_player" --ros-args "${below[@]}" "${all[@]}" -p "bag:=$bag" -p "rate:=$rate"
    player=${pids[-1]}
    wait_for "$player" || fail "the bag was not played to its end" 1
    unset 'pids[-1]'
    spawn linger sleep "$linger"
    wait_for "${pids[-1]}"
fi
