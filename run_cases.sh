#!/usr/bin/env bash
# Run cases of the study: sample -> highest mode -> wave -> modes -> comparison.
set -euo pipefail
cd "$(dirname "$0")"
usage() {
    cat <<'HELP'
./run_cases.sh [--case N ...] [--all] [--stage NAME] [-j N] [--dry-run] [--help]
  --case N ...   cases to run (default 2); FCC cases 1 to 4 are available
  --all          all available cases
  --stage NAME   only one of: sample highest wave modes analysis
  -j N           jobs that yade-batch runs at a time (default 2)
  --dry-run      print the commands, run nothing
Products go to products/; a finished product is not made again.
HELP
}
fail() { echo "run_cases.sh: $*" >&2; exit 2; }
cases=() stages=(sample highest wave modes analysis) jobs=2 dry=
while [ $# -gt 0 ]; do
    case "$1" in
        --case) shift
            [[ "${1:-}" =~ ^[0-9]+$ ]] || fail "--case needs a number, for example --case 2"
            while [[ "${1:-}" =~ ^[0-9]+$ ]]; do cases+=("$((10#$1))"); shift; done; continue ;;
        --all) cases=(1 2 3 4) ;;
        --stage) shift
            [[ " ${stages[*]} " == *" ${1:-none} "* ]] || fail "--stage is one of: ${stages[*]}"
            stages=("$1") ;;
        -j) shift; [[ "${1:-}" =~ ^[1-9][0-9]*$ ]] || fail "-j needs a number"; jobs=$1 ;;
        --dry-run) dry=1 ;;
        --help|-h) usage; exit 0 ;;
        *) fail "unknown option $1; see --help" ;;
    esac
    shift
done
[ ${#cases[@]} -gt 0 ] || cases=(2)
for n in "${cases[@]}"; do
    [ "$n" -ge 1 ] && [ "$n" -le 32 ] || fail "case $n: there are cases 1 to 32"
    [ "$n" -le 4 ] || fail "case $n: random packings are not yet available; choose from 1 to 4"
done
run() { if [ -n "$dry" ]; then echo "$*"; else "$@"; fi; }
file() { printf 'products/case%02d.%s.h5' "$1" "$2"; }
batch() { # script, kind of product
    local missing=() n table="products/$2.table"
    for n in "${cases[@]}"; do [ -f "$(file "$n" "$2")" ] || missing+=("$n"); done
    [ ${#missing[@]} -gt 0 ] || return 0
    if [ -z "$dry" ]; then
        awk -v want=" ${missing[*]} " '/^#/ {next} /^case/ || index(want, " " $1 " ")' \
            cases/fcc.table > "$table"
    fi
    run yade-batch -j "$jobs" --job-threads 1 --log "products/$2.%.log" "$table" "$1"
    [ -z "$dry" ] || return 0
    # yade-batch returns 0 although a job failed: what counts is the product.
    for n in "${missing[@]}"; do
        [ -f "$(file "$n" "$2")" ] || { echo "case $n: no $2; see products/$2.*.log" >&2; exit 1; }
    done
}
modes() { # case, kind, options
    local out; out=$(file "$1" "$2"); local n=$1; shift 2
    [ -f "$out" ] || run .venv/bin/python -m modal modes "$(file "$n" network)" "$@" -o "$out"
}
run ./setup.sh --extra analysis
run mkdir -p products
for stage in "${stages[@]}"; do
    case "$stage" in
        sample) batch yade_scripts/sample_fcc.py network ;;
        highest) for n in "${cases[@]}"; do modes "$n" highest.modes --highest 1; done ;;
        wave) batch yade_scripts/wave.py signals ;;
        modes) for n in "${cases[@]}"; do
                modes "$n" modes --all
                modes "$n" translations.modes --all --translations-only
            done ;;
        analysis) run .venv/bin/python -m analysis compare "${cases[@]}" \
            --products products -o products/report ;;
    esac
done
