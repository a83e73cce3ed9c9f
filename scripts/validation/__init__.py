"""The evidence for fdnet: studies of error against run time, and comparisons from outside."""

import os
from pathlib import Path

_SCRIPTS = str(Path(__file__).parents[1])
_paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
if _SCRIPTS not in _paths:  # child processes find this package too
    os.environ["PYTHONPATH"] = os.pathsep.join([_SCRIPTS, *filter(None, _paths)])
