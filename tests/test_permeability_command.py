"""`fdnet permeability` on files made here."""

import json
from pathlib import Path

import numpy as np
import pytest

from fdnet.cli import main
from fdnet.spheres.readers import read_spheres


def cubic(path: Path, cells: int = 4, *, radius: float = 0.5, extra: str = "") -> str:
    """Spheres on a simple cubic lattice of spacing 1; returns the box."""
    points = np.indices((cells,) * 3).reshape(3, -1).T + 0.5
    rows = "".join(f"{x},{y},{z},{radius}\n" for x, y, z in points)
    path.write_text("# a comment\nx,y,z,radius\n" + rows + extra)
    return ",".join(["0", str(cells)] * 3)


def answer(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = 0
    try:
        code = main(["permeability", *map(str, arguments)])
    except SystemExit as stop:
        code = int(stop.code or 0)
    said = capsys.readouterr()
    return code, said.out, said.err


def test_units_axes_and_fully_periodic_lattice(tmp_path, capsys):
    """Simple cubic, touching: k = 0.00252 d^2 (Zick and Homsy 1982); the law is within 10 %."""
    box = cubic(tmp_path / "sc.csv")
    values = {}
    for units, axis in (("mm", "x"), ("mm", "z"), ("um", "y")):
        code, out, err = answer(
            capsys,
            tmp_path / "sc.csv",
            "--units",
            units,
            "--box",
            box,
            "--periodic",
            "xyz",
            "--axis",
            axis,
            "--json",
        )
        assert code == 0, err
        values[units, axis] = json.loads(out)
    result = values["mm", "x"]
    assert result["porosity_initial"] == pytest.approx(0.476401, abs=2e-3)
    assert result["k_initial_m2"] == pytest.approx(0.00252e-6, rel=0.10, abs=0)
    assert result["k_damaged_m2"] == result["k_initial_m2"]
    assert values["mm", "z"]["k_initial_m2"] == pytest.approx(
        result["k_initial_m2"], rel=1e-3, abs=0
    )
    assert values["um", "y"]["k_initial_m2"] == pytest.approx(
        1e-6 * result["k_initial_m2"], rel=1e-3, abs=0
    )
    assert {
        "pores",
        "throats",
        "solver",
        "law",
        "damage_law",
        "seconds",
        "warnings",
        "porosity_damaged",
    } <= set(result)


def test_walls_hold_the_fluid_unless_they_slip(tmp_path, capsys):
    """A lattice between slipping walls is the endless lattice; no-slip walls leave less."""
    box = cubic(tmp_path / "sc.csv")
    k = {}
    for walls in ("", "--walls=slip", "--walls=no-slip", "--periodic=yz"):
        code, out, err = answer(
            capsys, tmp_path / "sc.csv", "--units", "mm", "--box", box, "--json", *walls.split()
        )
        assert code == 0, err
        k[walls] = json.loads(out)["k_initial_m2"]
    assert k["--walls=slip"] == pytest.approx(k["--periodic=yz"], rel=1e-6, abs=0)
    assert k[""] == k["--walls=no-slip"] < 0.8 * k["--walls=slip"]


def test_a_box_that_does_not_start_at_zero(tmp_path, capsys):
    cubic(tmp_path / "sc.csv")
    rows = (tmp_path / "sc.csv").read_text().splitlines()
    moved = [rows[1]] + [
        f"{float(row.split(',')[0]) + 7.0},{row.partition(',')[2]}" for row in rows[2:]
    ]
    (tmp_path / "moved.csv").write_text("\n".join(moved) + "\n")
    values = []
    for name, box in (("sc", "0,4,0,4,0,4"), ("moved", "7,11,0,4,0,4")):
        code, out, err = answer(
            capsys,
            tmp_path / f"{name}.csv",
            "--units",
            "mm",
            "--box",
            box,
            "--sections",
            "2",
            "--json",
        )
        assert code == 0, err
        values.append(json.loads(out))
    assert values[1]["k_initial_m2"] == pytest.approx(values[0]["k_initial_m2"], rel=1e-6, abs=0)
    assert [row["x_lo_m"] for row in values[1]["sections"]] == pytest.approx([0.0, 2e-3])


def test_all_laws_as_a_table(tmp_path, capsys):
    box = cubic(tmp_path / "sc.csv")
    code, out, _ = answer(
        capsys,
        tmp_path / "sc.csv",
        "--units",
        "mm",
        "--box",
        box,
        "--periodic",
        "yz",
        "--compare-laws",
    )
    assert code == 0
    for law in ("thesis", "effective", "thesis-code", "section-archie"):
        assert law in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--units", "mm", "--box", "0,1,0"], "--box: '0,1,0', expected six numbers"),
        (["--units", "mm", "--box", "0,4,4,0,0,4"], "each lower bound below the upper"),
        (["--units", "mm", "--periodic", "xy"], "--box: missing"),
        (["--units", "mm", "--periodic", "xq"], "--periodic: 'xq'"),
        (["--units", "furlong"], "invalid choice"),
        (["--units", "mm", "--sections", "0"], "expected 1 to 1000"),
        (["--units", "mm", "--law", "darcy"], "invalid choice"),
        ([], "units"),
    ],
)
def test_bad_options_end_with_2_and_one_line(tmp_path, capsys, arguments, said):
    cubic(tmp_path / "sc.csv")
    code, out, err = answer(capsys, tmp_path / "sc.csv", *arguments)
    assert code == 2
    assert said in err
    assert len(err.strip().splitlines()) == 1
    assert not out


