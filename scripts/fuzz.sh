#!/usr/bin/env bash
# Throws hostile bytes at every reader of foreign files, one after the other: seconds per target (60), then targets (all).
# Each has 1.5 GiB of memory and five seconds an input; what fails lies under fuzz/artifacts. Needs nightly Rust and
# cargo-fuzz (`cargo install cargo-fuzz --locked`). New inputs stay out of the seeds in fuzz/corpus.
set -euo pipefail
cd "$(dirname "$0")/../fuzz"
seconds=${1:-60}
shift || true
targets=("$@")
if [ ${#targets[@]} = 0 ]; then
  mapfile -t targets < <(cargo +nightly fuzz list --fuzz-dir .)
fi
scratch=$(mktemp -d -p "$([ -w /dev/shm ] && echo /dev/shm || echo "${TMPDIR:-/tmp}")")
trap 'rm -rf "$scratch"' EXIT
failed=0
# No sanitizer: the readers hold no unsafe code, and without one more inputs are tried. A claim beyond the limit aborts.
cargo +nightly fuzz build --fuzz-dir . --sanitizer none
for target in "${targets[@]}"; do
  mkdir -p "$scratch/new" "$scratch/files" "artifacts/$target"
  log=$scratch/log
  outcome=fine
  (
    ulimit -v 1572864
    TMPDIR=$scratch/files cargo +nightly fuzz run --fuzz-dir . --sanitizer none "$target" "$scratch/new" "corpus/$target" -- \
      -max_total_time="$seconds" -rss_limit_mb=1536 -timeout=5 -print_final_stats=1 -verbosity=0 >"$log" 2>&1
  ) || outcome=FAILED
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  printf '%-12s %10s inputs  %s\n' "$target" "${runs:-?}" "$outcome"
  if [ $outcome = FAILED ]; then
    failed=1
    tail -n 25 "$log" >&2
  fi
  rm -rf "$scratch"/*
done
exit $failed
