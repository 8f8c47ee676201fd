#!/usr/bin/env bash
# One line of a yade-batch table: yade_job.sh TABLE KEY SCRIPT FOLDER LOG PRODUCT
# The line is the one whose first column is KEY; FOLDER is where YADE's scripts read and write.
# yade-batch returns 0 although its job failed: what counts are the PRODUCT, which may be there from
# before, and the status of the job, which yade-batch writes into its log. YADE is the program that the variable YADE names, or
# the one in PATH.
set -euo pipefail
tried=(2023.02 2025.2) # of Debian 12 and of Debian 13
table=$1 key=$2 script=$3 folder=$4 log=$5 product=$6
is_tried() { # a release may have a letter or a third number behind it: 2023.02a, 2025.2.0
    local version
    for version in "${tried[@]}"; do
        [[ "$1" != "$version" && "$1" != "$version"[a-z.]* ]] || return 0
    done
    return 1
}
fail() { echo "error: $*" >> "$log"; exit 2; }
mkdir -p "$folder" "$(dirname "$log")"
: > "$log"
exec 2>> "$log"
batch=${YADE:+$YADE-batch}; batch=${batch:-yade-batch}
command -v "$batch" > /dev/null ||
    fail "$batch is not in PATH: install YADE, load its module, or name it by the variable YADE"
line=$(awk -v key="$key" '!/^#/ && NF && $1 + 0 == key + 0 && $1 ~ /^[0-9]/ {print NR; exit}' "$table")
[ -n "$line" ] || fail "$table: no line begins with $key; add one"
export WAVE_PRODUCTS=$folder OMP_NUM_THREADS=1
# yade-batch wants its line in the name of the log.
own=${log%.log}.line%.log
"$batch" -j 1 --job-threads 1 --nice 0 --lines "$line" --log "$own" "$table" "$script" > "$log" 2>&1 || true
own=${own//%/$line}
[ ! -f "$own" ] || { cat "$own" >> "$log"; rm -f "$own"; }
! grep -q '^error: ' "$log" || exit 1
{ [ -f "$product" ] && grep -q '^status *: 0 ' "$log"; } || {
    here=$("${batch%-batch}" --version 2> /dev/null | grep -o '20[0-9][0-9][.0-9a-z]*' | head -n 1) || true
    is_tried "$here" || fail "no product; this is YADE ${here:-of no known version}, and ${tried[*]}" \
        "were tried; install one of these, or name it by the variable YADE; see $log"
    echo "no product from YADE $here; the lines before this one may say why" >> "$log"
    exit 1
}
