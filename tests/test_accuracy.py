"""The accuracy study: its truth, its laws on two packs, its statistics and its tables."""

import csv
import math
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fdnet.network.laws.conductance import lubrication_law
from fdnet.network.laws.named import LAWS
from fdnet.spheres.snapshot import Kind
from fdnet.studies.network import law_models
from fdnet.studies.truth import truth
from tests.network.packs import face_centred

DATA = Path(__file__).parent / "data" / "truth"
TRUTH = DATA / "truth.csv"


@pytest.fixture(scope="module")
def study(root):
    sys.path.insert(0, str(root / "scripts"))
    try:
        import accuracy
        import accuracy_models
        import accuracy_tables
    finally:
        sys.path.pop(0)
    return SimpleNamespace(
        main=accuracy, cases=truth, models=accuracy_models, tables=accuracy_tables
    )


@pytest.fixture(scope="module")
def cases(study):
    return {case.name: case for case in study.cases.read_cases([TRUTH], [DATA])[0]}


def test_truth_is_read_with_its_class_and_what_is_missing_is_named(study, cases):
    found, missing = study.cases.read_cases([TRUTH], [DATA])
    rows = list(csv.DictReader(TRUTH.open()))
    named = {row["file"] for row in rows if row["file"]}
    assert set(missing) == {name for name in named if not (DATA / name).exists()}
    assert len(found) == len([row for row in rows if row["file"]]) - len(missing) + len(
        study.cases.LOOSE_SOLIDS
    )
    assert cases["SC_touching"].group == study.cases.LATTICE
    assert cases["A_200_eps40"].group == study.cases.EQUAL
    assert cases["A_200_eps40"].k == pytest.approx(0.00100982e-6)
    assert cases["A_200_eps40"].error == pytest.approx(0.005)
    assert cases["C_r5_half y"].ratio == pytest.approx(0.5498)


def test_loose_lattices_have_their_volume_fraction(cases):
    pack = cases["SC c = 0.343"].pack
    assert np.sum(4 / 3 * np.pi * pack.radius**3) / np.prod(
        np.ptp(pack.box, axis=1)
    ) == pytest.approx(0.343)


def test_turned_packs_have_the_axis_as_x(study, cases):
    pack = cases["C_r5_d2"].pack
    turned = study.cases.turned(pack, 1)
    assert np.array_equal(turned.position[:, 0], pack.position[:, 1])
    assert np.ptp(turned.box, axis=1) == pytest.approx(np.roll(np.ptp(pack.box, axis=1), -1))
    # turned, not mirrored: the signed volume of four spheres stays
    volumes = [np.linalg.det(one.position[1:4] - one.position[0]) for one in (pack, turned)]
    assert abs(volumes[0]) > 0
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-9)
    assert set(study.cases.all_grains(pack).kind) == {Kind.GRAIN}


def test_mean_and_worst_are_of_logarithms(study):
    assert study.models.rms([math.e, 1 / math.e]) == pytest.approx(1.0)
    assert study.models.worst([1.3, 0.7, 1.01]) == 0.7


def test_goal_adds_truths_error_above_two_percent_only(study):
    row = {"law": 1.07, "truth_error": 0.019}
    assert study.tables.reached([row], "law", (None, 0.06)) == "no"
    assert study.tables.reached([row | {"truth_error": 0.021}], "law", (None, 0.06)) == "yes"
    assert study.tables.reached([row | {"truth_error": 0.021}], "law", (0.03, 0.06)) == "no"
    assert (
        study.tables.reached([row | {"law": math.nan}, row | {"law": 1.05}], "law", (None, 0.06))
        == "yes"
    )


