#!/usr/bin/env bash
# Run cases of the study: state -> sample -> highest mode -> wave -> modes -> comparison.
set -euo pipefail
cd "$(dirname "$0")"
usage() {
    cat <<'HELP'
./run_cases.sh [--case N ...] [--all] [--stage NAME] [-j N] [--dry-run] [--help]
  --case N ...   cases to run (default 2): 1-4 FCC (minutes), 5-32 random (hours)
  --all          the FCC cases 1 to 4
  --stage NAME   only one of: state sample highest wave modes analysis
  -j N           jobs that yade-batch runs at a time (default 2)
  --dry-run      print the commands, run nothing
Products go to products/; a finished product is not made again.
HELP
}
fail() { echo "run_cases.sh: $*" >&2; exit 2; }
cases=() stages=(state sample highest wave modes analysis) jobs=2 dry=
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
done
run() { if [ -n "$dry" ]; then echo "$*"; else "$@"; fi; }
yade() { # options, table, script: runs the jobs, whatever its status
    command -v yade-batch > /dev/null || [ -n "$dry" ] || fail "yade-batch is not in PATH: install yade"
    run yade-batch "$@" || echo "run_cases.sh: yade-batch ended with status $?" >&2
}
file() { printf 'products/case%02d.%s.h5' "$1" "$2"; }
column() { awk -v n="$1" -v c="$2" '$1 == n {print $c}' cases/random.table; }
state() { # case: the state of its chain under the stress of the case
    local mu stress; mu=$(column "$1" 2) stress=$(column "$1" 4)
    if [ "$mu" = 0 ]; then
        # Of two walks through one pressure the last counts; names begin with their number.
        local name found; name="*_$(awk "BEGIN {printf \"%g\", $stress / 1000}")kPa.sample.h5"
        found=$(find products/chain_mu0 -name "$name" 2>/dev/null | sort | tail -1 || true)
        echo "${found:-products/chain_mu0/$name}"
    else
        printf 'products/chain_mu%s/%s' "$mu" "$(printf '%gPa.sample.h5' "$stress")"
    fi
}
batch() { # script, kind of product, table, cases ...
    local script=$1 kind=$2 rows=$3 missing=() n table="products/$2.table"; shift 3
    for n in "$@"; do [ -f "$(file "$n" "$kind")" ] || missing+=("$n"); done
    [ ${#missing[@]} -gt 0 ] || return 0
    if [ -z "$dry" ]; then
        awk -v want=" ${missing[*]} " '/^#/ {next} /^case/ || index(want, " " $1 " ")' \
            "$rows" > "$table"
    fi
    yade -j "$jobs" --job-threads 1 --log "products/$kind.%.log" "$table" "$script"
    [ -z "$dry" ] || return 0
    # yade-batch returns 0 although a job failed: what counts is the product.
    for n in "${missing[@]}"; do
        [ -f "$(file "$n" "$kind")" ] || { echo "case $n: no $kind; see products/$kind.*.log" >&2; exit 1; }
    done
}
chains() { # the compression chains that the random cases come from
    local n mu table=products/chains.table mus=" "
    for n in "${random[@]}"; do
        mu=$(column "$n" 2)
        [ -f "$(state "$n")" ] || [[ $mus = *" $mu "* ]] || mus+="$mu "
    done
    [ "$mus" != " " ] || return 0
    if [[ $mus = *" 0 "* ]]; then
        run .venv/bin/python -m modal pack -o products/chain_mu0
    fi
    mus=${mus/ 0 / }
    if [ "$mus" != " " ]; then
        [ -n "$dry" ] || awk -v want="$mus" '/^#/ {next} /^mu_comp/ || index(want, " " $1 " ")' \
            cases/chains.table > "$table"
        yade -j "$jobs" --job-threads 1 --log "products/chain.%.log" "$table" \
            yade_scripts/chain.py
    fi
    [ -z "$dry" ] || return 0
    for n in "${random[@]}"; do
        [ -f "$(state "$n")" ] || { echo "case $n: no state; see products/chain.*.log" >&2; exit 1; }
    done
}
random_samples() { # at rest with the friction of the wave, exported by YADE with its noise
    local n
    for n in "${random[@]}"; do
        # Status 3: nearly at rest; the sample says how near.
        [ -f "$(file "$n" sample)" ] || run .venv/bin/python -m modal relax "$(state "$n")" \
            --friction "$(column "$n" 3)" -o "$(file "$n" sample)" || [ $? = 3 ]
    done
    batch yade_scripts/export_random.py network cases/random.table "${random[@]}"
}
modes() { # case, kind, options
    local out; out=$(file "$1" "$2"); local n=$1; shift 2
    [ -f "$out" ] || run .venv/bin/python -m modal modes "$(file "$n" network)" "$@" -o "$out"
}
fcc=() random=()
for n in "${cases[@]}"; do if [ "$n" -le 4 ]; then fcc+=("$n"); else random+=("$n"); fi; done
run ./setup.sh --extra analysis
run mkdir -p products
for stage in "${stages[@]}"; do
    case "$stage" in
        state) [ ${#random[@]} = 0 ] || chains ;;
        sample) batch yade_scripts/sample_fcc.py network cases/fcc.table "${fcc[@]}"
            [ ${#random[@]} = 0 ] || random_samples ;;
        highest) for n in "${cases[@]}"; do modes "$n" highest.modes --highest 1; done ;;
        wave) batch yade_scripts/wave.py signals cases/fcc.table "${fcc[@]}"
            batch yade_scripts/wave.py signals cases/random.table "${random[@]}" ;;
        modes) for n in "${fcc[@]}"; do
                modes "$n" modes --all
                modes "$n" translations.modes --all --translations-only
            done
            for n in "${random[@]}"; do modes "$n" modes --lowest 100; done ;;
        analysis) run .venv/bin/python -m analysis compare "${cases[@]}" \
            --products products -o products/report ;;
    esac
done
