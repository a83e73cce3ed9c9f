"""CSV tables, summary.json and ParaView files: their sums, and no half files."""

import json
import re
import shutil
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
from builders import disk_of, naming

import fdnet
from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.files import replacing, write_text
from fdnet.report import picture, vtk
from fdnet.report.tables import write_sections, write_summary
from fdnet.spheres.readers import read_spheres
from fdnet.spheres.snapshot import Kind

pytestmark = pytest.mark.liggghts
BOX = np.array([[0.0, 4e-3], [0.0, 2e-3], [0.0, 2e-3]])


def test_tables_agree_with_each_other(finished, analysed):
    run, depth = finished, finished.spheres().fines().position[:, 0]
    sections, profile = run.sections, run.profile
    for row in sections.itertuples():
        assert row.fines_count == np.sum((row.x_lo_m <= depth) & (depth < row.x_hi_m))
    assert sections.fines_fraction.sum() == pytest.approx(1, abs=1e-8)
    lost = profile.porosity_initial - profile.porosity_damaged
    assert np.allclose(profile.porosity_reduction, lost, rtol=0, atol=2e-9)
    assert np.array_equal(profile.x_lo_m[1:], profile.x_hi_m[:-1])
    assert profile.fines_fraction.sum() == pytest.approx(1, abs=1e-7)
    assert run.throats.throat_conns_0.max() < len(run.pores)
    assert run.throats.blocked.sum() == analysed.occupancy.blocked.sum()


def test_section_edges_are_written_to_the_last_bit_and_no_flow_has_no_reduction(
    analysed, tmp_path
):
    edges = 0.1 + np.arange(3) / 3
    rows = [
        replace(row, x_lo=np.float64(low), x_hi=np.float64(high))
        for row, low, high in zip(analysed.sections, edges, edges[1:], strict=False)
    ]
    rows[0] = replace(rows[0], k_initial=0.0, k_damaged=0.0, k_reduction=None)
    path = write_sections(tmp_path / "s.csv", replace(analysed, sections=tuple(rows)))
    written = pd.read_csv(path)
    assert written.x_lo_m.tolist() == edges[:2].tolist()
    assert written.x_hi_m.tolist() == edges[1:].tolist()
    assert written.k_reduction.isna().tolist() == [True, False]
    assert ",0,0,," in path.read_text()


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
    for warning, name in zip(read["warnings"][1:], ("solver.mass_", "sections[0]."), strict=True):
        assert name in warning


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path):
    path = write_text(tmp_path / "a.csv", "old")
    with pytest.raises(TypeError):
        write_summary(tmp_path / "summary.json", {"oops": object()})
    with pytest.raises(ZeroDivisionError), replacing(path) as part:
        part.write_text("half") // 0
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_spheres_read_back_in_metres_and_from_no_spheres(finished, tmp_path):
    snapshot = finished.spheres()
    path = vtk.write_spheres_vtp(tmp_path / "spheres_damaged.vtp", snapshot)
    mesh = pv.read(path)
    assert np.array_equal(mesh.points, snapshot.position)
    for name, array in vtk.SPHERE_ARRAYS.items():
        assert np.array_equal(mesh.point_data[array], getattr(snapshot, name))
    assert np.array_equal(read_spheres(path).radius, snapshot.radius)
    with pytest.raises(CaseError, match=r"radius_m is in m; leave out --units mm"):
        read_spheres(path, units="mm")
    none = vtk.write_spheres_vtp(tmp_path / "spheres_none.vtp", snapshot.grains().fines())
    assert pv.read(none).n_points == 0


def test_a_mesh_on_a_full_disk_is_an_error_and_vtk_is_silent(analysed, tmp_path, capfd, caplog):
    with disk_of("8k", tmp_path / "disk") as place, pytest.raises(OSError, match="No space left"):
        vtk.write_network_vtp(place / "network.vtp", analysed)
    assert capfd.readouterr().err == ""
    assert caplog.records == []


def test_a_collection_reads_back_with_its_times(finished, tmp_path):
    spheres = finished.spheres()
    (tmp_path / "a & b").mkdir()
    for count, name in enumerate(["one.vtp", "a & b/two.vtp"], start=1):
        vtk.write_spheres_vtp(tmp_path / name, spheres.where(np.arange(len(spheres)) < count))
    entries = [(0.0, "one.vtp"), (1 / 3, tmp_path / "a & b" / "two.vtp")]
    reader = pv.get_reader(vtk.write_pvd(tmp_path / "spheres.pvd", entries))
    assert reader.time_values == [0.0, 1 / 3]
    for count, moment in enumerate(reader.time_values, start=1):
        reader.set_active_time_value(moment)
        assert reader.read()[0].n_points == count


def test_the_picture_is_drawn_or_the_process_was_killed_for_want_of_opengl(finished, tmp_path):
    source, box = finished.path / "spheres_damaged.vtp", finished.spheres().box
    reason = picture.render_spheres_png(tmp_path / "spheres_3d.png", source, box)
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


def test_without_vtk_a_run_lacks_those_files_alone_and_says_so(
    finished, tmp_path, monkeypatch, capsys
):
    folder, mesh = tmp_path / "run", finished.path / "spheres_damaged.vtp"
    shutil.copytree(finished.path, folder)
    for name in ("pyvista", "vtkmodules"):
        monkeypatch.setitem(sys.modules, name, None)
    command = ["run", str(folder / "case.toml"), "--out", str(folder), "--stages", "report"]
    assert main([*command, "--force"]) == 0
    answer, said = capsys.readouterr()
    assert "permeability" in answer
    assert said.count("warning: no 3-D picture and no ParaView files") == 1
    lost = {"spheres.pvd", "invasion.pvd", "frames", "figures/spheres_3d.png", "paraview_view.py"}
    gone = {str(path.relative_to(finished.path)) for path in finished.path.rglob("*")}
    gone -= {str(path.relative_to(folder)) for path in folder.rglob("*")}
    assert lost <= gone <= lost | {name for name in gone if name.endswith(".vtp")}
    run = fdnet.open_run(folder)
    assert run.summary["k_damaged_m2"] == finished.summary["k_damaged_m2"]
    assert sum("pip install 'fdnet[view]'" in text for text in run.summary["warnings"]) == 1
    assert main(["movie", str(folder)]) == 2
    assert "pip install 'fdnet[view]'" in capsys.readouterr().err
    with pytest.raises(CaseError, match=r"needs VTK, .*pip install 'fdnet\[view\]'"):
        read_spheres(mesh)


