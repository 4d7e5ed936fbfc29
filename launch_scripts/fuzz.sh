#!/usr/bin/env bash
# Coverage-guided fuzzing of everything that reads what others wrote: bags, messages, types' texts, YAML files, pictures (cargo-fuzz, libFuzzer).
# Needs a nightly compiler and cargo-fuzz: rustup toolchain install nightly && cargo install cargo-fuzz
# Usage: launch_scripts/fuzz.sh [SECONDS_PER_TARGET] [TARGET ...]
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
shift || true
targets=("$@")
[[ ${#targets[@]} -gt 0 ]] || mapfile -t targets < <(cd tests/fuzz && ls fuzz_targets/*.rs | xargs -n 1 basename -s .rs | grep -v '^common$')
cargo fuzz --version >/dev/null 2>&1 || { echo "no cargo-fuzz here: cargo install cargo-fuzz" >&2; exit 2; }

# What the mutations begin with, beside what earlier runs found (tests/fuzz/corpus).
seed() {
    mkdir -p "tests/fuzz/corpus/$1"
    cp "$2" "tests/fuzz/corpus/$1/$(basename "$2")"
}
for stack in params/stacks/*.yaml params/*.yaml; do seed yaml "$stack"; done
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cargo build --locked --release --bin gripsight
"${CARGO_TARGET_DIR:-target}/release/gripsight" simulate --duration 2 --seed 1 --out "$scratch/drive.mcap" >/dev/null
seed bag_mcap "$scratch/drive.mcap"
.venv/bin/python tests/fuzz/seeds.py "$scratch/drive.mcap" tests/fuzz/corpus

failed=0
for target in "${targets[@]}"; do
    echo "== $target"
    cargo +nightly fuzz run --fuzz-dir tests/fuzz "$target" -- -max_total_time="$seconds" -timeout=20 -rss_limit_mb=2048 \
        -max_len=200000 -print_final_stats=1 >"$scratch/log" 2>&1 || failed=1
    grep -aE 'stat::number_of_exec|stat::peak|ERROR|panicked|SUMMARY|^error' "$scratch/log" || true
done
exit "$failed"
