"""The network benchmark: packs as stated, statuses of children, growth, a small run end to end."""

import json
import sys

import numpy as np
import pytest
from scipy.spatial import cKDTree

from validation.benchmark import network, steps


def test_packs_are_tiles_with_fines_on_the_grains():
    rng = np.random.default_rng(1)
    grains = steps.tiled(1000, rng)
    fines = steps.seated(grains, 500, rng)
    size, radius = grains.box[:, 1], grains.radius[0]
    assert len(grains) == 1080
    assert len(fines) == 500
    assert np.all((grains.position >= 0) & (grains.position <= size))
    nearest = cKDTree(grains.position % size, boxsize=size).query(fines.position % size)[0]
    assert nearest == pytest.approx(np.full(500, 1.1 * radius), rel=2e-4)


def test_spheres_are_those_of_a_known_pack_with_fines():
    spheres = steps.tiled_spheres(2000, np.random.default_rng(1))
    fines, grains = spheres.fines(), spheres.grains()
    assert (len(grains), len(fines)) == (80, 2166)
    assert fines.radius == pytest.approx(np.full(2166, 0.2 * grains.radius[0]))


def test_a_child_ends_ok_or_failed_or_over_time():
    run = network.child
    assert run([sys.executable, "-c", "print('noise'); print('RESULT {\"k\": 2}')"], 60) == {
        "status": "ok",
        "k": 2,
    }
    assert run([sys.executable, "-c", "raise SystemExit('singular')"], 60) == {
        "status": "exit 1: singular"
    }
    assert run([sys.executable, "-c", "while True: pass"], 1) == {"status": "stopped after 1 s"}
    asleep = run([sys.executable, "-c", "import time; time.sleep(60)"], 0.1)
    assert asleep == {"status": "stopped after 1 s by the clock"}


def test_growth_is_the_exponent_of_the_time():
    rows = [
        {"tool": "t", "case": "tiled", "step": "s", "grains": n, "cpu_s": 3e-9 * n**1.5}
        for n in (1000, 10_000, 90_000)
    ]
    rows[0]["cpu_s"] = 1.0
    network.set_growth(rows)
    assert "growth" not in rows[0]
    assert [row["growth"] for row in rows[1:]] == pytest.approx([1.5, 1.5])


def test_the_size_of_networks_of_all_spheres_is_their_number():
    rows = [
        {"tool": "t", "case": "spheres", "step": "s", "grains": n, "fines": 27 * n, "cpu_s": n}
        for n in (10, 360, 3600)
    ]
    network.set_growth(rows)
    assert [row.get("growth") for row in rows] == [None, pytest.approx(1.0), pytest.approx(1.0)]


def test_small_run_of_all_steps(tmp_path, root, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(root))
    every = network.fdnet_rows(80, 50, tmp_path, 300)
    walled = {row["step"]: row["cpu_s"] for row in every if row["case"] == "walled"}
    assert walled.pop("total intact") == pytest.approx(sum(walled.values()))
    assert list(walled) == ["tessellate", "geometry", "conductance", "solve"]
    rows = {row["step"]: row for row in every if row["case"] == "tiled"}
    assert {
        "tessellate",
        "geometry",
        "occupancy",
        "conductance",
        "solve",
        "damage",
        "porosity",
    } < set(rows)
    assert rows["total"]["status"] == "ok"
    parts = sum(rows[step]["cpu_s"] for step in list(rows)[: list(rows).index("total")])
    assert rows["total"]["cpu_s"] == pytest.approx(parts)
    assert rows["total intact"]["cpu_s"] < parts
    assert all(20 < row["peak_MB"] < 4000 for row in rows.values())
    assert json.loads((tmp_path / "inflow.json").read_text())["intact"] > 0
    assert set(np.load(tmp_path / "clogged.npz")) == {
        "pairs",
        "position",
        "conductance",
        "inlet",
        "outlet",
    }
