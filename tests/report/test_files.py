"""CSV tables, summary.json and ParaView files: contract columns, sums, and no half files."""

import copy
import json
import re
import subprocess
import sys
from functools import cache
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
from builders import naming
from report_demo import BOX, demo_analysis, demo_damaged, demo_grains, snapshot_of

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import CaseError
from fdnet.files import replacing, write_text
from fdnet.network.permeability import analyse
from fdnet.report import picture, tables, vtk
from fdnet.report.tables import (
    section_rows,
    write_pores,
    write_sections,
    write_summary,
    write_throats,
)
from fdnet.spheres.readers import read_csv, write_spheres
from fdnet.spheres.snapshot import Kind, Snapshot
from fdnet.spheres.vtk_file import read_vtk


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """The tables and the mesh of the made-up specimen."""
    folder, analysis = tmp_path_factory.mktemp("demo"), demo_analysis()
    made = {
        name: getattr(tables, f"write_{name}")(folder / f"{name}.csv", analysis)
        for name in ("sections", "profile", "pores", "throats")
    }
    made["mesh"] = vtk.write_network_vtp(folder / "network.vtp", analysis)
    return made


SECTION_COLUMNS = [
    "section",
    "x_lo_m",
    "x_hi_m",
    "porosity_initial",
    "porosity_damaged",
    "k_initial_m2",
    "k_damaged_m2",
    "k_reduction",
    "k_initial_inplace_m2",
    "k_damaged_inplace_m2",
    "fines_count",
    "fines_fraction",
]


PROFILE_COLUMNS = [
    "x_lo_m",
    "x_hi_m",
    "porosity_initial",
    "porosity_damaged",
    "porosity_reduction",
    "fines_fraction",
]


def changed(analysis, **values):
    return SimpleNamespace(**(vars(analysis) | values))


def test_sections_hold_the_contract_columns_and_count_what_the_sphere_table_says(demo, tmp_path):
    sections = pd.read_csv(demo["sections"])
    spheres = pd.read_csv(write_spheres(tmp_path / "s.csv", demo_damaged()))
    assert list(sections.columns) == [*SECTION_COLUMNS, "k_initial_mD", "k_damaged_mD"]
    depth = spheres[spheres.kind == "fine"].x_m
    for row in sections.itertuples():
        assert row.fines_count == sum((row.x_lo_m <= depth) & (depth < row.x_hi_m))
    assert sections.fines_fraction.sum() == pytest.approx(1, abs=1e-8)
    rows = section_rows(demo_analysis())
    assert [*rows[0], "k_initial_mD", "k_damaged_mD"] == list(sections.columns)
    assert [row["fines_count"] for row in rows] == sections.fines_count.tolist()


def test_section_edges_are_written_to_the_last_bit_and_no_flow_has_no_reduction(tmp_path):
    edges = 0.1 + np.arange(3) / 3
    rows = [copy.copy(s) for s in demo_analysis().sections[:2]]
    for row, lo, hi in zip(rows, edges, edges[1:], strict=False):
        row.x_lo, row.x_hi = np.float64(lo), np.float64(hi)
    rows[0].k_initial, rows[0].k_damaged, rows[0].k_reduction = 0.0, 0.0, None
    path = write_sections(tmp_path / "s.csv", changed(demo_analysis(), sections=tuple(rows)))
    written = pd.read_csv(path)
    assert written.x_lo_m.tolist() == edges[:2].tolist()
    assert written.x_hi_m.tolist() == edges[1:].tolist()
    assert written.k_reduction.isna().tolist() == [True, False]
    assert ",0,0,," in path.read_text()


def test_profile_reduction_is_the_difference_and_shares_sum_to_one(demo):
    profile = pd.read_csv(demo["profile"])
    assert list(profile.columns) == PROFILE_COLUMNS
    lost = profile.porosity_initial - profile.porosity_damaged
    assert np.allclose(profile.porosity_reduction, lost, rtol=0, atol=2e-9)
    assert np.array_equal(profile.x_lo_m[1:], profile.x_hi_m[:-1])
    assert profile.fines_fraction.sum() == pytest.approx(1, abs=1e-7)


