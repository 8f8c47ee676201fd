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
Products go to products/. What was made with other settings, or of a file that has changed, is said
to be stale and made again; the rest is kept (python -m analysis status lists it). A random case
starts from its committed sample in results/samples where products/ has nothing of its own. A case
that fails is left out from there on, the others go on; the exit status is then 1.
YADE is the program named by the variable YADE, or the one in PATH.
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
declare -A failed=()
run() { if [ -n "$dry" ]; then echo "$*"; else "$@"; fi; }
give_up() { # case, what is missing
    failed[$1]=$2
    echo "run_cases.sh: case $1: $2; going on without it" >&2
}
attempt() { # case, what it makes, command: the case is given up where the command fails
    local n=$1 what=$2 status=0; shift 2
    run "$@" || status=$?
    [ "$status" != 130 ] || exit 130
    # Status 3: a product that falls short of what was asked, and says so.
    [ "$status" = 0 ] || [ "$status" = 3 ] || give_up "$n" "no $what"
}
alive() { # cases ...: those that have not failed
    local n; for n in "$@"; do [ -n "${failed[$n]:-}" ] || echo "$n"; done
}
yade() { # options, table, script: runs the jobs, whatever its status
    local batch=${YADE:+$YADE-batch}; batch=${batch:-yade-batch}
    command -v "$batch" > /dev/null || [ -n "$dry" ] ||
        fail "$batch is not in PATH: install yade, or name it by the variable YADE"
    run "$batch" "$@" || echo "run_cases.sh: $batch ended with status $?" >&2
}
file() { printf 'products/case%02d.%s.h5' "$1" "$2"; }
committed() { printf 'results/samples/case%02d.sample.h5' "$1"; }
column() { awk -v n="$1" -v c="$2" '$1 == n {print $c}' cases/random.table; }
state() { # case: the state of its compression under the stress of the case
    local mu stress; mu=$(column "$1" 2) stress=$(column "$1" 4)
    if [ "$mu" = 0 ]; then
        # Of two walks through one pressure the last counts; names begin with their number.
        local name found; name="*_$(awk "BEGIN {printf \"%g\", $stress / 1000}")kPa.sample.h5"
        found=$(find products/compression_mu0 -name "$name" 2>/dev/null | sort | tail -1 || true)
        echo "${found:-products/compression_mu0/$name}"
    else
        printf 'products/compression_mu%s/%s' "$mu" "$(printf '%gPa.sample.h5' "$stress")"
    fi
}
walks() { # case: whether its compression is walked; not where there is only a sample to start from
    [ -f "$(state "$1")" ] || ! { [ -f "$(file "$1" sample)" ] || [ -f "$(committed "$1")" ]; }
}
rows() { # table, wanted first columns: writes these lines to a file of their own and names it
    local wanted=$2 copy; copy=$(mktemp products/.table.XXXXXX)
    awk -v want=" $wanted " '/^#/ {next} /^[a-z]/ || index(want, " " $1 " ")' "$1" > "$copy"
    echo "$copy"
}
batch() { # script, kind of product, table, cases ...
    local script=$1 kind=$2 table=$3 n lines; shift 3
    mapfile -t lines < <(alive "$@")
    [ ${#lines[@]} -gt 0 ] || return 0
    [ -n "$dry" ] || table=$(rows "$table" "${lines[*]}")
    yade -j "$jobs" --job-threads 1 --log "products/$kind.%.log" "$table" "$script"
    [ -z "$dry" ] || return 0
    rm -f "$table"
    # yade-batch returns 0 although a job failed: what counts is the product. The scripts keep what
    # is current and set aside what is stale.
    for n in "${lines[@]}"; do
        [ -f "$(file "$n" "$kind")" ] || give_up "$n" "no $kind, see products/$kind.*.log"
    done
}
compressions() { # the compressions that the random cases come from
    local n mu table=cases/compressions.table mus=" " walked=()
    for n in "${random[@]}"; do
        walks "$n" || continue
        walked+=("$n") mu=$(column "$n" 2)
        [[ $mus = *" $mu "* ]] || mus+="$mu "
    done
    if [[ $mus = *" 0 "* ]]; then
        run .venv/bin/python -m modal pack -o products/compression_mu0 || [ $? != 130 ] || exit 130
    fi
    mus=${mus/ 0 / }
    if [ "$mus" != " " ]; then
        [ -n "$dry" ] || table=$(rows "$table" "$mus")
        yade -j "$jobs" --job-threads 1 --log "products/compression.%.log" "$table" \
            yade_scripts/compress.py
        [ -n "$dry" ] || rm -f "$table"
    fi
    [ -z "$dry" ] || return 0
    for n in "${walked[@]}"; do
        [ -f "$(state "$n")" ] || give_up "$n" "no state, see products/compression.*.log"
    done
}
random_samples() { # at rest with the friction of the wave, exported by YADE with its noise
    local n
    for n in $(alive "${random[@]}"); do
        if walks "$n"; then
            attempt "$n" sample .venv/bin/python -m modal relax "$(state "$n")" \
                --friction "$(column "$n" 3)" --if-stale -o "$(file "$n" sample)"
        elif [ ! -f "$(file "$n" sample)" ]; then
            run cp "$(committed "$n")" "$(file "$n" sample)"
        fi
    done
    batch yade_scripts/export_sample.py network cases/random.table "${random[@]}"
}
modes() { # case, kind, options
    local n=$1 kind=$2; shift 2
    [ -z "${failed[$n]:-}" ] || return 0
    attempt "$n" "$kind" .venv/bin/python -m modal modes "$(file "$n" network)" "$@" \
        --if-stale -o "$(file "$n" "$kind")"
}
fcc=() random=()
for n in "${cases[@]}"; do if [ "$n" -le 4 ]; then fcc+=("$n"); else random+=("$n"); fi; done
setup=(--extra analysis)
case " ${stages[*]} " in *" state "* | *" sample "* | *" wave "*) ;; *) setup+=(--without-yade) ;; esac
run ./setup.sh "${setup[@]}"
run mkdir -p products
for stage in "${stages[@]}"; do
    case "$stage" in
        state) [ ${#random[@]} = 0 ] || compressions ;;
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
        analysis) mapfile -t whole < <(alive "${cases[@]}")
            [ ${#whole[@]} = 0 ] || run .venv/bin/python -m analysis compare "${whole[@]}" \
                --products products -o products/report || failed[comparison]="failed" ;;
    esac
done
if [ ${#failed[@]} -gt 0 ]; then
    text=; for n in "${!failed[@]}"; do text+="; case $n: ${failed[$n]}"; done
    echo "run_cases.sh: failed:${text#;}" >&2
    exit 1
fi
