#!/usr/bin/env bash
# Every method on the same people, motions, splits and measures, from the papers' tables to new people and other flesh:
#
#   scripts/evidence.sh                    all parts at size evidence, hours on two cores
#   scripts/evidence.sh methods subjects   some of them
#   SIZE=smoke OUT=DIR scripts/evidence.sh a reduced form that proves the wiring; no figure of it is quoted
#
#   methods    each method trained once and judged in one table (new motions), ours and the autoencoders with three seeds
#   ablations  SoftSMPL without static disentangling, without motion transfer, without both; Dyna of order zero
#   casas      Casas and Otaduy's five sequences of the heaviest person, left out in turn
#   subjects   each person left out in turn: all folds for ours and Dyna, three (light, middle, heavy) for the others
#   dyna       Dyna's four cases for every method
#   flesh      the runs of methods on scans of the second law, and of the same people with other hidden flesh
#   fine       table 1 and the time a frame at 6890 vertices
#
# It can be stopped at any time and started again: finished parts are kept, a stopped training is resumed. Runs lie in
# target/evidence, what is printed and the measures in docs/evidence (OUT). SOFTTISSUE names a program built before.
set -euo pipefail
cd "$(dirname "$0")/.."
size=${SIZE:-evidence}
out=${OUT:-docs/evidence}
runs=target/evidence/$size
data=target/evidence/data
seeds=(1 2 3)
methods=(softtissue softsmpl casas-otaduy dyna)
softtissue=${SOFTTISSUE:-target/release/softtissue}
mkdir -p "$out" "$runs"

# train NAME [options]: a run, once; resumed where it was stopped.
train() {
    local name=$1 run=$runs/$1
    shift
    if [ -e "$run/bundle/manifest.json" ] && [ -e "$run/finished" ]; then return; fi
    if [ -e "$run/config.toml" ]; then
        "$softtissue" train --out "$run" --resume --no-eval
    else
        "$softtissue" train --config "configs/$size.toml" --out "$run" --data-dir "$data" --no-eval "$@"
    fi
    touch "$run/finished"
    echo "trained $name"
}
# keep NAME COMMAND...: what a command prints, once, in OUT/NAME.txt.
keep() {
    local name=$1 text=$out/$1.txt
    shift
    if [ -e "$text" ]; then return; fi
    "$@" --quiet > "$text.part"
    mv "$text.part" "$text"
    printf '\n== %s\n' "$name"
    cat "$text"
}
measures() { cp "$1" "$out/$2.json"; }
run_of() { echo "$runs/$1"; }

