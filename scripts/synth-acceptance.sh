#!/usr/bin/env bash
# Prints the acceptance table of the simulated flesh (docs/synth.md); about four minutes on one core.
# Arguments go to the example: groups of rows and settings, for instance: scripts/synth-acceptance.sh step bmi=28
set -euo pipefail
cd "$(dirname "$0")/.."
exec cargo run --quiet --release -p softtissue-synth --example flesh_acceptance -- "$@"
