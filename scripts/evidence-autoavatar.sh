#!/usr/bin/env bash
# AutoAvatar's evidence: the paper's tables with our figures, as docs/evidence/autoavatar.md.
#
#   scripts/evidence-autoavatar.sh                    the default size, about two hours on two cores
#   scripts/evidence-autoavatar.sh --check            runs nothing, says whether everything is there
#   SIZE=smoke OUT=DIR scripts/evidence-autoavatar.sh a reduced form that proves the wiring; no figure of it is quoted
#
#   fitted         all four networks on fitted poses (table 1)
#   rough          the method and pose alone on rough poses (table B)
#   closest-point  the same with one neighbour instead of several
#   softsmpl       SoftSMPL on the same scans, registered (fig. 7)
#
# It can be stopped at any time and started again: finished runs are kept, a stopped training is resumed, and all rows are
# judged once, in one table.
#
# SOFTTISSUE names a program built before. CONFIG is the configuration (configs/SIZE.toml, quick by default), RUNS and DATA
# are where runs and scans lie (in target/evidence), OUT is for what is written (docs/evidence). INTERPOLATION is the motion
# that training sees the first half of, NETWORKS are those of the first run, and SET holds further settings, separated by
# spaces: SET="autoavatar.teacher.steps=6000 autoavatar.grid=128".
set -euo pipefail
cd "$(dirname "$0")/.."
size=${SIZE:-quick}
config=${CONFIG:-configs/$size.toml}
out=${OUT:-docs/evidence}
runs=${RUNS:-target/evidence/autoavatar-$size}
data=${DATA:-target/evidence/data}
case $size in smoke | tiny) interpolation=punching ;; *) interpolation=chicken_wings ;; esac
interpolation=${INTERPOLATION:-$interpolation}
read -ra networks <<< "${NETWORKS:-autoregressive pose pose-tcn pose-differences}"
read -ra more <<< "${SET:-}"
softtissue=${SOFTTISSUE:-target/release/softtissue}
names=(fitted rough closest-point softsmpl)

only_check=false
case ${1:-} in
    --check) only_check=true ;;
    "") ;;
    *) echo "usage: $0 [--check]; what else can be said is in its first lines" >&2; exit 2 ;;
esac
fail() { echo "evidence: $1" >&2; exit 1; }
# list WORD...: as a list of the settings.
list() { local IFS=,; local quoted=("${@/#/\"}"); echo "[${quoted[*]/%/\"}]"; }
# train NAME [options]: a run, once; resumed where it was stopped.
train() {
    local name=$1 run=$runs/$1 sets=() set begun=$SECONDS
    shift
    if [ -e "$run/finished" ]; then return; fi
    for set in ${more[@]+"${more[@]}"}; do sets+=(--set "$set"); done
    if [ -e "$run/config.toml" ]; then
        "$softtissue" train --out "$run" --resume --no-eval
    else
        "$softtissue" train --config "$config" --out "$run" --data-dir "$data" --no-eval \
            --set "autoavatar.interpolation=$(list "$interpolation")" ${sets[@]+"${sets[@]}"} "$@"
    fi
    touch "$run/finished"
    echo "trained $name in $((SECONDS - begun)) s"
}
# What raw scans are made of is the avatar's setting, and SoftSMPL has to learn from the same ones.
raw_points() { sed -n '/^\[synth.scanner\]/,/^\[/s/^raw_points = //p' "$runs/fitted/config.toml"; }

run_all() {
    local avatar=(--set method=autoavatar) both
    both=(--set "autoavatar.networks=$(list autoregressive pose)")
    train fitted "${avatar[@]}" --set "autoavatar.networks=$(list "${networks[@]}")"
    train rough "${avatar[@]}" "${both[@]}" --set autoavatar.poses=rough
    train closest-point "${avatar[@]}" "${both[@]}" --set autoavatar.network.neighbours=1
    train softsmpl --set method=softsmpl --set "synth.scanner.raw_points=$(raw_points)" --set eval.compare_objectives=false
    # Tables that are older than a run are not of it.
    local others=() name fresh=true
    for name in "${names[@]}"; do
        [ "$out/autoavatar.txt" -nt "$runs/$name/finished" ] || fresh=false
    done
    if $fresh; then return; fi
    local measures=$runs/fitted/comparison
    for name in "${names[@]:1}"; do others+=(--against "$runs/$name"); done
    "$softtissue" eval "$runs/fitted" "${others[@]}" --quiet > "$out/autoavatar.txt.part"
    cp "$measures/autoavatar.json" "$measures/autoavatar.png" "$out"
    mkdir -p "$out/report"
    cp "$measures/report/index.html" "$out/report/autoavatar.html"
    sed -i '/^\(measures\|report\|picture\)   /d' "$out/autoavatar.txt.part"
    mv "$out/autoavatar.txt.part" "$out/autoavatar.txt"
}

