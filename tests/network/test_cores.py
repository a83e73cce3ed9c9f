"""Several cores give the same bits as one, and errors of parts are raised."""

import threading

import numpy as np
import pytest
from numba.core import config

from fdnet.network.cores import on_all_cores
from fdnet.network.laws import fine_sections, lubrication
from fdnet.network.laws.deposit_resistances import deposit_resistances
from fdnet.network.laws.fine_sections import bounded_by_fines
from fdnet.network.network import build_network
from tests.network.packs import random_pack, with_fines


@pytest.fixture
def pack():
    return with_fines(random_pack(40), 150, 0.2)


def test_every_part_is_done_once_on_several_threads(monkeypatch):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", 3)
    meet, seen = threading.Barrier(3, timeout=30), np.zeros(12, int)

    def work(part):
        meet.wait()  # three at a time, or this breaks
        seen[part] += 1

    on_all_cores(work, iter(range(12)))
    assert seen.tolist() == [1] * 12


@pytest.mark.parametrize("cores", [1, 4])
def test_the_error_of_a_part_is_raised(monkeypatch, cores):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", cores)

    def work(part):
        if part == 5:
            raise ValueError("part 5 failed")

    with pytest.raises(ValueError, match="part 5 failed"):
        on_all_cores(work, range(9))


def test_resistances_on_several_cores_are_those_on_one(monkeypatch, pack):
    together = build_network(pack, periodic="yz")
    for module in (lubrication, fine_sections):
        monkeypatch.setattr(module, "THROATS", 60)
    results = []
    for cores in (1, 4):
        monkeypatch.setattr(config, "NUMBA_NUM_THREADS", cores)
        plain = lubrication.half_resistances(together)
        results.append(np.concatenate([deposit_resistances(together), plain]))
    assert bounded_by_fines(together).sum() > 4 * 60  # several parts for each of the two laws
    np.testing.assert_array_equal(*results)
