"""`fdnet permeability` on files made here."""

import json
from pathlib import Path

import numpy as np
import pytest

from fdnet.cli import main
from fdnet.network.permeability import analyse
from fdnet.network.stokes import extrapolate, solve_stokes
from fdnet.report.vtk import write_spheres_vtp
from fdnet.spheres.readers import read_spheres, write_spheres
from fdnet.spheres.snapshot import Snapshot
from tests.spheres.dumps import PLACES, dump_text

CUBIC = 2.5203e-9
"""k, m2, of touching spheres of 1 mm on a simple cubic lattice (Zick and Homsy 1982, K = 42.1)."""
FOUR, THREE = "0,4,0,4,0,4", "0,3,0,3,0,3"


def cubic(path: Path, cells: int = 4, *, radius: float = 0.5, extra: str = "") -> Path:
    """Spheres on a simple cubic lattice of spacing 1."""
    points = np.indices((cells,) * 3).reshape(3, -1).T + 0.5
    rows = "".join(f"{x},{y},{z},{radius}\n" for x, y, z in points)
    path.write_text("# a comment\nx,y,z,radius\n" + rows + extra)
    return path


def table(path: Path, rows: list[tuple[float, ...]], kinds: list[str] | None = None) -> Path:
    """A file of spheres x, y, z, radius."""
    kinds = ["grain"] * len(rows) if kinds is None else kinds
    lines = [",".join(map(repr, map(float, row))) for row in rows]
    body = "".join(f"{line},{kind}\n" for line, kind in zip(lines, kinds, strict=True))
    path.write_text("x,y,z,radius,kind\n" + body)
    return path


def damaged(path: Path) -> Path:
    """The lattice with fines of 0.2 in half of its voids, without kinds."""
    places = np.indices((2, 4, 4)).reshape(3, -1).T + 1.0
    return cubic(path, extra="".join(f"{x},{y},{z},0.2\n" for x, y, z in places))


@pytest.fixture
def answer(capsys):
    """Exit code, output and errors of the command."""

    def said(*arguments: object) -> tuple[int, str, str]:
        try:
            code = main(["permeability", *map(str, arguments)])
        except SystemExit as stop:
            code = int(stop.code or 0)
        text = capsys.readouterr()
        return code, text.out, text.err

    return said


@pytest.fixture
def numbers(answer):
    """What the command prints with --json; its files are in mm."""

    def read(path: Path, *arguments: object, units: str | None = "mm") -> dict:
        more = ["--units", units] if units else []
        code, out, err = answer(path, *more, "--json", *arguments)
        assert code == 0, err
        return json.loads(out)

    return read


def close(k: float, rel: float = 2e-3):
    return pytest.approx(k, rel=rel, abs=0)


def test_units_axes_and_boxes_of_a_lattice(tmp_path, numbers):
    """Simple cubic, touching: k = 0.00252 d^2 (Zick and Homsy 1982); the law is within 10 %."""
    path = cubic(tmp_path / "sc.csv")
    given = ("--box", FOUR, "--periodic", "xyz", "--axis")
    result = numbers(path, *given, "x")
    k = result["k_initial_m2"]
    assert result["porosity_initial"] == pytest.approx(0.476401, abs=2e-3)
    assert k == close(0.00252e-6, rel=0.10)
    assert result["k_damaged_m2"] == k
    names = "pores throats solver law damage_law seconds warnings porosity_damaged"
    assert set(names.split()) <= set(result)
    assert numbers(path, *given, "z")["k_initial_m2"] == close(k, rel=1e-3)
    assert numbers(path, *given, "y", units="um")["k_initial_m2"] == close(1e-6 * k, rel=1e-3)
    # a box that does not start at zero, or with a minus sign, after a space as after `=`
    walled = numbers(path, "--box", FOUR, "--sections", 2)
    for shift in (7.0, -2.0):
        points = np.indices((4,) * 3).reshape(3, -1).T + 0.5 + [shift, 0, 0]
        moved = table(tmp_path / "moved.csv", [(*point, 0.5) for point in points])
        box = f"{shift},{shift + 4},0,4,0,4"
        for words in (["--box", box], [f"--box={box}"]):
            other = numbers(moved, *words, "--sections", 2)
            assert other["k_initial_m2"] == close(walled["k_initial_m2"], rel=1e-6)
            assert [row["x_lo_m"] for row in other["sections"]] == pytest.approx([0.0, 2e-3])


