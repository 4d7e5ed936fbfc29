#!/usr/bin/env bash
# The blind check at full size: makes sealed cases, diagnoses them, opens the labels, scores.
# Usage: launch_scripts/blind_check.sh OUT [CASES]
# Called again it goes on where it stopped. FOREIGN=DIR and RECORDED=DIR name drives of other plants and recorded bags; for the
# former, once:
#   python3 -m venv .venv-plants && .venv-plants/bin/pip install -r nodes/lib/reference_car/compare/requirements.txt
#   .venv-plants/bin/python tests/plants/make_foreign_bags.py out/foreign --draw 12 --seed "$RANDOM"
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:?usage: launch_scripts/blind_check.sh OUT [CASES]}
cases=${2:-600}

cargo build --release --locked -p gripsight
gripsight=${CARGO_TARGET_DIR:-target}/release/gripsight
mkdir -p "$out"
if [ ! -e "$out/cases/commitment.txt" ]; then
    more=()
    if [ -n "${FOREIGN:-}" ]; then more+=(--foreign "$FOREIGN" --foreign-cases $((cases / 6))); fi
    if [ -n "${RECORDED:-}" ]; then more+=(--recorded "$RECORDED" --recorded-cases $((cases / 12))); fi
    "$gripsight" withheld make --cases "$cases" --duration 16 "${more[@]}" --out "$out/cases" --labels "$out/labels.json"
fi
"$gripsight" withheld diagnose "$out/cases" --out "$out/verdicts"
"$gripsight" withheld score "$out/cases" "$out/verdicts" --labels "$out/labels.json" --out "$out/report"
