"""The packs and slabs of known permeability: their file, how they are made, and their limits."""

from functools import partial

import numpy as np
import pytest

from fdnet.errors import CaseError
from fdnet.network.stokes import solve_slab, solve_stokes
from fdnet.spheres.snapshot import Kind, resting
from validation import truth
from validation.truth_solved import SLAB_TOLERANCE, case_of, limit, made_anew, solved_anew


def test_spheres_and_tables_are_read_as_they_were_written(tmp_path):
    place = np.array([[-1e-4, 2e-4, 3e-4], [1.23456789e-3, 1e-4, 0.0]])
    box = np.array([[0.0, 2.5e-3], [0.0, 1.2e-3], [0.0, 1.1e-3]])
    spheres = resting(place, np.array([5e-5, 2.5e-4]), box, np.array([Kind.FINE, Kind.GRAIN]))
    rows = [{"slab": "one", "known_before": "later"}, {"slab": "two", "known_before": ""}]
    truth.write_truth(tmp_path / "t.npz", {"one": spheres}, {"slabs": rows})
    again = truth.read_pack("one", tmp_path / "t.npz")
    for name in ("position", "radius", "box", "kind"):
        np.testing.assert_allclose(getattr(again, name), getattr(spheres, name), rtol=1e-15)
    assert truth.read_table("slabs", tmp_path / "t.npz") == rows
    with pytest.raises(CaseError, match="is not there"):
        truth.read_pack("one", tmp_path / "missing.npz")


def test_every_case_and_slab_has_its_spheres_its_grids_and_who_knew_it():
    cases, slabs = list(truth.cases()), list(truth.slabs())
    assert (len(cases), len(slabs)) == (40, 207)
    assert {case.group for case in cases} == set(truth.GROUPS)
    known = [slab.known_before for slab in slabs]
    assert (known.count(truth.YES), known.count(truth.LATER)) == (183, 24)
    grids = truth.read_table("slab_grids")
    solved = {(row["slab"], row["solid"], row["cells"]) for row in grids}
    for slab, row in zip(slabs, truth.read_table("slabs"), strict=True):
        cells = row["grids"].split("+")
        assert len(cells) >= 3
        assert {(slab.name, truth.DEPOSIT, count) for count in cells} <= solved
        assert slab.ratio == pytest.approx(slab.k / slab.k0, rel=1e-3)
    packs = {case.name: case for case in cases}
    assert packs["A_200_eps40"].k == pytest.approx(1.00982e-9)
    assert packs["C_r5_half y"].ratio == 0.5498
    pack = packs["SC c = 0.343"].pack
    solid = np.sum(4 / 3 * np.pi * pack.radius**3) / np.prod(np.ptp(pack.box, axis=1))
    assert solid == pytest.approx(0.343)


def test_stored_specimens_are_those_of_their_cases():
    for row in truth.read_table("specimens"):
        case, spheres = case_of(row["name"]), truth.read_pack(row["name"])
        np.testing.assert_allclose(spheres.box[:, 1], case.size_m)
        for some, given in ((spheres.fines(), "fine_mm"), (spheres.grains(), "grain_mm")):
            radii = [1e-3 * float(number) for number in row[given].split()]
            assert min(radii) * (1 - 1e-6) <= some.radius.min()
            assert some.radius.max() <= max(radii) * (1 + 1e-6)
        assert len(spheres.fines()) <= case.fines.count == int(row["supplied"])
        assert not row["grains"] or len(spheres.grains()) == int(row["grains"])


@pytest.mark.parametrize(
    "name", ["packH_r5_d1", pytest.param("packF_80_eps45", marks=pytest.mark.nightly)]
)
def test_a_pack_is_made_again_from_its_recipe(name, tmp_path):
    assert made_anew(name, tmp_path) < 1e-9


def test_limit_of_three_grids_and_of_two():
    """k = 3 + 50 h^2 is found, also from the finest three of four grids, and from two."""
    grids = {n: 3.0 + 50.0 / n**2 for n in (96, 72, 120)}
    for some in ({48: 9.0} | grids, {n: grids[n] for n in (96, 120)}):
        assert limit(some).k == pytest.approx(3.0, rel=1e-12)
    assert limit(grids).error == 2.0 * SLAB_TOLERANCE


def test_stored_values_lie_below_those_of_coarse_grids():
    """One pack and one slab, without and with its deposit; from two grids within 2 %."""
    case, slab = next(truth.cases(["H_40_eps40"])), next(truth.slabs(["slabO_r5_light"]))
    spheres = truth.read_pack(slab.specimen)
    packs = [{n: solve_stokes(case.pack, cells=n).k for n in (32, 48)}]
    for some in (spheres.grains(), spheres):
        solve = partial(solve_slab, some, slab.planes, tolerance=1e-3)
        packs.append({n: solve(cells=n).k for n in (36, 48)})
    for grids, k in zip(packs, (case.k, slab.k0, slab.k), strict=True):
        assert min(grids.values()) > k
        assert limit(grids).k == pytest.approx(k, rel=0.02)


@pytest.mark.nightly
def test_a_slab_solved_anew_is_the_stored_one():
    rows = list(solved_anew("slabO_r5_light"))
    assert [row["cells"] for row in rows] == ["72", "96", "120", "limit"] * 2
    assert max(abs(row["difference"]) for row in rows) < 5e-4
