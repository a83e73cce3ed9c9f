"""`fdnet permeability` on files made here."""

import json
from functools import partial
from pathlib import Path

import builders
import numpy as np
import pytest

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
    return partial(builders.answer, capsys, "permeability")


@pytest.fixture
def numbers(answer):
    """What the command prints with --json; its files are in mm."""

    def read(path: Path, *arguments: object, units: str | None = "mm") -> dict:
        more = ["--units", units] if units else []
        code, out, err = answer(path, *more, "--json", *arguments)
        assert code == 0, err
        return json.loads(out)

    return read


def test_bad_options_end_with_2_and_one_line(tmp_path, answer):
    path = cubic(tmp_path / "sc.csv")
    one = table(tmp_path / "cell.csv", [(0.5, 0.5, 0.5, 0.5)])
    for file, arguments, said in [
        (path, ["--box", "0,1,0"], "--box: '0,1,0', expected six numbers"),
        (path, ["--periodic", "xy"], "--box: missing"),
        (path, ["--periodic", "xq"], "--periodic: 'xq'"),
        (path, ["--sections", "0"], "sections: 0 should be"),
        (path, None, "units"),
        (path, ["--types", "1:grain"], "--types: '1:grain', expected TYPE=KIND"),
        (path, ["--fines-below", "0"], "expected a radius above 0"),
        (one, ["--box", "0,1,0,1,0,1"], "1 grains, expected at least 4"),
        (one, ["--box", "0,1,0,1,0,1"], "--periodic"),
    ]:
        given = [] if arguments is None else ["--units", "mm", *arguments]
        code, out, err = answer(file, *given)
        assert (code, out) == (2, ""), said
        assert said in err
        assert len(err.strip().splitlines()) == 1, err


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


# ---- Unit cells, and spheres inside others.
@pytest.mark.parametrize(
    ("places", "radius", "height", "k", "error"),
    [
        ([(0.3, 0.6, 0.2)], 0.5, 1, CUBIC, 2e-3),
        ([(0.5, 0.5, k + 0.5) for k in range(4)], 0.5, 4, CUBIC, 2e-3),
        ([(0, 0, 0), (0.5, 0.5, 0.5)], 0.75**0.5 / 2, 1, 3.7605e-10, 6e-3),
    ],
    ids=["simple cubic", "a row of it", "body-centred"],
)
def test_a_unit_cell_is_repeated_until_it_can_be_tessellated(
    tmp_path, numbers, places, radius, height, k, error
):
    """k = 2 a2 / (9 c K) (Zick and Homsy 1982), within what larger cells are off by."""
    file = table(tmp_path / "cell.csv", [(*place, radius) for place in places])
    given = ["--box", f"0,1,0,1,0,{height}", "--periodic", "xyz"]
    result = numbers(file, *given, "--axis", "all", "--sections", 2)
    for axis in "xyz":
        assert result[f"k_{axis}_m2"] == pytest.approx(k, rel=error)
    times = " x 1 times" if height == 4 else " times"
    assert any("The cell was repeated" in one and times in one for one in result["assumptions"])
    rows = result["sections"]
    assert [row["x_hi_m"] for row in rows] == pytest.approx([5e-4, 1e-3])
    series = sum(5e-4 / row["k_initial_inplace_m2"] for row in rows)
    assert 1e-3 / series == pytest.approx(result["k_x_m2"], rel=1e-4)


def test_a_sphere_inside_a_grain_adds_nothing(tmp_path, numbers):
    """Same solid, same k, also where the grain is an image of one across the sides."""
    places, every = PLACES - 0.4, ("--box", THREE, "--periodic", "xyz")
    for name, inner in {
        "concentric": [(0, 0, 0, 0.3)],
        "there twice": [(0, 0, 0, 0.5)],
        "rounded": [(0.1155, 0.1155, 0.1155, 0.3)],
        "one in the other": [(0.2, 0, 0, 0.3), (0.3, 0, 0, 0.2), (0.4, 0, 0, 0.1)],
    }.items():
        more = [(*((place + one[:3]) % 3), one[3]) for place in places for one in inner]
        rows = [(*place, 0.5) for place in places] + more
        for kind in ("grain", "fine") if name != "there twice" else ("grain",):
            kinds = ["grain"] * 27 + [kind] * len(more)
            result = numbers(table(tmp_path / "nested.csv", rows, kinds), *every)
            assert result["k_initial_m2"] == pytest.approx(CUBIC, rel=2e-3), (name, kind)
            assert result["k_damaged_m2"] == result["k_initial_m2"], (name, kind)
            assert result["spheres_dropped"] == len(more), (name, kind)
            text = f"{len(more)} {kind}s lie wholly inside"
            assert any(text in one for one in result["warnings"]), (name, kind)
            assert not any("overlap" in one for one in result["warnings"])


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
    numbers(written(0.2), *every, units=None)


CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 3**0.5
CUBE = (2.0 * np.indices((2, 2, 2)).reshape(3, -1).T - 1) / 3**0.5


@pytest.mark.parametrize(
    ("parts", "radii"),
    [(np.vstack([[0, 0, 0], 0.8 * CORNERS]), [1, 0.3, 0.3, 0.3, 0.3]), (0.52 * CUBE, [0.72] * 8)],
    ids=["bumps", "eight"],
)
def test_clumps_are_right_against_resolved_flow(parts, radii):
    """Clumps of spheres that lie in each other: the network is 6.4 % high with bumps."""
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
    assert result.k_initial == pytest.approx(right, rel=0.07)
