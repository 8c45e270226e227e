#!/usr/bin/env bash
# Opens the page of a bundle in headless Chromium and uses it.
# usage: tests/browser/page.sh BUNDLE [FOLDER_FOR_PICTURES]
# SOFTTISSUE names the program (target/debug/softtissue), built with `--features web`.
set -euo pipefail
bundle=$(realpath "$1") pictures=${2:-}
[ -z "$pictures" ] || { mkdir -p "$pictures" && pictures=$(realpath "$pictures"); }
cd "$(dirname "$0")/../.."
softtissue=$(realpath "${SOFTTISSUE:-target/debug/softtissue}")

# In CI everything must be there; elsewhere a missing browser is no fault.
skip() {
    echo "skipped: needs $1"
    [ "${CI:-}" = true ] && exit 1
    exit 0
}
browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome) || skip chromium
command -v node >/dev/null || skip node
command -v npm >/dev/null || skip npm

work=$(mktemp -d) server=
trap 'rm -rf "$work"; [ -z "$server" ] || kill "$server" 2>/dev/null || true' EXIT
(cd "$work" && npm install --silent --no-audit --no-fund --no-save playwright-core@1.65.1 >npm.log 2>&1) || {
    cat "$work/npm.log"
    skip "playwright-core from npm"
}
motions=(--motion synth:jumping_jacks --motion tests/data/motion/cmu_01_01.bvh)
"$softtissue" export "$bundle" --web "$work/page" "${motions[@]}"
"$softtissue" view "$bundle" "${motions[@]}" --port 0 --no-browser >"$work/said" &
server=$!
for _ in $(seq 300); do
    grep -qs http "$work/said" && break
    kill -0 "$server" || exit 1
    sleep 0.2
done
address=$(grep -o 'http://[0-9.:]*/' "$work/said")
node tests/browser/page.mjs "$address" "$work/page" tests/fixtures/motion/plain.bvh "$work" "$browser" "$pictures"
kill -INT "$server"
wait "$server" || { echo "view did not end in peace"; exit 1; }
server=
