"""The whole analysis: invariances, sections, fines, moved grains, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import NetworkError
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Kind
from tests.network.packs import random_pack, with_fines

ALL, FLOW_X, WALLED = (True,) * 3, (False, True, True), (False,) * 3
THESIS, EFFECTIVE = ("thesis", "thesis"), ("effective", "thesis-code")
ARCHIE = ("lubrication", "section-archie")


def analysed(pack, periodic=FLOW_X, laws=EFFECTIVE, *, before=None, **more):
    options = AnalysisChoices.of_pack(law=laws[0], damage_law=laws[1], **more)
    before = pack.grains() if before is None else before
    return analyse(before, pack, periodic=periodic, options=options)


@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(80, aspect=2.0), 250, 0.15)


def test_sections_in_place_recombine_in_series(pack):
    length = pack.box[0, 1]
    for sections in (5, [0.0, 0.13 * length, 0.2 * length, 0.71 * length, length]):
        for periodic in (ALL, FLOW_X, WALLED):
            analysis = analysed(pack, periodic, sections=sections)
            for state in ("initial", "damaged"):
                name, rows = f"k_{state}_inplace", analysis.sections
                resistance = [(one.x_hi - one.x_lo) / getattr(one, name) for one in rows]
                k = getattr(analysis, f"k_{state}")
                assert length / sum(resistance) == pytest.approx(k, rel=1e-9), periodic
                assert min(resistance) > 0
    # shifted by half a period the two halves change places; all in-place values stay
    moved = pack.position.copy()
    moved[:, 0] = (moved[:, 0] + 0.5 * length) % length
    both = pack, replace(pack, position=moved)
    here, there = (analysed(one, ALL, sections=2).sections for one in both)
    assert abs(here[0].k_damaged_inplace / here[1].k_damaged_inplace - 1) > 0.01
    for name in ("k_initial_inplace", "k_damaged_inplace"):
        first, second = ([getattr(s, name) for s in one] for one in (here, there[::-1]))
        assert first == pytest.approx(second, rel=1e-5)


def test_damage_shows_in_the_section_that_holds_the_fines(pack):
    fines = pack.fines()
    near = fines.where(fines.position[:, 0] < 0.2 * pack.box[0, 1])
    analysis = analysed(pack.grains().joined(near), laws=ARCHIE, sections=4)
    x = near.position[:, 0]
    reduction = [one.k_reduction for one in analysis.sections]
    assert reduction[0] > 0.1
    assert reduction[2] == reduction[3] == 0.0
    assert [one.fines_fraction for one in analysis.sections] == [1.0, 0, 0, 0]
    assert analysis.profile.fines_fraction.sum() == pytest.approx(1.0)
    assert analysis.invasion_depth == x.max()
    assert analysis.invasion_depth_p95 == pytest.approx(np.quantile(x, 0.95))
    assert analysis.invaded_volume == pytest.approx(len(near) * 4 / 3 * np.pi * 0.15**3)


def test_moved_grains_make_a_second_network_and_renumbered_ones_none(pack):
    grains, rng = pack.grains(), np.random.default_rng(1)
    push = 0.02 * rng.normal(size=pack.position.shape) * (pack.kind == Kind.GRAIN)[:, None]
    shifted = replace(pack, position=pack.position + push)
    analysis = analysed(shifted, ALL, before=grains)
    for spheres, k in ((shifted.grains(), analysis.k_moved), (grains, analysis.k_initial)):
        assert analysed(None, ALL, before=spheres).k_initial == pytest.approx(k, rel=1e-9)
    assert analysis.k_damaged < analysis.k_moved != analysis.k_initial
    throats = len(analysis.network.throat_radius)
    assert len(analysis.conductance_initial) == len(analysis.flow_initial.throat_flux) == throats
    order = rng.permutation(len(pack))
    across = pack.position + pack.box[:, 1] * (np.arange(len(pack)) % 2)[:, None]
    for same in (pack.where(order), replace(pack, position=across)):
        assert analysed(same, ALL, before=grains).k_moved is None
    with pytest.raises(NetworkError, match="differ"):
        analysed(pack.where(np.arange(len(pack)) > 0), ALL, before=grains)
