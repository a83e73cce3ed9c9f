"""Spheres come back from every format as they were written, and malformed files are refused."""

import numpy as np
import pytest

from fdnet import read_spheres
from fdnet.errors import CaseError, DumpError
from fdnet.report.vtk import write_spheres_vtp
from fdnet.spheres.csv_file import write_spheres
from fdnet.spheres.readers import read_sphere_file
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
    "cut in the middle of a row": (lambda text: text[:-5], DumpError, "The run was cut"),
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
        "not whole",
    ),
    "no radius": (lambda text: text.replace("radius", "mass"), CaseError, "no column radius"),
    "no place": (lambda text: text.replace(" x y z", " a b c"), CaseError, "no columns x y z"),
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


def vtk_mesh(pack):
    import pyvista as pv

    mesh = pv.PolyData(np.array(pack.position))
    mesh.point_data["radius"] = np.array(pack.radius)
    return mesh


BROKEN_MESHES = {
    "no radius": (lambda mesh: mesh.point_data.remove("radius"), "no point data radius"),
    "a radius of zero": (
        lambda mesh: mesh.point_data.update({"radius": np.zeros(mesh.n_points)}),
        "radius that is not above 0",
    ),
    "a radius that is no number": (
        lambda mesh: mesh.point_data.update({"radius": np.full(mesh.n_points, np.nan)}),
        "radius that is not above 0",
    ),
    "three numbers for a radius": (
        lambda mesh: mesh.point_data.update({"radius": np.ones((mesh.n_points, 3))}),
        "is no number for each point",
    ),
    "a kind that there is not": (
        lambda mesh: mesh.point_data.update({"kind": np.full(mesh.n_points, 3)}),
        "kind holds 3",
    ),
    "a type that is not whole": (
        lambda mesh: mesh.point_data.update({"type": np.full(mesh.n_points, 1.5)}),
        "not whole",
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
