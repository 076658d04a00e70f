#!/usr/bin/env bash
# Trains at the thesis's size on a GPU in calls of some minutes, and puts what remains into a folder.
#
#   benchmarks/train_at_scale.sh OUTPUT [EXPERIMENT] [override ...]
#
# EXPERIMENT is simstack (default), label_views or label_maps. A state in outputs/at_scale/NAME is gone
# on with, else one whose parts lie in $RESUME (default OUTPUT). Settings by environment:
#
#   CHECK=0            1: compares CUDA and CPU first; only: does nothing else
#   SLICE=00:00:08:30  time of a call      CALLS=1  calls, one after another
#   LIMIT=             seconds that all of this may take; one call, as long as what is left allows
#   TOTAL_MB=          at most so much in OUTPUT, the state rounded if need be (benchmarks/state_parts.py)
#   RESUME=OUTPUT      where parts of a state are
#   NAME=EXPERIMENT    of the training, where one experiment has several with other settings
#   TRAINER=gpu        or cpu              PYTHON=python3
#
# Where a command may take 10 minutes and bring back 64 MB:
#
#   CHECK=only benchmarks/train_at_scale.sh OUT simstack
#   LIMIT=580 TOTAL_MB=60 benchmarks/train_at_scale.sh OUT simstack size.network=narrow
#   LIMIT=580 TOTAL_MB=60 benchmarks/train_at_scale.sh OUT/views label_views
#   LIMIT=580 TOTAL_MB=60 NAME=fused benchmarks/train_at_scale.sh OUT/fused label_maps \
#     dataset=tabletop_fused_maps_packed
#
# The last one takes crops of fused maps from outputs/fused_maps.npz, see docs/labelling.md.
#
# OUTPUT gets losses.csv, metrics.json, the state and the weights, in files of at most 15 MB. A state has
# 16 bytes per weight (weights, average, two moments), 12 with Muon: 80 MB for 6.7 million. TOTAL_MB keeps
# all files below a size: the state form `rounded` has 8 bytes per weight, or 6, and `average` 2 (the
# moments start over). Weights that no longer fit are left out, as the state holds them. A network whose
# smallest form is too large stops with one line before it trains. As long as the machine is there, calls
# resume from outputs/at_scale, where every bit is kept.
set -euo pipefail

[ $# -ge 1 ] || { sed -n '2,34s/^# \?//p' "$0"; exit 2; }
output=$(mkdir -p "$1" && cd "$1" && pwd)
experiment=${2:-simstack}
shift $(($# < 2 ? $# : 2))
from=$(cd "${RESUME:-$output}" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-python3}
trainer=${TRAINER:-gpu}
check=${CHECK:-0}
export PYTHONPATH="$PWD/src:$PWD${PYTHONPATH:+:$PYTHONPATH}"
folder=$PWD/outputs/at_scale/${NAME:-$experiment}
state=$folder/last.ckpt
part=15000000   # bytes of a file
collecting=45   # seconds that the copies below may take, and what a call needs beyond its time

# numba needs CUDA's compiler: where wheels bring none, a toolkit's
if [ "$trainer" = gpu ] && [ -z "${CUDA_HOME:-}${CUDA_PATH:-}" ]; then
  nvcc=$(readlink -f "$(command -v nvcc || true)" || true)
  for toolkit in "${nvcc%/bin/nvcc}" /usr/local/cuda; do
    if [ -n "$toolkit" ] && [ -d "$toolkit/nvvm" ]; then export CUDA_HOME=$toolkit && break; fi
  done
fi

if [ "$check" != 0 ] && [ "$trainer" = gpu ]; then
  scale=() # of simstack the check takes the narrow network and 32^3 voxels
  [ "$experiment" = simstack ] || scale=(scale=thesis "$@")
  "$python" -m benchmarks.check_device "experiment=$experiment" "${scale[@]}"
fi
[ "$check" != only ] || exit 0

collect() { # also after a failure, and when the time is up
  local status=$? weights name size room=${TOTAL_MB:-1000000} kept="the state holds it"
  for name in losses.csv run/metrics.json; do
    [ ! -f "$folder/$name" ] || cp "$folder/$name" "$output/"
  done
  if [ -f "$state" ]; then
    if ! "$python" -m benchmarks.state_parts split "$state" "$output" \
      ${TOTAL_MB:+--megabytes "$((TOTAL_MB - 1))"}; then
      status=1 kept="and so is the state: both are in $folder alone"
      ! compgen -G "$output/state.part*" >/dev/null || echo "state.part* are of an earlier call"
    fi
    size=$( (cat "$output"/state.part* 2>/dev/null || true) | wc -c)
    room=$((room - 1 - size / 1000000))
  fi
  for weights in "$folder"/*.safetensors; do # large ones in parts: cat NAME.part* >NAME
    [ -f "$weights" ] || continue
    name=$(basename "$weights") size=$(stat -c %s "$weights")
    rm -f "$output/$name" "$output/$name".part*
    if [ "$size" -gt $((room * 1000000)) ]; then
      echo "$name is left out, as it takes $((size / 1000000)) MB; $kept"
    elif [ "$size" -le $part ]; then cp "$weights" "$output/"
    else split -d -b $part "$weights" "$output/$name.part"; fi
  done
  ls -l "$output"
  exit "$status"
}

if [ -n "${TOTAL_MB:-}" ]; then
  "$python" -m benchmarks.state_parts fits "$((TOTAL_MB - 1))" \
    "experiment=$experiment" scale=thesis "$@"
fi
mkdir -p "$folder"
if [ ! -f "$state" ] && compgen -G "$from/state.part*" >/dev/null; then
  "$python" -m benchmarks.state_parts join "$from" "$state"
fi
trap collect EXIT
calls=${CALLS:-1}
[ -z "${LIMIT:-}" ] || calls=1
for _ in $(seq "$calls"); do
  time=${SLICE:-00:00:08:30}
  if [ -n "${LIMIT:-}" ]; then
    left=$((LIMIT - SECONDS - collecting))
    [ $left -gt 0 ] || { echo "LIMIT=$LIMIT leaves no time to train; give more" >&2; exit 2; }
    time=$(printf '00:%02d:%02d:%02d' $((left / 3600)) $((left / 60 % 60)) $((left % 60)))
  fi
  "$python" -m scenefw "experiment=$experiment" run=train scale=thesis "trainer=$trainer" \
    "trainer.max_time=$time" "paths.training=$folder" "paths.output=$folder/run" "$@"
  cat "$folder/run/metrics.json"
done
