"""Spheres come back from every format as they were written, and malformed files are refused."""

import gzip
import json
import os
import socket
import warnings

import numpy as np
import pytest

from fdnet import read_case, read_spheres
from fdnet.campaign.plan import sweep_plan
from fdnet.case.file import read_size_file
from fdnet.cli import main
from fdnet.errors import CaseError, DumpError
from fdnet.report.vtk import write_spheres_vtp
from fdnet.spheres.readers import read_sphere_file, write_spheres
from fdnet.spheres.snapshot import Kind, Snapshot

BOX = [[0.0, 4e-3], [0.0, 2e-3], [-1e-3, 1e-3]]


@pytest.fixture(scope="module")
def pack() -> Snapshot:
    """Twenty grains and ten fines at places with many digits."""
    rng = np.random.default_rng(5)
    place = np.array(BOX)[:, 0] + rng.random((30, 3)) * np.ptp(BOX, axis=1)
    radius = np.where(np.arange(30) < 20, 2.5e-4, 5e-5) * rng.uniform(0.9, 1.1, 30)
    return Snapshot.from_arrays(place, radius, box=BOX, kind=["grain"] * 20 + ["fine"] * 10)


def same(one: Snapshot, other: Snapshot) -> bool:
    names = ("position", "radius", "kind", "id")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def dump_text(
    pack: Snapshot,
    columns: str = "id type x y z radius",
    *,
    step: int = 7,
    flags: str = "pp pp ff",
) -> str:
    """The spheres as LAMMPS and LIGGGHTS dump them."""
    low, size = pack.box[:, 0], np.ptp(pack.box, axis=1)
    parts = (pack.position - low) / size
    values = {"id": pack.id, "type": pack.kind, "radius": pack.radius, "diameter": 2 * pack.radius}
    for k, axis in enumerate("xyz"):
        values |= {axis: pack.position[:, k], f"{axis}u": pack.position[:, k]}
        values |= {f"{axis}s": parts[:, k]}
    rows = zip(*(values[name].tolist() for name in columns.split()), strict=True)
    lines = ["ITEM: TIMESTEP", str(step), "ITEM: NUMBER OF ATOMS", str(len(pack))]
    lines += [f"ITEM: BOX BOUNDS {flags}"] + [f"{a!r} {b!r}" for a, b in pack.box.tolist()]
    lines += [f"ITEM: ATOMS {columns}"] + [" ".join(map(repr, row)) for row in rows]
    return "\n".join(lines) + "\n"


def write(path, text):
    path.write_text(text)
    return path


def test_csv_comes_back(pack, tmp_path):
    again = read_spheres(write_spheres(tmp_path / "s.csv", pack), box=BOX)
    assert same(again, pack)
    assert np.array_equal(again.box, pack.box)


@pytest.mark.parametrize("columns", ["id type x y z radius", "radius z y x type id"])
def test_a_dump_comes_back(pack, tmp_path, columns):
    given = read_sphere_file(write(tmp_path / "pack.dump", dump_text(pack, columns)))
    assert same(given.spheres, pack)
    assert np.array_equal(given.spheres.box, pack.box)
    assert given.spheres.step == 7
    assert any("type 1 is a grain" in sentence for sentence in given.assumptions)


@pytest.mark.parametrize(
    "columns", ["id type xu yu zu radius", "id type xs ys zs radius", "id type x y z diameter"]
)
def test_other_columns_of_lammps_say_the_same(pack, tmp_path, columns):
    again = read_spheres(write(tmp_path / "atoms.lammpstrj", dump_text(pack, columns)))
    assert again.position == pytest.approx(pack.position, rel=1e-12, abs=1e-15)
    assert again.radius == pytest.approx(pack.radius, rel=1e-15, abs=0)
    assert np.array_equal(again.kind, pack.kind)