def test_throat_fluxes_follow_from_the_tables_and_balance_in_every_pore(demo):
    throats, pores = pd.read_csv(demo["throats"]), pd.read_csv(demo["pores"])
    assert (len(throats), len(pores)) == (1722, 894)
    net = np.zeros(len(pores))
    inside = throats[throats.throat_conns_1 >= 0]
    np.add.at(net, throats.throat_conns_0, -throats.flux_damaged_m3)
    np.add.at(net, inside.throat_conns_1, inside.flux_damaged_m3)
    assert np.abs(net).max() < 1e-7 * throats.flux_damaged_m3.abs().max()
    for state in ("initial", "damaged"):
        beyond = np.append(pores[f"pressure_{state}"].to_numpy(), [0.0, 1.0])
        drop = beyond[throats.throat_conns_0] - beyond[throats.throat_conns_1]
        conductance = throats[f"conductance_{state}_m3"]
        wrong = (throats[f"flux_{state}_m3"] - conductance * drop).abs()
        assert (wrong <= 3e-9 * conductance).all()  # nine digits of two pressures up to 1
        assert np.abs(drop).max() > 0.1
    assert throats.blocked.sum() == (throats.law_used == "blocked").sum() > 0
    assert (throats.conductance_damaged_m3[throats.blocked == 1] == 0).all()
    assert (throats.conductance_initial_m3[throats.blocked == 1] > 0).all()


def test_an_intact_pack_has_open_throats_and_the_void_of_its_pores(tmp_path):
    intact = changed(demo_analysis(), occupancy=None)
    throats = pd.read_csv(write_throats(tmp_path / "throats.csv", intact))
    pores = pd.read_csv(write_pores(tmp_path / "pores.csv", intact))
    assert throats.porosity.eq(1).all()
    assert np.allclose(pores.porosity, 0.4)  # of the stand-in: void 0.4 of every tetrahedron
    assert throats.blocked.sum() == throats.fines_count.sum() == 0


def test_summary_takes_numpy_and_names_every_value_json_cannot_hold(tmp_path):
    summary = {
        "k": np.float64(2e-11),
        "n": np.int64(3),
        "flag": np.bool_(True),
        "none": None,
        "path": tmp_path,
        "solver": {"mass_balance": float("nan")},
        "sections": [{"k_reduction": np.inf}],
        "edges": np.array([1.0, 2.0]),
        "warnings": ("doubtful",),
    }
    written = write_summary(tmp_path / "summary.json", summary)
    read = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)
    assert read == written
    assert (read["k"], read["n"], read["flag"], read["none"]) == (2e-11, 3, True, None)
    assert read["edges"] == [1.0, 2.0]
    assert read["solver"]["mass_balance"] is read["sections"][0]["k_reduction"] is None
    assert read["warnings"][0] == "doubtful"
    assert [
        ("solver.mass_balance" in w, "sections[0].k_reduction" in w) for w in read["warnings"][1:]
    ] == [
        (True, False),
        (False, True),
    ]


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path):
    path = write_text(tmp_path / "a.csv", "old")
    with pytest.raises(TypeError):
        write_summary(tmp_path / "summary.json", {"oops": object()})
    with pytest.raises(ZeroDivisionError), replacing(path) as part:
        part.write_text("half") // 0
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_network_lines_join_the_ends_of_their_throats_and_pressures_drive_them(demo):
    analysis, mesh = demo_analysis(), pv.read(demo["mesh"])
    network, pairs = analysis.network, mesh.lines.reshape(-1, 3)[:, 1:]
    assert mesh.n_cells == len(network.throat_radius)
    assert mesh.n_verts == 0
    assert np.allclose(mesh.points[pairs], network.throat_ends, rtol=0, atol=1e-12)
    assert np.array_equal(mesh.points[: len(network.pore_radius)], network.pore_position)
    assert np.array_equal(mesh.cell_data["conductance_damaged_m3"], analysis.conductance_damaged)
    assert np.array_equal(mesh.cell_data["blocked"], analysis.occupancy.blocked)
    pressure = mesh.point_data["pressure_damaged"][pairs]
    expected = mesh.cell_data["conductance_damaged_m3"] * (pressure[:, 0] - pressure[:, 1])
    near = 1e-12 * np.abs(expected).max()
    assert np.allclose(mesh.cell_data["flux_damaged_m3"], expected, rtol=0, atol=near)


