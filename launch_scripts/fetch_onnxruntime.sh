#!/usr/bin/env bash
# Fetches the ONNX Runtime library (MIT, 24 MB) that the camera prior loads, into .deps/onnxruntime at the root of this
# tree, where the programs find it without any variable. Run it again at will: what is there and whole is kept.
#
#   launch_scripts/fetch_onnxruntime.sh [x86_64|aarch64]      needs a Python with pip ($PYTHON, else python3), sha256sum
set -euo pipefail

python=${PYTHON:-python3}

version=1.31.1
machine=${1:-$(uname -m)}
case "$machine" in
  x86_64) wheel_sha256=5752bd508126ae7c49894d3b9d2e83f0c3d487319246d04c444b393308d7ad7f ;;
  aarch64) wheel_sha256=da05378364c44d4407e463982d2bf8d5e4cfea873283757e48beeb41df97b7f3 ;;
  *) echo "expected x86_64 or aarch64, got $machine: build ONNX Runtime yourself and name it in onnxruntime_library" >&2; exit 1 ;;
esac

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
target="$root/.deps/onnxruntime"
library="$target/libonnxruntime.so.$version"
stamp="$target/SHA256SUMS.$machine"

if [ -f "$stamp" ] && (cd "$target" && sha256sum --check --status "$stamp"); then
  echo "ONNX Runtime $version for $machine is in $target"
  exit 0
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" -m pip download --quiet --no-deps --only-binary=:all: --python-version 3.11 \
  --platform "manylinux_2_28_$machine" --dest "$work" "onnxruntime==$version"
wheel=$(echo "$work"/onnxruntime-*.whl)
echo "$wheel_sha256  $wheel" | sha256sum --check --status || {
  echo "the wheel's hash is $(sha256sum "$wheel" | cut -d' ' -f1), expected $wheel_sha256: not installed" >&2
  exit 1
}
"$python" - "$wheel" "$work" <<'PYTHON'
import sys, zipfile
wheel, work = sys.argv[1:]
with zipfile.ZipFile(wheel) as archive:
    for name in archive.namelist():
        base = name.rsplit("/", 1)[-1]
        if base.startswith("libonnxruntime.so"):
            with open(f"{work}/{base}", "wb") as out:
                out.write(archive.read(name))
PYTHON
mkdir -p "$target"
mv "$work/libonnxruntime.so.$version" "$library"
ln -sf "libonnxruntime.so.$version" "$target/libonnxruntime.so"
(cd "$target" && rm -f SHA256SUMS.* && sha256sum "libonnxruntime.so.$version" > "$stamp")
echo "ONNX Runtime $version for $machine is in $target"
