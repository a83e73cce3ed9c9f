"""Progress shows the step, the invaded count and an honest time left; it never runs over."""

from types import SimpleNamespace

import numpy as np
import pytest

from fdnet.run.progress import Forecast, Progress

WELL = (
    Forecast(expected=86185, plug=24192, cap=482177, allowed=7.2756e-4),
    [97, 305, 506, 687, 847, 995, 1097, 1165, 1194, 1199, 1200, 1201, 1203],
    6049,
)

SPECIMEN5 = (
    Forecast(expected=16931, plug=4943, cap=68665),
    [159, 348, 447, 481, 492, 494, 496, 496, 496, 496, 496],
    1236,
)
"""Forecast, crossings of the face at each checkpoint, and its steps, of runs with seed 1: the well
and quick specimen 5."""


@pytest.fixture
def clock(monkeypatch) -> SimpleNamespace:
    """A clock that the test turns."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr("fdnet.run.progress.time.monotonic", lambda: clock.now)
    return clock


def test_lines_of_a_run_become_progress(capsys, clock):
    with Progress("invade", Forecast(expected=1000)) as progress:
        thermo, checkpoint = "   100  1369  1.5e-07  0.21", "FDNET checkpoint 1 300 10 20 3"
        for line in (thermo, "noise 1 2 3", checkpoint):
            clock.now += 6
            progress(line)
    shown = capsys.readouterr().err
    for part in ("step 300 of ~1000", "invaded 20", "~42 s left"):
        assert part in shown


def test_the_time_left_of_recorded_runs_is_within_a_factor_of_two(clock):
    """Later steps are slower, as more fines are there: the last third decides."""
    for forecast, crossed, chunk in (WELL, SPECIMEN5):
        times = np.cumsum(60.0 + 2.0 * np.arange(len(crossed)))
        progress = Progress("invade", forecast, show=False)
        for number, (count, now) in enumerate(zip(crossed, times, strict=True), start=1):
            clock.now = now
            progress(f"FDNET checkpoint {number} {number * chunk} 0 {count} 0")
            left = times[-1] - now
            if number > 1 and left > 0.1 * times[-1]:
                assert 0.5 < progress.left() / left < 2, forecast


def test_progress_never_runs_over_its_end():
    """Far beyond the expected step there is always more to come, up to the cap."""
    forecast = Forecast(expected=1000, plug=300, cap=5000)
    progress = Progress("invade", forecast, show=False)
    for number in range(1, 51):
        progress(f"FDNET checkpoint {number} {100 * number} 0 {10 * number} 0")
        assert min(100 * number + 1, 5000) <= progress.end <= 5000
    assert progress.end == 5000


def test_a_pack_that_is_made_again_counts_from_zero(clock):
    progress = Progress("pack", 1000, show=False)
    for step in (500, 900, 100, 200):
        clock.now += 10.0
        progress(f"   {step}   70   1.5e-07   0.21")
    assert progress.left() == pytest.approx(80.0)