def test_the_units_that_a_dump_names_are_its_units(pack, tmp_path):
    units, time = "ITEM: UNITS\n{}\n", "ITEM: TIME\n0.25\n"
    text = units + time + dump_text(pack) + time + dump_text(pack, step=8)
    path = write(tmp_path / "pack.dump", text.format("si"))
    assert same(read_spheres(path), pack)
    assert read_spheres(path).step == 8
    path.write_text(text.format("micro"))
    assert read_spheres(path).radius == pytest.approx(1e-6 * pack.radius, rel=1e-15, abs=0)
    path.write_text(text.format("lj"))
    with pytest.raises(CaseError, match="its units are 'lj'"):
        read_spheres(path)
    assert same(read_spheres(path, units="m"), pack)


def test_the_last_frame_or_the_one_asked_for(pack, tmp_path):
    moved = Snapshot.from_arrays(pack.position * 0.5, pack.radius, box=BOX, kind=pack.kind)
    path = write(tmp_path / "two.dump", dump_text(pack) + dump_text(moved, step=9))
    assert same(read_spheres(path), moved)
    assert same(read_spheres(path, step=7), pack)
    with pytest.raises(CaseError, match="no frame of step 8; the file has 7, 9"):
        read_spheres(path, step=8)


def test_a_dump_in_other_units(pack, tmp_path):
    path = write(tmp_path / "pack.dump", dump_text(pack))
    small = read_spheres(path, units="um", box=[0, 4e-3, 0, 2e-3, -1e-3, 1e-3])
    assert small.radius == pytest.approx(1e-6 * pack.radius, rel=1e-15, abs=0)
    assert small.box == pytest.approx(1e-6 * pack.box, rel=1e-15, abs=0)


def test_vtp_comes_back(pack, tmp_path):
    """VTK keeps double precision here."""
    again = read_spheres(write_spheres_vtp(tmp_path / "s.vtp", pack), box=BOX)
    assert same(again, pack)


def test_vtu_with_diameters_and_types(pack, tmp_path):
    import pyvista as pv

    mesh = pv.PolyData(np.array(pack.position)).cast_to_unstructured_grid()
    mesh.point_data["diameter"] = 2 * pack.radius
    mesh.point_data["type"] = np.where(pack.kind == Kind.FINE, 7, 3)
    mesh.save(tmp_path / "s.vtu")
    again = read_spheres(tmp_path / "s.vtu", types={3: "grain", 7: "fine"}, box=BOX)
    assert same(again, pack)


def test_kinds_by_radius_by_type_and_by_column_agree(pack, tmp_path):
    """The same spheres told apart in three ways; the limit is in the unit of the file."""
    rows = np.column_stack([1e3 * pack.position, 1e3 * pack.radius]).tolist()
    text = "x,y,z,radius\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows)
    by_radius = read_spheres(
        write(tmp_path / "mm.csv", text), units="mm", fines_below=0.1, box=np.multiply(1e3, BOX)
    )
    path = write(tmp_path / "pack.dump", dump_text(pack))
    by_type = read_spheres(path, types={1: "grain", 2: "fine"})
    swapped = read_spheres(path, types={1: "fine", 2: "grain"})
    assert np.array_equal(by_radius.kind, pack.kind)
    assert np.array_equal(by_type.kind, pack.kind)
    assert np.array_equal(swapped.kind, 3 - pack.kind)
    assert by_radius.box == pytest.approx(pack.box, rel=1e-15, abs=0)
    assert np.array_equal(read_spheres(path, fines_below=1e-4).kind, pack.kind)


def test_a_sphere_of_just_the_limit_is_a_grain(tmp_path):
    path = write(tmp_path / "s.csv", "x,y,z,radius\n0,0,0,0.1\n1,0,0,0.0999\n")
    kinds = read_spheres(path, units="mm", fines_below=0.1).kind
    assert kinds.tolist() == [Kind.GRAIN, Kind.FINE]


