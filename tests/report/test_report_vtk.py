"""ParaView files read back by an independent reader; the drawing child may die as it likes."""

import re
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv
from report_demo import BOX, demo_analysis, demo_damaged, demo_grains

from fdnet.errors import CaseError
from fdnet.report import picture, vtk
from fdnet.spheres.vtk_file import read_vtk


def test_network_lines_join_the_ends_of_their_throats(tmp_path):
    analysis = demo_analysis()
    mesh = pv.read(vtk.write_network_vtp(tmp_path / "network.vtp", analysis))
    network = analysis.network
    assert mesh.n_cells == len(network.throat_radius)
    assert mesh.n_verts == 0
    ends = mesh.points[mesh.lines.reshape(-1, 3)[:, 1:]]
    assert np.allclose(ends, network.throat_ends, rtol=0, atol=1e-12)
    assert np.array_equal(mesh.points[: len(network.pore_radius)], network.pore_position)
    assert np.array_equal(mesh.cell_data["conductance_damaged_m3"], analysis.conductance_damaged)
    assert np.array_equal(mesh.cell_data["blocked"], analysis.occupancy.blocked)


def test_pressures_at_the_faces_drive_every_flux(tmp_path):
    mesh = pv.read(vtk.write_network_vtp(tmp_path / "network.vtp", demo_analysis()))
    pressure = mesh.point_data["pressure_damaged"][mesh.lines.reshape(-1, 3)[:, 1:]]
    expected = mesh.cell_data["conductance_damaged_m3"] * (pressure[:, 0] - pressure[:, 1])
    assert np.allclose(
        mesh.cell_data["flux_damaged_m3"], expected, rtol=0, atol=1e-12 * np.abs(expected).max()
    )


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


def test_spheres_read_back(tmp_path):
    snapshot = demo_damaged()
    mesh = pv.read(vtk.write_spheres_vtp(tmp_path / "spheres_damaged.vtp", snapshot))
    assert np.array_equal(mesh.points, snapshot.position)
    for name, array in vtk.SPHERE_ARRAYS.items():
        assert np.array_equal(mesh.point_data[array], getattr(snapshot, name))


def test_no_spheres_make_an_empty_file(tmp_path):
    path = vtk.write_spheres_vtp(tmp_path / "spheres_none.vtp", demo_grains().fines())
    assert pv.read(path).n_points == 0


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


@pytest.mark.parametrize("name", CRASHES)
def test_a_dead_child_gives_a_reason_and_touches_nothing(tmp_path, monkeypatch, name):
    program, expected = CRASHES[name]
    monkeypatch.setattr(picture, "_command", lambda *_: [sys.executable, "-c", program])
    path = tmp_path / "spheres_3d.png"
    path.write_bytes(b"old")
    assert expected in picture.render_spheres_png(path, "s.vtp", BOX)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_hanging_child_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(
        picture, "_command", lambda *_: [sys.executable, "-c", "import time; time.sleep(60)"]
    )
    start = time.monotonic()
    assert picture.render_spheres_png(tmp_path / "v.png", "s.vtp", BOX, seconds=0.5).endswith(
        "given up after 0.5 s"
    )
    assert time.monotonic() - start < 20


def test_an_unwritable_folder_or_missing_interpreter_is_a_reason_too(tmp_path, monkeypatch):
    monkeypatch.setattr(picture, "_command", lambda *_: [str(tmp_path / "no-python")])
    assert "no 3-D picture" in picture.render_spheres_png(tmp_path / "v.png", "s.vtp", BOX)


def test_its_own_spheres_are_in_metres_and_no_other_unit_is_taken(tmp_path):
    snapshot = demo_damaged()
    path = vtk.write_spheres_vtp(tmp_path / "spheres_damaged.vtp", snapshot)
    assert np.array_equal(read_vtk(path).radius, snapshot.radius)
    with pytest.raises(CaseError, match=r"radius_m is in m; leave out --units mm"):
        read_vtk(path, units="mm")


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