def test_metre_columns_refuse_units(tmp_path, capsys):
    (tmp_path / "m.csv").write_text("x_m,y_m,z_m,radius_m\n0,0,0,1\n")
    code, _, err = answer(capsys, tmp_path / "m.csv", "--units", "mm")
    assert code == 2
    assert "units" in err


def test_degenerate_spheres_end_with_4(tmp_path, capsys):
    rows = "0.5,0.5,0.5,0.5\n1.5,0.5,0.5,0.5\n0.5,1.5,0.5,0.5\n0.5,0.5,0.5,0.5\n"
    (tmp_path / "sc.csv").write_text("x,y,z,radius\n" + rows)
    code, _, err = answer(capsys, tmp_path / "sc.csv", "--units", "mm", "--box", "0,2,0,2,0,2")
    assert code == 4
    assert "3 of 3 grains reach into the box" in err
    assert len(err.strip().splitlines()) == 1


def test_too_few_grains_and_missing_file(tmp_path, capsys):
    (tmp_path / "few.csv").write_text("x,y,z,radius,kind\n0,0,0,1,grain\n2,0,0,0.1,fine\n")
    assert answer(capsys, tmp_path / "few.csv", "--units", "mm")[0] == 2
    assert answer(capsys, tmp_path / "none.csv", "--units", "mm")[0] == 2


def test_a_pack_without_an_open_path_is_an_answer(tmp_path, capsys):
    """Spheres of 0.72 spacings close every triangle of the lattice and leave voids: k = 0.

    The circumradius of a triangle is 0.707 spacings.
    """
    box = cubic(tmp_path / "sc.csv", radius=0.72)
    code, out, err = answer(
        capsys, tmp_path / "sc.csv", "--units", "mm", "--box", box, "--periodic", "xyz", "--json"
    )
    assert code == 0, err
    result = json.loads(out)
    assert result["k_initial_m2"] == 0
    assert result["k_reduction"] is None
    assert 0 < result["porosity_initial"] < 0.05
    assert any("path" in warning for warning in result["warnings"])


@pytest.mark.filterwarnings("error")
def test_a_box_beside_all_grains_is_told(tmp_path, capsys):
    cubic(tmp_path / "sc.csv")
    code, _, err = answer(
        capsys, tmp_path / "sc.csv", "--units", "mm", "--box", "50,54,50,54,50,54"
    )
    assert code == 4
    assert "0 of 64 grains reach into the box" in err


def test_a_folder_for_the_table_is_looked_for_first(tmp_path, capsys):
    box = cubic(tmp_path / "sc.csv")
    table = tmp_path / "none" / "laws.csv"
    code, out, err = answer(
        capsys, tmp_path / "sc.csv", "--units", "mm", "--box", box, "--csv", table
    )
    assert (code, out) == (2, "")
    assert "is not a folder" in err