def test_laws_on_two_packs(study, cases):
    """The default within its goals on SC and on pack C with fines; all spheres as grains near it."""
    intact = study.models.intact_row(cases["SC_touching"])
    assert set(LAWS) < set(intact)
    assert intact["lubrication"] == pytest.approx(1.0, abs=0.01)
    damaged = study.models.damaged_row(cases["C_r5_d2"])
    for name in study.tables.RULES[2:]:
        assert damaged[name] == pytest.approx(1.0, abs=0.06)
        assert damaged[f"{name}: k"] == pytest.approx(damaged[name], abs=0.01)
    text = study.tables.damage_table([damaged], absolute=False)
    assert f"{damaged[study.main.DEFAULT]:.3f}" in text


def test_too_many_spheres_are_not_resolved_and_shown_as_such(study, cases, monkeypatch):
    monkeypatch.setattr(law_models, "RESOLVED_LIMIT", 100)
    assert math.isnan(study.models.resolved(cases["C_r5_d2"].pack))
    assert study.tables.ratio(math.nan) == "-"


def test_round_sections_are_those_of_the_law_without_corners(study):
    """In FCC the facets are far from round: their area overrates them about twice; loosely spaced discs do not."""
    network = study.models.network_of(face_centred(2))
    flux = [
        study.models.permeability(network, law(network))
        for law in (study.models.section_by_area, lubrication_law)
    ]
    assert 1.8 < flux[0] / flux[1] < 2.3


def test_refit_finds_the_weight_that_made_the_truth(study, cases):
    case = cases["C_80_eps40"]
    network = study.models.network_of(case.pack)
    k = study.models.permeability(network, study.models.series_law(network, weight=0.4))
    refit = study.models.refitted_series(
        [replace(case, name=name, k=k) for name in ("one", "two", "two y")]
    )
    assert refit["weight"] == pytest.approx(0.4, abs=1e-3)
    assert refit["weights"] == pytest.approx((0.4, 0.4), abs=1e-3)
    assert refit["held_out"] == pytest.approx([1.0] * 3, abs=1e-3)


def test_left_out_packs_do_not_fit_themselves(study, cases):
    """Two packs that want different weights: each is judged by the other's."""
    case = cases["C_80_eps40"]
    network = study.models.network_of(case.pack)
    k = [
        study.models.permeability(network, study.models.series_law(network, weight=w))
        for w in (0.2, 0.5)
    ]
    refit = study.models.refitted_series(
        [replace(case, name=f"p{i}", k=value) for i, value in enumerate(k)]
    )
    assert refit["weights"] == pytest.approx((0.2, 0.5), abs=1e-3)
    assert refit["held_out"] == pytest.approx([k[1] / k[0], k[0] / k[1]], rel=2e-3)


def test_tables_of_other_studies_are_read_from_their_files(study, root, tmp_path):
    validation = root / "docs" / "validation"
    assert study.tables.tiled_table(validation / "boundary_tiled.csv").count("\n") == 5
    path = tmp_path / "benchmark.csv"
    assert study.tables.benchmark_tables(path, {}) == study.tables.NO_BENCHMARK
    path.write_text(
        "tool,case,step,grains,fines,cpu_s,peak_MB,k_over_truth,status\n"
        "fdnet,packX,error,40,0,,,1.5,ok\npeer,packX,error,40,0,,,1.2,ok\n"
        "fdnet,tiled,solve,80,7,0.5,20,,ok\npeer,tiled,solve,80,,,,,stopped after 30 s\n"
    )
    text = study.tables.benchmark_tables(path, {"X": 1.01})
    assert "| X | 40 | 0 | 1.010 | 1.2 |" in text
    assert "| tiled | 80 | 7 | solve | 0.5 s, 20 | stopped after 30 s |" in text


def test_every_name_of_the_document_is_given(study, root):
    """Template and code agree; rows are those of the written tables, so nothing long is computed."""
    names = set(
        study.main.Template((root / "docs" / "accuracy.md.in").read_text()).get_identifiers()
    )
    source = (root / "scripts" / "accuracy.py").read_text()
    assert names
    assert all(f'"{name}"' in source for name in names)
