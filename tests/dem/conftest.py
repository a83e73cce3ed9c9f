"""Invasions by the real binary, of packs that are made once."""

import pytest

from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.run.fluid import fluid_of
from fdnet.scales.scales import scales_of


@pytest.fixture(scope="session")
def go(binary, grains_of):
    """Invade the pack of a case in a folder, with its own fluid or another one."""

    def invaded(case, folder, fluid=None, **launch):
        scales, grains = scales_of(case), grains_of(case)
        fluid = fluid or fluid_of(case, scales, grains)
        return invade(case, scales, grains, folder, Launch(binary=binary, **launch), fluid=fluid)

    return invaded
