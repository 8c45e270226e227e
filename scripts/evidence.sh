#!/usr/bin/env bash
# Every method on the same people, motions, splits and measures, from the papers' tables to new people and other flesh:
#
#   scripts/evidence.sh                    all parts at size evidence, hours on two cores
#   scripts/evidence.sh methods subjects   some of them
#   scripts/evidence.sh --check methods    runs nothing, says whether what a part writes is there and whole
#   SIZE=smoke OUT=DIR scripts/evidence.sh a reduced form that proves the wiring; no figure of it is quoted
#
#   methods    each method trained once and judged in one table (new motions), ours and SoftSMPL's autoencoders with three seeds
#   ablations  SoftSMPL without static disentangling, without motion transfer, without both; Dyna of order zero
#   weights    Casas and Otaduy's loss with and without the rigidity weights
#   casas      Casas and Otaduy's five sequences of the heaviest person, left out in turn
#   subjects   each person left out in turn: all folds for ours and Dyna, three (light, middle, heavy) for the others
#   dyna       Dyna's four cases for ours and Dyna, new people for SoftSMPL (Casas and Otaduy's models are one person's own)
#   flesh      the runs of methods on scans of the second law, and of the same people with other hidden flesh
#   fine       table 1 and the time a frame of every method at 6890 vertices
#
# It can be stopped at any time and started again: finished parts are kept, a stopped training is resumed. Each part is
# checked as it ends, and OUT/README.md lists what there is.
#
# SOFTTISSUE names a program built before. CONFIG is the configuration (configs/SIZE.toml), RUNS and DATA are where runs
# and scans lie (in target/evidence), OUT is for what is printed and for the measures (docs/evidence), SEEDS are the
# seeds of the methods part (1 2 3).
set -euo pipefail
cd "$(dirname "$0")/.."
size=${SIZE:-evidence}
config=${CONFIG:-configs/$size.toml}
out=${OUT:-docs/evidence}
runs=${RUNS:-target/evidence/$size}
data=${DATA:-target/evidence/data}
read -ra seeds <<< "${SEEDS:-1 2 3}"
methods=(softtissue softsmpl casas-otaduy dyna)
softtissue=${SOFTTISSUE:-target/release/softtissue}
all=(methods ablations weights casas subjects dyna flesh fine)

only_check=false
if [ "${1:-}" = --check ]; then only_check=true; shift; fi
parts=("$@")
[ $# -gt 0 ] || parts=("${all[@]}")
for part in "${parts[@]}"; do
    case " ${all[*]} " in *" $part "*) ;; *) echo "no part $part: name some of ${all[*]}" >&2; exit 2 ;; esac
done

