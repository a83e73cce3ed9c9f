"""The invasion by Yade: what is handed over and back, refusals, runs where it is installed."""

import math
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fdnet.errors import CaseError, FdnetError
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind
from fdnet.studies.benchmark import yade_exchange, yade_invasion, yade_invasion_rows
from fdnet.studies.benchmark.yade_exchange import FINE, GRAIN, HISTORY, Job
from fdnet.studies.engine.csv_rows import read_named
from tests.builders import tiny

STIFFNESS, DAMPING_RATIO, DENSITY, RADIUS = 1e4, 0.2, 2000.0, 5e-5
MASS = 4 / 3 * math.pi * RADIUS**3 * DENSITY
STEP = 0.02 * math.sqrt(MASS / STIFFNESS)


def one_fine_at_one_grain(**changes) -> Job:
    """A fine that flies at 1 m/s along x at a fixed grain, 10 micrometres off, in hardly a fluid.

    Its contact with the grain has the stiffness and damping ratio above: the two constants in
    series are half of each.
    """
    damping = 2 * DAMPING_RATIO * math.sqrt(STIFFNESS * MASS)
    material = [2 * STIFFNESS, STIFFNESS, 2 * damping, 0.0, DENSITY]
    values = {
        "position": np.array([[1e-3, 5e-4, 5e-4], [1e-3 - 3.1e-4, 5e-4, 5e-4]]),
        "radius": np.array([2.5e-4, RADIUS]),
        "kind": np.array([GRAIN, FINE]),
        "materials": np.array([material] * 3),
        "box": np.array([[0.0, 2e-3], [0.0, 1e-3], [0.0, 1e-3]]),
        "length": 2e-3,
        "pressure": 0.0,
        "viscosity": 1e-9,
        "start_velocity": 1.0,
        "time_step": STEP,
        "steps": 4000,
        "mesh_steps": 1000,
        "limit_s": 60.0,
    }
    return Job(**values | changes)


def test_two_constants_in_series_are_the_contact():
    """a b / (a + b) of two materials is the stiffness of their contact, and its damping 2 z
    sqrt(k m), with the mass of a fine at a fixed grain and half of it at another fine."""
    case = tiny("box.sides=walls")
    contacts = scales_of(case).contacts
    grain, fine, wall = yade_exchange.materials_of(case, contacts)
    mass = 4 / 3 * math.pi * case.fines.radius_range_m[0] ** 3 * case.fines.density_kg_m3
    pairs = {
        "grain-fine": (grain, fine, mass),
        "fine-fine": (fine, fine, mass / 2),
        "fine-wall": (wall, fine, mass),
    }
    for name, (one, other, inertia) in pairs.items():
        normal, shear, damping = one[:3] * other[:3] / (one[:3] + other[:3])
        contact = contacts[name]
        assert normal == pytest.approx(contact.normal_stiffness)
        assert shear == pytest.approx(contact.shear_stiffness)
        critical = 2 * math.sqrt(contact.normal_stiffness * inertia)
        assert damping == pytest.approx(contact.damping_ratio * critical)
        assert min(one[3], other[3]) == contact.friction


def test_a_job_and_its_answer_keep_every_sphere(tmp_path):
    job = one_fine_at_one_grain()
    path = yade_exchange.write_job(tmp_path / "a.job.npz", job)
    with np.load(path) as data:
        assert set(data.files) == set(Job.__dataclass_fields__)
        assert np.array_equal(data["position"], job.position)
    place = np.array([[4e-4, 5e-4, 6e-4]])
    numbers = {
        "cells": 9,
        "inflow": 1.0,
        "outflow": 1.0,
        "cpu_s": 2.0,
        "wall_s": 3.0,
        "peak_MB": 4,
    }
    history = np.array([[7.0, *[0.0] * (len(HISTORY) - 1)]])
    np.savez(tmp_path / "a.npz", position=place, history=history, **numbers)
    answer = yade_exchange.read_answer(tmp_path / "a.npz")
    assert answer.steps == 7
    end = yade_exchange.end_state(job, answer, job.box)
    assert list(end.kind) == [Kind.GRAIN, Kind.FINE]
    assert np.array_equal(end.position, [job.position[0], place[0]])
    np.savez(tmp_path / "b.npz", position=place * np.nan, history=history, **numbers)
    with pytest.raises(CaseError, match="no finite place"):
        yade_exchange.read_answer(tmp_path / "b.npz")
    with pytest.raises(CaseError, match="missing; Yade ended"):
        yade_exchange.read_answer(tmp_path / "c.npz")


def test_a_run_that_yade_cannot_repeat_is_refused():
    run = SimpleNamespace(path="runs/a", case=tiny("box.sides=periodic"))
    with pytest.raises(CaseError, match=r"drag\.field = 'uniform', expected 'network'"):
        yade_exchange.checked_case(run)


def test_a_missing_yade_is_refused_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(FdnetError, match=r"yade: not found on the path.*apt install yade"):
        yade_invasion.make_pair(tmp_path / "case.toml", 100, 1, tmp_path / "out", limit_s=1.0)
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(shutil.which("yade") is None, reason="Yade is not installed")
def test_a_fine_rebounds_in_yade_as_a_damped_spring_does(tmp_path):
    """exp(-pi z / sqrt(1 - z^2)) = 0.527 of its velocity; a contact that may not pull ends it
    when the force is gone, at sqrt(1 - z^2) t = atan2(2 z sqrt(1 - z^2), 2 z^2 - 1), so that
    exp(-z t) = 0.572 is left (Schwager and Poeschel 2007)."""
    job = one_fine_at_one_grain()
    answer = yade_invasion.run_yade(job, "a", tmp_path, yade_invasion.require_yade())
    assert answer.steps == job.steps
    frequency = math.sqrt(STIFFNESS / MASS)
    root = math.sqrt(1 - DAMPING_RATIO**2)
    ends = math.atan2(2 * DAMPING_RATIO * root, 2 * DAMPING_RATIO**2 - 1) / root
    kept = math.exp(-DAMPING_RATIO * ends)
    left = job.steps * STEP - 1e-5 - ends / frequency
    gone = job.position[1, 0] + 1e-5 - answer.position[0, 0]
    assert gone / left == pytest.approx(kept, rel=0.03)


@pytest.mark.skipif(shutil.which("yade") is None, reason="Yade is not installed")
def test_what_flows_into_the_spheres_of_yade_flows_out(tmp_path):
    lattice = 2.5e-4 * (1 + 2 * np.indices((4, 2, 2)).reshape(3, -1).T)
    lattice += np.random.default_rng(1).uniform(-2e-5, 2e-5, lattice.shape)
    fluid = one_fine_at_one_grain(pressure=1e3, viscosity=1e-3)
    spheres = {"position": lattice, "radius": np.full(16, 2.2e-4), "kind": np.full(16, GRAIN)}
    still = replace(fluid, steps=0, **spheres)
    answer = yade_invasion.run_yade(still, "b", tmp_path, yade_invasion.require_yade())
    assert answer.inflow == pytest.approx(answer.outflow, rel=1e-6)
    assert answer.inflow > 0


@pytest.mark.parametrize("fines", [2000, 10_000])
def test_the_page_shows_the_rows_of_its_tables(root, fines):
    rows = read_named(root / f"docs/validation/yade_invasion_{fines}.csv")
    page = (root / "docs/validation/yade-invasion.md").read_text(encoding="utf-8")
    assert yade_invasion_rows.comparison_table(rows) in page