def test_without_kinds_all_are_grains_in_the_box_around_them(tmp_path):
    given = read_sphere_file(
        write(tmp_path / "s.csv", "x,y,z,radius\n0,0,0,1\n3,0,0,2\n"), units="m"
    )
    assert given.around_grains
    assert given.spheres.box.tolist() == [[-1, 5], [-2, 2], [-2, 2]]
    assert len(given.assumptions) == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"step": 3}, "is no dump"),
        ({"fines_below": 1.0, "units": "m"}, "makes every sphere"),
        ({"fines_below": -1.0, "units": "m"}, "expected a radius above 0"),
        ({"fines_below": 0.1, "types": {1: "grain"}, "units": "m"}, "give one of the two"),
        ({"types": {1: "grain"}, "units": "m"}, "has no types"),
        ({"types": {1: "sand"}, "units": "m"}, "'sand', expected grain or fine"),
        ({"units": "inch"}, "units 'inch'"),
        ({"units": "m", "box": [0, 1, 0, 1]}, "expected six numbers"),
        ({"units": "m", "box": [0, 1, 0, 1, 2, 1]}, "each lower bound below the upper"),
    ],
)
def test_choices_that_do_not_fit_the_file_are_refused(tmp_path, change, message):
    path = write(tmp_path / "s.csv", "x,y,z,radius\n0,0,0,0.2\n1,0,0,0.3\n")
    with pytest.raises(CaseError, match=message):
        read_spheres(path, **change)


def test_a_column_of_kinds_and_a_radius_contradict_each_other(pack, tmp_path):
    with pytest.raises(CaseError, match="both tell grains from fines"):
        read_spheres(write_spheres(tmp_path / "s.csv", pack), fines_below=1e-4)


def test_types_must_be_whole_and_known(pack, tmp_path):
    path = write(tmp_path / "pack.dump", dump_text(pack))
    with pytest.raises(CaseError, match="type 2 is neither grain nor fine"):
        read_spheres(path, types={1: "grain"})
    other = write(tmp_path / "5.dump", dump_text(pack).replace("\n30 2 ", "\n30 5 "))
    with pytest.raises(CaseError, match="type 5 is neither grain nor fine"):
        read_spheres(other)


BROKEN_DUMPS = {
    "cut in the middle of a row": (
        lambda text: text[: text.rindex(" ")],
        DumpError,
        "29 of 30 rows, then the file ends",
    ),
    "cut after the box": (
        lambda text: text.split("ITEM: ATOMS")[0],
        DumpError,
        "file ends before",
    ),
    "a row short of a value": (
        lambda text: text[: text.rstrip().rindex(" ")] + "\n",
        DumpError,
        "values, expected 6",
    ),
    "not a number": (lambda text: text.replace("\n30 2 ", "\n30 two "), DumpError, "column type"),
    "a type that is not whole": (
        lambda text: text.replace("\n30 2 ", "\n30 2.5 "),
        CaseError,
        "type is 2.5, expected a whole",
    ),
    "no radius": (lambda text: text.replace("radius", "mass"), CaseError, "no column radius"),
    "no place": (lambda text: text.replace(" x y z", " a b c"), CaseError, "no column x, y, z"),
    "a slanted box": (
        lambda text: text.replace("BOUNDS pp pp ff", "BOUNDS xy xz yz pp pp ff"),
        DumpError,
        "slanted",
    ),
    "a negative radius": (
        lambda text: text[: text.rstrip().rindex(" ")] + " -1\n",
        CaseError,
        "expected a number above 0",
    ),
    "no spheres": (
        lambda text: text.split("ITEM: ATOMS")[0].replace("\n30\n", "\n0\n") + "ITEM: ATOMS id\n",
        CaseError,
        "no spheres|no column",
    ),
}


@pytest.mark.parametrize("name", BROKEN_DUMPS)
def test_every_malformed_dump_is_refused(pack, tmp_path, name):
    change, kind, message = BROKEN_DUMPS[name]
    text = dump_text(pack)
    broken = change(text)
    assert broken != text
    path = write(tmp_path / "broken.dump", broken)
    with pytest.raises(kind, match=message) as caught:
        read_spheres(path)
    assert str(path) in str(caught.value)
    assert caught.value.exit_code == 2
    assert "--resume" not in str(caught.value)


def vtk_mesh(pack):
    import pyvista as pv

    mesh = pv.PolyData(np.array(pack.position))
    mesh.point_data["radius"] = np.array(pack.radius)
    return mesh


