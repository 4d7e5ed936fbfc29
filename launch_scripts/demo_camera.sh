#!/usr/bin/env bash
# The warm start at work: one drive of the reference car through the suite's nodes, first without its camera, then with it.
set -euo pipefail
cd "$(dirname "$0")/.."

usage() {
    cat <<'TEXT'
Usage: launch_scripts/demo_camera.sh [--out FOLDER] [--bin FOLDER] [--mu MU] [--seed N]

Drives the reference car (gripsight simulate --camera), plays the bag to the nodes twice, and prints what the identifier
says of every sequence: from its own start, D = 0.51, and from the camera's prior.

  --out FOLDER     bag, logs and runs.csv   [out/demo_camera]
  --bin FOLDER     the built binaries       [target/release]
TEXT
}

out=out/demo_camera bin=target/release mu=0.85 seed=61
while (($#)); do
    case $1 in
        --out) out=$2 ;;
        --bin) bin=$2 ;;
        --mu) mu=$2 ;;
        --seed) seed=$2 ;;
        -h | --help) usage; exit 0 ;;
        *) echo "demo_camera: unknown option '$1'" >&2; usage >&2; exit 2 ;;
    esac
    shift 2
done
if [[ ! -x $bin/identifier ]]; then
    echo "demo_camera: no nodes in $bin; build them: cargo build --release --workspace --bins" >&2
    exit 1
fi
mkdir -p "$out"
"$bin/gripsight" simulate --mu "$mu" --pace 0.9 --duration 31 --camera 5 --seed "$seed" --out "$out/drive.mcap"
# The reference car's pictures show nothing but road: the region is all of them.
cp params/suite.yaml "$out/params.yaml"
printf '\ncamera_prior:\n  ros__parameters:\n    region: [0.0, 0.0, 1.0, 1.0]\n' >> "$out/params.yaml"

echo "camera,sequence,result,iterations,peak_friction_front,peak_friction_rear,reasons" > "$out/runs.csv"
for camera in without with; do
    option=()
    if [[ $camera == with ]]; then option=(--camera); fi
    launch_scripts/run_suite.sh --vehicle "$out/drive.vehicle.yaml" --bag "$out/drive.mcap" --params "$out/params.yaml" \
        --bin "$bin" "${option[@]}" 2> "$out/$camera.log" || { tail -n 5 "$out/$camera.log" >&2; exit 1; }
    sed -nE "s/.*sequence ([0-9]+): (accepted|rejected) after ([0-9]+) iterations; .* peak friction ([0-9.]+) \/ ([0-9.]+)(; (.*))?$/$camera,\1,\2,\3,\4,\5,\"\7\"/p" \
        "$out/$camera.log" >> "$out/runs.csv"
done
printf '\nTrue friction: %s\n' "$mu"
cat "$out/runs.csv"
