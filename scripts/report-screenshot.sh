#!/usr/bin/env bash
# A picture of a report, as Chromium draws it.
# usage: scripts/report-screenshot.sh REPORT.html OUT.png [WIDTHxHEIGHT]
set -euo pipefail
report=$(realpath "$1") out=$(realpath -m "$2") size=${3:-1280x1150}
browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome) || {
    echo "skipped: needs chromium"
    exit 0
}
"$browser" --headless --no-sandbox --hide-scrollbars --use-angle=swiftshader --enable-unsafe-swiftshader \
    --window-size="${size/x/,}" --virtual-time-budget=4000 --screenshot="$out" "file://$report" 2>/dev/null
echo "$out"