fail() { echo "evidence: $1" >&2; exit 1; }
run_of() { echo "$runs/$1"; }
# train NAME [options]: a run, once; resumed where it was stopped. All share one fit: the first run's table alone compares
# its objectives.
train() {
    local name=$1 run=$runs/$1 shared=()
    shift
    [ "$name" = softtissue ] || shared=(--set eval.compare_objectives=false)
    if $only_check || [ -e "$run/finished" ]; then return; fi
    if [ -e "$run/config.toml" ]; then
        "$softtissue" train --out "$run" --resume --no-eval
    else
        "$softtissue" train --config "$config" --out "$run" --data-dir "$data" --no-eval "${shared[@]}" "$@"
    fi
    touch "$run/finished"
    echo "trained $name"
}
# keep NAME MEASURES COMMAND...: what a command prints in OUT/NAME.txt, and in OUT/NAME.json the measures that it writes but
# for those of each clip, which stay in the run's folder.
keep() {
    local name=$1 measures=$2 text=$out/$1.txt
    shift 2
    if $only_check || [ -e "$text" ]; then return; fi
    "$@" --quiet > "$text.part"
    awk '/^  "clips": \[/ { skip = 1 } !skip; /^  \],?$/ { skip = 0 }' "$measures" > "$out/$name.json"
    mv "$text.part" "$text"
    printf '\n== %s\n' "$name"
    cat "$text"
}
# holds NAME METHOD...: whether a part's text and measures have every method.
holds() {
    local name=$1 method
    shift
    for method in "$@"; do
        grep -q "^$method  " "$out/$name.txt" || fail "$out/$name.txt has no row of $method"
        grep -q "\"$method\": {" "$out/$name.json" || fail "$out/$name.json has no figures of $method"
    done
}
# shows NAME TITLE KEY ...: whether the text has these tables and the measures these sections.
shows() {
    local name=$1
    shift
    while [ $# -gt 1 ]; do
        grep -qF "$1" "$out/$name.txt" || fail "$out/$name.txt has no table \"$1\""
        grep -q "^  \"$2\": [[{]" "$out/$name.json" || fail "$out/$name.json has no $2"
        shift 2
    done
}
settings() { "$softtissue" config print --config "$config"; }
# setting KEY: the words of its first list in the settings.
setting() { settings | sed -n "s/^$1 = \[\(.*\)\]/\1/p" | head -1 | tr -d ' "' | tr ',' '\n'; }
people() { setting bmi | wc -l; }
# The simulator stands in the tables unless the settings leave it out.
simulator() { settings | grep -q '^oracle = true' && echo oracle || true; }
# report FILE NAME: a report as OUT/report/NAME.html.
report() {
    $only_check || { mkdir -p "$out/report" && cp "$1" "$out/report/$2.html"; }
    [ -s "$out/report/$2.html" ] || fail "there is no $out/report/$2.html"
}

part_methods() {
    local method seed others=() run=
    run=$(run_of softtissue)
    for method in "${methods[@]}"; do
        train "$method" --set method="$method"
        [ "$method" = softtissue ] || others+=(--against "$(run_of "$method")")
    done
    keep methods "$run/comparison/metrics.json" "$softtissue" eval "$run" "${others[@]}"
    holds methods body $(simulator) "${methods[@]}"
    shows methods "Soft ratio by person" people "bodies of other mass" shape_response \
        "bodies of one height" bmi_response "Time of a frame" timing
    report "$run/comparison/report/index.html" methods
    for method in "${methods[@]}"; do
        keep "held-out-$method" "$(run_of "$method")/metrics.json" "$softtissue" eval "$(run_of "$method")"
        holds "held-out-$method" body "$method"
        shows "held-out-$method" "Error of vertices" over_time
        [ "$method" = dyna ] || shows "held-out-$method" "Subspaces" subspace "The same by person" subspace_by_subject
    done
    for seed in "${seeds[@]:1}"; do
        # other weights and draws on the same scans
        train "softtissue-seed-$seed" --set method=softtissue --set seed="$seed" --set synth.seed="${seeds[0]}"
        keep "held-out-softtissue-seed-$seed" "$(run_of "softtissue-seed-$seed")/metrics.json" \
            "$softtissue" eval "$(run_of "softtissue-seed-$seed")"
        holds "held-out-softtissue-seed-$seed" softtissue
        train "softsmpl-seed-$seed" --set method=softsmpl --set seed="$seed" --set synth.seed="${seeds[0]}" "${subspaces_alone[@]}"
        keep "held-out-softsmpl-seed-$seed" "$(run_of "softsmpl-seed-$seed")/metrics.json" \
            "$softtissue" eval "$(run_of "softsmpl-seed-$seed")"
        shows "held-out-softsmpl-seed-$seed" "Subspaces" subspace
    done
    $only_check || over_seeds > "$out/seeds.txt"
    grep -q '^softtissue' "$out/seeds.txt" || fail "$out/seeds.txt has no row of softtissue"
}
# Where SoftSMPL is asked for its subspaces alone.
subspaces_alone=(--set softsmpl.transfer_steps=2 --set softsmpl.training.steps=2 --set softsmpl.poses.training.epochs=1)
# Table 1 and the default method over the seeds, from the measures: two spaces of indent are a level.
over_seeds() {
    local names=("$out"/held-out-{softtissue,softsmpl}.json) seed
    for seed in "${seeds[@]:1}"; do names+=("$out"/held-out-{softtissue,softsmpl}-seed-"$seed".json); done
    awk -v seeds="${seeds[*]}" '
        function add(name, i, x) { n[name, i]++; sum[name, i] += x; square[name, i] += x * x }
        function spread(name, i,   m, k, v) { k = n[name, i]; m = sum[name, i] / k
            v = k > 1 ? (square[name, i] - k * m * m) / (k - 1) : 0
            return sprintf("%.3f ± %.3f", m, v > 0 ? sqrt(v) : 0) }
        /^  "/ { section = $1 }
        /^    "/ { entry = $1; gsub(/[":]/, "", entry) }
        /^        "/ { region = $1 }
        section == "\"methods\":" && entry == "softtissue" && FILENAME ~ /held-out-softtissue/ {
            if (/^      "soft_ratio":/) add(entry, 1, $2 + 0)
            if (/^          "energy_ratio":/ && region == "\"soft\":") add(entry, 2, $2 + 0)
        }
        section == "\"subspace\":" && FILENAME ~ /held-out-softsmpl/ {
            if (/"ae_mm":/) autoencoder = $2 + 0
            if (/"pca_mm":/ && !/scan/) { sizes[entry + 0]
                add(entry, 1, $2 + 0); add(entry, 2, autoencoder); add(entry, 3, autoencoder / $2) }
        }
        END {
            print "Over the seeds " seeds ": mean ± sample standard deviation."
            printf "%-12s   %16s   %16s\n", "method", "soft ratio", "energy"
            printf "%-12s   %16s   %16s\n\n", "softtissue", spread("softtissue", 1), spread("softtissue", 2)
            printf "%-12s   %16s   %16s   %16s\n", "subspace, mm", "PCA", "autoencoder", "ratio"
            for (size = 1; size <= 1000; size++) if (size in sizes)
                printf "%-12s   %16s   %16s   %16s\n", size " numbers", spread(size, 1), spread(size, 2), spread(size, 3)
        }' "${names[@]}"
}
part_ablations() {
    local name others=() run
    run=$(run_of softsmpl)
    for name in without-static without-transfer without-both; do
        train "softsmpl-$name" --set method=softsmpl $(ablation "$name")
        others+=(--against "$(run_of "softsmpl-$name")")
    done
    train dyna-zero-order --set method=dyna --set dyna.order=0
    others+=(--against "$(run_of dyna-zero-order)" --against "$(run_of dyna)")
    train softsmpl --set method=softsmpl
    train dyna --set method=dyna
    keep ablations "$run/comparison/metrics.json" "$softtissue" eval "$run" "${others[@]}"
    holds ablations softsmpl softsmpl/without-static softsmpl/without-transfer softsmpl/without-both dyna dyna/zero-order
    shows ablations "bodies of other mass" shape_response "linear probe" leak
    report "$run/comparison/report/index.html" ablations
}
ablation() {
    local static="--set softsmpl.static_disentangling=false" transfer="--set softsmpl.transfer=false"
    case $1 in
        without-static) echo "$static" ;;
        without-transfer) echo "$transfer" ;;
        without-both) echo "$static $transfer" ;;
    esac
}
part_weights() {
    local run
    run=$(run_of casas-otaduy)
    train casas-otaduy --set method=casas-otaduy
    train casas-otaduy-unweighted --set method=casas-otaduy --set casas_otaduy.regressor.weighted=false
    keep weights "$run/comparison/metrics.json" \
        "$softtissue" eval "$run" --against "$(run_of casas-otaduy-unweighted)"
    holds weights body casas-otaduy casas-otaduy/unweighted
}
part_casas() {
    local heaviest motion folds= run name=leave-one-sequence-out
    run=$(run_of casas-otaduy)
    printf -v heaviest 's%02d' $(($(people) - 1))
    for motion in one_leg_jump running_on_spot jumping_jacks light_hopping_loose jiggle_on_toes; do
        if setting motions | grep -qx "$motion"; then folds+=${folds:+,}$heaviest/$motion; fi
    done
    train casas-otaduy --set method=casas-otaduy
    keep casas "$run/metrics-$name.json" "$softtissue" eval "$run" --protocol $name --folds "$folds"
    holds casas body casas-otaduy
    shows casas "What was left out" over_time
    for motion in ${folds//,/ }; do grep -q "^$motion  " "$out/casas.txt" || fail "$out/casas.txt has no row of $motion"; done
    report "$run/report-$name/index.html" casas
}
part_subjects() {
    local method count folds three run name=leave-one-subject-out
    count=$(people)
    printf -v three 's%02d,s%02d,s%02d' 0 $((count / 2)) $((count - 1))
    [ "$count" -gt 2 ] || three=s00,s01
    for method in "${methods[@]}"; do
        run=$(run_of "$method")
        train "$method" --set method="$method"
        folds=$three
        case $method in softtissue | dyna) folds=all ;; esac
        keep "subjects-$method" "$run/metrics-$name.json" "$softtissue" eval "$run" --protocol $name --folds "$folds"
        holds "subjects-$method" body "$method"
        shows "subjects-$method" "What was left out" over_time
        report "$run/report-$name/index.html" "subjects-$method"
    done
}
part_dyna() {
    local method case cases
    for method in softtissue dyna softsmpl; do
        cases=(new-instance new-motion new-subject new-both)
        [ "$method" != softsmpl ] || cases=(new-subject new-both)
        train "$method" --set method="$method"
        keep "cases-$method" "$(run_of "$method")/metrics-dyna-cases.json" "$softtissue" eval "$(run_of "$method")" \
            --protocol dyna-cases --folds "$(IFS=,; echo "${cases[*]}")"
        holds "cases-$method" body "$method"
        for case in "${cases[@]}"; do
            grep -q "^$case  " "$out/cases-$method.txt" || fail "$out/cases-$method.txt has no row of $case"
        done
    done
}
part_flesh() {
    local method others=() name run
    run=$(run_of softtissue)
    for method in "${methods[@]}"; do
        train "$method" --set method="$method"
        [ "$method" = softtissue ] || others+=(--against "$(run_of "$method")")
    done
    for name in second-law other-flesh; do
        local other=synth.flesh.law=second
        [ $name = second-law ] || other=synth.subjects.other_flesh=1
        $only_check || [ -e "$out/$name.txt" ] ||
            "$softtissue" synth --config "$config" --out "$runs/$name" --set $other --quiet
        keep "$name" "$run/on-$name/metrics.json" "$softtissue" eval "$run" --on "$runs/$name" "${others[@]}"
        holds "$name" body "${methods[@]}"
    done
}
# SoftSMPL's subspaces are learned whole. All else is at this size for its time alone, which does not depend on what is learned.
part_fine() {
    local others=() run raw=$runs/fine.txt few=() key
    run=$(run_of fine)
    local size=(--set synth.level=1 --set synth.takes=1)
    train fine "${size[@]}" --set method=softsmpl "${subspaces_alone[@]}" --set eval.bounded_seconds=0 --set eval.oracle=false
    few=(--set subspace.training.steps=2 --set casas_otaduy.autoencoder.steps=2 --set casas_otaduy.regressor.steps=2)
    for method in "${methods[@]}"; do
        [ "$method" != softsmpl ] || continue
        train "fine-$method" "${size[@]}" "${few[@]}" --set method="$method"
        others+=(--against "$(run_of "fine-$method")")
    done
    if ! $only_check && [ ! -e "$out/fine.txt" ]; then
        "$softtissue" eval "$run" "${others[@]}" --quiet > "$raw"
        { for key in subspace subspace_by_subject timing; do section "$run/comparison/metrics.json" "$key"; done; } |
            { printf '{\n'; sed '$s/,$//'; printf '}\n'; } > "$out/fine.json"
        awk -v RS= -v ORS='\n\n' 'NR == 1 || /^(Subspaces|The same by person|Time of a frame)/' "$raw" > "$out/fine.txt"
        cat "$out/fine.txt"
    fi
    holds fine "${methods[@]}"
    shows fine "Subspaces" subspace "Time of a frame in ms at 6890 vertices" timing
}
# section FILE KEY: a section of the measures, with a comma after it.
section() { awk -v key="$2" '$0 ~ "^  \"" key "\": {" { on = 1 } on && /^  },?$/ { print "  },"; exit } on' "$1"; }