BROKEN_MESHES = {
    "no radius": (lambda mesh: mesh.point_data.remove("radius"), "no column radius among"),
    "a radius of zero": (
        lambda mesh: mesh.point_data.update({"radius": np.zeros(mesh.n_points)}),
        "expected a number above 0",
    ),
    "a radius that is no number": (
        lambda mesh: mesh.point_data.update({"radius": np.full(mesh.n_points, np.nan)}),
        "expected a number above 0",
    ),
    "three numbers for a radius": (
        lambda mesh: mesh.point_data.update({"radius": np.ones((mesh.n_points, 3))}),
        "is no number for each point",
    ),
    "a kind that there is not": (
        lambda mesh: mesh.point_data.update({"kind": np.full(mesh.n_points, 3)}),
        "kind is 3, expected grain or fine",
    ),
    "a type that is not whole": (
        lambda mesh: mesh.point_data.update({"type": np.full(mesh.n_points, 1.5)}),
        "type is 1.5, expected a whole number",
    ),
}


@pytest.mark.parametrize("name", BROKEN_MESHES)
def test_every_malformed_mesh_is_refused(pack, tmp_path, name):
    change, message = BROKEN_MESHES[name]
    mesh = vtk_mesh(pack)
    change(mesh)
    mesh.save(tmp_path / "s.vtp")
    with pytest.raises(CaseError, match=message):
        read_spheres(tmp_path / "s.vtp")


@pytest.mark.parametrize(
    "spoil", [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: b"x,y,z\n"]
)
@pytest.mark.parametrize("suffix", [".vtp", ".vtu"])
def test_a_cut_or_foreign_vtk_file_is_refused_quietly(pack, tmp_path, spoil, suffix, capfd):
    mesh = vtk_mesh(pack)
    path = tmp_path / f"s{suffix}"
    (mesh if suffix == ".vtp" else mesh.cast_to_unstructured_grid()).save(path)
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(CaseError, match=r"read as a VTK file|holds no points"):
        read_spheres(path)
    assert capfd.readouterr() == ("", "")


def test_a_missing_file_is_named(tmp_path):
    for name in ("none.csv", "none.vtp", "none.dump"):
        with pytest.raises(CaseError, match=name):
            read_spheres(tmp_path / name)


PLACES = np.indices((3, 3, 3)).reshape(3, -1).T + 0.5
"""Centres of touching spheres of radius 0.5 on a simple cubic lattice."""


def lattice_dump(
    columns: str = "id type x y z radius",
    *,
    step: int = 0,
    bounds: str = "pp pp pp",
    sides: str = "0 3",
    rows: int = 27,
    end: str = " \n",
    gap: str = " ",
) -> str:
    """The lattice as LIGGGHTS dumps it, with cells between `gap`."""
    head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n27\nITEM: BOX BOUNDS {bounds}\n"
    lines = [head + f"{sides}\n" * 3 + f"ITEM: ATOMS {columns} \n"]
    for number, (x, y, z) in list(enumerate(PLACES.tolist(), start=1))[:rows]:
        cells = {
            "id": number,
            "type": 1,
            "radius": 0.5,
            "diameter": 1.0,
            "element": "Q",
            "f": "nan",
        }
        cells |= dict(zip(("x", "y", "z"), (x, y, z), strict=True))
        cells |= dict(zip(("xsu", "ysu", "zsu"), (x / 3, y / 3, z / 3), strict=True))
        lines.append(gap.join(str(cells[name]) for name in columns.split()) + end)
    return "".join(lines)


PLAIN_DUMP = lattice_dump()
TILTS = "xy xz yz pp pp pp"
WHOLE_DUMPS = {
    "text in another column": lattice_dump("id type element x y z radius"),
    "no number in another column": lattice_dump("id f type x y z radius"),
    "capital names": PLAIN_DUMP.replace("x y z radius", "X Y Z Radius"),
    "aligned": lattice_dump(gap="     ", end="\n"),
    "tabs": lattice_dump(gap="\t", end="\n"),
    "CRLF": PLAIN_DUMP.replace("\n", "\r\n"),
    "no line feed at the end": PLAIN_DUMP.rstrip(),
    "blank last lines": PLAIN_DUMP + "\n  \n",
    "blank first line": "\n" + PLAIN_DUMP,
    "parts of the box": lattice_dump("id type xsu ysu zsu diameter"),
    "tilt 0": lattice_dump(bounds=TILTS, sides="0 3 0"),
    "old header": lattice_dump(bounds=""),
    "units, time and label": "ITEM: UNITS\r\nlj\nITEM: TIME\n0.5\nITEM: LABEL\na\n" + PLAIN_DUMP,
    "radius and diameter": lattice_dump("id diameter x y z radius"),
}


