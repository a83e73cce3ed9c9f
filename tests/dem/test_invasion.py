"""Invasions by the real binary: every fine is counted, overlaps are seen, the end is said."""

import math

import numpy as np
import pytest
from bench import bench
from builders import resting_spheres, tiny

from fdnet.dem import checkpoint
from fdnet.dem.checkpoint import Deepest, deepest_of, read_watch, watch_variables
from fdnet.dem.deck import number, render_text, specimen_box
from fdnet.dem.supply import batches_of, place_batches
from fdnet.errors import LiggghtsError
from fdnet.scales import clock
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind

pytestmark = pytest.mark.liggghts


@pytest.mark.parametrize(
    "keys",
    [
        ["box.sides=periodic", "drag.refresh_steps=1"],
        ["grains.motion=mobile"],
        ["drag.scheme=viscous", "drag.upstream=darcy"],
        ["drag.scheme=implicit", "fines.radius_mm=[0.02,0.05]"],
        ["fines.radius_mm=[0.02,0.05]", "fines.friction=0.0", "run={duration_ms=0.25}"],
    ],
)
def test_supplied_is_invaded_passed_and_upstream_always(go, grains_of, tmp_path, keys):
    """And fixed grains do not move, mobile ones by less than a fifth of their radius."""
    case = tiny("run.cap_ms=0.6", *keys)
    result = go(case, tmp_path)
    for row in result.history:
        assert row.upstream + row.invaded + row.passed == scales_of(case).supplied_count
    x = result.state.fines().position[:, 0]
    assert np.count_nonzero((x >= 0) & (x < case.size_m[0])) == result.history[-1].invaded
    assert result.overlap.fraction < 0.1
    assert (result.stop_reason == "duration") == (case.run.duration_ms is not None)
    moved = np.max(np.abs(result.state.grains().position - grains_of(case).position))
    assert (moved > 0) == (case.grains.motion == "mobile")
    assert moved < 0.2 * 0.25e-3


@pytest.mark.parametrize("scheme", ["implicit", "held"])
def test_a_batched_invasion_accounts_for_every_fine(go, tmp_path, scheme):
    keys = ("fines.supply=batches", "fines.count=900", "run.checkpoint_ms=0.005")
    if scheme == "held":
        keys += ("drag.inertia=schiller-naumann", "drag.pressure_gradient=true")
    case = tiny(*keys, f"drag.scheme={scheme}", "run.cap_ms=0.1", "fines.friction=0.2")
    whole, batches = go(case, tmp_path), batches_of(case, scales_of(case))
    last = whole.history[-1]
    assert len(batches.counts) > 5
    assert whole.supplied == batches.supplied(batches.entered_at(last.chunk))
    assert whole.supplied == last.upstream + last.invaded + last.passed
    assert whole.overlap.fraction < (0.15 if scheme == "held" else 0.1)


def test_every_stop_reason_is_told_and_fines_that_pass_are_removed(go, tmp_path, monkeypatch):
    """Five fines that wait at the face do not say that it is plugged."""
    passing = ("fines.radius_mm=0.02", "fines.friction=0.0", "fines.count=200", "run.cap_ms=3.0")
    monkeypatch.setattr(clock, "MUD_PORES", 0.06)
    for turn, (reason, *keys) in enumerate(
        [
            ("cap", "run.cap_ms=0.05"),
            ("plugged", "fines={radius_mm=0.12, count=60}"),
            ("supply_exhausted", "fines={radius_mm=0.12, count=5}"),
            ("mud_cut_off", "fines={radius_mm=0.02, friction=0.0}", "run.cap_ms=3.0"),
            ("supply_exhausted", *passing),
        ]
    ):
        result = go(tiny(*keys), tmp_path / str(turn))
        assert result.stop_reason == reason
        said = any("the mud was cut off after" in warning for warning in result.warnings)
        assert said == (reason == "mud_cut_off")
    assert result.history[-1].passed > 0
    assert len(result.state.fines()) == 200 - result.history[-1].passed
    assert any("empty slab" in warning for warning in result.warnings)


