"""How the laws are judged: rows of two packs and a slab, statistics, and the page's tables."""

import math

import numpy as np
import pandas as pd
import pytest

from fdnet.spheres.snapshot import Kind, resting
from validation import truth
from validation.accuracy import ARCHIE, FINEST, SLABS, THROATS, by_all_spheres, slab_row, tables


def test_laws_on_a_slab():
    """26 fines of a fifth of a grain: near the truth, and k, k0 and their ratio fit."""
    row = slab_row(next(truth.slabs(["slabO_r5_light"])))
    for pair in (ARCHIE, FINEST):
        assert row[pair] == pytest.approx(1.0, abs=0.1)
        assert row[f"{pair}: k"] == pytest.approx(row[pair] * row["lubrication: k0"], rel=1e-3)
    assert row["lubrication: k0"] == pytest.approx(1.0, abs=0.15)
    assert row["fines"] >= 26
    assert row[THROATS] > 1.0


def test_a_fine_that_vanishes_changes_nothing():
    """Without the spheres around a section the mean is 1 % too high."""
    pack = truth.read_pack("packH_r5_d1")
    grains, places, size = pack.grains(), pack.fines().position[::3], pack.box[0, 1]
    k0, changes = by_all_spheres(grains)[0], []
    for place in places:  # a fine of a two-hundredth of a grain on the grain nearest to it
        away = place - grains.position
        away -= size * np.round(away / size)
        apart = np.linalg.norm(away, axis=1)
        one = int(np.argmin(apart - grains.radius))
        radius = 0.005 * grains.radius[one]
        centre = grains.position[one] + away[one] / apart[one] * (grains.radius[one] + radius)
        fine = resting(np.mod(centre, size)[None], radius, pack.box, Kind.FINE)
        changes.append(by_all_spheres(grains.joined(fine))[0] / k0 - 1.0)
    assert len(changes) == 14
    assert abs(np.mean(changes)) < 3e-3
    assert -0.01 < min(changes) < max(changes) < 0.01


def test_the_page_holds_the_tables_and_numbers_of_the_committed_files(root):
    """`python scripts/validation.py accuracy --draw` prints them."""
    page = (root / "docs/evidence/accuracy.md").read_text(encoding="utf-8")
    for table in tables(root / "docs/validation").split("\n\n"):
        assert table in page
    rows = pd.read_csv(root / "docs/validation" / SLABS)
    known = {slab.name: slab.known_before for slab in truth.slabs()}
    assert dict(zip(rows["case"], rows["known_before"], strict=True)) == known
    off, many = np.log(rows[FINEST]), rows[THROATS] >= 100
    for some in (many, ~many):
        assert f"{100 * math.sqrt(np.mean(off[some] ** 2)):.1f} %" in " ".join(page.split())
