"""Shared fixtures."""

import sys
from pathlib import Path

import pytest

from fdnet.dem.binary import Binary, find_binary

sys.path.insert(0, str(Path(__file__).parent))
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def root() -> Path:
    """The project folder."""
    return ROOT


@pytest.fixture(scope="session")
def binary() -> Binary:
    """The real LIGGGHTS; the suite needs it (scripts/setup.sh installs it)."""
    return find_binary()
