"""A cut invasion that is continued gives the numbers of an uncut one."""

import pytest
from cut_and_continue import MATRIX, cell_case, differences

from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import make_pack
from fdnet.scales.scales import scales_of

pytestmark = pytest.mark.liggghts
QUICK = (("periodic", "fixed", "batches", "held"), ("periodic", "mobile", "batches", "viscous"))
"""Cells in which a continued invasion once gave other numbers."""


@pytest.fixture(scope="module")
def packed(binary, tmp_path_factory):
    """Grains of the small case, made on first use for each kind of side."""
    made = {}

    def grains(case):
        if case.box.sides not in made:
            folder = tmp_path_factory.mktemp(case.box.sides)
            made[case.box.sides] = make_pack(case, scales_of(case), folder, Launch(binary=binary))
        return made[case.box.sides].grains

    return grains


@pytest.mark.parametrize("cell", QUICK, ids="-".join)
def test_a_continued_invasion_is_the_uncut_one(binary, packed, tmp_path, cell):
    case = cell_case(*cell)
    assert differences(case, packed(case), tmp_path, binary) == []
    assert not list(tmp_path.glob("*/post/*contacts*")), "the scratch file stays"


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("cell", MATRIX, ids="-".join)
def test_a_continued_invasion_is_the_uncut_one_everywhere(binary, packed, tmp_path, cell, ranks):
    case = cell_case(*cell)
    assert differences(case, packed(case), tmp_path, binary, ranks=ranks) == []
