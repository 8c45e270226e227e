#!/usr/bin/env bash
# Measures every acceptance figure that takes more than a test, with the commands that a user has:
#
#   scripts/acceptance.sh                 all parts, about an hour on two cores
#   scripts/acceptance.sh main fit        some of them
#   SEED=2 scripts/acceptance.sh main     the main job on other people
#
#   main    the main job at size quick from an empty cache: its time, and every figure of metrics.json
#   folds   the usual three folds of leave-one-sequence-out on the scans of main
#   fit     joint errors and deltas against truth: scanner on and off, clips that start in mid-motion
#   speed   frames a second of the fit at 6890 vertices, and the analytic fit against Adam
#   synth   the flesh: frequencies, amplitudes, volume, elements, steps, second law, milliseconds a frame
#   bench   what runs for every frame, beside a plain way to the same numbers
#
# What is printed is kept in target/acceptance/PART.txt. Stopping and resuming, agreement of backends and players,
# derivatives and bad input are tests: cargo test --workspace, .ci/run.
set -euo pipefail
cd "$(dirname "$0")/.."
out=target/acceptance
seed=${SEED:-1}
softtissue=(cargo run --quiet --release --)

main() {
    rm -rf "$out/run" "$out/data"
    "${softtissue[@]}" train --config quick --seed "$seed" --out "$out/run" --data-dir "$out/data"
    echo "every figure: $out/run/metrics.json, as tables and charts: $out/run/report/index.html"
}
folds() {
    if [ ! -e "$out/run/metrics.json" ]; then main; fi
    "${softtissue[@]}" eval "$out/run" --protocol leave-one-sequence-out --quiet
}
fit() {
    local accuracy=(cargo run --quiet --release -p softtissue-fit --example fit_accuracy --)
    local sets=$out/fit-sets still=(--set synth.scanner.drift=0 --set synth.scanner.noise=0)
    rm -rf "$sets"
    "${softtissue[@]}" synth --config quick --seed "$seed" --out "$sets/off" --quiet "${still[@]}"
    "${softtissue[@]}" synth --config quick --seed "$seed" --out "$sets/on" --quiet
    echo "scanner off:"
    "${accuracy[@]}" "$sets/off"
    echo "scanner on:"
    "${accuracy[@]}" "$sets/on"
    echo "scanner on, without the first 40 frames of every clip:"
    "${accuracy[@]}" "$sets/on" from=40
    rm -rf "$sets"
}
speed() { scripts/fit-speed.sh; }
synth() { scripts/synth-acceptance.sh; }
bench() { cargo bench --quiet --bench main; }

parts=("$@")
[ $# -gt 0 ] || parts=(main folds fit speed synth bench)
for part in "${parts[@]}"; do
    case $part in
        main | folds | fit | speed | synth | bench) ;;
        *) echo "no part $part: name some of main folds fit speed synth bench" >&2; exit 2 ;;
    esac
done
cargo build --quiet --release
mkdir -p "$out"
for part in "${parts[@]}"; do
    printf '\n== %s\n' "$part"
    begun=$SECONDS
    "$part" 2>&1 | tee "$out/$part.txt"
    echo "$part took $((SECONDS - begun)) s; kept in $out/$part.txt"
done