def test_columns_of_the_table_stand_below_their_names(tmp_path, capsys):
    box = cubic(tmp_path / "sc.csv")
    _, out, _ = answer(
        capsys,
        tmp_path / "sc.csv",
        "--units",
        "mm",
        "--box",
        box,
        "--periodic",
        "yz",
        "--compare-laws",
    )
    rows = [line for line in out.splitlines()[1:] if line[:8] not in ("assumed:", "warning:")]
    assert len({len(line) for line in rows}) == 1


def damaged(path: Path) -> tuple[str, str]:
    """The lattice with fines of 0.2 in half of its voids, without kinds; returns box and limit."""
    places = np.indices((2, 4, 4)).reshape(3, -1).T + 1.0
    return cubic(path, extra="".join(f"{x},{y},{z},0.2\n" for x, y, z in places)), "0.3"


def test_three_axes_at_once_are_the_three_one_by_one(tmp_path, capsys):
    box, limit = damaged(tmp_path / "s.csv")
    given = [tmp_path / "s.csv", "--units", "mm", "--box", box, "--periodic", "yz"]
    given += ["--fines-below", limit, "--json"]
    _, out, _ = answer(capsys, *given, "--axis", "all")
    whole = json.loads(out)
    for axis in "xyz":
        alone = json.loads(answer(capsys, *given, "--axis", axis)[1])
        assert whole[f"k_{axis}_m2"] == alone["k_initial_m2"]
        assert whole[f"k_{axis}_damaged_m2"] == alone["k_damaged_m2"]
        assert alone["k_damaged_m2"] < alone["k_initial_m2"]
    assert whole["k_initial_m2"] == whole["k_x_m2"] != whole["k_y_m2"]
    assert whole["k_damaged_m2"] == whole["k_x_damaged_m2"]


@pytest.mark.parametrize(("axis", "order"), [("y", (1, 2, 0)), ("z", (2, 0, 1))])
def test_box_and_periodic_sides_are_those_of_the_file(tmp_path, capsys, axis, order):
    """Flow along y or z is flow along x through the file with its columns exchanged."""
    _, limit = damaged(tmp_path / "s.csv")
    header, *rows = (tmp_path / "s.csv").read_text().splitlines()[1:]
    cells = [row.split(",") for row in rows]
    exchanged = [",".join([*(row[k] for k in order), row[3]]) for row in cells]
    (tmp_path / "t.csv").write_text("\n".join([header, *exchanged]) + "\n")
    bounds = [("0", "4"), ("0.5", "3.5"), ("0", "4")]
    answers = []
    for file, along, sides, periodic in (
        ("s.csv", axis, bounds, "z"),
        ("t.csv", "x", [bounds[k] for k in order], "xyz"[order.index(2)]),
    ):
        box = ",".join(value for pair in sides for value in pair)
        given = ["--units", "mm", "--box", box, "--periodic", periodic, "--axis", along, "--json"]
        code, out, err = answer(capsys, tmp_path / file, *given, "--fines-below", limit)
        assert code == 0, err
        answers.append(json.loads(out))
    for name in ("k_initial_m2", "k_damaged_m2"):
        assert answers[0][name] == pytest.approx(answers[1][name], rel=1e-9, abs=0)
    assert answers[0]["k_damaged_m2"] < answers[0]["k_initial_m2"]


def test_three_axes_as_a_table_and_as_csv(tmp_path, capsys):
    box, limit = damaged(tmp_path / "s.csv")
    given = [tmp_path / "s.csv", "--units", "mm", "--box", box, "--axis", "all"]
    given += ["--fines-below", limit, "--csv", tmp_path / "laws.csv"]
    code, out, err = answer(capsys, *given, "--compare-laws", "--sections", "2")
    assert code == 0, err
    table = out.split("sections")[0].splitlines()[1:]
    by_axis = [line for line in table if line.split()[2] in ("x", "y", "z")]
    assert len(by_axis) == 3 * 11  # the default, and all pairs
    assert len({len(line) for line in by_axis}) == 1
    header, *rows = (tmp_path / "laws.csv").read_text().splitlines()
    assert header.endswith("k_x_m2,k_y_m2,k_z_m2,k_x_damaged_m2,k_y_damaged_m2,k_z_damaged_m2")
    assert len(rows) == 11


