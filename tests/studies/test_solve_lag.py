from itertools import pairwise

import pytest
from builders import followed

from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import make_pack
from fdnet.run.fluid import NetworkFluid
from fdnet.scales.scales import scales_of
from fdnet.studies.dem.solve_lag import LagOf, WatchedFluid

pytestmark = pytest.mark.liggghts


@pytest.fixture(scope="module")
def watched(binary, tmp_path_factory):
    """A fluid watched with four thresholds through a small invasion, and its updates."""
    case, folder = followed("seed=3"), tmp_path_factory.mktemp("lag")
    scales, launch = scales_of(case), Launch(binary=binary)
    grains = make_pack(case, scales, folder / "pack", launch).grains
    runs = []
    for name in ("plain", "watched"):
        fluid = NetworkFluid(case=case, scales=scales, grains=grains)
        seen = WatchedFluid(fluid, (0.0, 0.1, 0.3, 10.0)) if name == "watched" else fluid
        runs.append((seen, invade(case, scales, grains, folder / name, launch, fluid=seen)))
    return runs


def test_a_fluid_that_is_watched_answers_as_before(watched):
    (_, plain), (_, seen) = watched
    assert len(seen.updates) > 5
    assert seen.updates == plain.updates


def test_a_network_that_is_solved_less_lags_more(watched):
    fluid, result = watched[1]
    always, *rows, never = (lag.row() for lag in fluid.lags)
    assert always.solves == always.updates <= len(result.updates)
    assert (always.k_most, always.flux_rms) == (0.0, 0.0)
    assert never.solves >= 5  # each of five chunks begins with a solve
    for less, more in pairwise((always, *rows, never)):
        assert less.solves >= more.solves
    assert never.flux_rms > 0.0
    assert abs(never.k_mean) <= never.k_rms <= never.k_most > 0.0


def test_the_lag_of_k_is_that_of_what_was_solved_last(watched):
    fluid = watched[1][0].fluid
    lag, deposit = LagOf(0.5), fluid.renewal.deposit
    full = fluid.renewal.of(deposit.fines, anew=True)[0]
    half = deposit.fines.where(deposit.fines.id % 3 > 0)
    less = fluid.renewal.of(half, anew=True)[0]
    weight = fluid.pack.through / fluid.pack.through.sum()
    lag.see(deposit.fines, full, weight, anew=False)
    lag.see(half, less, weight, anew=False)
    assert (lag.solves, lag.k[0]) == (1, 0.0)
    assert lag.k[1] == pytest.approx(full.k_over_k0 / less.k_over_k0 - 1.0)
    assert lag.k[1] < 0.0 < lag.flux[1]
    lag.see(half, less, weight, anew=True)
    assert (lag.solves, lag.k[2], lag.flux[2]) == (2, 0.0, 0.0)


def test_finer_sections_leave_less(watched):
    assert -0.1 < watched[1][0].finer_sections() < 0.0
