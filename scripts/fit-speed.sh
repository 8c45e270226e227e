#!/usr/bin/env bash
# Speed of the pose fit on one core: frames a second at both levels of the body, and against Adam through autodiff on
# the same frames, objective and starts. About five minutes after the build.
set -euo pipefail
cd "$(dirname "$0")/.."
export RAYON_NUM_THREADS=1
cargo run --quiet --release -p softtissue-fit --example fit_speed
cargo run --quiet --release -p softtissue-train --example fit_against_adam
