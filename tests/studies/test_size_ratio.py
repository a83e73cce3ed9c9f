"""The study of the size ratio in its quick form, on the real binary: 1/20 of a grain."""

from dataclasses import replace

import pytest

from validation.command import run_study
from validation.dem.size_ratio import (
    DEFAULT,
    FINES,
    HELD,
    MATERIAL,
    RATIOS,
    SHEARS,
    STEP,
    STUDY,
    case_of,
    held_band,
    held_of,
)
from validation.engine.table import read_rows


@pytest.mark.liggghts
def test_a_pack_lets_go_of_fines_with_the_default_shear_and_not_with_the_materials(tmp_path):
    run_study(STUDY, tmp_path, quick=True)
    rows = read_rows(tmp_path / "size-ratio.csv")
    held = {row.series: held_of(row) for row in rows if row.quantity == HELD}
    free, stuck = (held[f"1/20, {shear}, by step"] for shear in (DEFAULT, MATERIAL))
    assert held_band(free)[1] < held_band(stuck)[0]
    assert held_band(free)[0] == 0


def test_in_the_table_of_the_page_the_default_does_not_depend_on_stiffness_or_step(root):
    """Every count lies in the binomial band of every other of its ratio."""
    rows = read_rows(root / "docs" / "validation" / "size-ratio.csv")
    for ratio in RATIOS:
        name = f"1/{ratio}, {DEFAULT}"
        counts = [
            held_of(row)
            for row in rows
            if row.quantity == HELD and row.series.removesuffix(", by step") == name
        ]
        assert len(counts) == 5
        for count in counts:
            low, high = held_band(count)
            assert all(low <= other <= high for other in counts), (name, counts)


def test_the_binomial_band_by_hand():
    """None of n: up to 1 - 0.025^(1/n) (Clopper and Pearson)."""
    assert held_band(0) == (0, 4)
    assert 3 < FINES * (1 - 0.025 ** (1 / FINES)) < 4
    assert held_band(FINES) == (FINES - 4, FINES)


def test_points_change_their_own_keys_alone():
    for point in STUDY.points(False):
        case = case_of(point)
        twin = case_of(
            replace(point, value=2 * float(point.value) if point.knob != STEP else 0.01)
        )
        key = "stiffness_N_m" if point.knob != STEP else "time_step_factor"
        assert case.run.model_dump() | {key: 0} == twin.run.model_dump() | {key: 0}
        assert getattr(case.run, key) == point.value
        shear = SHEARS[str(point.settings["shear"])] or (None, None)
        assert (case.grains.shear_stiffness_N_m, case.fines.shear_stiffness_N_m) == shear
        assert case.fines.count == FINES