def test_a_trickle_may_count_as_plugged(go, tmp_path):
    """With `plug_rate` the end comes at the first plug time with no more crossings than that."""
    plug = ("run.plug_time_ms=0.05", "run.plug_rate=0.5")
    case = tiny("fines.count=900", "run.checkpoint_ms=0.01", "run.cap_ms=2", *plug)
    result, allowed = go(case, tmp_path), checkpoint.plug_allowance(case, scales_of(case))
    crossed = [row.invaded + row.passed for row in result.history]
    assert result.stop_reason == "plugged"
    assert 0 < crossed[-1] - crossed[-6] <= allowed
    assert all(
        crossed[n] - result.history[n - 5].most_crossed > allowed
        for n in range(5, len(crossed) - 1)
        if result.history[n].quiet == 0
    )


def test_fines_that_vanish_are_an_error(grains_of, tmp_path):
    case = tiny()
    (tmp_path / "post").mkdir()
    grains = grains_of(case)
    damaged = grains.joined(next(place_batches(case, scales_of(case), grains)))
    more = (300, 0, 0), 301, "is not the 301 supplied"
    for counts, supplied, message in (((200, 90, 5), 300, "fines inside"), more):
        row = checkpoint.Checkpoint(1, 10, *counts, 0, 0, 0)
        with pytest.raises(LiggghtsError, match=message):
            checkpoint.check_counts(tmp_path, row, damaged, supplied)


# ---- The overlap of fines: it is measured right and changes no motion.
def test_what_was_seen_is_read_line_by_line(tmp_path):
    assert list(read_watch(tmp_path)) == []
    text = "# step,overlap\n50,-1e+24\n100,0.02\n# step,overlap\n150,0.01\n1,x\n200,0."
    (tmp_path / "overlap.csv").write_text(text)
    seen = list(read_watch(tmp_path))
    assert seen == [(50, 0.0), (100, 0.02), (150, 0.01)]
    assert deepest_of(seen) == Deepest(step=100, fraction=0.02)
    assert deepest_of([]) == Deepest(step=0, fraction=0.0)
    checkpoint.cut_watch(tmp_path, 100)
    assert [row.step for row in read_watch(tmp_path)] == [50, 100]


def test_the_deck_sees_the_overlap_of_an_impact(tmp_path):
    """v sqrt(m/k) of an undamped spring, over the fine's diameter; before and after it nothing.

    The grain that is hit overlaps another one by a third, which is no overlap of a fine.
    """
    case = tiny("fines.damping_ratio=0.0", "grains.damping_ratio=0.0", "fines.friction=0.0")
    scales, radius, speed, box = scales_of(case), 0.05e-3, 2.0, specimen_box(case)
    places = [[2e-3, 8e-4, 8e-4], [2e-3 + 3.3e-4, 8e-4, 8e-4]]
    pair = resting_spheres(places, 2.5e-4, box, kind=Kind.GRAIN)
    place = [[2e-3 - 3.05e-4, 8e-4, 8e-4]]
    fine = resting_spheres(place, radius, box, kind=Kind.FINE, first=3)
    checkpoint.write_watch_parts(case, pair, tmp_path)
    watch = watch_variables(case, scales, pair) | {"every": 2}
    text = f"fix still grains freeze\nvelocity fines set {number(speed)} 0 0 units box\n"
    text += render_text("_overlap.in.j2", {"overlap": watch})
    text += "variable chunk equal 1\n" + render_text("watched.in.j2", {})
    run = {"density": [2650.0, 2650.0, 2146.0], "step": scales.time_step / 5, "steps": 2000}
    bench(case, pair.joined(fine), tmp_path, commands=text, moving="fines", every=2000, **run)
    seen = list(read_watch(tmp_path))
    mass, stiffness = 4 / 3 * math.pi * radius**3 * 2146, scales.contacts["grain-fine"]
    expected = speed * math.sqrt(mass / stiffness.normal_stiffness) / (2 * radius)
    assert deepest_of(seen).fraction == pytest.approx(expected, rel=2e-3)
    assert seen[0].fraction == seen[-1].fraction == 0.0


def test_watching_does_not_move_a_single_bit(go, tmp_path, monkeypatch):
    case = tiny("run.cap_ms=0.2")
    watched = go(case, tmp_path / "watched")
    monkeypatch.setattr(checkpoint, "watch_variables", lambda *_: None)
    alone = go(case, tmp_path / "alone")
    assert not (tmp_path / "alone" / "overlap.csv").exists()
    assert np.array_equal(watched.state.position, alone.state.position)
    assert watched.overlap == deepest_of(read_watch(tmp_path / "watched"))
    assert watched.overlap.fraction > alone.overlap.fraction > 0