def test_every_format_gives_the_same_answer(tmp_path, capsys):
    """CSV with a limit, CSV with kinds, dump and VTK of the same spheres, to the last digit."""
    from fdnet.report.vtk import write_spheres_vtp
    from fdnet.spheres.readers import write_spheres
    from tests.spheres.test_readers import dump_text

    box, limit = damaged(tmp_path / "s.csv")
    bounds = [float(part) for part in box.split(",")]
    spheres = read_spheres(tmp_path / "s.csv", units="mm", box=bounds, fines_below=float(limit))
    write_spheres(tmp_path / "kinds.csv", spheres)
    write_spheres_vtp(tmp_path / "s.vtp", spheres)
    (tmp_path / "s.dump").write_text(dump_text(spheres))
    metres = ["--box", ",".join(f"{1e-3 * value!r}" for value in bounds)]
    answers = []
    for file, *more in (
        ("s.csv", "--units", "mm", "--box", box, "--fines-below", limit),
        ("kinds.csv", *metres),
        ("s.vtp", *metres),
        ("s.dump",),
        ("s.dump", "--types", "1=grain,2=fine"),
        ("s.dump", "--fines-below", "3e-4"),
    ):
        code, out, err = answer(capsys, tmp_path / file, "--periodic", "yz", "--json", *more)
        assert code == 0, err
        answers.append(json.loads(out))
    assert {result["k_damaged_m2"] for result in answers} == {answers[0]["k_damaged_m2"]}
    assert answers[0]["k_damaged_m2"] < answers[0]["k_initial_m2"]


def test_what_the_answer_rests_on_is_in_it(tmp_path, capsys):
    box, limit = damaged(tmp_path / "s.csv")
    given = [tmp_path / "s.csv", "--units", "mm", "--box", box, "--json"]
    plain = json.loads(answer(capsys, *given)[1])
    assert any("all its spheres are grains" in text for text in plain["assumptions"])
    assert any("walls that hold the fluid" in text for text in plain["assumptions"])
    chosen = json.loads(
        answer(
            capsys,
            *given,
            "--fines-below",
            limit,
            "--damage-law",
            "section-archie",
            "--walls",
            "slip",
        )[1]
    )
    assert chosen["damage_law_used"] == "section-archie"
    assert any("let the fluid slip" in text for text in chosen["assumptions"])
    assert not any("damage law is fdnet's default" in text for text in chosen["assumptions"])
    default = json.loads(answer(capsys, *given, "--fines-below", limit)[1])
    assert default["damage_law"] == "auto"
    assert default["damage_law_used"] == "all-spheres"
    assert any("damage law is fdnet's default" in text for text in default["assumptions"])


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--types", "1:grain"], "--types: '1:grain', expected TYPE=KIND"),
        (["--types", "1=grain,1=fine"], "names a type twice"),
        (["--types", "1=sand"], "'sand', expected grain or fine"),
        (["--types", "1=grain"], "has no types"),
        (["--fines-below", "0"], "expected a radius above 0"),
        (["--fines-below", "9"], "makes every sphere"),
        (["--fines-below", "0.1", "--types", "1=grain"], "give one of the two"),
    ],
)
def test_bad_choices_of_kinds_end_with_2(tmp_path, capsys, arguments, expected):
    cubic(tmp_path / "sc.csv")
    code, out, err = answer(capsys, tmp_path / "sc.csv", "--units", "mm", *arguments)
    assert (code, out) == (2, "")
    assert expected in err
    assert len(err.strip().splitlines()) == 1


def test_a_dump_of_fines_alone_says_what_to_do(tmp_path, capsys):
    from tests.spheres.test_readers import dump_text

    damaged(tmp_path / "s.csv")
    spheres = read_spheres(tmp_path / "s.csv", units="mm", fines_below=0.3)
    (tmp_path / "s.dump").write_text(dump_text(spheres.fines()))
    code, _, err = answer(capsys, tmp_path / "s.dump")
    assert code == 2
    assert "0 grains, expected at least 4" in err