def test_walls_hold_the_fluid_unless_they_slip(tmp_path, numbers):
    """A lattice between slipping walls is the endless lattice; no-slip walls leave less."""
    path = cubic(tmp_path / "sc.csv")
    choices = ("", "--walls=slip", "--walls=no-slip", "--periodic=yz")
    k = [numbers(path, "--box", FOUR, *one.split())["k_initial_m2"] for one in choices]
    assert k[1] == close(k[3], rel=1e-6)
    assert k[0] == k[2] < 0.8 * k[1]


def test_bad_options_end_with_2_and_one_line(tmp_path, answer):
    path = cubic(tmp_path / "sc.csv")
    metres, few = tmp_path / "m.csv", tmp_path / "few.csv"
    metres.write_text("x_m,y_m,z_m,radius_m\n0,0,0,1\n")
    few.write_text("x,y,z,radius,kind\n0,0,0,1,grain\n2,0,0,0.1,fine\n")
    one = table(tmp_path / "cell.csv", [(0.5, 0.5, 0.5, 0.5)])
    fines = read_spheres(damaged(tmp_path / "d.csv"), units="mm", fines_below=0.3).fines()
    alone = tmp_path / "fines.dump"
    alone.write_text(dump_text(fines))
    laws = tmp_path / "none" / "laws.csv"
    for file, arguments, said in [
        (path, ["--box", "0,1,0"], "--box: '0,1,0', expected six numbers"),
        (path, ["--box", "0,4,4,0,0,4"], "each lower bound below the upper"),
        (path, ["--periodic", "xy"], "--box: missing"),
        (path, ["--periodic", "xq"], "--periodic: 'xq'"),
        (path, ["--units", "furlong"], "invalid choice"),
        (path, ["--sections", "0"], "expected 1 to 1000"),
        (path, ["--law", "darcy"], "invalid choice"),
        (path, None, "units"),
        (path, ["--types", "1:grain"], "--types: '1:grain', expected TYPE=KIND"),
        (path, ["--types", "1=grain,1=fine"], "names a type twice"),
        (path, ["--types", "1=sand"], "'sand', expected grain or fine"),
        (path, ["--types", "1=grain"], "has no types"),
        (path, ["--fines-below", "0"], "expected a radius above 0"),
        (path, ["--fines-below", "9"], "makes every sphere"),
        (path, ["--fines-below", "0.1", "--types", "1=grain"], "give one of the two"),
        (path, ["--box", FOUR, "--csv", laws], "is not a folder"),
        (metres, [], "units"),
        (few, [], "expected at least 4"),
        (tmp_path / "none.csv", [], "none.csv"),
        (alone, ["--units", "m"], "0 grains, expected at least 4"),
        (one, ["--box", "0,1,0,1,0,1"], "1 grains, expected at least 4"),
        (one, ["--box", "0,1,0,1,0,1"], "--periodic"),
    ]:
        given = [] if arguments is None else ["--units", "mm", *arguments]
        code, out, err = answer(file, *given)
        assert (code, out) == (2, ""), said
        assert said in err
        assert len(err.strip().splitlines()) == 1, err


@pytest.mark.filterwarnings("error")
def test_degenerate_spheres_end_with_4(tmp_path, answer):
    rows = [(0.5, 0.5, 0.5), (1.5, 0.5, 0.5), (0.5, 1.5, 0.5), (0.5, 0.5, 0.5)]
    flat = table(tmp_path / "flat.csv", [(*row, 0.5) for row in rows])
    for path, box, said in [
        (flat, "0,2,0,2,0,2", "3 of 3 grains reach into the box"),
        (cubic(tmp_path / "sc.csv"), "50,54,50,54,50,54", "0 of 64 grains reach into the box"),
    ]:
        code, _, err = answer(path, "--units", "mm", "--box", box)
        assert code == 4
        assert said in err
        assert len(err.strip().splitlines()) == 1


