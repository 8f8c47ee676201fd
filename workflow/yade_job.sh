#!/usr/bin/env bash
# One line of a yade-batch table: yade_job.sh TABLE LINE SCRIPT FOLDER [LOG PRODUCT]
# FOLDER is where YADE's scripts read and write. yade-batch returns 0 although its job failed: what
# counts is the PRODUCT. YADE is the program that the variable YADE names, or the one in PATH.
set -euo pipefail
table=$1 line=$2 script=$3 folder=$4 log=${5:-$4/yade.log} product=${6:-}
batch=${YADE:+$YADE-batch}; batch=${batch:-yade-batch}
command -v "$batch" > /dev/null || {
    echo "$batch is not in PATH: install yade, or name it by the variable YADE" >&2; exit 2; }
mkdir -p "$folder" "$(dirname "$log")"
export WAVE_PRODUCTS=$folder OMP_NUM_THREADS=1
# yade-batch wants its line in the name of the log.
own=${log%.log}.line%.log
"$batch" -j 1 --job-threads 1 --lines "$line" --log "$own" "$table" "$script" > "$log" 2>&1
own=${own//%/$line}
if [ -n "$product" ] && [ ! -f "$product" ]; then
    grep -h '^error: ' "$own" >&2 || tail -n 5 "$own" >&2 || true
    echo "$script, line $line of $table: no $product; see $own" >&2
    exit 1
fi
