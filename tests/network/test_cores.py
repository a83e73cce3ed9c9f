"""Several cores give the same bits as one, and errors of parts are raised."""

import threading

import numpy as np
import pytest
from numba.core import config

from fdnet.network.compiled import on_all_cores
from fdnet.network.laws import deposit_resistances as fine_sections
from fdnet.network.laws import lubrication
from fdnet.network.laws.deposit_resistances import bounded_by_fines, deposit_resistances
from fdnet.network.network import build_network
from fdnet.network.permeability import analyse
from tests.network.packs import random_pack, with_fines


@pytest.fixture
def pack():
    return with_fines(random_pack(40), 150, 0.2)


def test_parts_are_done_side_by_side_and_their_results_are_in_order(monkeypatch):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", 3)
    meet, done = threading.Barrier(3, timeout=30), []

    def work(part):
        meet.wait()  # three at a time, or this breaks
        done.append(part)
        return 10 * part

    assert on_all_cores(work, iter(range(12))) == [10 * part for part in range(12)]
    assert sorted(done) == list(range(12))


def test_a_part_takes_no_more_cores_of_its_own(monkeypatch):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", 2)

    def work(_):
        return on_all_cores(lambda _: threading.get_ident(), range(8))

    for inner in on_all_cores(work, range(4)):
        assert len(set(inner)) == 1


def test_a_single_part_stays_in_this_thread_and_may_take_all_cores(monkeypatch):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", 2)
    meet = threading.Barrier(2, timeout=30)

    def work(_):
        on_all_cores(lambda _: meet.wait(), range(2))  # side by side, or this breaks
        return threading.get_ident()

    assert on_all_cores(work, range(1)) == [threading.get_ident()]


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


def test_sections_on_several_cores_are_those_on_one(monkeypatch, pack):
    results = []
    for cores in (1, 4):
        monkeypatch.setattr(config, "NUMBA_NUM_THREADS", cores)
        analysis = analyse(pack, periodic="yz", sections=3, damage_law="section-archie")
        results.append([(one.k_initial, one.k_damaged) for one in analysis.sections])
    assert results[0] == results[1]