# tables ROWS: the text with the rows whose names match alone.
tables() {
    awk -v wanted="^($1)\$" '
        # a row is a name and figures; everything else is a title or a head
        NF > 1 && $NF ~ /^(-|[0-9.]+)$/ && $1 !~ /^(after|method)$/ && $1 !~ /,$/ { if ($1 ~ wanted) print; next }
        { print }' "$out/autoavatar.txt"
}
# reading RUN: seconds that raw scans took, the last time.
reading() {
    awk -F '"seconds":' '/"name":"scans of the avatar"/ { s = $2 + 0 } END { printf "%.0f\n", s }' "$runs/$1/log.jsonl"
}
# training RUN: seconds from step to step, however often it was stopped.
training() {
    awk '/"step":/ && /"stage":"autoavatar\// {
        match($0, /"elapsed_s":[0-9.]+/); now = substr($0, RSTART + 12, RLENGTH - 12) + 0
        match($0, /"stage":"[^"]*"/); stage = substr($0, RSTART, RLENGTH)
        if (stage == last && now > before) sum += now - before
        last = stage; before = now }
        END { printf "%.0f\n", sum }' "$runs/$1/log.jsonl"
}
# What the first run was started with: people, motions, split and avatar.
settings() {
    awk '/^\[/ { section = $0; avatar = /^\[autoavatar/ } avatar { print; next }
        section == "[synth]" && /^(bmi|takes|frames|level|motions) = / || section == "[split]" && / = / {
            if (section != last) print section; last = section; print }' "$runs/fitted/config.toml"
}

page() {
    local run count
    echo "# AutoAvatar"
    echo
    echo "Made by \`${SET:+SET=\"$SET\" }scripts/evidence-autoavatar.sh\`, size \`$size\`. The person who is learned, the motion that is interpolated"
    echo "(its second half is left out) and the motions that are extrapolated are in the settings below; what the figures mean is"
    echo "in [autoavatar.md](../autoavatar.md#measures). \`standing-still\` keeps the last true heights. Lower is better but for"
    echo "energy, where 1 is right. The same as [text](autoavatar.txt), [JSON](autoavatar.json) and [page](report/autoavatar.html)."
    echo
    echo "## The paper's table 1"
    echo
    echo '```'
    tables "standing-still|$(IFS='|'; echo "${networks[*]}")"
    echo '```'
    echo
    echo "## Fitted and rough poses (the paper's table B)"
    echo
    echo "Each avatar is driven, and its surfaces are judged, with the poses that it was learned on."
    echo
    echo '```'
    tables "pose|autoregressive|rough/pose|rough/autoregressive" | without_motion
    echo '```'
    echo
    echo "## Nearest neighbours and the closest point"
    echo
    echo '```'
    tables "pose|autoregressive|closest-point/pose|closest-point/autoregressive" | without_motion
    echo '```'
    echo
    echo "## SoftSMPL on the same scans (the paper's fig. 7)"
    echo
    echo "SoftSMPL learns the scans registered and is rolled out from the clip's first frame, never started again; its surface is"
    echo "the body with the person's static detail and its displacements. \`body\` is the same without displacements."
    echo
    echo '```'
    tables "standing-still|body|pose|autoregressive|softsmpl"
    echo '```'
    echo
    echo "## What it looks like"
    echo
    echo "![scan, AutoAvatar, pose alone and truth](autoavatar.png)"
    echo
    echo "From the top: the scan's heights, AutoAvatar, pose alone (red: 2 cm and more from the scan), and the true surface; one"
    echo "rollout through a motion that training has not seen. Surfaces are drawn as the body's mesh moved by their heights."
    echo
    echo "## Time"
    echo
    echo "| run | networks | training, s | reading raw scans, s |"
    echo "|---|---|---|---|"
    for run in fitted rough closest-point; do
        count=$(awk -F '"' '/^networks = / { n = gsub(/"/, "\"") / 2; print n; exit }' "$runs/$run/config.toml")
        echo "| $run | $count | $(training "$run") | $(reading "$run") |"
    done
    echo
    echo "The time of a frame is in the last table above: with the surface drawn and measured, and, in a long rollout, with its"
    echo "heights alone."
    echo
    echo "## Settings"
    echo
    echo '```'
    settings
    echo '```'
    echo
    echo "## What differs from the paper, and why"
    awk '/^## / { on = /^## What differs from the paper/; next } on' docs/autoavatar.md
}
# Table 1 alone.
without_motion() { awk '/^How heights move/ { exit } { print }'; }

check() {
    local row
    for row in standing-still body softsmpl "${networks[@]}" rough/autoregressive closest-point/autoregressive; do
        grep -q "^$row  " "$out/autoavatar.txt" || fail "$out/autoavatar.txt has no row of $row"
        grep -q "\"$row\": {" "$out/autoavatar.json" || fail "$out/autoavatar.json has no figures of $row"
        grep -q "^$row  " "$out/autoavatar.md" || fail "$out/autoavatar.md has no row of $row"
    done
    for row in autoavatar.png report/autoavatar.html; do [ -s "$out/$row" ] || fail "there is no $out/$row"; done
    grep -q "^| .* | .* | .* |" "$out/autoavatar.md" || fail "$out/autoavatar.md has no table"
}

if ! $only_check; then
    mkdir -p "$out" "$runs"
    [ -n "${SOFTTISSUE:-}" ] || cargo build --quiet --release
    run_all
    page > "$out/autoavatar.md.part"
    mv "$out/autoavatar.md.part" "$out/autoavatar.md"
fi
check
echo "evidence: $out/autoavatar.md"