def test_a_throat_across_a_periodic_side_ends_in_an_image(tmp_path):
    network = SimpleNamespace(**vars(demo_analysis().network))
    inner = np.flatnonzero(network.throat_pores[:, 1] >= 0)[0]
    network.throat_ends = network.throat_ends.copy()
    network.throat_ends[inner, 1] += [0, 2e-3, 0]
    analysis = SimpleNamespace(**(vars(demo_analysis()) | {"network": network}))
    mesh = pv.read(vtk.write_network_vtp(tmp_path / "network.vtp", analysis))
    image = mesh.lines.reshape(-1, 3)[inner, 2]
    other = network.throat_pores[inner, 1]
    assert mesh.point_data["end"][image] == 1
    assert mesh.points[image] == pytest.approx(network.pore_position[other] + [0, 2e-3, 0])
    assert mesh.point_data["pressure_damaged"][image] == analysis.flow_damaged.pore_pressure[other]
    assert mesh.point_data["volume_m3"].sum() == pytest.approx(
        network.pore_volume.sum()
    )  # images hold no volume


def test_the_pressure_falls_by_one_per_period_along_x(tmp_path):
    network = SimpleNamespace(**vars(demo_analysis().network) | {"periodic": (True, True, True)})
    inner = np.flatnonzero(network.throat_pores[:, 1] >= 0)[:2]
    network.throat_ends = network.throat_ends.copy()
    network.throat_ends[inner, 1] += [[4e-3, 0, 0], [0, 2e-3, 0]]
    analysis = SimpleNamespace(**(vars(demo_analysis()) | {"network": network}))
    mesh = pv.read(vtk.write_network_vtp(tmp_path / "network.vtp", analysis))
    image, pore = mesh.lines.reshape(-1, 3)[inner, 2], network.throat_pores[inner, 1]
    drop = mesh.point_data["pressure_damaged"][pore] - mesh.point_data["pressure_damaged"][image]
    assert drop == pytest.approx([1, 0], abs=1e-12)


def test_spheres_read_back_in_metres_and_from_no_spheres(tmp_path):
    snapshot = demo_damaged()
    path = vtk.write_spheres_vtp(tmp_path / "spheres_damaged.vtp", snapshot)
    mesh = pv.read(path)
    assert np.array_equal(mesh.points, snapshot.position)
    for name, array in vtk.SPHERE_ARRAYS.items():
        assert np.array_equal(mesh.point_data[array], getattr(snapshot, name))
    assert np.array_equal(read_vtk(path).radius, snapshot.radius)
    with pytest.raises(CaseError, match=r"radius_m is in m; leave out --units mm"):
        read_vtk(path, units="mm")
    none = vtk.write_spheres_vtp(tmp_path / "spheres_none.vtp", demo_grains().fines())
    assert pv.read(none).n_points == 0


def test_a_mesh_on_a_full_disk_is_an_error_and_vtk_prints_nothing(tmp_path, capfd, caplog):
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=8k", "tmpfs", str(place)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small file system needs root")
    try:
        with pytest.raises(OSError, match="No space left"):
            vtk.write_network_vtp(place / "network.vtp", demo_analysis())
    finally:
        subprocess.run(["umount", str(place)], check=True)
    assert capfd.readouterr().err == ""
    assert caplog.records == []


def test_a_collection_reads_back_with_its_times(tmp_path):
    (tmp_path / "a & b").mkdir()
    for count, name in enumerate(["one.vtp", "a & b/two.vtp"], start=1):
        vtk.write_spheres_vtp(tmp_path / name, demo_damaged().where(np.arange(1000) < count))
    entries = [(0.0, "one.vtp"), (1 / 3, tmp_path / "a & b" / "two.vtp")]
    reader = pv.get_reader(vtk.write_pvd(tmp_path / "spheres.pvd", entries))
    assert reader.time_values == [0.0, 1 / 3]
    for count, moment in enumerate(reader.time_values, start=1):
        reader.set_active_time_value(moment)
        assert reader.read()[0].n_points == count


def test_the_picture_is_drawn_or_the_process_was_killed_for_want_of_opengl(tmp_path):
    source = vtk.write_spheres_vtp(tmp_path / "spheres_damaged.vtp", demo_damaged())
    reason = picture.render_spheres_png(tmp_path / "spheres_3d.png", source, BOX)
    assert "exit code" not in reason, reason  # a Python error in the child
    assert (tmp_path / "spheres_3d.png").exists() == (reason == "")
    if not reason:
        assert pv.read(tmp_path / "spheres_3d.png").dimensions[:2] == (1500, 950)