@pytest.mark.parametrize("name", WHOLE_DUMPS)
@pytest.mark.parametrize("packed", ["plain", "gzip", "UTF-16"])
def test_any_dump_of_lammps_is_read(tmp_path, name, packed):
    """The lattice itself is the right value."""
    data = WHOLE_DUMPS[name].encode("utf-16" if packed == "UTF-16" else "utf-8")
    path = tmp_path / "s.dump"
    path.write_bytes(gzip.compress(data) if packed == "gzip" else data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        spheres = read_spheres(path, units="mm")
    assert spheres.position == pytest.approx(1e-3 * PLACES, rel=1e-14)
    assert spheres.radius == pytest.approx(np.full(27, 5e-4), rel=1e-15)
    assert spheres.box == pytest.approx(1e-3 * np.array([[0.0, 3.0]] * 3), rel=1e-15)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (PLAIN_DUMP.replace("\n5 1 ", "\n5 1 1 "), 14, "7 values, expected 6"),
        (PLAIN_DUMP.replace("\n5 1 0.5", "\n5 1 nan"), 14, "column x holds 'nan'"),
        (PLAIN_DUMP.replace("\n5 1 0.5", "\n5 1 1_0"), 14, "column x holds '1_0'"),
        (lattice_dump(bounds=TILTS, sides="0 3 0.1"), 6, r"slanted \(triclinic\) by 0.1"),
        (lattice_dump(bounds="abc origin"), 5, "a general slanted box is not read"),
        (PLAIN_DUMP + "28 1 1 1 1 1 \n", 37, "28 rows, expected 27"),
        (lattice_dump(rows=17), 26, "17 of 27 rows, then the file ends"),
        (PLAIN_DUMP[:40], 4, "the file ends in the middle of a line"),
        ("ITEM: TIMESTEP\n", 1, "the file ends before the step"),
    ],
)
def test_a_malformed_dump_names_a_line_that_is_there(tmp_path, text, line, message):
    path = write(tmp_path / "s.dump", text)
    with pytest.raises(DumpError, match=rf"s\.dump:{line}: .*{message}") as caught:
        read_spheres(path)
    assert line <= len(text.splitlines())
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("last", [lattice_dump(step=9, rows=17), PLAIN_DUMP[:50]])
def test_a_cut_frame_leaves_the_whole_ones(tmp_path, last):
    path = write(tmp_path / "s.dump", PLAIN_DUMP + last)
    assert len(read_spheres(path, step=0)) == 27
    with pytest.warns(UserWarning, match="this frame was left out and that of step 0 used"):
        assert read_spheres(path).step == 0
    with pytest.raises(CaseError, match=r"no frame of step 9; the file has 0 \(.*the file ends"):
        read_spheres(path, step=9)
    write(path, PLAIN_DUMP + last[:-1] + lattice_dump(step=12))
    assert read_sphere_file(path).spheres.step == 12


def test_a_last_number_that_may_be_cut_is_named(tmp_path):
    path = write(tmp_path / "s.dump", PLAIN_DUMP[:-2])
    with pytest.warns(UserWarning, match=r"ends without a line feed: its last number, 0\.5, may"):
        assert len(read_spheres(path)) == 27


@pytest.mark.parametrize(
    ("bounds", "given", "box", "periodic"),
    [
        ("pp pp pp", None, None, (True, True, True)),
        ("pp ff fs", None, None, (True, False, False)),
        ("pp pp ff", None, [0, 3, 0, 2, 0, 3], (True, False, False)),
        ("pp pp pp", "", None, (False, False, False)),
        ("", None, None, (False, False, False)),
    ],
)
def test_the_sides_are_those_of_the_file(tmp_path, bounds, given, box, periodic):
    path = write(tmp_path / "s.dump", lattice_dump(bounds=bounds))
    read = read_sphere_file(path, periodic=given, box=box)
    assert read.periodic == periodic
    said = any("BOX BOUNDS" in text for text in read.assumptions)
    assert said == (given is None and bool(bounds))
    assert not read.warnings