def test_a_box_with_a_negative_number_and_a_pack_without_fines(tmp_path, capsys):
    """The lattice moved by -2: its box begins with a minus sign, after a space as after `=`."""
    points = np.indices((4,) * 3).reshape(3, -1).T - 1.5
    rows = "".join(f"{x},{y},{z},0.5\n" for x, y, z in points)
    (tmp_path / "s.csv").write_text("x,y,z,radius\n" + rows)
    box = ",".join(["-2,2"] * 3)
    given = [tmp_path / "s.csv", "--units", "mm", "--periodic", "y"]
    code, out, err = answer(capsys, *given, "--box", box)
    assert code == 0, err
    assert (code, out, err) == answer(capsys, *given, f"--box={box}")
    assert "x: inlet and outlet; z: walls that hold the fluid; y: periodic" in out
    assert "k mD" in out
    assert "damage" not in out
    assert "cross the side walls" not in out


def test_spheres_that_cross_a_side_wall_are_reported(tmp_path, capsys):
    cubic(tmp_path / "s.csv")
    given = [tmp_path / "s.csv", "--units", "mm", "--box", "0,4,0.1,3.9,0,4", "--json"]
    _, out, _ = answer(capsys, *given)
    text = "32 of 64 spheres cross the side walls; if the pack is periodic give --periodic y"
    assert any(line.startswith(text) for line in json.loads(out)["warnings"])
    _, out, _ = answer(capsys, *given, "--periodic", "y")
    assert not any("cross the side" in one for one in json.loads(out)["warnings"])


def table(path: Path, rows: list[tuple[float, ...]], kinds: list[str] | None = None) -> Path:
    """A file of spheres x, y, z, radius."""
    kinds = ["grain"] * len(rows) if kinds is None else kinds
    lines = [",".join(map(repr, (*map(float, row),))) for row in rows]
    body = "".join(f"{line},{kind}\n" for line, kind in zip(lines, kinds, strict=True))
    path.write_text("x,y,z,radius,kind\n" + body)
    return path


HALF = 0.5
CELLS = {
    "sc": ([(0.3, 0.6, 0.2)], HALF, 1, 2.5203e-9),
    "sc row": ([(0.5, 0.5, k + 0.5) for k in range(4)], HALF, 4, 2.5203e-9),
    "bcc": ([(0, 0, 0), (0.5, 0.5, 0.5)], 0.75**0.5 / 2, 1, 3.7605e-10),
    "fcc": ([(0, 0, 0), (0, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 0.5, 0)], 0.5**0.5 / 2, 1, 8.6237e-11),
}
"""Places, radius, height of the cell, and k = 2 a2 / (9 c K), m2, for an edge of 1 mm, where K is
42.1, 162.9 and 435 (Zick and Homsy 1982)."""
CLOSE = {"sc": 2e-3, "sc row": 2e-3, "bcc": 6e-3, "fcc": 1.4e-2}
"""What larger cells of the same lattices are off by."""


@pytest.mark.parametrize("name", CELLS)
def test_a_unit_cell_is_repeated_until_it_can_be_tessellated(tmp_path, capsys, name):
    places, radius, height, k = CELLS[name]
    file = table(tmp_path / "cell.csv", [(*place, radius) for place in places])
    given = [file, "--units", "mm", "--box", f"0,1,0,1,0,{height}", "--periodic", "xyz", "--json"]
    code, out, err = answer(capsys, *given, "--axis", "all", "--sections", "2")
    assert code == 0, err
    result = json.loads(out)
    for axis in "xyz":
        assert result[f"k_{axis}_m2"] == pytest.approx(k, rel=CLOSE[name], abs=0)
    times = " x 1 times" if height == 4 else " times"
    assert any("The cell was repeated" in one and times in one for one in result["assumptions"])
    rows = result["sections"]
    assert [row["x_hi_m"] for row in rows] == pytest.approx([5e-4, 1e-3])
    series = sum(5e-4 / row["k_initial_inplace_m2"] for row in rows)
    assert 1e-3 / series == pytest.approx(result["k_x_m2"], rel=1e-4, abs=0)


