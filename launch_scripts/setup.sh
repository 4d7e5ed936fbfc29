#!/usr/bin/env bash
# Installs what gripsight needs on a Debian or Ubuntu machine that has a Rust toolchain. Safe to run again.
set -euo pipefail

usage() {
    cat <<'TEXT'
Usage: launch_scripts/setup.sh [--tests] [--dry-run]

Sets up, inside the project's folder as far as possible:
  system packages   launch_scripts/apt_packages.txt; without root they are unpacked into .deps/system
  ONNX Runtime      .deps/onnxruntime, from a pinned and hash-checked wheel (for the camera prior)
  Python tools      .venv; with --tests the DDS peers and bag readers of tests/requirements.txt

  --tests     also what the tests need
  --dry-run   say what would be done, do nothing

Examples:
  launch_scripts/setup.sh              to run gripsight
  launch_scripts/setup.sh --tests      to run its tests too
TEXT
}

cd "$(dirname "$0")/.."
with_tests=false
dry_run=false
for argument in "$@"; do
    case $argument in
        --tests) with_tests=true ;;
        --dry-run) dry_run=true ;;
        -h | --help) usage; exit 0 ;;
        *) echo "setup: unknown option '$argument'" >&2; usage >&2; exit 2 ;;
    esac
done

say() { printf 'setup: %s\n' "$*" >&2; }
run() { if $dry_run; then say "would run: $*"; else "$@"; fi; }

command -v cargo >/dev/null || { say "no Rust toolchain: install cargo with rustup, then run this again"; exit 1; }

if [[ $(uname -m) == x86_64 && -z ${RUSTFLAGS:-} ]] && ! grep -qw avx2 /proc/cpuinfo; then
    say "this processor has no AVX2, which .cargo/config.toml builds for: export RUSTFLAGS='-C target-cpu=x86-64', then run this again"
    exit 1
fi

# --- system packages -------------------------------------------------------------------------------------------------
# A line of the list: package name, then `tests` where only the tests need it.
wanted=()
while read -r name purpose _; do
    if [[ -z $name || $name == \#* ]]; then continue; fi
    if [[ $purpose != tests ]] || $with_tests; then wanted+=("$name"); fi
done < launch_scripts/apt_packages.txt

installed() { [[ $(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null) == installed ]]; }
missing=()
for package in "${wanted[@]}"; do installed "$package" || missing+=("$package"); done

unpack_without_root() {
    # What apt would install, dependencies included, unpacked where nothing else is touched.
    local all
    all=$(apt-get install --simulate -qq "${missing[@]}" | awk '/^Inst/ {print $2}')
    say "no root: unpacking into .deps/system: $(tr '\n' ' ' <<<"$all")"
    if $dry_run; then return; fi
    mkdir -p .deps/debs .deps/system
    # shellcheck disable=SC2086
    (cd .deps/debs && apt-get download -qq $all)
    for package in .deps/debs/*.deb; do dpkg -x "$package" .deps/system; done
    printf '%s\n' "${missing[@]}" > .deps/system/unpacked.txt
}

if ((${#missing[@]} == 0)); then
    say "system packages: all there"
elif ! command -v apt-get >/dev/null; then
    say "not a Debian or Ubuntu machine: install these yourself: ${missing[*]}"
elif ((EUID == 0)) || sudo -n true 2>/dev/null; then
    sudo=(); if ((EUID != 0)); then sudo=(sudo -n); fi
    say "installing system packages: ${missing[*]}"
    run "${sudo[@]}" apt-get update -qq
    run "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >&2
elif [[ -f .deps/system/unpacked.txt ]] && diff -q <(printf '%s\n' "${missing[@]}") .deps/system/unpacked.txt >/dev/null; then
    say "system packages: unpacked in .deps/system"
else
    unpack_without_root
fi

# --- Python tools ----------------------------------------------------------------------------------------------------
python=${PYTHON:-python3}
make_venv() {
    if [[ -x .venv/bin/pip ]]; then return; fi
    rm -rf .venv
    if "$python" -m venv .venv >/dev/null 2>&1; then return; fi
    # Without root python3-venv is only unpacked: its wheel of pip fills an environment made without.
    local wheel
    wheel=$(compgen -G '.deps/system/usr/share/python-wheels/pip-*.whl' | tail -n 1) || true
    if [[ -z $wheel ]]; then say "'$python -m venv' failed: install python3-venv"; exit 1; fi
    "$python" -m venv --without-pip .venv
    .venv/bin/python "$wheel/pip" install -q --disable-pip-version-check pip >&2
}
if $dry_run; then
    say "would make .venv, with tests/requirements.txt for the tests, and run launch_scripts/fetch_onnxruntime.sh"
    exit 0
fi
make_venv
if $with_tests && ! diff -q tests/requirements.txt .venv/requirements.txt >/dev/null 2>&1; then
    say "installing the tests' Python tools into .venv"
    .venv/bin/python -m pip install -q --disable-pip-version-check -r tests/requirements.txt >&2
    cp tests/requirements.txt .venv/requirements.txt
fi

# --- ONNX Runtime ----------------------------------------------------------------------------------------------------
PYTHON=.venv/bin/python launch_scripts/fetch_onnxruntime.sh >&2
say "done"