def test_a_pack_without_an_open_path_is_an_answer(tmp_path, numbers):
    """Spheres of 0.72 spacings close every triangle of the lattice and leave voids: k = 0.

    The circumradius of a triangle is 0.707 spacings.
    """
    path = cubic(tmp_path / "sc.csv", radius=0.72)
    result = numbers(path, "--box", FOUR, "--periodic", "xyz")
    assert result["k_initial_m2"] == 0
    assert result["k_reduction"] is None
    assert 0 < result["porosity_initial"] < 0.05
    assert any("path" in warning for warning in result["warnings"])


def test_three_axes_at_once_are_the_three_one_by_one(tmp_path, answer, numbers):
    path = damaged(tmp_path / "s.csv")
    given = ["--box", FOUR, "--periodic", "yz", "--fines-below", 0.3]
    whole = numbers(path, *given, "--axis", "all")
    for axis in "xyz":
        alone = numbers(path, *given, "--axis", axis)
        assert whole[f"k_{axis}_m2"] == alone["k_initial_m2"]
        assert whole[f"k_{axis}_damaged_m2"] == alone["k_damaged_m2"]
        assert alone["k_damaged_m2"] < alone["k_initial_m2"]
    assert whole["k_initial_m2"] == whole["k_x_m2"] != whole["k_y_m2"]
    assert whole["k_damaged_m2"] == whole["k_x_damaged_m2"]
    # as a table whose columns stand below their names, and as CSV
    given = ["--units", "mm", "--box", FOUR, "--fines-below", 0.3, "--csv", tmp_path / "laws.csv"]
    code, out, err = answer(path, *given, "--axis", "all", "--compare-laws", "--sections", 2)
    assert code == 0, err
    lines = out.split("sections")[0].splitlines()[1:]
    by_axis = [line for line in lines if line.split()[2] in ("x", "y", "z")]
    assert len(by_axis) == 3 * 11  # the default, and all pairs
    assert len({len(line) for line in by_axis}) == 1
    for law in ("thesis", "effective", "thesis-code", "section-archie"):
        assert law in out
    header, *rows = (tmp_path / "laws.csv").read_text().splitlines()
    assert header.endswith("k_x_m2,k_y_m2,k_z_m2,k_x_damaged_m2,k_y_damaged_m2,k_z_damaged_m2")
    assert len(rows) == 11


def test_flow_along_y_or_z_is_flow_along_x_through_the_file_with_its_columns_exchanged(
    tmp_path, numbers
):
    """Box and periodic sides are those of the file."""
    path, other = damaged(tmp_path / "s.csv"), tmp_path / "t.csv"
    header, *rows = path.read_text().splitlines()[1:]
    bounds = ["0,4", "0.5,3.5", "0,4"]
    for axis, order in (("y", (1, 2, 0)), ("z", (2, 0, 1))):
        cells = [row.split(",") for row in rows]
        exchanged = [",".join([*(row[k] for k in order), row[3]]) for row in cells]
        other.write_text("\n".join([header, *exchanged]) + "\n")
        answers = [
            numbers(file, "--box", box, "--periodic", sides, "--axis", along, "--fines-below", 0.3)
            for file, along, box, sides in (
                (path, axis, ",".join(bounds), "z"),
                (other, "x", ",".join(bounds[k] for k in order), "xyz"[order.index(2)]),
            )
        ]
        for name in ("k_initial_m2", "k_damaged_m2"):
            assert answers[0][name] == close(answers[1][name], rel=1e-9), axis
        assert answers[0]["k_damaged_m2"] < answers[0]["k_initial_m2"]


