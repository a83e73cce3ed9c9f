"""Spheres come back from every format as they were written, and malformed files are refused."""

import gzip
import os
import socket
import struct
import warnings

import numpy as np
import pytest
import pyvista as pv

from fdnet import read_case, read_spheres
from fdnet.campaign.plan import sweep_plan
from fdnet.case.file import read_size_file
from fdnet.errors import CaseError, DumpError
from fdnet.network.permeability import analyse
from fdnet.report.vtk import write_spheres_vtp
from fdnet.spheres.dump import read_binary_frame
from fdnet.spheres.readers import read_sphere_file, write_spheres
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.spheres.dumps import PLACES, dump_text, lattice_dump

BOX = [[0.0, 4e-3], [0.0, 2e-3], [-1e-3, 1e-3]]
CUBIC = 2.5203e-9
"""k, m2, of touching spheres of 1 mm on a simple cubic lattice (Zick and Homsy 1982, K = 42.1)."""


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


def write(path, text):
    path.write_text(text)
    return path


def is_lattice(spheres):
    """Whether these are the touching spheres of 1 mm at PLACES."""
    assert spheres.position == pytest.approx(1e-3 * PLACES, rel=1e-14)
    assert spheres.radius == pytest.approx(np.full(27, 5e-4), rel=1e-15)
    return True


def test_what_was_written_comes_back(pack, tmp_path):
    """To the last digit, from tables, dumps and VTK, which keeps double precision here."""
    again = read_spheres(write_spheres(tmp_path / "s.csv", pack), box=BOX)
    assert same(again, pack)
    assert np.array_equal(again.box, pack.box)
    assert same(read_spheres(write_spheres_vtp(tmp_path / "s.vtp", pack), box=BOX), pack)
    mesh = pv.PolyData(np.array(pack.position)).cast_to_unstructured_grid()
    mesh.point_data["diameter"] = 2 * pack.radius
    mesh.point_data["type"] = np.where(pack.kind == Kind.FINE, 7, 3)
    mesh.save(tmp_path / "s.vtu")
    assert same(read_spheres(tmp_path / "s.vtu", types={3: "grain", 7: "fine"}, box=BOX), pack)
    for columns in ("id type x y z radius", "radius z y x type id"):
        given = read_sphere_file(write(tmp_path / "pack.dump", dump_text(pack, columns)))
        assert same(given.spheres, pack)
        assert np.array_equal(given.spheres.box, pack.box)
        assert given.spheres.step == 7
        assert any("type 1 is a grain" in sentence for sentence in given.assumptions)
    for names in ("xu yu zu radius", "xs ys zs radius", "x y z diameter"):
        columns = f"id type {names}"
        other = read_spheres(write(tmp_path / "atoms.lammpstrj", dump_text(pack, columns)))
        assert other.position == pytest.approx(pack.position, rel=1e-12, abs=1e-15), columns
        assert other.radius == pytest.approx(pack.radius, rel=1e-15, abs=0), columns
        assert np.array_equal(other.kind, pack.kind), columns


def test_units_are_those_that_are_asked_for_or_that_a_dump_names(pack, tmp_path):
    path = write(tmp_path / "plain.dump", dump_text(pack))
    small = read_spheres(path, units="um", box=[0, 4e-3, 0, 2e-3, -1e-3, 1e-3])
    assert small.radius == pytest.approx(1e-6 * pack.radius, rel=1e-15, abs=0)
    assert small.box == pytest.approx(1e-6 * pack.box, rel=1e-15, abs=0)
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


def test_kinds_by_radius_by_type_and_by_column_agree(pack, tmp_path):
    """The same spheres told apart in three ways; the limit is in the unit of the file."""
    rows = np.column_stack([1e3 * pack.position, 1e3 * pack.radius]).tolist()
    text = "x,y,z,radius\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows)
    mm = {"units": "mm", "fines_below": 0.1}
    by_radius = read_spheres(write(tmp_path / "mm.csv", text), box=np.multiply(1e3, BOX), **mm)
    assert by_radius.box == pytest.approx(pack.box, rel=1e-15, abs=0)
    path = write(tmp_path / "pack.dump", dump_text(pack))
    same_types = read_spheres(path, types={1: "grain", 2: "fine"})
    for spheres in (by_radius, same_types, read_spheres(path, fines_below=1e-4)):
        assert np.array_equal(spheres.kind, pack.kind)
    swapped = read_spheres(path, types={1: "fine", 2: "grain"})
    assert np.array_equal(3 - swapped.kind, pack.kind)
    limit = write(tmp_path / "s.csv", "x,y,z,radius\n0,0,0,0.1\n1,0,0,0.0999\n")
    assert read_spheres(limit, **mm).kind.tolist() == [Kind.GRAIN, Kind.FINE]


