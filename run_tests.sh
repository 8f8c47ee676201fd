#!/usr/bin/env bash
# Set up what the tests need, then run them. Arguments go to pytest, which then runs once, as in
#   ./run_tests.sh -m slow      or      GRANULAR_WITHOUT=numba,pypardiso ./run_tests.sh -k modes
# Without arguments the whole suite runs, with numba and PARDISO, and then what goes another way
# without them once more, with scipy alone. Both run, and the worse status of the two is the script's.
set -euo pipefail
cd "$(dirname "$0")"
./setup.sh --extra test
# Hundreds of programs that tests start would each compile all modules anew.
unset PYTHONDONTWRITEBYTECODE
# Two workers with one thread each; a file's tests share what they prepared.
export OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1
pytest=(.venv/bin/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder)
[ $# -eq 0 ] || exec "${pytest[@]}" "$@"
trap 'exit 130' INT # pytest itself ends in order, and would leave us to go on
status=0
"${pytest[@]}" || status=$?
mapfile -t files < <(grep -rl --include="test_*.py" two_ways tests)
GRANULAR_WITHOUT=numba,pypardiso,threadpoolctl "${pytest[@]}" -m "two_ways and not slow" "${files[@]}" ||
    status=$(($? > status ? $? : status))
exit "$status"