# What a table is, in a line.
what_is() {
    case $1 in
        methods) echo "all methods on motions that training has not seen, by person and by shape, and the time of a frame" ;;
        held-out-softtissue-seed-*) echo "the default method with another seed" ;;
        held-out-softsmpl-seed-*) echo "SoftSMPL's subspaces with another seed; its regressors are hardly trained" ;;
        held-out-dyna) echo "dyna beside Dyna of order zero and the linear baselines" ;;
        held-out-*) echo "${1#held-out-} beside its ablations and the linear baselines, with its subspaces (SoftSMPL table 1)" ;;
        seeds) echo "SoftSMPL's table 1 and the default method over the seeds" ;;
        ablations) echo "SoftSMPL without its parts and Dyna of order zero: errors, speed by shape (SoftSMPL fig. 8), what the descriptor gives away" ;;
        weights) echo "Casas and Otaduy's loss with and without the rigidity weights" ;;
        casas) echo "Casas and Otaduy's sequences of the heaviest person, each left out in turn (their fig. 7)" ;;
        subjects-*) echo "${1#subjects-} on people whom training has not seen" ;;
        cases-*) echo "${1#cases-} in Dyna's four cases" ;;
        second-law) echo "the methods on scans of another constitutive law" ;;
        other-flesh) echo "the methods on the same people with other hidden flesh" ;;
        autoavatar) echo "AutoAvatar's tables, by \`scripts/evidence-autoavatar.sh\` ([page](autoavatar.md))" ;;
        fine) echo "all methods at 6890 vertices: subspaces and the time of a frame" ;;
        *) echo "" ;;
    esac
}
index() {
    local text name
    echo "# Evidence"
    echo
    echo "Made by \`scripts/evidence.sh\`, size \`$size\`. The tables are as the command prints them, with the measures beside"
    echo "them as JSON; [what the figures mean](../measures.md) is told once. Seeds ${seeds[*]} where a table says so, ${seeds[0]} elsewhere."
    echo "Parts are made one at a time: where the program has learned otherwise since, [results](../results.md) says so."
    echo
    echo "| table | what it is | judged |"
    echo "|---|---|---|"
    for text in "$out"/*.txt; do
        name=$(basename "$text" .txt)
        [ "$name" = times ] || echo "| [$name]($name.txt) | $(what_is "$name") | $(sed -n '1s/; against.*//p' "$text") |"
    done
    for text in "$out"/report/*.html; do
        [ ! -e "$text" ] || echo "| [report/$(basename "$text")](report/$(basename "$text")) | $(what_is "$(basename "$text" .html)"), with charts | |"
    done
    echo
    echo "## Sizes and steps"
    echo
    echo '```'
    settings | awk '/^\[/ { section = $0 } /^(bmi|takes|frames|level|motions|steps|transfer_steps|epochs|latents|components) = / || (/^sizes = /) {
        if (section != "") print section; section = ""; print }'
    echo '```'
    echo
    echo "## Time"
    echo
    awk '{ sum[$1] += $3; if (!($1 in seen)) { seen[$1]; order[++n] = $1 } }
        END { print "| part | seconds |"; print "|---|---|"; for (i = 1; i <= n; i++) print "| " order[i] " | " sum[order[i]] " |" }' "$out/times.txt"
}

mkdir -p "$out" "$runs"
[ -n "${SOFTTISSUE:-}" ] || cargo build --quiet --release
for part in "${parts[@]}"; do
    begun=$SECONDS
    "part_$part"
    $only_check || echo "$part took $((SECONDS - begun)) s" | tee -a "$out/times.txt"
done
if $only_check; then echo "all there: ${parts[*]}"; exit; fi
index > "$out/README.md"
echo "text, measures and report: $out"