def test_choices_that_do_not_fit_the_file_are_refused(pack, tmp_path):
    table = write(tmp_path / "s.csv", "x,y,z,radius\n0,0,0,0.2\n1,0,0,0.3\n")
    dump = write(tmp_path / "pack.dump", dump_text(pack))
    other = write(tmp_path / "5.dump", dump_text(pack).replace("\n30 2 ", "\n30 5 "))
    for path, change, message in [
        (table, {"step": 3}, "is no dump"),
        (table, {"fines_below": -1.0, "units": "m"}, "expected a radius above 0"),
        (table, {"fines_below": 0.1, "types": {1: "grain"}, "units": "m"}, "give one of the two"),
        (table, {"types": {1: "grain"}, "units": "m"}, "has no types"),
        (table, {"types": {1: "sand"}, "units": "m"}, "'sand', expected grain or fine"),
        (table, {"units": "m", "box": [0, 1, 0, 1, 2, 1]}, "each lower bound below the upper"),
        (dump, {"types": {1: "grain"}}, "type 2 is neither grain nor fine"),
        (other, {}, "type 5 is neither grain nor fine"),
        *((tmp_path / name, {}, name) for name in ("none.csv", "none.vtp", "none.dump")),
    ]:
        with pytest.raises(CaseError, match=message):
            read_spheres(path, **change)


# ---- Dumps.
PLAIN_DUMP = lattice_dump()
TILTS = "xy xz yz pp pp pp"


def test_any_dump_of_lammps_is_read(tmp_path):
    """The lattice itself is the right value."""
    header = "ITEM: UNITS\r\nlj\nITEM: TIME\n0.5\nITEM: LABEL\na\n"
    dumps = {
        "no number in another column": lattice_dump("id f type x y z radius"),
        "capital names": PLAIN_DUMP.replace("x y z radius", "X Y Z Radius"),
        "aligned": lattice_dump(gap="     ", end="\n"),
        "CRLF": PLAIN_DUMP.replace("\n", "\r\n"),
        "no line feed at the end": PLAIN_DUMP.rstrip(),
        "blank last lines": PLAIN_DUMP + "\n  \n",
        "parts of the box": lattice_dump("id type xsu ysu zsu diameter"),
        "tilt 0": lattice_dump(bounds=TILTS, sides="0 3 0"),
        "old header": lattice_dump(bounds=""),
        "units, time and label": header + PLAIN_DUMP,
    }
    path = tmp_path / "s.dump"
    for name, text in dumps.items():
        for packed in (text.encode(), gzip.compress(text.encode()), text.encode("utf-16")):
            path.write_bytes(packed)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                spheres = read_spheres(path, units="mm")
            assert is_lattice(spheres), name
            assert spheres.box == pytest.approx(1e-3 * np.array([[0.0, 3.0]] * 3), rel=1e-15)


def test_every_malformed_dump_is_refused(pack, tmp_path):
    text, path = dump_text(pack), tmp_path / "broken.dump"
    for broken, kind, message in [
        (text.split("ITEM: ATOMS")[0], DumpError, "file ends before"),
        (text.replace("\n30 2 ", "\n30 two "), DumpError, "column type"),
        (text.replace("\n30 2 ", "\n30 2.5 "), CaseError, "type is 2.5, expected a w"),
        (text.replace("radius", "mass"), CaseError, "no column radius"),
        (text[: text.rstrip().rindex(" ")] + " -1\n", CaseError, "a number above 0"),
    ]:
        with pytest.raises(kind, match=message) as caught:
            read_spheres(write(path, broken))
        assert str(path) in str(caught.value)
        assert caught.value.exit_code == 2
        assert "--resume" not in str(caught.value)


def test_a_cut_frame_leaves_the_whole_ones(tmp_path):
    path = tmp_path / "s.dump"
    for last in (lattice_dump(step=9, rows=17), PLAIN_DUMP[:50]):
        write(path, PLAIN_DUMP + last)
        assert len(read_spheres(path, step=0)) == 27
        with pytest.warns(UserWarning, match="this frame was left out and that of step 0 used"):
            assert read_spheres(path).step == 0
        with pytest.raises(CaseError, match=r"no frame of step 9; the file has 0 \(.*file ends"):
            read_spheres(path, step=9)
        write(path, PLAIN_DUMP + last[:-1] + lattice_dump(step=12))
        assert read_sphere_file(path).spheres.step == 12
    write(path, PLAIN_DUMP[:-2])
    with pytest.warns(UserWarning, match=r"ends without a line feed: its last number, 0\.5, may"):
        assert len(read_spheres(path)) == 27