CRASHES = {
    "segmentation fault": (
        "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
        "signal 11; no usable OpenGL?",
    ),
    "exit 139 as a shell tells it": ("import sys; sys.exit(139)", "exit code 139"),
    "error": ("raise RuntimeError('no context')", "exit code 1; RuntimeError: no context"),
    "nothing left": ("pass", "left no complete PNG"),
    "cut picture": (
        r"import json, sys; path = json.load(sys.stdin)['frames'][0][2]; "
        r"open(path, 'wb').write(b'\x89PNG\r\n\x1a\nhalf')",
        "left no complete PNG",
    ),
}


def test_a_dead_or_hanging_child_gives_a_reason_and_touches_nothing(tmp_path, monkeypatch):
    path = tmp_path / "spheres_3d.png"
    path.write_bytes(b"old")
    hang = ("import time; time.sleep(60)", "given up after 0.5 s")
    for name, (program, expected) in (CRASHES | {"hang": hang}).items():
        command = [sys.executable, "-c", program]
        monkeypatch.setattr(picture, "drawing_command", lambda *_, command=command: command)
        seconds = {"seconds": 0.5} if name == "hang" else {}
        assert expected in picture.render_spheres_png(path, "s.vtp", BOX, **seconds), name
        assert path.read_bytes() == b"old"
        assert list(tmp_path.iterdir()) == [path]
    monkeypatch.setattr(picture, "drawing_command", lambda *_: [str(tmp_path / "no-python")])
    assert "no 3-D picture" in picture.render_spheres_png(tmp_path / "v.png", "s.vtp", BOX)


def test_the_paraview_script_names_arrays_that_the_files_have(tmp_path):
    """It needs ParaView to run; here it compiles, and every array that it names is written."""
    script = vtk.write_macro(tmp_path / "paraview_view.py").read_text(encoding="utf-8")
    compile(script, "paraview_view.py", "exec")
    spheres = pv.read(vtk.write_spheres_vtp(tmp_path / "s.vtp", demo_damaged()))
    network = pv.read(vtk.write_network_vtp(tmp_path / "n.vtp", demo_analysis()))
    own = {*spheres.point_data, *network.point_data, "depth_mm"}
    assert set(re.findall(r'\("POINTS", "(\w+)"\)|\["POINTS", "(\w+)"\]', script)) <= {
        pair for name in own for pair in ((name, ""), ("", name))
    }
    assert "blocked" in network.cell_data


# ------------------------------------------------------------------------------------------------
# A real analysis.


SIDES = {"walls": (False, False, False), "periodic": (True, True, True)}


@cache
def analysis_of(sides="walls", *, damaged=True, moved=False):
    after = demo_damaged()
    if moved:
        shift = np.where(after.kind == Kind.GRAIN, 2e-6, 0.0)[:, None] * np.array([0.0, 1.0, 0.0])
        after = Snapshot(
            step=1,
            time_s=1.0,
            box=BOX,
            id=after.id,
            kind=after.kind,
            position=after.position + shift,
            radius=after.radius,
            velocity=after.velocity,
        )
    options = AnalysisChoices.of_pack(
        sections=4, law="thesis", damage_law="thesis", profile_bin_mm=0.2
    )
    return analyse(
        demo_grains(), after if damaged else None, periodic=SIDES[sides], options=options
    )


def fines_outside_others(spheres, periodic):
    """The fines that no sphere holds wholly, but for a thousandth of their radius."""
    apart = spheres.position[:, None] - spheres.position
    side = np.ptp(spheres.box, axis=1)
    distance = np.linalg.norm(apart - np.where(periodic, np.rint(apart / side) * side, 0), axis=2)
    inside = distance + 0.999 * spheres.radius[:, None] <= spheres.radius
    np.fill_diagonal(inside, val=False)
    return spheres.where(~inside.any(axis=1) & (spheres.kind == Kind.FINE))