def test_fines_in_a_unit_cell_are_repeated_with_it(tmp_path, capsys):
    """The cell with a fine in its void, and the same lattice of 27 cells written out."""
    shifts = [tuple(map(float, one)) for one in np.indices((3, 3, 3)).reshape(3, -1).T]
    grain, fine = (0.5, 0.5, 0.5, 0.5), (0.02, 0.05, 0.0, 0.25)
    files = []
    for name, moved in (("one", [(0.0, 0.0, 0.0)]), ("many", shifts)):
        rows = [
            (*(a + b for a, b in zip(one[:3], by, strict=True)), one[3])
            for one in (grain, fine)
            for by in moved
        ]
        kinds = ["grain"] * len(moved) + ["fine"] * len(moved)
        files.append(table(tmp_path / f"{name}.csv", rows, kinds))
    values = []
    for file, side in zip(files, (1, 3), strict=True):
        box = ",".join(["0", str(side)] * 3)
        code, out, err = answer(
            capsys, file, "--units", "mm", "--box", box, "--periodic", "xyz", "--json"
        )
        assert code == 0, err
        values.append(json.loads(out))
    for key in ("k_initial_m2", "k_damaged_m2", "porosity_damaged"):
        assert values[0][key] == pytest.approx(values[1][key], rel=2e-3, abs=0)
    assert values[0]["k_damaged_m2"] < 0.9 * values[0]["k_initial_m2"]


def test_few_grains_between_walls_need_the_periodic_sides(tmp_path, capsys):
    file = table(tmp_path / "cell.csv", [(0.5, 0.5, 0.5, 0.5)])
    code, _, err = answer(capsys, file, "--units", "mm", "--box", "0,1,0,1,0,1")
    assert code == 2
    assert "1 grains, expected at least 4" in err
    assert "--periodic" in err


INNER = {
    "touching from within": [(0.2, 0, 0, 0.3)],
    "concentric": [(0, 0, 0, 0.3)],
    "there twice": [(0, 0, 0, 0.5)],
    "rounded": [(0.1155, 0.1155, 0.1155, 0.3)],
    "four": [(0.2, 0, 0, 0.3), (0, 0.2, 0, 0.3), (0, 0, -0.2, 0.3), (0.1, 0.1, 0, 0.2)],
    "one in the other": [(0.2, 0, 0, 0.3), (0.3, 0, 0, 0.2), (0.4, 0, 0, 0.1)],
}


@pytest.mark.parametrize(
    ("name", "kind"),
    [*((name, "grain") for name in INNER)]
    + [(name, "fine") for name in INNER if name != "there twice"],
)
def test_a_sphere_inside_a_grain_adds_nothing(tmp_path, capsys, name, kind):
    """Same solid, same k: 2.5203e-9 m2 (Zick and Homsy 1982), also where the grain is an image."""
    places = np.indices((3, 3, 3)).reshape(3, -1).T + 0.1  # spheres cross the sides
    rows = [(*place, 0.5) for place in places]
    inner = [(*((place + one[:3]) % 3), one[3]) for place in places for one in INNER[name]]
    kinds = ["grain"] * len(rows) + [kind] * len(inner)
    file = table(tmp_path / "nested.csv", [*rows, *inner], kinds)
    given = ["--units", "mm", "--box", "0,3,0,3,0,3", "--periodic", "xyz", "--json"]
    code, out, err = answer(capsys, file, *given)
    assert code == 0, err
    result = json.loads(out)
    assert result["k_initial_m2"] == pytest.approx(2.5203e-9, rel=2e-3, abs=0)
    assert result["k_damaged_m2"] == result["k_initial_m2"]
    assert result["spheres_dropped"] == len(inner)
    assert any(f"{len(inner)} {kind}s lie wholly inside" in one for one in result["warnings"])
    assert not any("overlap" in one for one in result["warnings"])


