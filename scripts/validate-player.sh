#!/usr/bin/env bash
# Builds the Python wheel and holds it against bundles' self-checks, and the exported networks in ONNX Runtime against the
# player.
# usage: scripts/validate-player.sh [--speed] BUNDLE...         SOFTTISSUE names the program (target/debug/softtissue)
#
# --speed times a frame beside ONNX Runtime as well.
set -euo pipefail
speed=false
if [ "$1" = --speed ]; then speed=true; shift; fi
here=$(dirname "$(realpath "$0")")
softtissue=$(realpath "${SOFTTISSUE:-target/debug/softtissue}")

# In CI everything must be there; elsewhere a missing tool is no fault.
skip() {
    echo "skipped: needs $1"
    [ "${CI:-}" = true ] && exit 1
    exit 0
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/python" || skip "Python with venv"
pip() { "$work/python/bin/pip" install --quiet --disable-pip-version-check "$@" || skip "$* from the package index"; }
pip maturin==1.16.0 numpy==2.3.5 onnx==1.23.2 onnxruntime==1.32.0
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$here/../target}/python
"$work/python/bin/maturin" build --release --locked --quiet --manifest-path "$here/../integrations/python/Cargo.toml" \
    --interpreter "$work/python/bin/python" --out "$work/wheel"
pip --no-deps "$work"/wheel/*.whl
for bundle in "$@"; do
    "$softtissue" export "$bundle" --shape 0.3,-2 --onnx "$work/fused.onnx" --plain-onnx "$work/plain.onnx"
    "$work/python/bin/python" "$here/../integrations/python/tests/check.py" "$bundle" "$work/fused.onnx" "$work/plain.onnx"
    if $speed; then
        "$work/python/bin/python" "$here/../integrations/python/tests/speed.py" "$bundle" "$work/fused.onnx"
    fi
done