def test_the_sides_are_those_of_the_file(tmp_path):
    path = tmp_path / "s.dump"
    for bounds, given, box, periodic in [
        ("pp pp pp", None, None, (True, True, True)),
        ("pp ff fs", None, None, (True, False, False)),
        ("pp pp ff", None, [0, 3, 0, 2, 0, 3], (True, False, False)),
        ("pp pp pp", "", None, (False, False, False)),
        ("", None, None, (False, False, False)),
    ]:
        write(path, lattice_dump(bounds=bounds))
        read = read_sphere_file(path, periodic=given, box=box)
        assert read.periodic == periodic, bounds
        said = any("BOX BOUNDS" in text for text in read.assumptions)
        assert said == (given is None and bool(bounds)), bounds
        assert not read.warnings
    spheres = read_spheres(write(path, PLAIN_DUMP), units="mm")  # Python takes them too
    for one in (spheres, spheres.turned("y"), spheres.grains()):
        assert analyse(one).k_initial == pytest.approx(CUBIC, rel=2e-3, abs=0)
    assert analyse(spheres, periodic="").k_initial < 2e-9
    write(path, lattice_dump(bounds="ff pp ff"))
    assert read_spheres(path).turned("y").periodic == (True, False, False)
    said = read_sphere_file(path, periodic="xyz").warnings
    assert any("so that x, z has walls" in text for text in said)


# ---- Dumps in binary.
COLUMNS = ("id", "x", "radius")
ROWS = np.array([[3.0, 0.1, 1e-5], [1.0, 0.2, 2e-5], [2.0, -0.3, 3e-5]])
BOUNDS = (0.0, 1.0, 0.0, 2.0, -1.0, 3.0)


def dump_of(blocks, *, columns=3, slanted=0, count=None):
    """The bytes of a dump whose rows lie in such blocks, as DumpCustom::header_binary says."""
    rows = sum(len(block) for block in blocks) if count is None else count
    data = struct.pack("<qqi6i6dii", 7, rows, slanted, *[1] * 6, *BOUNDS, columns, len(blocks))
    for block in blocks:
        data += struct.pack("<i", block.size) + block.astype("<f8").tobytes()
    return data


@pytest.fixture
def read(tmp_path):
    def frame_of(data):
        (tmp_path / "a.bin").write_bytes(data)
        return read_binary_frame(tmp_path / "a.bin", COLUMNS)

    return frame_of


def test_rows_of_all_ranks_come_sorted_by_id(read):
    for blocks in ([ROWS], [ROWS[:1], ROWS[1:]], [ROWS, ROWS[:0]]):
        frame = read(dump_of(blocks))
        assert (frame.step, frame.columns) == (7, COLUMNS)
        assert np.array_equal(frame.box, np.reshape(BOUNDS, (3, 2)))
        assert np.array_equal(frame.rows, ROWS[[1, 2, 0]])
    assert read(dump_of([ROWS[:0]])).rows.shape == (0, 3), "a dump may hold no sphere"


def test_what_is_no_whole_binary_frame_is_refused(read, tmp_path):
    whole = dump_of([ROWS[:2], ROWS[2:]])
    for length in range(len(whole)):
        with pytest.raises(DumpError, match="The run was cut"):
            read(whole[:length])
    for data, message in [
        (dump_of([ROWS]) + b"more", "4 bytes follow the frame"),
        (dump_of([ROWS], count=2), "9 values, expected 3 for each of 2 atoms"),
        (dump_of([ROWS], columns=4), "4 columns of 3 atoms"),
        (dump_of([ROWS], slanted=1), "slanted box 1; expected"),
        (dump_of([ROWS], count=-1), "-1 atoms"),
        (dump_of([np.full((1, 3), np.nan)]), "a value is not finite"),
        (dump_of([ROWS])[:-76] + struct.pack("<i", -9), "a block of -9 values"),
    ]:
        with pytest.raises(DumpError, match=message) as refused:
            read(data)
        assert "a.bin" in str(refused.value)
    with pytest.raises(DumpError, match=r"none\.bin: cannot be read"):
        read_binary_frame(tmp_path / "none.bin", COLUMNS)


# ---- Tables and VTK files of other codes.
def rows_of(sep: str = ",", size: str = "0.5", end: str = "\n") -> str:
    return "".join(sep.join([*map(str, place), size]) + end for place in PLACES.tolist())


