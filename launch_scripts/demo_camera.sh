#!/usr/bin/env bash
# The warm start at work: drives of the reference car through the suite's nodes, first without its camera, then with it.
set -euo pipefail
cd "$(dirname "$0")/.."

usage() {
    cat <<'TEXT'
Usage: launch_scripts/demo_camera.sh [options]

Drives the reference car on roads whose pictures match their friction (gripsight simulate --camera), plays each bag to
the nodes twice, and records what they say: once from mu0 = 0.51, once from the camera's prior. Then prints a table of
the turns of the outer loop. Needs what launch_scripts/setup.sh --tests installs (a DDS peer records).

  --method METHOD     paper or robust                                              [paper]
  --window SECONDS    how much of the drive is identified from                     [9: the first acceleration]
  --epochs N           of training the residual network, each turn                    [10]
  --mu "MU..."        the roads' friction                                          [0.85 0.80 0.60]
  --seeds "N..."      drives on each; odd ones go round the other way              [101 102 103 104]
  --out FOLDER        bags, recordings, logs and runs.csv                          [out/demo_camera]
  --bin FOLDER        the built binaries                                           [target/release]
TEXT
}

method=paper window=9 epochs=10 mus='0.85 0.80 0.60' seeds='101 102 103 104' out=out/demo_camera bin=target/release
while (($#)); do
    case $1 in
        --method) method=$2 ;;
        --window) window=$2 ;;
        --epochs) epochs=$2 ;;
        --mu) mus=$2 ;;
        --seeds) seeds=$2 ;;
        --out) out=$2 ;;
        --bin) bin=$2 ;;
        -h | --help) usage; exit 0 ;;
        *) echo "demo_camera: unknown option '$1'" >&2; usage >&2; exit 2 ;;
    esac
    shift 2
done
if [[ ! -x $bin/identifier ]]; then
    echo "demo_camera: no nodes in $bin; build them: cargo build --release --workspace --bins" >&2
    exit 1
fi
python=.venv/bin/python
if [[ ! -x $python ]]; then
    echo "demo_camera: no $python; run launch_scripts/setup.sh --tests" >&2
    exit 1
fi
export ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-42}
mkdir -p "$out"
# The reference car's pictures show nothing but road, and are renders: the region is all of them, the network's error that on renders.
sed -E "s/^( *method:) .*/\1 $method/; s/^( *window_s:) .*/\1 $window.0/; s/^( *hop_s:) .*/\1 $window.0/; s/^( *first_s:) .*/\1 0.0/" params/suite.yaml > "$out/params.yaml"
printf '\ncamera_prior:\n  ros__parameters:\n    region: full\n    network_error: 0.1\n' >> "$out/params.yaml"
printf '\ns4_residual:\n  ros__parameters:\n    epochs: %d\n' "$epochs" >> "$out/params.yaml"

# One drive through the suite; the recorder ends with the first run of the identification.
play() {
    local drive=$1 recording=$2 suite status=0
    shift 2
    : > "$recording.ready"
    "$python" tests/peers/record.py "$recording.mcap" > "$recording.ready" &
    local recorder=$!
    until grep -q ready "$recording.ready"; do
        kill -0 "$recorder" 2>/dev/null || { echo "demo_camera: the recorder did not start" >&2; exit 1; }
        sleep 0.1
    done
    launch_scripts/run_suite.sh --vehicle "$drive.vehicle.yaml" --bag "$drive.mcap" --params "$out/params.yaml" \
        --bin "$bin" --linger 120 "$@" 2> "$recording.log" &
    suite=$!
    wait "$recorder" || status=$?
    kill -TERM "$suite" 2>/dev/null || true
    wait "$suite" || true
    if ((status)); then
        echo "demo_camera: no end of the run in $recording.mcap" >&2
        tail -n 5 "$recording.log" >&2
        exit 1
    fi
}

for mu in $mus; do
    for seed in $seeds; do
        drive=$out/mu${mu}_seed$seed reverse=()
        if ((seed % 2)); then reverse=(--reverse); fi
        "$bin/gripsight" simulate --mu "$mu" --realistic --pace 0.9 --duration "$((window + 1))" --camera 5 --seed "$seed" \
            "${reverse[@]}" --out "$drive.mcap" > "$drive.log" 2>&1
        play "$drive" "$drive.without"
        play "$drive" "$drive.with" --camera
        echo "mu $mu, seed $seed: recorded" >&2
    done
done
"$python" tests/results/camera_prior/warm_start.py rows "$out" > "$out/runs.csv"
"$python" tests/results/camera_prior/warm_start.py table "$out/runs.csv"
