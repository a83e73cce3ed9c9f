"""ParaView files (.vtp, .pvd) of a run, written and read."""

import errno
import os
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

from fdnet.errors import VIEW, CaseError
from fdnet.files import write_bytes, write_text
from fdnet.report.tables import blocked_throats, pore_porosity
from fdnet.spheres.snapshot import Array, Snapshot

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

SPHERE_ARRAYS = {"radius": "radius_m", "kind": "kind", "id": "id", "velocity": "velocity_m_s"}
"""Names of the point data of sphere files, by the attribute of a snapshot."""
LAW_CODES = {"clean": 0, "deposition": 1, "clogging": 2, "blocked": 3, "sections": 5}


def view_missing() -> str:
    """Why VTK and pyvista cannot be loaded; "" where they can."""
    try:
        import pyvista  # noqa: F401
        from vtkmodules import vtkIOXML  # noqa: F401
    except ImportError as error:
        return str(error)
    return ""


def refuse_without_view(what: str) -> None:
    """Raise CaseError where VTK or pyvista cannot be loaded; `what` is what needs them."""
    if why := view_missing():
        raise CaseError(f"{what}: needs VTK, which cannot be loaded ({why}); {VIEW}")


def write_network_vtp(path: str | Path, analysis: "Analysis") -> Path:
    """The pore network: pores as points, throats as lines.

    Points 0 .. P-1 are the pores. Further points (`end` 1) are where a throat leaves the network
    at a face or goes to a periodic image, so that no line crosses the whole box. Conductances are
    times viscosity (m3), fluxes times viscosity over the pressure drop (m3), pressures over the
    pressure drop; law_used is as in `LAW_CODES`.
    """
    network, occupancy = analysis.network, analysis.occupancy
    mesh, source, periods = _network_mesh(network)
    clean, damaged = np.asarray([analysis.conductance_initial, analysis.conductance_damaged])
    none = np.zeros(len(clean))
    codes = [LAW_CODES.get(str(name), -1) for name in analysis.law_used]
    cells = {
        "throat_radius_m": network.throat_radius,
        "throat_length_m": network.throat_length,
        "throat_share": network.throat_share,
        "porosity": none + 1.0 if occupancy is None else occupancy.throat_porosity,
        "fines": none.astype(int) if occupancy is None else occupancy.throat_fines,
        "blocked": blocked_throats(analysis).astype(np.uint8),
        "law_used": np.array(codes, np.int8),
        "conductance_initial_m3": clean,
        "conductance_damaged_m3": damaged,
        "flux_initial_m3": analysis.flow_initial.throat_flux,
        "flux_damaged_m3": analysis.flow_damaged.throat_flux,
        "conductance_lost": 1.0 - np.divide(damaged, clean, out=none + 1.0, where=clean > 0),
    }
    mesh.cell_data.update(cells)

    def with_ends(values: Array, inlet: float, outlet: float) -> Array:
        """Values of the pores, then of the ends: those of their pores, or of the faces."""
        ends = np.where(source == -1, inlet, outlet)
        ends[source >= 0] = np.asarray(values)[source[source >= 0]]
        return np.append(values, ends)

    # along a periodic x the pressure falls by 1 per period
    fall = np.append(np.zeros(len(network.pore_radius)), periods * network.periodic[0])
    nothing = np.zeros(len(source))
    points = {
        "pressure_initial": with_ends(analysis.flow_initial.pore_pressure, 1.0, 0.0) - fall,
        "pressure_damaged": with_ends(analysis.flow_damaged.pore_pressure, 1.0, 0.0) - fall,
        "radius_m": with_ends(network.pore_radius, 0.0, 0.0),
        "porosity": with_ends(pore_porosity(analysis), np.nan, np.nan),
        "volume_m3": np.append(network.pore_volume, nothing),
        "share": np.append(network.pore_share, nothing),
        "end": np.repeat(np.array([0, 1], np.uint8), [len(network.pore_radius), len(source)]),
    }
    mesh.point_data.update(points)
    return _save(path, mesh)


