#!/usr/bin/env bash
# Latency from a sample to its live residual at 200 Hz, and from SIGINT to the end, seen by a peer on CycloneDDS or
# Fast DDS. Needs a tree that is set up for the tests (launch_scripts/setup.sh --tests).
# Usage: launch_scripts/latency.sh [--peer cyclonedds|fastdds] [--seconds S] [--hz HZ] [--ends N] [--bin FOLDER]
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${CARGO_TARGET_DIR:-target}/release
if [[ " $* " != *" --bin "* && " $* " != *" --help "* ]]; then
    packages=(gripsight gripsight_telemetry gripsight_s4_residual gripsight_identifier)
    cargo build --locked --release "${packages[@]/#/-p}"
    set -- "$@" --bin "$folder"
else
    for ((i = 1; i < $#; i++)); do if [[ ${!i} == --bin ]]; then j=$((i + 1)) && folder=${!j}; fi; done
fi
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"$folder/gripsight" simulate --realistic --pace 0.9 --duration 62 --seed 21 --out "$scratch/drive.mcap" >/dev/null
ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-92} ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST .venv/bin/python tests/peers/measure_latency.py "$scratch/drive.mcap" "$@"