TABLES = {
    "diameter": "x,y,z,diameter\n" + rows_of(size="1"),
    "capitals": "X,Y,Z,Radius\n" + rows_of(),
    "aligned": "  x   y  z   radii\n" + rows_of("    "),
    "further columns": "x,y,z,radius,name,type\n" + rows_of(size="0.5,sand,1"),
    "Yade": "#format x_y_z_r\n" + rows_of("\t"),
    "no header": rows_of(" "),
    "numpy": "# x y z diameter\n" + rows_of(" ", "1"),
    "decimal commas": "x;y;z;radius\n" + rows_of(";").replace(".", ","),
    "units": "x (mm),y (mm),z [mm],radius_mm\n" + rows_of(),
    "micrometres": "x [µm]\ty [µm]\tz [µm]\tr [µm]\n"
    + "".join("\t".join(f"{1e3 * one}" for one in (*place, 0.5)) + "\n" for place in PLACES),
    "ParaView": '"radius","Points:0","Points:1","Points:2"\n'
    + "".join(f"0.5,{x},{y},{z}\n" for x, y, z in PLACES.tolist()),
}


def test_tables_of_other_codes_are_read(tmp_path):
    path = tmp_path / "s.txt"
    for name, text in TABLES.items():
        units = None if name in ("units", "micrometres") else "mm"
        for encoding in ("utf-8-sig", "cp1252", "utf-16"):
            path.write_bytes(text.encode(encoding))
            assert is_lattice(read_spheres(path, units=units)), (name, encoding)


@pytest.mark.parametrize("suffix", [".vtp", ".vtu", ".vtk", ".vtk.gz"])
def test_vtk_files_of_other_codes_are_read(tmp_path, suffix):
    path, plain = tmp_path / f"s{suffix}", tmp_path / f"s{suffix.removesuffix('.gz')}"
    names = ("Radius", "r", "diameter", "radius_mm")
    for number, name in enumerate(names):
        mesh = pv.PolyData(PLACES)
        mesh = mesh if suffix != ".vtu" else mesh.cast_to_unstructured_grid()
        mesh.point_data["v"], mesh.point_data["X"] = np.zeros((27, 3)), np.zeros(27)
        mesh.point_data[name] = np.full(27, 1.0 if name.lower()[0] == "d" else 0.5)
        mesh.save(plain, binary=number % 2 == 0)
        if suffix.endswith(".gz"):
            path.write_bytes(gzip.compress(plain.read_bytes()))
        spheres = read_spheres(path, units=None if name == "radius_mm" else "mm")
        assert is_lattice(spheres), name


def test_every_malformed_mesh_is_refused(tmp_path):
    good = np.full(27, 0.5)
    for columns, message in [
        ({}, "no column radius among"),
        ({"radius": 0 * good}, "expected a number above 0"),
        ({"radius": np.ones((27, 3))}, "is no number for each point"),
        ({"radius": good, "kind": 6 * good}, "kind is 3, expected grain or fine"),
    ]:
        mesh = pv.PolyData(PLACES)
        for name, values in columns.items():
            mesh.point_data[name] = values
        mesh.save(tmp_path / "s.vtp")
        with pytest.raises(CaseError, match=message):
            read_spheres(tmp_path / "s.vtp", units="mm")


def test_a_vtk_file_that_is_cut_or_foreign_or_ends_vtk_is_refused_quietly(tmp_path, capfd):
    mesh = pv.PolyData(PLACES)
    mesh.save(tmp_path / "s.vtp")
    mesh.cast_to_unstructured_grid().save(tmp_path / "s.vtu")
    for path in (tmp_path / "s.vtp", tmp_path / "s.vtu"):
        whole = path.read_bytes()
        for spoilt in (whole[: len(whole) // 2], b"", b"x,y,z\n"):
            path.write_bytes(spoilt)
            with pytest.raises(CaseError, match=r"read as a VTK file|holds no points"):
                read_spheres(path)
    assert capfd.readouterr() == ("", "")


def test_only_ordinary_files_of_bounded_size_are_read(tmp_path_factory):
    """No reader waits for a pipe, a device or more bytes than there may be, behind a link too."""
    folder = tmp_path_factory.mktemp("e")
    os.mkfifo(folder / "pipe")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(folder / "socket"))
    with (folder / "vast").open("wb") as file:
        file.truncate(2**40)
    names = [folder, *(folder / name for name in ("pipe", "socket", "vast"))]
    link = folder / "given.vtp"
    for name in (*names, "/dev/zero", "/dev/null", "/proc/kmsg", "/proc/kcore"):
        link.unlink(missing_ok=True)
        link.symlink_to(name)
        for read in (
            lambda one: read_spheres(one, units="mm"),
            lambda one: read_size_file(folder, str(one)),
            *(read_case, sweep_plan),
        ):
            for given in (name, link):
                with pytest.raises((CaseError, ValueError)):
                    read(given)