def _network_mesh(network: Any) -> tuple[Any, Array, Array]:
    """The throats as lines, m: the P pores are the first points, then E further ends.

    With the pore (E,) that each end is an image of, -1 and -2 beyond the inlet and outlet face,
    and the number (E,) of periods along x between both.
    """
    import pyvista as pv

    pores, lines = np.asarray(network.pore_position), np.array(network.throat_pores)
    ends, source = np.asarray(network.throat_ends).reshape(-1, 3), lines.ravel().copy()
    away = source < 0
    away[~away] = np.linalg.norm(ends[~away] - pores[source[~away]], axis=1) > 1e-9
    points, source = ends[away], source[away]
    lines[away.reshape(lines.shape)] = len(pores) + np.arange(len(points))
    periods = np.rint((points[:, 0] - pores[source, 0]) / np.ptp(network.box[0]))
    places = np.concatenate([pores, points])
    mesh = pv.PolyData(places, lines=np.insert(lines, 0, 2, axis=1).ravel())
    return mesh, source, np.where(source < 0, 0, periods)


def write_spheres_vtp(path: str | Path, snapshot: Snapshot) -> Path:
    """The spheres as points with `radius_m`, `kind` (1 grain, 2 fine), `id` and `velocity_m_s`.

    In ParaView: Glyph, sphere of radius 1, scaled by `radius_m`.
    """
    import pyvista as pv

    mesh = pv.PolyData(np.array(snapshot.position)) if len(snapshot) else pv.PolyData()
    for name, array in SPHERE_ARRAYS.items() if len(snapshot) else ():
        mesh.point_data[array] = np.array(getattr(snapshot, name))
    return _save(path, mesh)


def write_pvd(path: str | Path, entries: Sequence[tuple[float, str | Path]]) -> Path:
    """A ParaView collection of (time in s, file); files are named relative to its folder."""
    folder = Path(path).resolve().parent
    rows = "".join(
        f'    <DataSet timestep={quoteattr(repr(float(time)))} part="0" '
        f"file={quoteattr(Path(os.path.relpath(Path(folder, file), folder)).as_posix())}/>\n"
        for time, file in entries
    )
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
    return write_text(path, f"{head}{rows}  </Collection>\n</VTKFile>\n")


def write_macro(path: str | Path) -> Path:
    """The script that opens a run in ParaView as the report shows it, next to the run's files."""
    macro = resources.files("fdnet.report").joinpath("paraview_view.py.txt")
    return write_text(path, macro.read_text(encoding="utf-8"))


def _save(path: str | Path, mesh: Any) -> Path:
    """Write the mesh. Raises OSError where it cannot be written.

    VTK makes the file in memory alone: on a full disk its own writer aborts the whole process.
    """
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(mesh)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    if not writer.Write():
        raise OSError(errno.EIO, "VTK could not make the file", str(path))
    return write_bytes(path, writer.GetOutputString().encode())


def write_flux_vtp(path: str | Path, network: Any, values: Array) -> Path:
    """The throats of a network as lines, m, with `values` (T,) as `value`, for a picture."""
    mesh, *_ = _network_mesh(network)
    mesh.cell_data["value"] = np.asarray(values, float)
    return _save(path, mesh)


def write_lines_vtp(path: str | Path, lines: Sequence[tuple[Array, Array]]) -> Path:
    """Lines of points (M, 3) m, each with its values (M,) as `value`, for a picture."""
    import pyvista as pv

    counts = [len(points) for points, _ in lines]
    if not counts:
        return _save(path, pv.PolyData())
    first = np.cumsum([0, *counts[:-1]])
    cells = [np.append(n, at + np.arange(n)) for n, at in zip(counts, first, strict=True)]
    mesh = pv.PolyData(
        np.concatenate([points for points, _ in lines]), lines=np.concatenate(cells)
    )
    mesh.point_data["value"] = np.concatenate([values for _, values in lines])
    return _save(path, mesh)


# ---- The ParaView files of a run as pyvista meshes, ready to plot.
def read_mesh(path: Path) -> Any:
    """The mesh in a .vtp file, m. Raises CaseError when it is missing, unreadable or empty."""
    refuse_without_view(str(path))
    import pyvista as pv

    if not path.exists():
        how = f"fdnet run CASE.toml --out {path.parent} --stages report"
        raise CaseError(f"{path}: is missing; write it with {how}")
    with pv.vtk_verbosity("off"):
        try:
            mesh = pv.read(path)
        except Exception as error:
            raise CaseError(f"{path}: cannot be read as a VTK file ({error})") from error
    if not mesh.n_points:
        raise CaseError(f"{path}: holds no points; write it anew with --stages report --force")
    return mesh


def read_balls(path: Path) -> Any:
    """The spheres in a .vtp file as balls, m, with `radius_m`, `kind` and `id` on them."""
    spheres = read_mesh(path)
    import pyvista as pv

    ball = pv.Sphere(radius=1.0, theta_resolution=16, phi_resolution=16)
    return spheres.glyph(geom=ball, scale="radius_m", orient=False)