def test_the_paraview_script_names_arrays_that_the_files_have(finished, tmp_path):
    """It needs ParaView to run; here it compiles, and every array that it names is written."""
    script = vtk.write_macro(tmp_path / "paraview_view.py").read_text(encoding="utf-8")
    compile(script, "paraview_view.py", "exec")
    spheres, network = (
        pv.read(finished.path / f"{name}.vtp") for name in ("spheres_damaged", "network")
    )
    own = {*spheres.point_data, *network.point_data, "depth_mm"}
    assert set(re.findall(r'\("POINTS", "(\w+)"\)|\["POINTS", "(\w+)"\]', script)) <= {
        pair for name in own for pair in ((name, ""), ("", name))
    }
    assert "blocked" in network.cell_data


def test_fluxes_in_paraview_follow_from_pressures_and_conductances(finished, tmp_path):
    """Also across periodic sides: the image of a pore has its pressure, a drop of 1 along x."""
    spheres = finished.spheres("initial"), finished.spheres()
    for periodic in ("", "xyz"):
        analysis = fdnet.analyse(*spheres, periodic=periodic, law="thesis", damage_law="thesis")
        mesh = pv.read(vtk.write_network_vtp(tmp_path / f"network{periodic}.vtp", analysis))
        pairs = mesh.lines.reshape(-1, 3)[:, 1:]
        assert np.allclose(mesh.points[pairs], analysis.network.throat_ends, rtol=0, atol=1e-12)
        volume = mesh.point_data["volume_m3"].sum()  # images hold none
        assert volume == pytest.approx(analysis.network.pore_volume.sum())
        for state in ("initial", "damaged"):
            pressure = mesh.point_data[f"pressure_{state}"][pairs]
            flux, known = mesh.cell_data[f"flux_{state}_m3"], np.isfinite(pressure).all(axis=1)
            conductance = mesh.cell_data[f"conductance_{state}_m3"]
            expected = conductance * mesh.cell_data["throat_share"] * -np.diff(pressure)[:, 0]
            assert known.mean() > 0.9
            near = 1e-9 * np.abs(flux).max()
            assert np.allclose(flux[known], expected[known], rtol=0, atol=near), (periodic, state)


# ---- Sphere tables.
def csv_of(folder, text, *, encoding="utf-8"):
    path = folder / "in.csv"
    path.write_bytes(text.encode(encoding))
    return path


def test_comments_blank_lines_bom_crlf_quotes_and_column_order_are_fine(tmp_path):
    path = csv_of(
        tmp_path,
        '\ufeff# pack\r\n\r\n"kind", radius_m ,z_m,y_m,x_m\r\n# more\r\n'
        '"fine",4,3,2,1\r\n grain,8,7,6,5',
    )
    rows = read_spheres(path)
    assert rows.position.tolist() == [[1, 2, 3], [5, 6, 7]]
    assert rows.radius.tolist() == [4, 8]
    assert rows.kind.tolist() == [Kind.FINE, Kind.GRAIN]


HEADER = "x,y,z,radius,kind\n"
GOOD = "1,2,3,1,grain\n"
BROKEN = {
    "nan": (HEADER + GOOD + "1,nan,3,1,grain\n", ":3: y is 'nan', expected a finite number"),
    "infinite": (HEADER + "1e999,2,3,1,grain\n", ":2: x is '1e999'"),
    "text": ("# c\n\n" + HEADER + GOOD + "1,2,zwei,1,grain\n", ":5: z is 'zwei'"),
    "empty value": (HEADER + "1,2,,1,grain\n", ":2: z is ''"),
    "python's underscore": (HEADER + "1_0,2,3,1,grain\n", ":2: x is '1_0'"),
    "negative radius": (HEADER + "1,2,3,-1,fine\n", ":2: radius is -1, expected a number above 0"),
    "zero radius": (HEADER + "1,2,3,0,fine\n", ":2: radius is 0, expected"),
    "unknown kind": (HEADER + "1,2,3,1,sand\n", ":2: kind is 'sand', expected grain or fine"),
    "short row": (HEADER + GOOD + "1,2,3,1\n", ":3: 4 values, expected 5"),
    "long row": (HEADER + "1,2,3,1,grain,9\n", ":2: 6 values, expected 5"),
    "missing column": ("x,y,radius\n1,2,3\n", ":1: no column z"),
    "misspelt": ("x,y,z,radiu\n", ":1: no column radius among 'x,y,z,radiu' (is 'radiu' meant?)"),
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
            read_spheres(path, units="mm")
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
            read_spheres(csv_of(tmp_path, header + "\n1,2,3,4\n"), units=units)
    for path, message in ((tmp_path / "none.csv", "No such file"), (tmp_path, "irectory")):
        with pytest.raises(CaseError, match=message):
            read_spheres(path, units="m")
    with pytest.raises(CaseError, match="radius is '4 µm'"):
        read_spheres(csv_of(tmp_path, "x,y,z,radius\n1,2,3,4 µm", encoding="latin-1"), units="m")
