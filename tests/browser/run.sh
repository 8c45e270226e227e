#!/usr/bin/env bash
# Opens a report in headless Chromium and uses it. Without an argument it makes a sample report first.
# usage: tests/browser/run.sh [REPORT.html]
set -euo pipefail
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
report=${1:-}
if [ -z "$report" ]; then
    report=$(cargo run --quiet -p softtissue-eval --example report_sample -- "$work/sample" | tail -1)
fi
node tests/browser/report.mjs "$report" "$work" "$browser"