def test_every_format_gives_the_same_answer(tmp_path, numbers):
    """CSV with a limit, CSV with kinds, dump and VTK of the same spheres, to the last digit."""
    path, dump = damaged(tmp_path / "s.csv"), tmp_path / "s.dump"
    spheres = read_spheres(path, units="mm", box=[0, 4] * 3, fines_below=0.3)
    kinds = write_spheres(tmp_path / "kinds.csv", spheres)
    mesh = write_spheres_vtp(tmp_path / "s.vtp", spheres)
    dump.write_text(dump_text(spheres))
    metres = ["--box", ",".join(["0,4e-3"] * 3)]
    answers = [
        numbers(file, "--periodic", "yz", *more, units=units)
        for file, units, *more in (
            (path, "mm", "--box", FOUR, "--fines-below", 0.3),
            (kinds, None, *metres),
            (mesh, None, *metres),
            (dump, None),
            (dump, None, "--types", "1=grain,2=fine"),
            (dump, None, "--fines-below", 3e-4),
        )
    ]
    assert {result["k_damaged_m2"] for result in answers} == {answers[0]["k_damaged_m2"]}
    assert answers[0]["k_damaged_m2"] < answers[0]["k_initial_m2"]


def test_what_the_answer_rests_on_is_in_it(tmp_path, answer, numbers):
    path, limit = damaged(tmp_path / "s.csv"), ("--fines-below", 0.3)
    plain = numbers(path, "--box", FOUR)["assumptions"]
    assert any("all its spheres are grains" in text for text in plain)
    assert any("walls that hold the fluid" in text for text in plain)
    laws = ("--damage-law", "section-archie", "--walls", "slip")
    chosen = numbers(path, "--box", FOUR, *limit, *laws)
    assert chosen["damage_law_used"] == "section-archie"
    assert any("let the fluid slip" in text for text in chosen["assumptions"])
    assert not any("damage law is fdnet's default" in text for text in chosen["assumptions"])
    default = numbers(path, "--box", FOUR, *limit)
    assert (default["damage_law"], default["damage_law_used"]) == ("auto", "all-spheres")
    assert any("damage law is fdnet's default" in text for text in default["assumptions"])
    # a pack without fines says nothing of damage, and a metre is no sand
    code, out, err = answer(cubic(path), "--units", "mm", "--box", FOUR, "--periodic", "y")
    assert code == 0, err
    assert "x: inlet and outlet; z: walls that hold the fluid; y: periodic" in out
    assert "k mD" in out
    assert "damage" not in out
    assert "cross the side walls" not in out
    dump = tmp_path / "m.dump"
    text = dump_text(Snapshot.from_arrays(PLACES, 0.5, box=[0, 3] * 3), step=0)
    dump.write_text(text + text.replace("\n0\n", "\n500\n", 1))
    result = numbers(dump, "--periodic", "xyz", units=None)
    for what in (
        "are in m.",
        "last of 2 frames",
        "type 2 a fine",
        "box of",
        "repeat along x, y, z",
    ):
        assert any(what in one for one in result["assumptions"]), what
    assert any("no sand" in one and "unit" in one for one in result["warnings"])
    _, out, _ = answer(dump, "--periodic", "xyz")
    said = [line[9:] for line in out.splitlines() if line.startswith("assumed: ")]
    assert said == result["assumptions"]
    assert "warning: the grains are 1 to 1 m wide" in out
    assert not any("no sand" in one for one in numbers(dump, "--periodic", "xyz")["warnings"])


def test_doubtful_packs_are_told_of(tmp_path, numbers):
    """Side walls that cut spheres, overlaps, k that no packing has, walls called periodic."""

    def warns(path, text, *arguments):
        said = numbers(path, *arguments)["warnings"]
        return any(one.startswith(text) for one in said)

    path, sides = cubic(tmp_path / "sc.csv"), ("--box", "0,4,0.1,3.9,0,4")
    text = "32 of 64 spheres cross the side walls; if the pack is periodic give --periodic y"
    assert warns(path, text, *sides)
    assert not warns(path, "32 of 64 spheres cross", *sides, "--periodic", "y")
    every = ("--periodic", "xyz", "--box")
    for box, doubted in ((FOUR, False), ("0,4,0,8,0,8", True)):  # a channel of 4 mm beside it
        said = numbers(path, *every, box)["warnings"]
        assert any("no packing has" in one for one in said) == doubted
    # spheres of 0.525 at a spacing of 1 overlap by 0.05 / 1.05 = 4.8 % of a diameter
    text = "grains overlap by up to 4.8 % of a diameter: the pack is denser than rigid spheres get"
    one = table(tmp_path / "cell.csv", [(0.5, 0.5, 0.5, 0.525)])
    assert warns(cubic(path, radius=0.525), text, *every, FOUR)
    assert warns(one, text, *every, "0,1,0,1,0,1")
    # close-packed layers between walls across y: the last does not fit on the first
    layer, rise = np.indices((4, 1, 4)).reshape(3, -1).T + 0.5, 0.5**0.5
    shifts = [(0, 0), (0.5, 0.5), (0, 0), (0.5, 0.5), (0.25, 0.6)]
    places = [(layer + np.array([a, k * rise, b])) % (4, 99, 4) for k, (a, b) in enumerate(shifts)]
    file = table(tmp_path / "walled.csv", [(*place, 0.5) for place in np.concatenate(places)])
    box = ("--box", f"0,4,0,{4 * rise + 1},0,4")
    for periodic, doubted in (("xyz", True), ("xz", False)):
        text = "no grain crosses the periodic sides y"
        assert warns(file, text, *box, "--periodic", periodic) == doubted


