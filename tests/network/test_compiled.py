"""Compiled code: a cache that follows the sources and is never trusted; several cores."""

import os
import subprocess
import sys
import threading

import numba
import numpy as np
from numba.core import config

from fdnet.network import compiled as module
from fdnet.network.compiled import cache_folder, on_all_cores
from fdnet.network.laws import deposit_resistances as deposit
from fdnet.network.laws import lubrication
from fdnet.network.network import build_network
from fdnet.network.permeability import analyse
from tests.network.packs import random_pack, with_fines


def call(command, folder, **settings):
    environment = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")} | settings
    environment.pop("NUMBA_CACHE_DIR", None)
    how = {"env": environment, "cwd": folder, "capture_output": True, "text": True, "timeout": 120}
    return subprocess.run([sys.executable, *command], check=False, **how)


def test_every_state_of_sources_and_settings_has_a_cache_of_its_own(tmp_path, monkeypatch):
    assert "numba-" in str(numba.config.CACHE_DIR)
    (tmp_path / "one.py").write_text("a = 1\n")
    (tmp_path / "two.py").write_text("b = 1\n")
    before = cache_folder(tmp_path, tmp_path / "cache")
    assert cache_folder(tmp_path, tmp_path / "cache") == before
    with monkeypatch.context() as other:
        other.setattr(numba.config, "OPT", "other")
        assert cache_folder(tmp_path, tmp_path / "cache") != before
    (tmp_path / "two.py").write_text("b = 2\n")
    assert cache_folder(tmp_path, tmp_path / "cache") != before


SOURCE = """
import sys
from fdnet.network.compiled import compiled

@compiled
def twice(x):
    return 2 * x

print(twice(int(sys.argv[1])), twice.stats.cache_hits and 1 or 0)
"""
SPOILT = {"empty": lambda content: b"", "cut": lambda content: content[: len(content) // 2]}


def test_a_bad_cache_is_left_aside_and_made_anew(tmp_path):
    """A program with one compiled function; a spoilt file costs one sentence and no result."""
    (tmp_path / "program.py").write_text(SOURCE)

    def answer(read, said):
        done = call(["program.py", "21"], tmp_path)
        assert done.stdout.split() == ["42", str(int(read))], done.stderr
        assert done.stderr.count("\n") == said, done.stderr
        return done.stderr

    answer(False, 0)
    for kind, how in (("nbi", "empty"), ("nbc", "cut")):
        (file,) = tmp_path.rglob(f"program.twice*.{kind}")
        file.write_bytes(SPOILT[how](file.read_bytes()))
        assert str(file.parent) in answer(False, 1), (kind, how)
    answer(True, 0)


def test_a_cache_in_a_place_that_others_can_write_is_not_used(tmp_path):
    """Code of somebody else must not be run: with no ~/.cache a folder of ours."""
    (tmp_path / "program.py").write_text(SOURCE)
    (tmp_path / "cache").write_text("a file, so no folder for the cache")
    own = tmp_path / f"fdnet-{os.getuid()}"
    ask = "import fdnet.network.compiled, numba; print(numba.config.CACHE_DIR)"
    for mode, taken in ((0o777, False), (0o700, True)):
        own.mkdir(exist_ok=True)
        own.chmod(mode)
        said = call(["-c", ask], tmp_path, TMPDIR=str(tmp_path)).stdout.strip()
        assert said.startswith(str(tmp_path))
        assert said.startswith(f"{own}/") == taken, oct(mode)


# numba must not round otherwise than written: whoever calls a function first, in loops or not.


@module.compiled
def product_less(one, two, three):
    return one * two - three


@module.loops_in_place
def asked_by_loops(one, two, three):
    return product_less(one, two, three)


@module.compiled_for_loops
def product_less_in_loops(one, two, three):
    return one * two - three


def test_no_function_rounds_other_than_written_whoever_calls_it_first():
    """A fused product and sum would not be 0, and which copy is fused depends on the process."""
    one = 1.0 + 2.0**-30
    for function in (asked_by_loops, product_less, product_less_in_loops):
        assert function(one, one, one * one) == 0.0


# ---- Several cores.
def test_parts_are_done_side_by_side_and_their_results_are_in_order(monkeypatch):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", 3)
    meet, done = threading.Barrier(3, timeout=30), []

    def work(part):
        meet.wait()  # three at a time, or this breaks
        done.append(part)
        return 10 * part

    assert on_all_cores(work, iter(range(12))) == [10 * part for part in range(12)]
    assert sorted(done) == list(range(12))

    def inner(_):  # a part takes no more cores of its own
        return len(set(on_all_cores(lambda _: threading.get_ident(), range(8))))

    assert on_all_cores(inner, range(4)) == [1] * 4


def test_several_cores_give_the_same_bits_as_one(monkeypatch):
    pack = with_fines(random_pack(40), 150, 0.2)
    together = build_network(pack, periodic="yz")
    monkeypatch.setattr(lubrication, "THROATS", 60)
    assert deposit.bounded_by_fines(together).sum() > 4 * 60  # several parts for each of the laws
    results = []
    for cores in (1, 4):
        monkeypatch.setattr(config, "NUMBA_NUM_THREADS", cores)
        halves = [deposit.deposit_resistances(together), lubrication.half_resistances(together)]
        analysis = analyse(pack, periodic="yz", sections=3, damage_law="section-archie")
        results.append((halves, [(one.k_initial, one.k_damaged) for one in analysis.sections]))
    assert results[0][1] == results[1][1]
    np.testing.assert_array_equal(results[0][0], results[1][0])
