#!/usr/bin/env bash
# Make every table and figure of docs/isostaticity.md, attenuation.md, transducers.md and results.md
# that comes from committed files again, in place; `git diff --stat results` then says what differs.
# Three minutes.
#   results/remake.sh            from a clone, after ./setup.sh --extra analysis
#   results/remake.sh samples    also what is measured in the committed samples: some ten minutes more
# What needs YADE or LAMMPS (case02, split_case*.csv, lammps_rest) has its commands in README.md.
set -euo pipefail
cd "$(dirname "$0")/.."
export MPLBACKEND=agg
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
make_study() {
    .venv/bin/python -m analysis study studies/otsubo2017/study.yaml --results results/study/cases -o "$made/out"
    for file in $(git ls-files results/study | grep -v /cases/); do
        [ ! -e "$made/out/${file#results/study/}" ] || cp "$made/out/${file#results/study/}" "$file"
    done
}
make_study # first: the others read its tables
for name in isostaticity soft_modes plane_waves width; do
    .venv/bin/python "examples/$name.py" "results/$name" > /dev/null
done
make_study # again: its page shows the figure on isostaticity
.venv/bin/python examples/transducers.py results/transducers > /dev/null
.venv/bin/python examples/stress_dependence.py results/transducers > /dev/null
.venv/bin/python examples/isostaticity_doubts.py results/isostaticity/doubts > /dev/null
if [ "${1:-}" = samples ]; then
    .venv/bin/python examples/paper_rules.py results/independent > /dev/null
    .venv/bin/python -m analysis measure results/samples/case0[5-8].sample.h5 \
        results/samples/case29.sample.h5 results/samples/case3[0-2].sample.h5 --quantities \
        coordination_of_bearing bulk_modulus shear_modulus poisson anisotropy bulk_over_affine \
        shear_over_affine shear_over_indeterminacy v_p_moduli v_p v_s_moduli v_s \
        -o results/elastic.md
fi
