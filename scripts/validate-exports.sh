#!/usr/bin/env bash
# Holds what `softtissue animate` writes against programs of others: glTF against the Khronos validator, USD against
# usd-core's, point caches against what Blender shows of them.
# usage: scripts/validate-exports.sh BUNDLE            SOFTTISSUE names the program (target/debug/softtissue)
set -euo pipefail
here=$(dirname "$(realpath "$0")")
softtissue=$(realpath "${SOFTTISSUE:-target/debug/softtissue}") bundle=$(realpath "$1")
USD=usd-core==26.11
BLENDER="bpy==5.0.1 numpy<2"

# In CI everything must be there; elsewhere a missing tool is no fault.
skip() {
    echo "skipped: needs $1"
    [ "${CI:-}" = true ] && exit 1
    exit 0
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/python" || skip "Python with venv"
cd "$work"
animate() { "$softtissue" animate --bundle "$bundle" --motion synth:one_leg_jump --frames 40 --shape=-2 --out "$1"; }
for out in jump.glb jump.gltf jump.usda jump.pc2 jump.mdd frames; do animate "$out"; done
"$here/validate-gltf.sh" jump.glb jump.gltf

"$work/python/bin/pip" install --quiet --disable-pip-version-check "$USD" || skip "$USD"
"$work/python/bin/python" "$here/validate-usd.py" jump.usda
# Blender's module is made for one version of Python alone.
if "$work/python/bin/pip" install --quiet --disable-pip-version-check $BLENDER 2>/dev/null; then
    for cache in jump.pc2 jump.mdd; do
        "$work/python/bin/python" "$here/../integrations/blender/check_import.py" "$cache" frames
    done
else
    echo "no Blender module for this Python: point caches were not shown in it"
fi
