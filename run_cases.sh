#!/usr/bin/env bash
# Run cases of the study: the front door of workflow/Snakefile, which says what is made from what.
set -euo pipefail
cd -P "$(dirname "$0")" # the name by which Slurm knows the folder
usage() {
    cat <<'HELP'
./run_cases.sh [--case N ... | --all | --study] [--stage NAME] [-j N] [--from-scratch] [--spheres N]
               [--seed N] [--report] [--slurm] [--dry-run | --status] [--help]
  --case N ...    cases to run (default 2): lines of cases/fcc.table (minutes) and cases/random.table (hours)
  --all           the FCC cases
  --study         all cases, their linear waves, and every table and figure of the study
  --stage NAME    only as far as one of: STAGES
  -j N            jobs at a time (default: the number of cores; with --slurm 20)
  --from-scratch  random cases start from a cloud, not from their committed samples
  --spheres N     a reduced study: random packings of N spheres, compressed without YADE, crystals
                  of 40 layers; its products have a folder of their own
  --seed N        packings from another cloud, in a folder seed_N among the products, where the study
                  finds them: how much samples differ (with --stage sample, no wave is needed)
  --report        the report of these cases, and a page of what made each product
  --slurm         every job is one of Slurm's (docs/workflow.md)
  --dry-run       list what would be made and what it may cost, make nothing
  --status        which case has what, what is stale and why, what the rest may cost
Products go to products/. What is made is kept; what was made with other settings, or of a file that
has changed, is made again. A product that fails is named with its reason, and what needs it is left
out; the rest goes on. Exit status: 0; 2 if what is wrong says what to do; else 1.
Ctrl-C stops the running jobs. A run that was killed is resumed by the same command.
YADE is the program named by the variable YADE, or the one in PATH.
HELP
}
fail() { echo "run_cases.sh: $*" >&2; exit 2; }
number() { [[ "${2:-}" =~ ^[1-9][0-9]{0,7}$ ]] || fail "$1 needs a number, for example $1 $3"; }
numbers() { awk '$1 ~ /^[0-9]+$/ {print $1 + 0}' "${@/%/.table}"; }
mapfile -t crystals < <(numbers cases/fcc)
mapfile -t known < <(numbers cases/fcc cases/random)
stages=(state sample highest wave linear modes response density structure shear moduli split analysis)
products=$(sed -n 's/^products: *\([^ ]*\).*/\1/p' workflow/study.yaml)
cases=() stage=analysis jobs='' options=() seed='' slurm='' only=''
while [ $# -gt 0 ]; do
    case "$1" in
        --case) shift; [[ "${1:-}" =~ ^[0-9]+$ ]] || fail "--case needs a number, for example --case 2"
            while [[ "${1:-}" =~ ^[0-9]+$ ]]; do
                n=$((10#$1)); shift
                [[ " ${known[*]} " == *" $n "* ]] || fail "case $n: no line in cases/fcc.table or cases/random.table"
                [[ " ${cases[*]} " == *" $n "* ]] || cases+=("$n")
            done; continue ;;
        --all) cases=("${crystals[@]}") ;;
        --study) cases=("${known[@]}"); stage=study ;;
        --report) stage=report ;;
        --stage) shift; [[ " ${stages[*]} " == *" ${1:-none} "* ]] || fail "--stage is one of: ${stages[*]}"
            stage=$1 ;;
        -j) shift; number -j "${1:-}" 2; jobs=$1 ;;
        --from-scratch) options+=(from_scratch=True) ;;
        --spheres) shift; number --spheres "${1:-}" 1000; products+=/${1}_spheres
            options+=("spheres=$1" preparation=modal crystal_layers=40) ;;
        --seed) shift; number --seed "${1:-}" 2; seed=$1 ;;
        --slurm) slurm=slurm ;;
        --dry-run|--status) only=${1#--} ;;
        --help|-h) usage | sed "s/STAGES/${stages[*]}/"; exit 0 ;;
        *) fail "unknown option $1; see --help" ;;
    esac
    shift
done
[ "$(uname)" = Linux ] ||
    fail "the study runs on Linux, with YADE; on $(uname) \`pip install .\` gives granular-modes"
