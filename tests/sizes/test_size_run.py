"""A run of measured sizes through the real binary: what is placed, supplied and said."""

import json

import numpy as np
import pytest

import fdnet
from fdnet.case.file import case_from

pytestmark = pytest.mark.liggghts

CASE = {
    "name": "measured",
    "box": {"size": ["1.9 mm", "1.8 mm", "1.8 mm"], "sides": "periodic"},
    "grains": {
        "sizes": {"D10": "0.25 mm", "D50": "0.40 mm", "D90": "0.60 mm"},
        "porosity": "38 %",
    },
    "fines": {
        "materials": [
            {
                "name": "CaCO3",
                "share": 3.0,
                "density": "2.71 g/cc",
                "sizes": {"D10": "25 um", "D50": "50 um", "D90": "90 um"},
            },
            {
                "name": "barite",
                "share": 1.0,
                "density": "4.2 g/cc",
                "sizes": {"D10": "40 um", "D90": "80 um"},
            },
        ],
        "cut": "50 um",
        "solids": "60 lb/bbl",
        "slab": "0.25 mm",
        "supply": "batches",
    },
    "fluid": {"viscosity": "10 cP", "velocity_m_s": 0.6},
    "run": {"stiffness": "100 N/m", "duration": "0.6 ms"},
    "analysis": {"sections": 2},
}


def test_a_sand_and_a_mud_run_to_their_summary(binary, tmp_path):
    """Grain to smallest fine 1 : 17, two materials, units throughout."""
    case = case_from(CASE)
    assert case.grains.radius_range_m[1] > 15 * case.fines.radius_range_m[0]
    run = fdnet.run_case(case, tmp_path / "run", stages=("pack", "invade", "analyse"))
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    counts = [summary[f"{name}_count"] for name in ("invaded", "passed", "upstream")]
    assert summary["supplied_count"] == sum(counts) > 50
    grains, fines = summary["sizes"]["grains"], summary["sizes"]["fines"]
    assert grains["law"] == "log-normal"
    assert grains["asked_m"] == pytest.approx({"D10": 2.5e-4, "D50": 4e-4, "D90": 6e-4})
    for name in ("D10", "D50", "D90"):
        assert grains["placed_m"][name] == pytest.approx(grains["curve_m"][name], rel=0.05)
    assert fines["law"] == "mixture"
    assert fines["placed_count"] == summary["supplied_count"]
    assert fines["curve_m"]["D10"] is None
    assert fines["placed_m"]["D90"] == pytest.approx(fines["curve_m"]["D90"], rel=0.05)
    assert fines["finer_left_out"] == pytest.approx(case.fines.curve.below)
    said = " ".join(summary["warnings"])
    assert "of the solids (finer than 50 um)" in said
    assert np.min(run.spheres().fines().radius) >= 25e-6 * (1 - 1e-9)
    assert abs(summary["porosity_initial"] - 0.38) <= 0.003
    assert run.case.given["fines.solids"] == "60 lb/bbl"