@pytest.mark.parametrize("radius", [0.2, 0.35])
def test_a_sphere_that_several_cover_together_adds_nothing(tmp_path, capsys, radius):
    """Eight spheres on the corners of a cube reach 0.396 mm from its middle along an axis."""
    places = np.indices((3, 3, 3)).reshape(3, -1).T + 0.1
    corners = 0.17 * (2 * np.indices((2, 2, 2)).reshape(3, -1).T - 1)
    rows = [(*((place + corner) % 3), 0.33) for place in places for corner in corners]
    given = ["--units", "mm", "--box", "0,3,0,3,0,3", "--periodic", "xyz", "--json"]
    results = []
    for name, more in (("clumps", []), ("filled", [(*place, radius) for place in places])):
        code, out, err = answer(capsys, table(tmp_path / f"{name}.csv", [*rows, *more]), *given)
        assert code == 0, err
        results.append(json.loads(out))
    alone, filled = results
    assert (alone["spheres_dropped"], filled["spheres_dropped"]) == (0, 27)
    assert filled["k_initial_m2"] == alone["k_initial_m2"]
    assert any("27 grains lie wholly inside" in one for one in filled["warnings"])


def two_types(path: Path, radius: float) -> Path:
    """The touching lattice as a dump whose first layer is of type 2, with this radius."""
    from fdnet.spheres.snapshot import Snapshot
    from tests.spheres.test_readers import dump_text

    places = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
    second = places[:, 0] < 1e-3
    kind = np.where(second, "fine", "grain")
    radii = np.where(second, 1e-3 * radius, 0.5e-3)
    path.write_text(dump_text(Snapshot.from_arrays(places, radii, box=[0, 3e-3] * 3, kind=kind)))
    return path


def test_a_second_type_as_large_as_grains_is_no_fine(tmp_path, capsys):
    given = ["--periodic", "xyz", "--json"]
    for radius, said in ((0.5, "clearly smaller"), (0.4, "0.80 of the radius")):
        file = two_types(tmp_path / "two.dump", radius)
        code, out, err = answer(capsys, file, *given)
        assert (code, out) == (2, "")
        assert said in err
        assert "--types 1=grain,2=grain" in err
    asked = answer(capsys, file, *given, "--types", "1=grain,2=fine")
    assert asked[0] == 0, asked[2]
    file = two_types(tmp_path / "two.dump", 0.5)
    code, out, err = answer(capsys, file, *given, "--types", "1=grain,2=grain")
    assert code == 0, err
    assert json.loads(out)["k_damaged_m2"] == pytest.approx(2.5203e-9, rel=2e-3, abs=0)
    assert answer(capsys, two_types(tmp_path / "two.dump", 0.2), *given)[0] == 0


def test_the_text_says_what_was_assumed_and_that_a_metre_is_no_sand(tmp_path, capsys):
    from fdnet.spheres.snapshot import Snapshot
    from tests.spheres.test_readers import dump_text

    places = np.indices((3, 3, 3)).reshape(3, -1).T + 0.5
    text = dump_text(Snapshot.from_arrays(places, 0.5, box=[0, 3] * 3))
    (tmp_path / "m.dump").write_text(text + text.replace("\n0\n", "\n500\n", 1))
    given = [tmp_path / "m.dump", "--periodic", "xyz"]
    code, out, err = answer(capsys, *given, "--json")
    assert code == 0, err
    assumed = json.loads(out)["assumptions"]
    for what in (
        "are in m.",
        "last of 2 frames",
        "type 2 a fine",
        "box of",
        "repeat along x, y, z",
    ):
        assert any(what in one for one in assumed), what
    assert any("no sand" in one and "unit" in one for one in json.loads(out)["warnings"])
    _, out, _ = answer(capsys, *given)
    assert [line[9:] for line in out.splitlines() if line.startswith("assumed: ")] == assumed
    assert "warning: the grains are 1 to 1 m wide" in out
    said = json.loads(answer(capsys, *given, "--units", "mm", "--json")[1])
    assert not any("no sand" in one for one in said["warnings"])


