#!/usr/bin/env bash
# Logs for Rerun: the crate's tests, then a run or clip logged by the program and verified by Rerun's own.
# usage: scripts/validate-rerun.sh RUN_OR_CLIP
# Not a part of .ci/run, which compiles the feature: a hundred crates stand behind it.
set -euo pipefail
viewed=$(realpath "$1")
cd "$(dirname "$0")/.."
cargo test --package softtissue-rerun --features log
cargo build --release --features rerun
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/python"
"$work/python/bin/pip" install --quiet --disable-pip-version-check rerun-sdk==0.36.3
rerun() { "$work/python/bin/rerun" "$@" 2>&1; }
rerun analytics disable > "$work/analytics" || true

target/release/softtissue view "$viewed" --viz "$work/run.rrd"
rerun rrd verify "$work/run.rrd"
rerun rrd print "$work/run.rrd" > "$work/printed"
for what in Mesh3D:vertex_positions Mesh3D:triangle_indices Mesh3D:vertex_colors Scalars:scalars; do
    grep -q "$what" "$work/printed" || { echo "the log has no $what" >&2; exit 1; }
done
echo "$(grep -c '^Chunk' "$work/printed") chunks, verified"