# ------------------------------------------------------------------------------------------------
# Unit cells, and spheres inside others.


@pytest.mark.parametrize(
    ("places", "radius", "height", "k", "error"),
    [
        ([(0.3, 0.6, 0.2)], 0.5, 1, CUBIC, 2e-3),
        ([(0.5, 0.5, k + 0.5) for k in range(4)], 0.5, 4, CUBIC, 2e-3),
        ([(0, 0, 0), (0.5, 0.5, 0.5)], 0.75**0.5 / 2, 1, 3.7605e-10, 6e-3),
        pytest.param(
            [(0, 0, 0), (0, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 0.5, 0)],
            0.5**0.5 / 2,
            1,
            8.6237e-11,
            1.4e-2,
            marks=pytest.mark.nightly,
        ),
    ],
    ids=["simple cubic", "a row of it", "body-centred", "face-centred"],
)
def test_a_unit_cell_is_repeated_until_it_can_be_tessellated(
    tmp_path, numbers, places, radius, height, k, error
):
    """k = 2 a2 / (9 c K), m2, for an edge of 1 mm and K of 42.1, 162.9 and 435.

    Zick and Homsy 1982; the errors are what larger cells of the same lattices are off by.
    """
    file = table(tmp_path / "cell.csv", [(*place, radius) for place in places])
    given = ["--box", f"0,1,0,1,0,{height}", "--periodic", "xyz"]
    result = numbers(file, *given, "--axis", "all", "--sections", 2)
    for axis in "xyz":
        assert result[f"k_{axis}_m2"] == close(k, rel=error)
    times = " x 1 times" if height == 4 else " times"
    assert any("The cell was repeated" in one and times in one for one in result["assumptions"])
    rows = result["sections"]
    assert [row["x_hi_m"] for row in rows] == pytest.approx([5e-4, 1e-3])
    series = sum(5e-4 / row["k_initial_inplace_m2"] for row in rows)
    assert 1e-3 / series == close(result["k_x_m2"], rel=1e-4)


def test_fines_in_a_unit_cell_are_repeated_with_it(tmp_path, numbers):
    """The cell with a fine in its void, and the same lattice of 27 cells written out."""
    values = []
    for side in (1, 3):
        shifts = np.indices((side,) * 3).reshape(3, -1).T
        rows = [(*(shift + 0.5), 0.5) for shift in shifts]
        rows += [(*(shift + np.array([0.02, 0.05, 0.0])), 0.25) for shift in shifts]
        kinds = ["grain"] * len(shifts) + ["fine"] * len(shifts)
        file = table(tmp_path / "cells.csv", rows, kinds)
        values.append(numbers(file, "--box", ",".join([f"0,{side}"] * 3), "--periodic", "xyz"))
    for key in ("k_initial_m2", "k_damaged_m2", "porosity_damaged"):
        assert values[0][key] == close(values[1][key]), key
    assert values[0]["k_damaged_m2"] < 0.9 * values[0]["k_initial_m2"]


