#!/usr/bin/env bash
# Run cases of a study: the front door of workflow/Snakefile, which says what is made from what.
#
# ./run_cases.sh [--case N ... | --all | --study [YAML]] [--stage NAME] [-j N] [--spheres N] [--seed N]
#                [--from-scratch] [--slurm | --profile DIR] [--dry-run | --status] [--help]
#   --case N ...    cases to run, by number or name (default 2), and a table of each
#   --all           the crystals
#   --study [YAML]  all cases (default: of studies/otsubo2017/study.yaml), every table, figure, one page
#   --stage NAME    as far as: sample highest wave linear modes response density structure shear moduli split
#   -j N            jobs at a time (default: the number of cores; on a cluster 20)
#   --spheres N     reduced: random packings of N spheres without YADE, crystals of 40 layers, in a folder
#   --seed N        packings from another cloud, which give the study's numbers their scatter
#   --from-scratch  random cases start from a cloud, not from their committed samples
#   --slurm         each job is one of Slurm's; --profile DIR: of another cluster (docs/workflow.md)
#   --dry-run       what would be made; --status: each file, whether it is there, and why it would be made again
# Products go to products/. What is made is kept; a run that was killed is resumed by the same command.
# Exit status: 0; 3 for a page without some cases, which says why; 2 if what is wrong says what to do;
# else 1. The variable YADE names another YADE.
set -euo pipefail
cd -P "$(dirname "$0")" # the name by which Slurm knows the folder
fail() { echo "run_cases.sh: $*" >&2; exit 2; }
number() { [[ "$2" =~ ^[1-9][0-9]{0,7}$ ]] || fail "$1 needs a number, for example $1 $3"; }
study=studies/otsubo2017/study.yaml
products=products
cases=()        # 2 if none is named
stage=result
jobs_at_a_time= # empty: as many as fit
only=           # dry-run or summary; empty: run
config=()       # further settings of the Snakefile
profile=local
while [ $# -gt 0 ]; do
    case "$1" in
        --case) while [[ "${2:-}" =~ ^[A-Za-z0-9_] ]]; do
                [[ "$2" =~ ^[A-Za-z0-9_.+-]+$ ]] || fail "--case $2: no name of a case; see the study's cases"
                cases+=("$2"); shift
            done
            [ ${#cases[@]} -gt 0 ] || fail "--case needs a number, for example --case 2" ;;
        --all) cases=(fcc) ;;
        --study) cases=(all) stage=page
            if [ $# -gt 1 ] && [[ "$2" != -* ]]; then
                [[ "$2" =~ ^[A-Za-z0-9_./+][A-Za-z0-9_./+-]*\.yaml$ ]] ||
                    fail "--study $2: give a file *.yaml, whose path has letters, digits and _ . - + / alone"
                study=$2; shift
            fi ;;
        --stage) stage=${2:-none}; shift
            [[ "$stage" =~ ^[a-z]+$ ]] || fail "--stage $stage: give one word; see --help" ;;
        -j) number -j "${2:-}" 2; jobs_at_a_time=$2; shift ;;
        --spheres) number --spheres "${2:-}" 1000; products+=/${2}_spheres config+=("spheres=$2"); shift ;;
        --seed) number --seed "${2:-}" 2; config+=("seed=$2"); shift ;;
        --from-scratch) config+=(from_scratch=True) ;;
        --slurm) profile=slurm ;;
        --profile) profile=${2:-none}; profile=${profile%/}; profile=${profile#workflow/profiles/}; shift
            [[ "$profile" =~ ^[A-Za-z0-9_-]+$ ]] || fail "--profile $profile: no such folder in workflow/profiles" ;;
        --dry-run) only=dry-run ;;
        --status) only=summary ;;
        --help | -h) sed -n '4,18s/^# \{0,1\}//p' "$0"; exit 0 ;;
        *) fail "unknown option $1; see --help" ;;
    esac
    [ $# = 0 ] || shift
done
[ "$(uname)" = Linux ] || fail "the study runs on Linux, with YADE; on $(uname) \`pip install .\` gives granular-modes"
[ -f "workflow/profiles/$profile/config.yaml" ] || fail "--profile $profile: no such folder in workflow/profiles"
extra=workflow
! grep -q '^executor: *slurm' "workflow/profiles/$profile/config.yaml" || extra=slurm
./setup.sh --extra "$extra" --without-yade
exec .venv/bin/python workflow/run.py "$profile" "$only" "$jobs_at_a_time" "study=$study" "products=$products" \
    "stage=$stage" "cases=[$(IFS=,; echo "${cases[*]:-2}")]" "${config[@]}"
