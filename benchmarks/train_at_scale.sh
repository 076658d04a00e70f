#!/usr/bin/env bash
# Trains at the thesis's size on a GPU in calls of some minutes, and puts what remains into a folder.
#
#   benchmarks/train_at_scale.sh OUTPUT [EXPERIMENT] [override ...]
#
# EXPERIMENT is simstack (default), label_views or label_maps. A state in outputs/at_scale/NAME is gone
# on with, else one whose parts lie in $RESUME (default OUTPUT). Settings by environment:
#
#   SLICE=00:00:08:30  time of a call      CALLS=1  calls, one after another
#   STATE_MB=          at most so much for the state, rounded if need be (benchmarks/state_parts.py)
#   RESUME=OUTPUT      where parts of a state are
#   NAME=EXPERIMENT    of the training, where one experiment has several with other settings
#   TRAINER=gpu        or cpu              CHECK=1  0 leaves out the comparison of CUDA and CPU
#   PYTHON=python3
#
#   CALLS=3 benchmarks/train_at_scale.sh OUT/views label_views
#   CALLS=3 benchmarks/train_at_scale.sh OUT/maps label_maps
#   NAME=fused CALLS=3 benchmarks/train_at_scale.sh OUT/fused label_maps \
#     dataset=tabletop_fused_maps_packed
#
# The last one takes crops of fused maps from outputs/fused_maps.npz, see docs/labelling.md.
set -euo pipefail

[ $# -ge 1 ] || { sed -n '2,22s/^# \?//p' "$0"; exit 2; }
output=$(mkdir -p "$1" && cd "$1" && pwd)
experiment=${2:-simstack}
shift $(($# < 2 ? $# : 2))
from=$(cd "${RESUME:-$output}" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-python3}
trainer=${TRAINER:-gpu}
export PYTHONPATH="$PWD/src:$PWD${PYTHONPATH:+:$PYTHONPATH}"
folder=$PWD/outputs/at_scale/${NAME:-$experiment}
state=$folder/last.ckpt
mkdir -p "$folder"

if [ "${CHECK:-1}" = 1 ] && [ "$trainer" = gpu ]; then
  scale=() # of simstack the check takes the narrow network and 32^3 voxels
  [ "$experiment" = simstack ] || scale=(scale=thesis "$@")
  "$python" -m benchmarks.check_device "experiment=$experiment" "${scale[@]}"
fi
if [ ! -f "$state" ] && compgen -G "$from/state.part*" >/dev/null; then
  "$python" -m benchmarks.state_parts join "$from" "$state"
fi
for _ in $(seq "${CALLS:-1}"); do
  "$python" -m scenefw "experiment=$experiment" run=train scale=thesis "trainer=$trainer" \
    "trainer.max_time=${SLICE:-00:00:08:30}" "paths.training=$folder" \
    "paths.output=$folder/run" "$@"
  cat "$folder/run/metrics.json"
done
cp "$folder/losses.csv" "$folder/run/metrics.json" "$output/"
for weights in "$folder"/*.safetensors; do # large ones in parts: cat NAME.part* >NAME
  name=$(basename "$weights")
  rm -f "$output/$name" "$output/$name".part*
  if [ "$(stat -c %s "$weights")" -le 15000000 ]; then cp "$weights" "$output/"
  else split -d -b 15000000 "$weights" "$output/$name.part"; fi
done
"$python" -m benchmarks.state_parts split "$state" "$output" ${STATE_MB:+--megabytes "$STATE_MB"}
ls -l "$output"
