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
  --gap             diagnose the gap too (node gap_diagnosis)
  --bin FOLDER      where the nodes' binaries are                                      [target/release]
  -h, --help        this text

Results arrive on /identifier/pacejka. Ctrl-C stops every node.
The environment counts as for any ROS 2 node: ROS_DOMAIN_ID, ROS_LOCALHOST_ONLY, ROS_AUTOMATIC_DISCOVERY_RANGE.

Examples:
  launch_scripts/run_suite.sh --vehicle params/vehicles/f1tenth.yaml --stack f1tenth
  launch_scripts/run_suite.sh --vehicle bags/demo_f1tenth.vehicle.yaml --bag bags/demo_f1tenth.mcap --rate 10
TEXT
}

root=$(cd "$(dirname "$0")/.." && pwd)
vehicle='' stack=gripsight params=$root/params/suite.yaml bag='' rate=1.0 linger=20 prior='' camera=false gap=false
bin=$root/target/release
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
        --bin) bin=$2 ;;
        *) fail "unknown option '$1' (see --help)" ;;
    esac
    shift 2
done
[[ -n $vehicle ]] || fail "--vehicle is missing: params/vehicles holds examples"
if [[ ! -f $stack ]]; then stack=$root/params/stacks/$stack.yaml; fi
for file in "$vehicle" "$stack" "$params"; do [[ -f $file ]] || fail "no file '$file'"; done
if [[ -n $bag && ! -e $bag ]]; then fail "no bag '$bag'"; fi

# A stack's file maps the suite's topic names to the car's: `odom: /car_state/odom`. What it maps signal by signal, telemetry reads itself.
remaps() {
    local name
    for name in "$@"; do
        sed -n -e "s|^$name: *{topic: *\([^ ,}]*\).*|-r\n$name:=\1|p" -e "s|^$name: *\(/[^ #]*\).*|-r\n$name:=\1|p" "$stack"
    done
}

pids=()
priority=()
defaults=()
start() {
    local node=$1
    shift
    [[ -x $bin/$node ]] || fail "no binary '$bin/$node': build it with cargo build --release" 1
    "${priority[@]}" "$bin/$node" --ros-args "${defaults[@]}" --params-file "$params" --params-file "$vehicle" "$@" &
    pids+=($!)
}
# shellcheck disable=SC2329
stop() {
    trap - EXIT INT TERM
    if ((${#pids[@]})); then
        kill -INT "${pids[@]}" 2>/dev/null || true
        wait "${pids[@]}" 2>/dev/null || true
    fi
}
trap stop EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

replay=()
if [[ -n $bag ]]; then replay=(-p reliable_inputs:=true -p use_sim_time:=true); fi
mapfile -t car < <(remaps odom drive imu wheels)
mapfile -t motion < <(remaps odom drive)
mapfile -t eyes < <(remaps odom image image/compressed)

start telemetry "${car[@]}" -p "topics_file:=$stack" "${replay[@]}"
start s4_residual "${motion[@]}" -r sequence:=telemetry/sequence -r candidate:=identifier/candidate "${replay[@]}"
start identifier "${motion[@]}" -r sequence:=telemetry/sequence -r model:=s4_residual/model -r friction:=camera_prior/friction "${replay[@]}"
if $camera; then
    defaults=(--params-file "$root/params/camera_prior.yaml")
    start camera_prior "${eyes[@]}" "${replay[@]}"
    defaults=()
elif [[ -n $prior ]]; then
    start camera_prior -p input:=none -p "configured_mu:=$prior" "${replay[@]}"
fi
if $gap; then
    # The diagnosis never stands in the way of the other nodes.
    priority=(nice -n 10)
    start gap_diagnosis -r sequence:=telemetry/sequence -r pacejka:=identifier/pacejka "${replay[@]}"
fi
if [[ -z $bag ]]; then
    wait -n "${pids[@]}" || fail "a node ended: the suite stops" 1
else
    "$bin/bag_player" --ros-args -p "bag:=$bag" -p "rate:=$rate" &
    player=$!
    pids+=("$player")
    wait "$player"
    sleep "$linger"
fi
