"""The studies of the defaults and of the drive velocity: their cases, and their tables."""

import math

import pytest

from fdnet.case.file import case_from
from fdnet.scales.scales import scales_of
from fdnet.studies.command import run_study
from fdnet.studies.dem import defaults, drive_velocity
from fdnet.studies.engine.levels import levels
from fdnet.studies.engine.study import DONE, Measured, Point
from fdnet.studies.engine.table import read_rows


def setting(value: str, seed: int = 1) -> Point:
    return Point(
        series="specimen 5", knob="setting", value=value, seed=seed, settings={"size": "whole"}
    )


def test_what_the_study_calls_the_defaults_are_the_defaults():
    """Without the five keys the same case has the same scales; the walls' friction is 0.55."""
    now = defaults.case_of(setting(defaults.NOW))
    data = now.data()
    del data["box"]["sides"], data["box"]["wall_friction"]
    del data["drag"]["upstream"], data["run"]["time_step_factor"], data["fines"]["supply"]
    plain = case_from(data)
    assert scales_of(plain) == scales_of(now)
    assert (plain.box.sides, plain.fines.supply) == (now.box.sides, now.fines.supply)
    assert plain.wall_friction == now.wall_friction == 0.55


def test_each_setting_changes_what_it_says():
    now = defaults.case_of(setting(defaults.NOW)).data()

    def changes(value: str) -> set[str]:
        then = defaults.case_of(setting(value)).data()
        return {
            f"{table}.{key}={then[table][key]}"
            for table in now
            if isinstance(now[table], dict)
            for key in now[table]
            if now[table][key] != then[table][key]
        }

    alone = {
        defaults.WALLS: {"box.sides=walls"},
        defaults.SMOOTH: {"box.sides=walls", "box.wall_friction=0.0"},
        defaults.FAST: {"drag.upstream=interstitial"},
        defaults.SHORT: {"run.time_step_factor=0.1"},
        defaults.AT_ONCE: {"fines.supply=slab"},
    }
    for value, expected in alone.items():
        assert changes(value) == expected, value
    assert changes(defaults.BEFORE) == set().union(*alone.values())


def test_the_table_of_defaults_says_what_changed():
    """Two seeds, 100 and 110 fines by default; 10 more with walls, each time."""
    runs = [
        Measured(
            point=setting(value, seed),
            status=DONE,
            observed={"invaded": 90.0 + 10 * seed + more, "depth_p95": 1e-3, "k_ratio": 0.5},
            wall_s=1.0,
            core_s=2.0,
            steps=math.nan,
            peak_memory_bytes=math.nan,
        )
        for seed in (1, 2)
        for value, more in ((defaults.NOW, 0.0), (defaults.WALLS, 10.0))
    ]
    text = defaults.summary(defaults.judge(runs))
    assert "| specimen 5, all defaults | 2 | 2 | 105 ± 64 | - | 1 ± 0 | - |" in text
    assert "| specimen 5, walls with friction | 2 | 2 | 115 ± 64 | +9.52 % |" in text


def test_a_drive_keeps_the_push_over_the_stiffness():
    slow, fast = (
        drive_velocity.case_of(
            Point(series="", knob="factor", value=value, seed=1, settings={"size": "whole"})
        )
        for value in (1.0, 9.0)
    )
    first, second = scales_of(slow), scales_of(fast)
    assert first.force_factor == pytest.approx(1.0, rel=1e-12)
    assert second.force_factor == pytest.approx(9.0, rel=1e-12)
    assert second.drag_overlap == pytest.approx(first.drag_overlap, rel=1e-12)
    assert second.sticking.push == pytest.approx(first.sticking.push, rel=1e-12)


@pytest.mark.liggghts
def test_driven_invasions_on_the_binary(tmp_path):
    """The quick form: as long by the clock of the fluid, in a third of it by that of the deck."""
    run_study(drive_velocity.STUDY, tmp_path, quick=True)
    rows = read_rows(tmp_path / "drive-velocity.csv")
    seen = {
        (row.value, row.seed, row.quantity): row.observed for row in rows if row.status == DONE
    }
    for seed in (1, 2):
        times = [seen[value, seed, "physical_time_s"] for value in (1.0, 3.0)]
        assert times == pytest.approx([0.012, 0.012], rel=0.01)
        counts = [seen[value, seed, "invaded"] for value in (1.0, 3.0)]
        assert abs(counts[0] - counts[1]) <= 5
        depths = [seen[value, seed, "mean_depth"] for value in (1.0, 3.0)]
        assert depths[0] == pytest.approx(depths[1], rel=0.1)


def test_in_the_table_of_the_page_the_deposit_does_not_depend_on_the_drive(root):
    """Of 15 means over four seeds chance would leave about one outside its 95 % band."""
    rows = read_rows(root / "docs/validation/drive-velocity.csv")
    means = [
        level
        for name in drive_velocity.OBSERVED
        for level in levels(rows, drive_velocity.SERIES, name)
        if not level.reference
    ]
    assert [level.runs for level in means] == [4] * 15
    assert sum(level.size > level.half_width for level in means) <= 2
    stokes = {row.value: row.observed for row in rows if row.quantity == "impact_stokes"}
    assert all(stokes[value] < 0.5 for value in (1.0, 3.0, 9.0))
