"""The accuracy study: its truth, laws on two packs, statistics, tables and page."""

import csv
import math
from dataclasses import replace
from string import Template

import numpy as np
import pytest

from fdnet.network.laws.conductance import lubrication_law, series_law
from fdnet.network.laws.named import LAWS
from fdnet.network.permeability import analyse
from fdnet.studies.accuracy import measurement, page
from fdnet.studies.accuracy.benchmark_tables import NO_BENCHMARK, benchmark_tables
from fdnet.studies.accuracy.boundary_tables import tiled_table
from fdnet.studies.accuracy.choices import refitted_series, section_by_area
from fdnet.studies.accuracy.face import face_numbers
from fdnet.studies.accuracy.goals import ratio, reached, rms, worst
from fdnet.studies.accuracy.measurement import (
    RESOLVED,
    SIDE_KOZENY,
    network_of,
    permeability,
    resolved,
)
from fdnet.studies.accuracy.numbers import page_numbers
from fdnet.studies.accuracy.results import read_results
from fdnet.studies.accuracy.rows import RULES, damaged_row, intact_row
from fdnet.studies.accuracy.tables import damage_table
from fdnet.studies.accuracy.vanishing import vanishing_rows
from fdnet.studies.engine.csv_rows import read_named
from fdnet.studies.truth.cases import (
    EQUAL,
    LATTICE,
    LOOSE_SOLIDS,
    read_cases,
)
from fdnet.studies.truth.packs import DATA
from tests.network.packs import face_centred

TRUTH = DATA / "truth.csv"


@pytest.fixture(scope="module")
def cases():
    return {case.name: case for case in read_cases([TRUTH], [DATA])[0]}


def test_truth_is_read_with_its_class_and_what_is_missing_is_named(cases):
    result, missing = read_cases([TRUTH], [DATA])
    rows = list(csv.DictReader(TRUTH.open()))
    named = {row["file"] for row in rows if row["file"]}
    assert set(missing) == {name for name in named if not (DATA / name).exists()}
    assert len(result) == len([row for row in rows if row["file"]]) - len(missing) + len(
        LOOSE_SOLIDS
    )
    assert cases["SC_touching"].group == LATTICE
    assert cases["A_200_eps40"].group == EQUAL
    assert cases["A_200_eps40"].k == pytest.approx(0.00100982e-6)
    assert cases["A_200_eps40"].error == pytest.approx(0.005)
    assert cases["C_r5_half y"].ratio == pytest.approx(0.5498)


def test_loose_lattices_have_their_volume_fraction(cases):
    pack = cases["SC c = 0.343"].pack
    assert np.sum(4 / 3 * np.pi * pack.radius**3) / np.prod(
        np.ptp(pack.box, axis=1)
    ) == pytest.approx(0.343)


def test_turned_packs_have_the_axis_as_x(cases):
    pack = cases["C_r5_d2"].pack
    rotated = pack.turned("y")
    assert np.array_equal(rotated.position[:, 0], pack.position[:, 1])
    assert np.ptp(rotated.box, axis=1) == pytest.approx(np.roll(np.ptp(pack.box, axis=1), -1))
    # turned, not mirrored: the signed volume of four spheres stays
    volumes = [np.linalg.det(one.position[1:4] - one.position[0]) for one in (pack, rotated)]
    assert abs(volumes[0]) > 0
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-9)


def test_mean_and_worst_are_of_logarithms():
    assert rms([math.e, 1 / math.e]) == pytest.approx(1.0)
    assert worst([1.3, 0.7, 1.01]) == 0.7


def test_goal_adds_truths_error_above_two_percent_only():
    row = {"law": 1.07, "truth_error": 0.019}
    assert reached([row], "law", (None, 0.06)) == "no"
    assert reached([row | {"truth_error": 0.021}], "law", (None, 0.06)) == "yes"
    assert reached([row | {"truth_error": 0.021}], "law", (0.03, 0.06)) == "no"
    assert reached([row | {"law": math.nan}, row | {"law": 1.05}], "law", (None, 0.06)) == "yes"


def test_laws_on_two_packs(cases):
    """The default is within its goals on SC and on pack C with fines; all spheres are high."""
    intact = intact_row(cases["SC_touching"])
    assert set(LAWS) < set(intact)
    assert intact["lubrication"] == pytest.approx(1.0, abs=0.01)
    damaged = damaged_row(cases["C_r5_d2"])
    for name in RULES[2:]:
        goal = 0.09 if name == RESOLVED else 0.06
        assert damaged[name] == pytest.approx(1.0, abs=goal)
        assert damaged[f"{name}: k"] == pytest.approx(damaged[name], abs=0.01)
    text = damage_table([damaged], absolute=False)
    assert f"{damaged[SIDE_KOZENY]:.3f}" in text


def test_the_network_of_all_spheres_is_the_one_that_runs_take(cases):
    pack = cases["C_r5_d2"].pack
    result = analyse(pack, periodic="xyz", walls="slip", damage_law="all-spheres")
    assert resolved(pack) == pytest.approx(result.k_damaged)


def test_a_fine_that_vanishes_changes_nothing():
    """Without the fourth sphere and those around a section the mean is 1 % too high."""
    row = vanishing_rows(DATA, ratios=(0.005,), every=3)[0]
    assert row["places"] == 14
    assert abs(row["mean"]) < 2e-3
    assert -0.01 < row["least"] < row["most"] < 0.01


