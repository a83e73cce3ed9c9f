"""The accuracy study: its truth, laws on two packs and a slab, statistics, tables and page."""

import csv
import math
import shutil

import numpy as np
import pytest

from fdnet.network.laws.named import LAWS
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Kind
from validation.accuracy import (
    ARCHIE,
    FINEST,
    SLABS,
    THROATS,
    by_all_spheres,
    full_size_table,
    pack_rows,
    page_tables,
    read_rows,
    slab_rows,
    slab_table,
    summary,
)
from validation.engine.csv_rows import read_named, write_named
from validation.truth.cases import EQUAL, LATTICE, LOOSE_SOLIDS, read_cases
from validation.truth.packs import DATA, MM, read_pack, snapshot
from validation.truth.slabs import LATER, SLAB_FOLDER, SLAB_TRUTH

TRUTH = DATA / "truth.csv"


@pytest.fixture(scope="module")
def cases():
    return {case.name: case for case in read_cases([TRUTH], [DATA])[0]}


@pytest.fixture(scope="module")
def slabs(root):
    return read_rows(root / "docs/validation" / SLABS)


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
    assert summary([math.exp(0.03), math.exp(-0.04)]) == "3.5 %, 0.961"
    assert summary([1.3, 0.7, 1.01]).endswith(", 0.700")
    assert summary([math.e**2, math.e**-2]) == "factor 7.4, 7.4"


def test_laws_on_two_packs(cases):
    """Near truth on SC and on pack C with fines, whose k/k0 the thesis's laws miss by far."""
    intact, damaged = pack_rows([cases["SC_touching"], cases["C_r5_d2"]])
    assert {f"{law}: k0" for law in LAWS} < set(intact)
    assert intact["lubrication: k0"] == pytest.approx(1.0, abs=0.01)
    assert math.isnan(intact[FINEST])
    assert math.isnan(intact[THROATS])
    for pair in (ARCHIE, FINEST):
        assert damaged[pair] == pytest.approx(1.0, abs=0.09)
        assert damaged[f"{pair}: k"] == pytest.approx(damaged[pair], abs=0.01)
    assert damaged["thesis + thesis"] > 1.25
    assert damaged["size_ratio"] == pytest.approx(5.0)


def test_the_network_of_all_spheres_is_the_one_that_runs_take(cases):
    pack = cases["C_r5_d2"].pack
    result = analyse(pack, periodic="xyz", walls="slip", damage_law="all-spheres")
    assert by_all_spheres(pack)[0] == pytest.approx(result.k_damaged)


def test_laws_on_a_slab(tmp_path):
    """26 fines of a fifth of a grain: near the truth, and k, k0 and their ratio fit."""
    [line] = [r for r in read_named(SLAB_FOLDER / SLAB_TRUTH) if r["slab"] == "slabO_r5_light"]
    shutil.copy(SLAB_FOLDER / line["file"], tmp_path)
    write_named(tmp_path / SLAB_TRUTH, [line])
    [row] = slab_rows(tmp_path)
    for pair in (ARCHIE, FINEST):
        assert row[pair] == pytest.approx(1.0, abs=0.1)
        assert row[f"{pair}: k"] == pytest.approx(row[pair] * row["lubrication: k0"], rel=1e-3)
    assert row["lubrication: k0"] == pytest.approx(1.0, abs=0.15)
    assert row["k_over_k0"] == pytest.approx(
        float(line["k_mm2"]) / float(line["k0_mm2"]), rel=1e-3
    )
    assert row["fines"] >= 26
    assert row["size_ratio"] == pytest.approx(5.0, rel=0.05)
    assert row[THROATS] > 1.0


def test_a_fine_that_vanishes_changes_nothing():
    """Without the fourth sphere and those around a section the mean is 1 % too high."""
    pack, edge = read_pack(DATA / "packH_r5_d1.csv")
    grains, places = pack.grains(), pack.fines().position[::3]
    k0, size, changes = by_all_spheres(grains)[0], edge * MM, []
    for place in places:  # a fine of a two-hundredth of a grain on the grain nearest to it
        away = place - grains.position
        away -= size * np.round(away / size)
        apart = np.linalg.norm(away, axis=1)
        one = int(np.argmin(apart - grains.radius))
        radius = 0.005 * grains.radius[one]
        centre = grains.position[one] + away[one] / apart[one] * (grains.radius[one] + radius)
        fine = snapshot(
            np.mod(centre, size)[None] / MM, np.array([radius / MM]), edge, np.array([Kind.FINE])
        )
        changes.append(by_all_spheres(grains.joined(fine))[0] / k0 - 1.0)
    assert len(changes) == 14
    assert abs(np.mean(changes)) < 2e-3
    assert -0.01 < min(changes) < max(changes) < 0.01


def test_every_slab_of_the_truth_is_in_the_table(slabs):
    truth = {row["slab"]: row for row in read_named(SLAB_FOLDER / SLAB_TRUTH)}
    assert {row["case"]: row["known_before"] for row in slabs} == {
        name: row["known_before"] for name, row in truth.items()
    }
    counts = [line.split("|")[2] for line in slab_table(slabs).splitlines()[2:]]
    assert sum(map(int, counts[:6])) == sum(map(int, counts[6:8])) == len(truth)
    assert sum(map(int, counts[8:])) == len([1 for row in slabs if row["known_before"] == LATER])


def test_the_page_holds_the_tables_of_the_committed_files(root):
    """`scripts/accuracy.py` prints them."""
    page = (root / "docs/accuracy.md").read_text(encoding="utf-8")
    for table in page_tables(root / "docs/validation").split("\n\n"):
        assert table in page


def test_the_numbers_of_the_first_screen_are_those_of_the_tables(slabs, root):
    """Computed once more, from the columns alone."""
    many = np.array([row[THROATS] >= 100 for row in slabs])
    off = np.abs(np.log([row[FINEST] for row in slabs]))
    rms = [f"{100 * math.sqrt(np.mean(off[some] ** 2)):.1f} %" for some in (many, ~many)]
    text = " ".join((root / "docs/accuracy.md").read_text(encoding="utf-8").split())
    for words in rms:
        assert words in text


def test_full_size_tables_show_the_span_over_the_runs():
    rows = [
        {"case": name, "section": "whole", "k_over_k0": k, "section-archie": ratio}
        for name, k, ratio in (("a", 0.4, 1.02), ("b", 0.7, 0.97))
    ]
    assert "| whole | 2 | 0.40 to 0.70 | 0.97 to 1.02 |" in full_size_table(rows)