part_methods() {
    local method seed others=()
    for method in "${methods[@]}"; do
        train "$method" --set method="$method"
        [ "$method" = softtissue ] || others+=(--against "$(run_of "$method")")
    done
    keep methods "$softtissue" eval "$(run_of softtissue)" "${others[@]}"
    measures "$(run_of softtissue)/comparison/metrics.json" methods
    mkdir -p "$out/report"
    cp "$(run_of softtissue)/comparison/report/index.html" "$out/report/index.html"
    for method in "${methods[@]}"; do
        keep "held-out-$method" "$softtissue" eval "$(run_of "$method")"
        measures "$(run_of "$method")/metrics.json" "held-out-$method"
    done
    for seed in "${seeds[@]:1}"; do
        # other weights and draws on the same scans
        train "softtissue-seed-$seed" --set method=softtissue --set seed="$seed" --set synth.seed=1
        keep "held-out-softtissue-seed-$seed" "$softtissue" eval "$(run_of "softtissue-seed-$seed")"
        measures "$(run_of "softtissue-seed-$seed")/metrics.json" "held-out-softtissue-seed-$seed"
    done
}
part_ablations() {
    local name others=()
    for name in without-static without-transfer without-both; do
        train "softsmpl-$name" --set method=softsmpl $(ablation "$name")
        others+=(--against "$(run_of "softsmpl-$name")")
    done
    train dyna-zero-order --set method=dyna --set dyna.order=0
    others+=(--against "$(run_of dyna-zero-order)" --against "$(run_of dyna)")
    train softsmpl --set method=softsmpl
    train dyna --set method=dyna
    keep ablations "$softtissue" eval "$(run_of softsmpl)" "${others[@]}"
    measures "$(run_of softsmpl)/comparison/metrics.json" ablations
}
ablation() {
    local static="--set softsmpl.static_disentangling=false" transfer="--set softsmpl.transfer=false"
    case $1 in
        without-static) echo "$static" ;;
        without-transfer) echo "$transfer" ;;
        without-both) echo "$static $transfer" ;;
    esac
}
people() { "$softtissue" config print --config "configs/$size.toml" | sed -n 's/^bmi = //p' | tr ',' '\n' | wc -l; }
part_casas() {
    local heaviest motions=(one_leg_jump running_on_spot jumping_jacks light_hopping_loose jiggle_on_toes) folds= motion
    [ "$size" != smoke ] || motions=(one_leg_jump jumping_jacks)
    printf -v heaviest 's%02d' $(($(people) - 1))
    for motion in "${motions[@]}"; do folds+=${folds:+,}$heaviest/$motion; done
    train casas-otaduy --set method=casas-otaduy
    keep casas "$softtissue" eval "$(run_of casas-otaduy)" --protocol leave-one-sequence-out --folds "$folds"
    measures "$(run_of casas-otaduy)/metrics-leave-one-sequence-out.json" casas
}
part_subjects() {
    local method count folds three
    count=$(people)
    printf -v three 's%02d,s%02d,s%02d' 0 $((count / 2)) $((count - 1))
    [ "$count" -gt 2 ] || three=s00,s01
    for method in "${methods[@]}"; do
        train "$method" --set method="$method"
        folds=$three
        case $method in softtissue | dyna) folds=all ;; esac
        keep "subjects-$method" "$softtissue" eval "$(run_of "$method")" --protocol leave-one-subject-out --folds "$folds"
        measures "$(run_of "$method")/metrics-leave-one-subject-out.json" "subjects-$method"
    done
}
part_dyna() {
    local method
    for method in "${methods[@]}"; do
        train "$method" --set method="$method"
        keep "cases-$method" "$softtissue" eval "$(run_of "$method")" --protocol dyna-cases
        measures "$(run_of "$method")/metrics-dyna-cases.json" "cases-$method"
    done
}
part_flesh() {
    local method others=() name
    for method in "${methods[@]}"; do
        train "$method" --set method="$method"
        [ "$method" = softtissue ] || others+=(--against "$(run_of "$method")")
    done
    "$softtissue" synth --config "configs/$size.toml" --out "$runs/second-law" --set synth.flesh.law=second --quiet
    "$softtissue" synth --config "configs/$size.toml" --out "$runs/other-flesh" --set synth.subjects.other_flesh=1 --quiet
    for name in second-law other-flesh; do
        keep "$name" "$softtissue" eval "$(run_of softtissue)" --on "$runs/$name" "${others[@]}"
        measures "$(run_of softtissue)/on-$name/metrics.json" "$name"
    done
}
part_fine() {
    train fine --set synth.level=1 --set synth.takes=1
    keep fine "$softtissue" eval "$(run_of fine)"
    measures "$(run_of fine)/metrics.json" fine
}

all=(methods ablations casas subjects dyna flesh fine)
parts=("$@")
[ $# -gt 0 ] || parts=("${all[@]}")
for part in "${parts[@]}"; do
    case " ${all[*]} " in *" $part "*) ;; *) echo "no part $part: name some of ${all[*]}" >&2; exit 2 ;; esac
done
[ -n "${SOFTTISSUE:-}" ] || cargo build --quiet --release
for part in "${parts[@]}"; do
    begun=$SECONDS
    "part_$part"
    echo "$part took $((SECONDS - begun)) s" | tee -a "$out/times.txt"
done
echo "text, measures and report: $out"