def test_overlaps_are_told_as_by_run(tmp_path, capsys):
    """Spheres of 0.525 at a spacing of 1 overlap by 0.05 / 1.05 = 4.8 % of a diameter."""
    box = cubic(tmp_path / "sc.csv", radius=0.525)
    one = table(tmp_path / "cell.csv", [(0.5, 0.5, 0.5, 0.525)])
    text = "grains overlap by up to 4.8 % of a diameter: the pack is denser than rigid spheres get"
    for file, sides in ((tmp_path / "sc.csv", box), (one, "0,1,0,1,0,1")):
        given = [file, "--units", "mm", "--box", sides, "--periodic", "xyz", "--json"]
        code, out, err = answer(capsys, *given)
        assert code == 0, err
        assert any(line.startswith(text) for line in json.loads(out)["warnings"])


def test_a_permeability_that_no_packing_has_is_told(tmp_path, capsys):
    """The lattice in a periodic box that is twice as wide: a channel of 4 mm beside it."""
    cubic(tmp_path / "sc.csv")
    given = [tmp_path / "sc.csv", "--units", "mm", "--periodic", "xyz", "--json"]
    for box, doubted in (("0,4,0,4,0,4", False), ("0,4,0,8,0,8", True)):
        code, out, err = answer(capsys, *given, "--box", box)
        assert code == 0, err
        assert any("no packing has" in one for one in json.loads(out)["warnings"]) == doubted


def test_a_walled_pack_called_periodic_is_told(tmp_path, capsys):
    """Close-packed layers between walls across y: the last layer does not fit on the first."""
    layer = np.indices((4, 1, 4)).reshape(3, -1).T + 0.5
    shifts, rise = [(0, 0), (0.5, 0.5), (0, 0), (0.5, 0.5), (0.25, 0.6)], 0.5**0.5
    places = np.concatenate(
        [(layer + np.array([a, k * rise, b])) % (4, 99, 4) for k, (a, b) in enumerate(shifts)]
    )
    height = 4 * rise + 1
    file = table(tmp_path / "walled.csv", [(*place, 0.5) for place in places])
    given = [file, "--units", "mm", "--box", f"0,4,0,{height},0,4", "--json"]
    text = "no grain crosses the periodic sides y"
    for periodic, doubted in (("xyz", True), ("xz", False)):
        code, out, err = answer(capsys, *given, "--periodic", periodic)
        assert code == 0, err
        assert any(one.startswith(text) for one in json.loads(out)["warnings"]) == doubted


_CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 3**0.5
_CUBE = (2.0 * np.indices((2, 2, 2)).reshape(3, -1).T - 1) / 3**0.5


@pytest.mark.parametrize(
    ("parts", "radii"),
    [
        (np.vstack([[0, 0, 0], 0.8 * _CORNERS]), [1, 0.3, 0.3, 0.3, 0.3]),
        (0.36 * _CORNERS, [0.75] * 4),
        (0.52 * _CUBE, [0.72] * 8),
    ],
    ids=["bumps", "four", "eight"],
)
def test_clumps_are_right_against_resolved_flow(parts, radii):
    """Clumps of spheres that lie in each other; k was up to 1.47 times that of resolved flow."""
    from fdnet.network.permeability import analyse
    from fdnet.network.stokes import extrapolate, solve_stokes
    from fdnet.spheres.snapshot import Snapshot

    rng, count, apart = np.random.default_rng(5), 12, 0.4
    places = rng.random((count, 3))
    for _ in range(2000):
        away = places[:, None] - places
        away -= np.round(away)
        far = np.linalg.norm(away, axis=2) + 9 * np.eye(count)
        push = np.where(far < apart, (apart - far) / far, 0.0)
        places = (places + 0.3 * np.sum(push[:, :, None] * away, axis=1)) % 1
    turns = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(count)]
    spheres = np.concatenate(
        [place + 0.245 * parts @ turn for place, turn in zip(places, turns, strict=True)]
    )
    radius = 0.245e-3 * np.tile(radii, count)
    clumps = Snapshot.from_arrays(1e-3 * (spheres % 1), radius, box=[0, 1e-3] * 3)
    coarse, fine = (solve_stokes(clumps, cells=cells, tolerance=1e-3) for cells in (32, 48))
    right = extrapolate(coarse, fine).k
    result = analyse(clumps, periodic="xyz")
    assert result.counts["grains_centred_in_others"] > count
    assert result.k_initial == pytest.approx(right, rel=0.05, abs=0)
