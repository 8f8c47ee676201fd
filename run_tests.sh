#!/usr/bin/env bash
# Set up what the tests need, then run them. Arguments go to pytest.
set -euo pipefail
cd "$(dirname "$0")"
./setup.sh --extra test
exec .venv/bin/python -m pytest "$@"
