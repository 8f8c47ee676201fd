"""Run by every Python of a test run: packages in GRANULAR_WITHOUT cannot be imported."""

import os
import sys

for name in filter(None, os.environ.get("GRANULAR_WITHOUT", "").split(",")):
    sys.modules[name] = None
