#!/usr/bin/env bash
# The loop closed live: ten runs over topics at real time, two cars, five variants, with processor and memory of the nodes, beside the same laps in
# process. 30 minutes. Needs a set-up tree.
# Usage: launch_scripts/closed_loop_live.sh OUT [--cars NAMES] [--variants NAMES] [--track NAME] [--mu MU] [--laps N] [--bin FOLDER]
set -euo pipefail
cd "$(dirname "$0")/.."
if [[ " $* " != *" --bin "* && " $* " != *" --help "* ]]; then
    cargo build --locked --release --workspace --bins
    set -- "$@" --bin "${CARGO_TARGET_DIR:-target}/release"
fi
ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-94} ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST exec setsid --wait .venv/bin/python tests/peers/closed_loop_live.py "$@"