[ ${#cases[@]} -gt 0 ] || cases=(2)
# nproc takes OMP_NUM_THREADS for the number of cores.
[ "$seed" != 1 ] || fail "--seed 1: that is the study's own; another, for example --seed 2, tells how much samples differ"
[ -z "$seed" ] || { products+=/seed_$seed; options+=("seed=$seed"); }
[ -n "$jobs" ] || jobs=$([ -n "$slurm" ] && echo 20 || env -u OMP_NUM_THREADS nproc)
./setup.sh --extra "${slurm:-workflow}" --without-yade
python=.venv/bin/python
export PYTHONPATH=$PWD/workflow:$PWD
options+=("products=$products" "cases=[$(IFS=,; echo "${cases[*]}")]" "stage=$stage")
# Every product is renamed when it is complete, so what a killed run has finished counts; and Snakemake's
# own lock would outlive a kill.
snakemake=("$python" -m snakemake -s workflow/Snakefile --logger study --ignore-incomplete --nolock)
study() { # Snakemake's options: what it says beside the study's own lines is left out
    { "${snakemake[@]}" "$@" --config "${options[@]}" 2>&1 1>&3 |
        { grep --line-buffered -v '^Using .* for setting default command line arguments.$' >&2 || true; }
    } 3>&1
    return "${PIPESTATUS[0]}"
}
# No more jobs side by side than the memory that is free now, or granted, has room for.
memory=$("$python" -c 'from modal.tools.workload import memory_at_hand; print(int(memory_at_hand() / 2**20))')
how=(--cores "$jobs" --resources "mem_mb=$memory")
if [ -n "$slurm" ]; then
    command -v sbatch > /dev/null || fail "--slurm: no sbatch in PATH; run it where jobs are submitted"
    # Where accounting is off, the controller is asked instead.
    sacct --noheader > /dev/null 2>&1 || export PATH=$PWD/workflow/slurm:$PATH
    how=(--profile workflow/profiles/slurm --jobs "$jobs")
fi
run() { study "${how[@]}" ${stale:+--forcerun $stale} "$@"; }

if [ -z "$only" ]; then
    mkdir -p "$products"
    # Snakemake itself takes a disk without any space badly.
    head -c 100000 /dev/zero 2> /dev/null > "$products/.space.$$" && rm "$products/.space.$$" ||
        { rm -f "$products/.space.$$"; fail "$products: cannot be written; free space on its disk, or give it back its permissions"; }
    exec 9> "$products/.driver"
    flock -n 9 || { echo "another run is at work in $products: waiting for it"; flock 9; }
    # A kill leaves jobs behind: what they make counts, and nothing is made twice.
    flock -n "$products/.jobs" true ||
        { echo "jobs of a run that was killed are at work: waiting"; flock "$products/.jobs" true; }
    # Its marks of unfinished products would keep Snakemake from its report.
    [ ! -d .snakemake/incomplete ] || find .snakemake/incomplete -type f -delete
    at_work() { # but for a job that this driver itself runs in
        local queue
        queue=$(squeue --me --noheader --format='%i|%Z') || fail "squeue does not say which jobs of an earlier run are at work; run it again when Slurm answers"
        awk -F '|' '$1 != ENVIRON["SLURM_JOB_ID"] && $2 == ENVIRON["PWD"] {n++} END {exit !n}' <<< "$queue"
    }
    if [ -n "$slurm" ] && at_work; then
        echo "Slurm jobs of an earlier run are at work or wait (scancel ends them): waiting for them"
        while at_work; do sleep 10; done
    fi
fi
stale=
if compgen -G "$products/*.h5" > /dev/null; then
    stale=$("$python" -m analysis status --products "$products" --stale "${cases[@]}")
    [ "$only" != status ] || "$python" -m analysis status --products "$products"
fi
case $only in
    status) plan=$(run --dry-run) || exit 2; grep -e '^plan: ' -e '^nothing' <<< "$plan"; exit 0 ;;
    dry-run) run --dry-run || exit 2; exit 0 ;;
esac
# With Slurm it is the nodes that need YADE.
if [ -z "$slurm" ] && ! ./setup.sh --is-yade-there 2> /dev/null; then
    plan=$(run --dry-run) || exit 2
    if grep -q '^plan: .*, by YADE$' <<< "$plan"; then ./setup.sh --extra workflow; fi
fi
STUDY_FAILED=$(mktemp) status=0
export STUDY_FAILED
trap 'rm -f "$STUDY_FAILED"' EXIT
run || status=$?
if [[ $status != 130 && ( $stage = analysis || $stage = report ) ]]; then
    for n in "${cases[@]}"; do cat "$(printf '%s/report/case%02d.txt' "$products" "$n")" 2> /dev/null || true; done
fi
[ ! -d "$products/cost" ] || "$python" workflow/cost.py "$products"
if [[ $status = 0 && ( $stage = report || $stage = study ) ]]; then
    mkdir -p "$products/report"
    study --cores 1 --report "$products/report/workflow.html" || status=$?
    ls "$products"/*/{report,study,workflow}.html 2> /dev/null || true
fi
if [ "$status" = 1 ]; then
    # Each had its line when it failed; after a long run they are said once more. Without any it was
    # the settings that were refused.
    [ "$(wc -l < "$STUDY_FAILED")" -lt 2 ] || sed 's/^. /run_cases.sh: failed: /' "$STUDY_FAILED" >&2
    grep -q '^1' "$STUDY_FAILED" || status=2
fi
exit "$status"