def test_tables_of_a_real_analysis_agree_with_each_other(tmp_path):
    for number, sides in enumerate(SIDES):
        folder_ = tmp_path / str(number)
        folder_.mkdir()
        with naming(sides):
            analysis = analysis_of(sides)
            sections = pd.read_csv(tables.write_sections(folder_ / "sections.csv", analysis))
            profile = pd.read_csv(tables.write_profile(folder_ / "profile.csv", analysis))
            pores = pd.read_csv(tables.write_pores(folder_ / "pores.csv", analysis))
            throats = pd.read_csv(tables.write_throats(folder_ / "throats.csv", analysis))
            depth = fines_outside_others(demo_damaged(), SIDES[sides]).position[:, 0]
            for row in sections.itertuples():
                assert row.fines_count == ((depth >= row.x_lo_m) & (depth < row.x_hi_m)).sum()
            assert sections.fines_count.sum() == analysis.invaded_count
            assert profile.fines_fraction.sum() == pytest.approx(1, abs=1e-7)
            assert throats.throat_conns_0.max() < len(pores)
            assert throats.blocked.sum() == analysis.occupancy.blocked.sum()


def test_fluxes_in_paraview_follow_from_pressures_and_conductances(tmp_path):
    for sides, moved in (("walls", False), ("periodic", True)):
        analysis = analysis_of(sides, moved=moved)
        mesh = pv.read(vtk.write_network_vtp(tmp_path / f"{sides}.vtp", analysis))
        for state in ("initial", "damaged"):
            pressure = mesh.point_data[f"pressure_{state}"][mesh.lines.reshape(-1, 3)[:, 1:]]
            flux, known = mesh.cell_data[f"flux_{state}_m3"], np.isfinite(pressure).all(axis=1)
            conductance = mesh.cell_data[f"conductance_{state}_m3"]
            expected = conductance * mesh.cell_data["throat_share"] * -np.diff(pressure)[:, 0]
            assert known.mean() > 0.9
            near = 1e-9 * np.abs(flux).max()
            assert np.allclose(flux[known], expected[known], rtol=0, atol=near), (sides, state)


# ------------------------------------------------------------------------------------------------
# Sphere tables: nothing is lost by writing.


def columns(path, **units):
    """Position, radius and kind; without a column kind all are grains."""
    rows = read_csv(path, **units)
    kind = np.full(len(rows.radius), Kind.GRAIN) if rows.kind is None else rows.kind
    return rows.position, rows.radius, kind


def test_a_written_table_reads_back_to_the_same_doubles(tmp_path):
    snapshot = demo_damaged()
    position, radius, kind = columns(write_spheres(tmp_path / "s.csv", snapshot))
    assert np.array_equal(position, snapshot.position)
    assert np.array_equal(radius, snapshot.radius)
    assert np.array_equal(kind, snapshot.kind)


def test_spheres_just_off_a_section_edge_stay_on_their_side(tmp_path):
    edge = 0.003
    depth = np.array([np.nextafter(edge, 0), edge, np.nextafter(edge, 1), -5e-324, 0.0])
    fines = snapshot_of(np.column_stack([depth, depth * 0, depth * 0]), 1e-5, Kind.FINE)
    position, _, _ = columns(write_spheres(tmp_path / "s.csv", fines))
    assert (position[:, 0] >= edge).tolist() == [False, True, True, False, False]
    assert (position[:, 0] >= 0).tolist() == [True, True, True, False, True]


def csv_of(folder, text, *, encoding="utf-8"):
    path = folder / "in.csv"
    path.write_bytes(text.encode(encoding))
    return path


def test_plain_columns_are_in_the_given_unit(tmp_path):
    for number, (units, metres) in enumerate(
        [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("um", 1e-6)]
    ):
        folder_ = tmp_path / str(number)
        folder_.mkdir()
        with naming(units, metres):
            path = csv_of(folder_, "x,y,z,radius\n1,2,-3,4e0\n")
            position, radius, kind = columns(path, units=units)
            assert position[0] == pytest.approx([metres, 2 * metres, -3 * metres], rel=1e-15)
            assert radius[0] == pytest.approx(4 * metres, rel=1e-15)
            assert kind.tolist() == [Kind.GRAIN]


def test_comments_blank_lines_bom_crlf_quotes_and_column_order_are_fine(tmp_path):
    path = csv_of(
        tmp_path,
        '\ufeff# pack\r\n\r\n"kind", radius_m ,z_m,y_m,x_m\r\n# more\r\n'
        '"fine",4,3,2,1\r\n grain,8,7,6,5',
    )
    position, radius, kind = columns(path)
    assert position.tolist() == [[1, 2, 3], [5, 6, 7]]
    assert radius.tolist() == [4, 8]
    assert kind.tolist() == [Kind.FINE, Kind.GRAIN]


