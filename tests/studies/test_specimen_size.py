"""The study of specimen size in its quick form, on the real binary."""

import pytest

from validation.command import run_study
from validation.engine.levels import levels
from validation.engine.table import read_rows
from validation.network.specimen_size import INTACT, INVADED, NAMED, PERIODIC, STUDY

pytestmark = pytest.mark.liggghts


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("specimen-size")
    run_study(STUDY, out, quick=True)
    return read_rows(out / "specimen-size.csv")


def test_what_one_pack_is_off_by_falls_with_its_grains(rows):
    for name in ("one run's k_initial", "one run's porosity_initial"):
        result = [level.error for level in levels(rows, f"{INTACT}, {PERIODIC}", name)]
        assert result[0] > 2 * result[-1] > 0


def test_packs_of_equal_count_meet_the_porosity_of_their_grains(rows):
    """At 0.40 nothing overlaps, so porosity is 1 - n v / V apart from the two end walls."""
    for row in rows:
        if row.quantity == "porosity_initial":
            assert row.observed == pytest.approx(0.40, abs=0.01)


def test_every_seed_is_a_run_of_its_own(rows):
    result = [row.observed for row in rows if row.quantity == "porosity_loss_first"]
    assert len(set(result)) == len(result) == 6
    assert {level.value for level in levels(rows, f"{INVADED}, {PERIODIC}", "k_ratio_first")} == {
        43.0,
        84.0,
    }


def test_boxes_in_use_are_those_of_the_cases(root):
    from builders import TINY

    from fdnet.case.file import read_case

    def size(text):
        return tuple(float(side) for side in text.split(","))

    assert size(NAMED["quick case"][0]) == read_case(root / "cases/quick.toml").box.size_mm
    assert size(NAMED["specimen 5"][0]) == read_case(root / "cases/specimen5.toml").box.size_mm
    assert size(NAMED["tests' tiny case"][0]) == tuple(TINY["box"]["size_mm"])
