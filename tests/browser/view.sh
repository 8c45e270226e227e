#!/usr/bin/env bash
# Opens a page of `softtissue view` in headless Chromium and uses it.
# usage: tests/browser/view.sh PAGE.html [FOLDER_FOR_PICTURES]
set -euo pipefail
page=$(realpath "$1") pictures=${2:-}
[ -z "$pictures" ] || { mkdir -p "$pictures" && pictures=$(realpath "$pictures"); }
cd "$(dirname "$0")/../.."

# In CI everything must be there; elsewhere a missing browser is no fault.
skip() {
    echo "skipped: needs $1"
    [ "${CI:-}" = true ] && exit 1
    exit 0
}
browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome) || skip chromium
command -v node >/dev/null || skip node
command -v npm >/dev/null || skip npm

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
(cd "$work" && npm install --silent --no-audit --no-fund --no-save playwright-core@1.65.1 >npm.log 2>&1) || {
    cat "$work/npm.log"
    skip "playwright-core from npm"
}
node tests/browser/view.mjs "$page" "$work" "$browser" "$pictures"
