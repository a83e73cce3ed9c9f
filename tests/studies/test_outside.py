"""Comparisons with numbers from outside, and the scoreboard: set-ups, quick forms, rows."""

import re

import numpy as np
import pytest

from validation import mechanics, outside, scoreboard
from validation.comparisons import findings, read_rows

OPEN = {
    "ln P of a clog, friction 0.1",
    "the same with LAMMPS's contacts",
    "moduli, walls at the sides: Young's, 1.9 mm over 3 mm",
    "k of sand of quartz, 35 MPa over 0",
}
"""What disagrees, and is said to."""


@pytest.mark.liggghts
@pytest.mark.parametrize("overlap", [0.0, 0.03, 0.05])
def test_fines_pass_the_throat_of_three_grains_up_to_half_a_percent(overlap, tmp_path):
    """The numbers 0.1547, 0.1201 and 0.0970."""
    exact = outside.passing_ratio(overlap)
    assert round(exact, 4) == {0.0: 0.1547, 0.03: 0.1201, 0.05: 0.0970}[overlap]
    assert outside.passes(0.995 * exact, overlap, tmp_path / "a", seed=1)
    assert not outside.passes(1.005 * exact, overlap, tmp_path / "b", seed=1)


@pytest.mark.liggghts
@pytest.mark.parametrize(
    ("chapter", "name"),
    [
        (outside, "fine on a slope"),
        (outside, "fine on a slope with rolling friction"),
        (outside, "free fine"),
        (outside, "constriction, friction 0.5"),
        (mechanics, "moduli, periodic sides"),
        pytest.param(outside, "single fines in a loose pack", marks=pytest.mark.nightly),
        pytest.param(outside, "constriction, friction 0.1", marks=pytest.mark.nightly),
        pytest.param(mechanics, "unbonded test, LIGGGHTS", marks=pytest.mark.nightly),
    ],
)
def test_a_quick_form_agrees_and_gives_the_committed_numbers(chapter, name, root, tmp_path):
    """Those that have the settings of the full form are the same to six digits."""
    own = chapter.__name__.removeprefix("validation.")
    command = ["--quick", "--only", name, "--out", str(tmp_path)]
    assert chapter.main(command) == 0
    rows = read_rows(tmp_path / f"{own}.csv")
    assert set(rows.status) == {"done"}
    assert all(one.verdict == "holds" for one in findings(chapter.CHAPTER.comparisons, rows))
    keys = ["comparison", "value", "seed", "quantity"]
    known = read_rows(root / "docs" / "validation" / f"{own}.csv")
    rows, known = (one.assign(value=one.value.astype(str)) for one in (rows, known))
    both = rows.merge(known, on=keys, suffixes=("", "_known"))
    if "loose pack" not in name and "constriction" not in name:
        assert len(both) == len(rows)
        apart = (both.observed - both.observed_known).abs()
        assert (apart <= 1e-6 * both.observed_known.abs() + 1e-12).all()
    (picture,) = tmp_path.glob("*.png")
    assert picture.stat().st_size > 10_000


def test_a_command_goes_on_where_it_was_stopped(tmp_path, capsys):
    """What the CSV has is not measured again."""
    command = ["--quick", "--only", "Ergun's bed", "--out", str(tmp_path)]
    assert outside.main(command) == 0
    path = tmp_path / "outside.csv"
    first = path.read_text()
    path.write_text(first.replace("0.0145", "0.0146"))
    assert outside.main(command) == 0
    assert path.read_text() == first.replace("0.0145", "0.0146")
    assert "holds" in capsys.readouterr().out


@pytest.mark.liggghts
@pytest.mark.parametrize("row", ["1", "6", "8"])
def test_a_quick_row_of_the_scoreboard_holds(row, tmp_path):
    assert scoreboard.main(["--quick", "--only", row, "--out", str(tmp_path)]) == 0
    rows = read_rows(tmp_path / "scoreboard.csv")
    lines = findings(scoreboard.CHAPTER.comparisons, rows)
    own = [line.verdict for line in lines if line.what.startswith(f"{row}: ")]
    assert own == ["holds"] * 2


def test_the_page_has_the_tables_of_the_committed_rows(root):
    """A line of the scoreboard that another chapter keeps is not said a second time."""
    page = (root / "docs" / "evidence" / "scoreboard.md").read_text(encoding="utf-8")
    rows = read_rows(root / "docs" / "validation" / "scoreboard.csv")
    board = findings(scoreboard.CHAPTER.comparisons, rows[rows.status == "done"])
    said = {line.what.partition(": ")[2] for line in board}
    lines = [line for name in ("outside", "mechanics") for line in scoreboard.kept(name)]
    others = [line for line in lines if line.source != mechanics.ITSELF and line.what not in said]
    fails, _, rest = page.partition("**Holds:**")
    holds = rest.partition("**In part")[0]
    parts = {"**does not hold**": fails, "holds": holds}
    rows = [(line, parts.get(line.verdict, page)) for line in board]
    for line, where in [*rows, *((line, page) for line in others)]:
        shown = line.measured.partition(", in ")[0].replace("(half of ", "")
        for number in re.findall(r"\d[\d.,]*(?<![.,])", shown):
            assert number in where, (line.what, line.measured)
    assert {one.what for one in lines if one.verdict == "**does not hold**"} == OPEN


def test_gamma_of_a_ball_that_a_plane_halves():
    """Half of a ball lies below a plane through its centre; whole balls and none elsewhere."""
    volume = scoreboard.ball_between(np.array([0.0, 0.5, 3.0]), np.full(3, 1.0), 0.0, 2.0)
    ball = 4 / 3 * np.pi
    assert volume == pytest.approx([ball / 2, ball * 27 / 32, 0.0])
