"""Shared fixtures."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fdnet.case.case import Case
from fdnet.dem.liggghts import Binary, Launch, find_binary
from fdnet.dem.packing import make_pack
from fdnet.network.permeability import Analysis, analyse
from fdnet.run.finished import FinishedRun
from fdnet.spheres.snapshot import Snapshot

sys.path.insert(0, str(Path(__file__).parent))
ROOT = Path(__file__).resolve().parents[1]

_approx = pytest.approx


def _approx_relative(expected: Any, rel: Any = None, abs: Any = None, nan_ok: bool = False) -> Any:
    """pytest.approx without its own absolute tolerance: 1e-12 is a tenth of a permeability."""
    return _approx(expected, rel, 0.0 if rel is not None and abs is None else abs, nan_ok)


pytest.approx = _approx_relative


@pytest.fixture(scope="session")
def root() -> Path:
    """The project folder."""
    return ROOT


@pytest.fixture(scope="session")
def binary() -> Binary:
    """The real LIGGGHTS; the suite needs it (scripts/setup.sh installs it)."""
    return find_binary()


@pytest.fixture(scope="session")
def grains_of(
    binary: Binary, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[Case], Snapshot]:
    """Grains of a case, packed once for all tests that ask for the same pack."""
    made: dict[str, Snapshot] = {}

    def grains(case: Case) -> Snapshot:
        name = case.digest("pack")
        if name not in made:
            folder = tmp_path_factory.mktemp(f"pack-{name}")
            made[name] = make_pack(case, folder, Launch(binary=binary)).grains
        return made[name]

    return grains


@pytest.fixture
def case_file(tmp_path: Path) -> Path:
    """The file of the tiny case."""
    from builders import tiny

    path = tmp_path / "case.toml"
    path.write_text(tiny("run.cap_ms=0.35").toml())
    return path


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> FinishedRun:
    """A tiny run of all stages: fixed grains, periodic sides. Tests leave its folder as it is."""
    from builders import tiny

    from fdnet.run.pipeline import run_case

    out = tmp_path_factory.mktemp("fixed") / "run"
    return run_case(tiny("run.cap_ms=0.35", "box.sides=periodic"), out)


@pytest.fixture(scope="session")
def analysed(finished: FinishedRun) -> Analysis:
    """The analysis of that run, made again from its spheres."""
    case = finished.case
    spheres = finished.spheres("initial"), finished.spheres()
    return analyse(*spheres, periodic=case.periodic, options=case.analysis)