def test_too_many_spheres_are_not_resolved_and_shown_as_such(cases, monkeypatch):
    monkeypatch.setattr(measurement, "RESOLVED_LIMIT", 100)
    assert math.isnan(resolved(cases["C_r5_d2"].pack))
    assert ratio(math.nan) == "-"


def test_round_sections_are_those_of_the_law_without_corners():
    """In FCC the facets are far from round: by their area they conduct about twice as much."""
    network = network_of(face_centred(2))
    flux = [permeability(network, law(network)) for law in (section_by_area, lubrication_law)]
    assert 1.8 < flux[0] / flux[1] < 2.3


def test_refit_finds_the_weight_that_made_the_truth(cases):
    case = cases["C_80_eps40"]
    network = network_of(case.pack)
    k = permeability(network, series_law(network, weight=0.4))
    refit = refitted_series([replace(case, name=name, k=k) for name in ("one", "two", "two y")])
    assert [row["weight"] for row in refit] == pytest.approx([0.4] * 3, abs=1e-3)
    assert [row["weight_without"] for row in refit] == pytest.approx([0.4] * 3, abs=1e-3)
    assert [row["held_out"] for row in refit] == pytest.approx([1.0] * 3, abs=1e-3)


def test_left_out_packs_do_not_fit_themselves(cases):
    """Two packs that want different weights: each is judged by the other's."""
    case = cases["C_80_eps40"]
    network = network_of(case.pack)
    k = [permeability(network, series_law(network, weight=w)) for w in (0.2, 0.5)]
    refit = refitted_series([replace(case, name=f"p{i}", k=value) for i, value in enumerate(k)])
    assert sorted(row["weight_without"] for row in refit) == pytest.approx([0.2, 0.5], abs=1e-3)
    assert [row["held_out"] for row in refit] == pytest.approx(
        [k[1] / k[0], k[0] / k[1]], rel=2e-3
    )


def test_tables_of_other_studies_are_read_from_their_files(root, tmp_path):
    validation = root / "docs" / "validation"
    assert tiled_table(validation / "boundary_tiled.csv").count("\n") == 5
    path = tmp_path / "benchmark.csv"
    assert benchmark_tables(path, {}) == NO_BENCHMARK
    path.write_text(
        "tool,case,step,grains,fines,cpu_s,peak_MB,k_over_truth,status\n"
        "fdnet,packX,error,40,0,,,1.5,ok\npeer,packX,error,40,0,,,1.2,ok\n"
        "fdnet,tiled,solve,80,7,0.5,20,,ok\npeer,tiled,solve,80,,,,,stopped after 30 s\n"
    )
    text = benchmark_tables(path, {"X": 1.01})
    assert "| X | 40 | 0 | 1.010 | 1.2 |" in text
    assert "| tiled | 80 | 7 | solve | 0.5 s, 20 | stopped after 30 s |" in text


@pytest.fixture(scope="module")
def numbers(root):
    validation = root / "docs" / "validation"
    return page_numbers(read_results(validation), validation)


def test_every_name_of_the_document_is_given(root, numbers):
    """Template and code agree, in both directions."""
    validation = root / "docs" / "validation"
    names = set(Template((root / "docs" / "accuracy.md.in").read_text()).get_identifiers())
    tables = page.page_tables(read_results(validation), validation)
    assert names == {*numbers, *tables, "benchmark", "missing"}


def test_the_page_is_written_from_the_committed_tables(root):
    """So every number of its prose that is computed is that of the tables."""
    docs = root / "docs"
    text = page.document(docs, docs / "benchmark_network.csv")
    assert (docs / "accuracy.md").read_text(encoding="utf-8") == text


def test_the_numbers_of_the_first_screen_are_those_of_the_tables(numbers, root):
    """Computed once more, from the columns alone."""
    folder = root / "docs" / "validation"
    with (folder / "accuracy_damage.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    off = np.array([float(row[SIDE_KOZENY]) for row in rows])
    assert numbers["rms_damage"] == f"{100 * math.sqrt(np.mean(np.log(off) ** 2)):.1f} %"
    assert numbers["off_damage"] == f"{100 * max(1 - off.min(), off.max() - 1):.0f} %"
    later = off[[row["known_before"] != "yes" for row in rows]]
    assert numbers["later_damage"] == str(len(later))
    assert numbers["rms_later_damage"] == f"{100 * math.sqrt(np.mean(np.log(later) ** 2)):.1f} %"
    assert numbers["thesis_most"] == f"{max(float(r['thesis + thesis-code']) for r in rows):.0f}"


def test_the_recipe_has_the_spans_of_its_table(root):
    """docs/how-to/check_the_face.md against docs/validation/stokes_sections.csv."""
    page = (root / "docs/how-to/check_the_face.md").read_text(encoding="utf-8")
    numbers = face_numbers(root / "docs/validation")
    for name in ("face_periodic_before", "face_periodic_after"):
        assert numbers[name] in page
    rows = [line for line in page.splitlines() if "| walls |" in line]
    spans = [float(part) for row in rows for part in row.split("|")[4].split(" to ")]
    assert f"{min(spans):.3f} to {max(spans):.3f}" == numbers["face_walls_after"]
    table = read_named(root / "docs/validation/stokes_sections.csv")
    assert all(row["network_damage_law"].startswith("all-spheres") for row in table)
    assert min(float(row["network_k_reduction"]) for row in table) > 0.5  # no light damage