def test_python_takes_the_sides_of_the_file_too(tmp_path):
    """A simple cubic lattice in a dump with pp has k = 2.5203e-9 m2 (Zick and Homsy 1982)."""
    from fdnet.network.permeability import analyse

    spheres = read_spheres(write(tmp_path / "s.dump", lattice_dump(bounds="pp pp pp")), units="mm")
    for one in (spheres, spheres.turned("y"), spheres.grains()):
        assert analyse(one).k_initial == pytest.approx(2.5203e-9, rel=2e-3, abs=0)
    assert analyse(spheres, periodic="").k_initial < 2e-9
    sides = write(tmp_path / "t.dump", lattice_dump(bounds="ff pp ff"))
    assert read_spheres(sides).turned("y").periodic == (True, False, False)


def test_walls_that_are_called_periodic_are_named(tmp_path):
    path = write(tmp_path / "s.dump", lattice_dump(bounds="ff pp ff"))
    assert any(
        "so that x, z has walls" in text
        for text in read_sphere_file(path, periodic="xyz").warnings
    )


def rows_of(sep: str = ",", size: str = "0.5", end: str = "\n") -> str:
    return "".join(sep.join([*map(str, place), size]) + end for place in PLACES.tolist())


TABLES = {
    "diameter": "x,y,z,diameter\n" + rows_of(size="1"),
    "capitals": "X,Y,Z,Radius\n" + rows_of(),
    "r": "x y z r\n" + rows_of(" "),
    "d and tabs": "x\ty\tz\td\n" + rows_of("\t", "1.0"),
    "aligned": "  x   y  z   radii\n" + rows_of("    "),
    "further columns": "x,y,z,radius,name,type\n" + rows_of(size="0.5,sand,1"),
    "Yade": "#format x_y_z_r\n" + rows_of("\t"),
    "Yade with more": "#format x_y_z_r_matId\n" + rows_of("\t", "0.5\t3"),
    "no header": rows_of(" "),
    "numpy": "# x y z diameter\n" + rows_of(" ", "1"),
    "decimal commas": "x;y;z;radius\n" + rows_of(";").replace(".", ","),
    "units": "x (mm),y (mm),z [mm],radius_mm\n" + rows_of(),
    "micrometres": "x [µm]\ty [µm]\tz [µm]\tr [µm]\n"
    + "".join("\t".join(f"{1e3 * one}" for one in (*place, 0.5)) + "\n" for place in PLACES),
    "ParaView": '"radius","Points:0","Points:1","Points:2"\n'
    + "".join(f"0.5,{x},{y},{z}\n" for x, y, z in PLACES.tolist()),
    "CRLF": "x,y,z,radius\r\n" + rows_of(end="\r\n"),
}


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "cp1252", "utf-16"])
def test_tables_of_other_codes_are_read(tmp_path, name, encoding):
    path = tmp_path / "s.txt"
    path.write_bytes(TABLES[name].encode(encoding))
    units = None if name in ("units", "micrometres") else "mm"
    spheres = read_spheres(path, units=units)
    assert spheres.position == pytest.approx(1e-3 * PLACES, rel=1e-14)
    assert spheres.radius == pytest.approx(np.full(27, 5e-4), rel=1e-15)


