#!/usr/bin/env bash
# A script inside YADE, on a table of one line: yade_job.sh TABLE SCRIPT FOLDER LOG PRODUCT
# FOLDER is where YADE's scripts read and write. YADE is the program that the variable YADE names, or
# the one in PATH. What counts are the PRODUCT, which may be there from before, and that the script
# names no error. The table is read as of yade-batch, which itself starts a second YADE for that.
set -euo pipefail
tried=2023.02
table=$1 script=$2 folder=$3 log=$4 product=$5 yade=${YADE:-yade}
fail() { echo "error: $*" >> "$log"; exit 2; }
mkdir -p "$folder" "$(dirname "$log")"
: > "$log"
exec 2>> "$log"
command -v "$yade" > /dev/null ||
    fail "$yade is not in PATH: install YADE, load its module, or name it by the variable YADE"
export WAVE_PRODUCTS=$folder OMP_NUM_THREADS=1 YADE_BATCH=$table:2
"$yade" -n -x -j1 "$script" > "$log" 2>&1 < /dev/null || true
! grep -q '^error: ' "$log" || exit 1
[ -f "$product" ] || {
    here=$("$yade" --version 2> /dev/null | grep -o '20[0-9][0-9][.0-9a-z]*' | head -n 1)
    [[ "$here" = "$tried"* ]] || fail "no product; this is YADE ${here:-of no known version}, and" \
        "$tried was tried; install that one, or name it by the variable YADE; see $log"
    echo "no product from YADE $here; the lines before this one may say why" >> "$log"
    exit 1
}
