"""Extreme whole runs on the real binary: right counts and bounds, or one clear error."""

import contextlib
import io
import json
import math
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from builders import TINY

from fdnet.case.file import read_case, set_keys
from fdnet.cli import main
from fdnet.scales.scales import scales_of

pytestmark = pytest.mark.liggghts
DENSE = "fines.concentration=0.2"
STIFF = ("run.stiffness_N_m=1e7", "run.cap_ms=0.01")


def run(folder: Path, *assignments: str, without: str = "") -> tuple[int, dict[str, Any], str]:
    """The tiny case with `assignments` through the command line: exit code, summary, message."""
    data = set_keys(TINY, ["run.cap_ms=0.1", "fluid.velocity_m_s=2.0", *assignments])
    data.pop(without, None)
    (folder / "case.toml").write_text(tomli_w.dumps(data))
    out, err = io.StringIO(), io.StringIO()
    stages = ["--stages", "pack,invade,analyse", "--json", "--quiet"]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(["run", str(folder / "case.toml"), "--out", str(folder / "run"), *stages])
    return code, json.loads(out.getvalue()) if code == 0 else {}, err.getvalue()


def check_bounds(folder: Path, summary: dict[str, Any]) -> None:
    """What holds for every run: fines are conserved and never raise k, and numbers are finite.

    They add at most their own volume of solid, those upstream up to half of it.
    """
    case = read_case(folder / "case.toml")
    counts = [summary[f"{name}_count"] for name in ("invaded", "passed", "upstream")]
    assert sum(counts) == summary["supplied_count"]
    inside = sum(section["fines_count"] for section in summary["sections"])
    assert inside == summary["invaded_count"]
    assert 0 <= summary["k_damaged_m2"] <= summary["k_initial_m2"] < 1e-6
    assert 0 <= summary["porosity_damaged"] <= summary["porosity_initial"] <= 1
    upstream = summary["upstream_count"] * case.fines.mean_volume_m3
    most = (summary["invaded_volume_m3"] + 0.5 * upstream) / math.prod(case.size_m)
    assert summary["porosity_initial"] - summary["porosity_damaged"] <= most + 1e-3
    assert math.isfinite(summary["max_overlap_fraction"])
    assert summary["solver"]["residual"] <= 1e-6


@pytest.mark.parametrize(
    ("name", "assignments"),
    [
        ("porosity 0.30", ["grains.count=85"]),
        ("porosity 0.60", ["grains.count=47"]),
        ("radii 1:4", ["grains.radius_mm=[0.1, 0.4]", "grains.count=50", "fines.radius_mm=0.04"]),
        ("inviscid", ["fluid.viscosity_cP=1e-12"]),
        ("the contact bound", ["run.time_step_factor=0.3"]),
        ("mobile grains", ["grains.motion='mobile'", "fines.count=100"]),
        ("more than the void", ["fines.radius_mm=0.09", "fines.count=1200", DENSE]),
        ("drag x 1000", ["drag.multiplier=1000.0", "fines.count=50", *STIFF]),
    ],
)
def test_a_hard_case_runs_and_keeps_its_bounds(tmp_path, name, assignments):
    code, summary, err = run(tmp_path, *assignments)
    assert code == 0, f"{name}: {err}"
    check_bounds(tmp_path, summary)
    wanted = {"porosity 0.60": 0.60, "porosity 0.30": 0.30}
    if name in wanted:
        assert summary["porosity_initial"] == pytest.approx(wanted[name], abs=0.01)
    if name == "the contact bound":
        contacts = scales_of(read_case(tmp_path / "case.toml")).contacts.values()
        limit = min(contact.step_limit for contact in contacts)
        assert summary["dem_dt_s"] == pytest.approx(0.3 * limit, rel=1e-6)
    if name == "porosity 0.30":
        assert any("denser than rigid spheres get" in one for one in summary["warnings"])


def test_no_fines_leave_the_pack_as_it_is(tmp_path):
    code, summary, err = run(tmp_path, without="fines")
    assert code == 0, err
    assert summary["k_damaged_m2"] == summary["k_initial_m2"] > 0
    assert summary["porosity_damaged"] == summary["porosity_initial"]
    assert summary["stop_reason"] is None


def test_fines_larger_than_every_throat_stay_at_the_face(tmp_path):
    """Circles between three touching grains of 0.25 mm have 0.04 mm: 0.2 mm cannot pass."""
    code, summary, err = run(tmp_path, "fines.radius_mm=0.2", "fines.count=30", "run.cap_ms=0.35")
    assert code == 0, err
    check_bounds(tmp_path, summary)
    assert summary["passed_count"] == 0
    assert summary["invasion_depth_m"] < 1e-3
    assert summary["upstream_count"] > 20


def test_a_pack_denser_than_reachable_is_refused_with_the_overlap_it_needs(tmp_path):
    code, _, err = run(tmp_path, "grains.count=110")
    assert code == 2
    assert "grains.count: 110 needs grains that overlap by" in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()
    crowded = "fines={radius_mm=0.2, count=200, concentration=0.3}"
    code, _, err = run(tmp_path, crowded)
    assert code == 2
    assert "fines.concentration: 0.3 leaves" in err, "a supply that finds no place"
    assert not (tmp_path / "run").exists()