@pytest.mark.parametrize("name", ["radius", "Radius", "radii", "r", "diameter", "D", "radius_mm"])
@pytest.mark.parametrize("suffix", [".vtp", ".vtu", ".vtk", ".vtk.gz"])
@pytest.mark.parametrize("binary", [True, False])
def test_vtk_files_of_other_codes_are_read(tmp_path, name, suffix, binary):
    import pyvista as pv

    mesh = pv.PolyData(PLACES)
    mesh = mesh if suffix != ".vtu" else mesh.cast_to_unstructured_grid()
    mesh.point_data["v"] = np.zeros((27, 3))
    mesh.point_data["X"] = np.zeros(27)
    mesh.point_data[name] = np.full(27, 1.0 if name.lower()[0] == "d" else 0.5)
    path = tmp_path / f"s{suffix}"
    mesh.save(tmp_path / f"s{suffix.removesuffix('.gz')}", binary=binary)
    if suffix.endswith(".gz"):
        path.write_bytes(gzip.compress((tmp_path / "s.vtk").read_bytes()))
    spheres = read_spheres(path, units=None if name == "radius_mm" else "mm")
    assert spheres.position == pytest.approx(1e-3 * PLACES, rel=1e-14)
    assert spheres.radius == pytest.approx(np.full(27, 5e-4), rel=1e-15)


VTP = (
    '<VTKFile type="PolyData" version="1.0"><PolyData><Piece NumberOfPoints="{count}" '
    'NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="0"><PointData>'
    '<DataArray type="{type}" Name="radius" format="ascii">{radius}</DataArray></PointData>'
    '<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0'
    "</DataArray></Points></Piece></PolyData></VTKFile>"
)


@pytest.mark.parametrize(
    ("count", "kind", "radius"),
    [
        (2, "String", "0.5 0.5"),
        (2, "Float64", "a b"),
        (2, "Float64", "0.5"),
        (10**9, "Float64", "0.5 0.5"),
        (10**18, "Float64", "0.5 0.5"),
        (-1, "Float64", "0.5 0.5"),
    ],
)
def test_a_file_that_ends_vtk_is_refused_quietly(tmp_path, capfd, count, kind, radius):
    path = write(tmp_path / "s.vtp", VTP.format(count=count, type=kind, radius=radius))
    with pytest.raises(CaseError, match=r"s\.vtp: (cannot be read as a VTK|point|holds no)"):
        read_spheres(path)
    assert capfd.readouterr() == ("", "")


def endless(folder):
    """Names of things that no reader may wait for, one of them behind a link."""
    os.mkfifo(folder / "pipe")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(folder / "socket"))
    (folder / "link").symlink_to("/dev/zero")
    with (folder / "vast").open("wb") as file:
        file.truncate(2**40)
    names = [folder / name for name in ("pipe", "socket", "link", "vast")]
    return [folder, "/dev/zero", "/dev/null", "/proc/kmsg", "/proc/kcore", *names]


@pytest.mark.parametrize("suffix", ["", ".vtp"])
def test_only_ordinary_files_of_bounded_size_are_read(tmp_path_factory, suffix):
    folder = tmp_path_factory.mktemp("e")
    for name in endless(folder):
        (folder / "given.vtp").unlink(missing_ok=True)
        (folder / "given.vtp").symlink_to(name)
        given = folder / "given.vtp" if suffix else name
        for read in (
            lambda one: read_spheres(one, units="mm"),
            read_case,
            sweep_plan,
            lambda one: read_size_file(folder, str(one)),
        ):
            with pytest.raises((CaseError, ValueError)):
                read(given)


@pytest.mark.parametrize(
    ("name", "text", "options"),
    [
        ("s.dump", PLAIN_DUMP, []),
        ("s.dump", PLAIN_DUMP + lattice_dump(step=9, rows=9), ["--periodic", "xyz"]),
        ("s.txt", TABLES["Yade"], ["--box", "0,3,0,3,0,3", "--periodic", "xyz"]),
    ],
)
def test_the_permeability_of_the_lattice_comes_from_every_file(
    tmp_path, capsys, name, text, options
):
    """Zick and Homsy 1982, K = 42.1: k = 2.5203e-9 m2. Sides that repeat come from the dump."""
    path = write(tmp_path / name, text)
    assert main(["permeability", str(path), "--units", "mm", "--json", *options]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["k_initial_m2"] == pytest.approx(2.5203e-9, rel=2e-3)
    assert len(said["warnings"]) == text.count("\n9\nITEM: N")
    assert any("BOX BOUNDS pp pp pp" in one for one in said["assumptions"]) == (not options)