def test_a_sphere_inside_a_grain_adds_nothing(tmp_path, numbers):
    """Same solid, same k, also where the grain is an image of one across the sides."""
    places, every = PLACES - 0.4, ("--box", THREE, "--periodic", "xyz")
    for name, inner in {
        "touching from within": [(0.2, 0, 0, 0.3)],
        "concentric": [(0, 0, 0, 0.3)],
        "there twice": [(0, 0, 0, 0.5)],
        "rounded": [(0.1155, 0.1155, 0.1155, 0.3)],
        "four": [(0.2, 0, 0, 0.3), (0, 0.2, 0, 0.3), (0, 0, -0.2, 0.3), (0.1, 0.1, 0, 0.2)],
        "one in the other": [(0.2, 0, 0, 0.3), (0.3, 0, 0, 0.2), (0.4, 0, 0, 0.1)],
    }.items():
        more = [(*((place + one[:3]) % 3), one[3]) for place in places for one in inner]
        rows = [(*place, 0.5) for place in places] + more
        for kind in ("grain", "fine") if name != "there twice" else ("grain",):
            kinds = ["grain"] * 27 + [kind] * len(more)
            result = numbers(table(tmp_path / "nested.csv", rows, kinds), *every)
            assert result["k_initial_m2"] == close(CUBIC), (name, kind)
            assert result["k_damaged_m2"] == result["k_initial_m2"], (name, kind)
            assert result["spheres_dropped"] == len(more), (name, kind)
            text = f"{len(more)} {kind}s lie wholly inside"
            assert any(text in one for one in result["warnings"]), (name, kind)
            assert not any("overlap" in one for one in result["warnings"])
    # eight spheres on the corners of a cube reach 0.396 mm from its middle along an axis
    corners = 0.17 * (2 * np.indices((2, 2, 2)).reshape(3, -1).T - 1)
    rows = [(*((place + corner) % 3), 0.33) for place in places for corner in corners]
    alone = numbers(table(tmp_path / "clumps.csv", rows), *every)
    assert alone["spheres_dropped"] == 0
    for radius in (0.2, 0.35):
        filled = rows + [(*place, radius) for place in places]
        result = numbers(table(tmp_path / "filled.csv", filled), *every)
        assert result["spheres_dropped"] == 27
        assert result["k_initial_m2"] == alone["k_initial_m2"]
        assert any("27 grains lie wholly inside" in one for one in result["warnings"])


def test_a_second_type_as_large_as_grains_is_no_fine(tmp_path, answer, numbers):
    """The touching lattice as a dump whose first layer is of type 2, with this radius."""
    file, every = tmp_path / "two.dump", ("--periodic", "xyz")

    def written(radius):
        second = PLACES[:, 0] < 1
        kind, size = np.where(second, "fine", "grain"), np.where(second, radius, 0.5)
        spheres = Snapshot.from_arrays(1e-3 * PLACES, 1e-3 * size, box=[0, 3e-3] * 3, kind=kind)
        file.write_text(dump_text(spheres))
        return file

    for radius, said in ((0.5, "clearly smaller"), (0.4, "0.80 of the radius")):
        code, out, err = answer(written(radius), *every, "--json")
        assert (code, out) == (2, "")
        assert said in err
        assert "--types 1=grain,2=grain" in err
    numbers(file, *every, "--types", "1=grain,2=fine", units=None)
    grains = numbers(written(0.5), *every, "--types", "1=grain,2=grain", units=None)
    assert grains["k_damaged_m2"] == close(CUBIC)
    numbers(written(0.2), *every, units=None)


CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 3**0.5
CUBE = (2.0 * np.indices((2, 2, 2)).reshape(3, -1).T - 1) / 3**0.5


@pytest.mark.parametrize(
    ("parts", "radii"),
    [
        (np.vstack([[0, 0, 0], 0.8 * CORNERS]), [1, 0.3, 0.3, 0.3, 0.3]),
        (0.36 * CORNERS, [0.75] * 4),
        (0.52 * CUBE, [0.72] * 8),
    ],
    ids=["bumps", "four", "eight"],
)
def test_clumps_are_right_against_resolved_flow(parts, radii):
    """Clumps of spheres that lie in each other; k was up to 1.47 times that of resolved flow."""
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
    right, result = extrapolate(coarse, fine).k, analyse(clumps, periodic="xyz")
    assert result.counts["grains_centred_in_others"] > count
    assert result.k_initial == close(right, rel=0.05)
