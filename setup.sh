#!/usr/bin/env bash
# Set up what is missing: YADE, and h5py and scipy for its Python, from Debian; a virtual
# environment in .venv.
#   ./setup.sh [--extra analysis|test]
# Does nothing where all is there. As root or with sudo it installs; otherwise it prints the
# exact command and ends with status 2.
set -euo pipefail
cd "$(dirname "$0")"
extra=analysis
case "${1:-}" in
    "") ;;
    --extra) extra=${2:?"setup.sh: --extra needs a name: analysis or test"} ;;
    *) echo "setup.sh: unknown option $1; use --extra analysis or --extra test" >&2; exit 2 ;;
esac

packages=()
[ -x /usr/bin/yade ] || packages+=(yade)
/usr/bin/python3 -c 'import h5py' 2>/dev/null || packages+=(python3-h5py)
# The scripts inside YADE find the recorded chain of contacts with scipy's shortest path.
/usr/bin/python3 -c 'import scipy' 2>/dev/null || packages+=(python3-scipy)
# An existing virtual environment needs no venv module any more.
[ -x .venv/bin/python ] || python3 -c 'import ensurepip, venv' 2>/dev/null || packages+=(python3-venv)
if [ ${#packages[@]} -gt 0 ]; then
    install="apt-get install -y --no-install-recommends ${packages[*]}"
    if ! command -v apt-get >/dev/null; then
        echo "setup.sh: missing ${packages[*]}; they are Debian packages, install them by hand" >&2
        exit 2
    elif [ "$(id -u)" = 0 ]; then
        apt-get update -q && DEBIAN_FRONTEND=noninteractive $install
    elif sudo -n true 2>/dev/null; then
        sudo apt-get update -q && sudo DEBIAN_FRONTEND=noninteractive $install
    else
        echo "setup.sh: missing ${packages[*]}; run: sudo apt-get update && sudo $install" >&2
        exit 2
    fi
fi

# The stamp holds what was installed, so that a second run, or a change of pyproject.toml, is seen.
stamp=".venv/installed-$extra"
if ! cmp -s pyproject.toml "$stamp"; then
    [ -x .venv/bin/python ] || python3 -m venv .venv
    pip=".venv/bin/python -m pip install --quiet --disable-pip-version-check"
    # The fast packages are optional: where they cannot be had, the rest is installed without.
    $pip -e ".[$extra,fast]" || $pip -e ".[$extra]"
    cp pyproject.toml "$stamp"
fi