HEADER = "x,y,z,radius,kind\n"


GOOD = "1,2,3,1,grain\n"


BROKEN = {
    "nan": (HEADER + GOOD + "1,nan,3,1,grain\n", ":3: y is 'nan', expected a finite number"),
    "infinite": (HEADER + "1e999,2,3,1,grain\n", ":2: x is '1e999'"),
    "text": ("# c\n\n" + HEADER + GOOD + "1,2,zwei,1,grain\n", ":5: z is 'zwei'"),
    "empty value": (HEADER + "1,2,,1,grain\n", ":2: z is ''"),
    "python's underscore": (HEADER + "1_0,2,3,1,grain\n", ":2: x is '1_0'"),
    "negative radius": (
        HEADER + "1,2,3,-0.5,fine\n",
        ":2: radius is -0.5, expected a number above 0",
    ),
    "zero radius": (HEADER + "1,2,3,0,fine\n", ":2: radius is 0, expected"),
    "unknown kind": (HEADER + "1,2,3,1,sand\n", ":2: kind is 'sand', expected grain or fine"),
    "short row": (HEADER + GOOD + "1,2,3,1\n", ":3: 4 values, expected 5"),
    "long row": (HEADER + "1,2,3,1,grain,9\n", ":2: 6 values, expected 5"),
    "missing column": ("x,y,radius\n1,2,3\n", ":1: no column z"),
    "misspelt column": (
        "x,y,z,radiu\n",
        ":1: no column radius among 'x,y,z,radiu' (is 'radiu' meant?)",
    ),
    "column twice": ("x,y,z,radius,x\n", ":1: column 'x' occurs twice"),
    "two unit systems": ("x_m,y,z,radius\n", ":1: its columns are in different units (m, none)"),
    "no header": ("1,2,3,4,5\n", ":1: no header above 5 columns of numbers"),
    "a comment on diameters": ("# diameters\n1,2,3,4\n", ":2: no header above 4 columns"),
    "mixed separators": ("x;y;z;radius\n1;2,3,4\n", ":2: 2 values, expected 4"),
    "two radii": (
        "x,y,z,radius,diameter\n1,2,3,1,2\n1,2,3,1,3\n",
        ":3: diameter is 3, expected what radius says",
    ),
    "parts of no box": ("xs,ys,zs,radius\n0,0,0,1\n", ":1: no column x, y, z among"),
    "an unknown unit": ("x_nm,y_nm,z_nm,radius_nm\n0,0,0,1\n", ":1: no column x, y, z, radius"),
    "empty file": ("", "the file is empty"),
    "comments only": ("# a\n# b\n", "the file is empty"),
    "header only": (HEADER, "no spheres after the header"),
    "open quote": (HEADER + '"1,2,3,1,grain\n', ":2: unexpected end of data"),
}


def test_every_malformed_table_is_refused_with_file_and_line(tmp_path):
    for name, (text, message) in BROKEN.items():
        path = csv_of(tmp_path, text)
        with naming(name), pytest.raises(CaseError) as caught:
            read_csv(path, units="mm")
        assert str(caught.value).startswith(str(path)), name
        assert message in str(caught.value), name


def test_what_is_no_text_file_or_has_another_unit_is_refused(tmp_path):
    """Units are given exactly when the columns have none."""
    for header, units, message in (
        ("x_m,y_m,z_m,radius_m", "mm", "is in m; leave out"),
        ("x,y,z,radius", None, "give --units"),
        ("x,y,z,radius", "inch", "units 'inch': expected one of m, cm, mm, um"),
    ):
        with pytest.raises(CaseError, match=message):
            read_csv(csv_of(tmp_path, header + "\n1,2,3,4\n"), units=units)
    with pytest.raises(CaseError, match="No such file"):
        read_csv(tmp_path / "none.csv", units="m")
    with pytest.raises(CaseError, match="irectory"):
        read_csv(tmp_path, units="m")
    with pytest.raises(CaseError, match="radius is '4 µm'"):
        read_csv(csv_of(tmp_path, "x,y,z,radius\n1,2,3,4 µm", encoding="latin-1"), units="m")
