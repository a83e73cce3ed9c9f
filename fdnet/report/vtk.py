"""ParaView files, meshes and the view in the report.

ParaView files (.vtp, .pvd) of one specimen.
"""

import base64
import errno
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

from fdnet.errors import CaseError
from fdnet.files import write_bytes, write_text
from fdnet.report.tables import blocked_throats, pore_porosity
from fdnet.spheres.snapshot import Array, Snapshot

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

SPHERE_ARRAYS = {"radius": "radius_m", "kind": "kind", "id": "id", "velocity": "velocity_m_s"}
"""Names of the point data of sphere files, by the attribute of a snapshot."""
LAW_CODES = {"clean": 0, "deposition": 1, "clogging": 2, "blocked": 3, "sections": 5}


def write_network_vtp(path: str | Path, analysis: "Analysis") -> Path:
    """The pore network: pores as points, throats as lines.

    Points 0 .. P-1 are the pores. Further points (`end` 1) are where a throat leaves the network
    at a face or goes to a periodic image, so that no line crosses the whole box. Cell data:
    geometry and porosity of the throats, conductances (times viscosity, m3), fluxes (times
    viscosity over the pressure drop, m3), share of the conductance lost, blocked, law_used as in
    `LAW_CODES`. Point data: pressure over the pressure drop, radius (m), volume (m3).
    """
    import pyvista as pv

    drawing = _drawing(analysis.network)
    mesh = pv.PolyData(drawing.points, lines=np.insert(drawing.lines, 0, 2, axis=1).ravel())
    for name, values in _throat_data(analysis).items():
        mesh.cell_data[name] = values
    for name, values in _pore_data(analysis, drawing).items():
        mesh.point_data[name] = values
    return _save(path, mesh)


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
    """A ParaView collection of (time in s, file).

    The files are named relative to the folder of `path`.
    """
    folder = Path(path).resolve().parent
    rows = "".join(
        f'    <DataSet timestep={quoteattr(repr(float(time)))} part="0" '
        f"file={quoteattr(Path(os.path.relpath(Path(folder, file), folder)).as_posix())}/>\n"
        for time, file in entries
    )
    return write_text(
        path,
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
        f"{rows}  </Collection>\n</VTKFile>\n",
    )


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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Drawing:
    """The network as points and lines, with E extra ends for P pores and T throats.

    Attributes:
        points: (P+E, 3) m, pores first.
        lines: (T, 2) indices of points.
        source: (E,) pore that the end is an image of; -1 and -2 beyond the inlet and outlet face.
        periods: (E,) number of periods along x between the end and that pore.
    """

    points: Array
    lines: Array
    source: Array
    periods: Array


def _drawing(network: Any) -> _Drawing:
    pores, lines = np.asarray(network.pore_position), np.array(network.throat_pores)
    ends, source = np.asarray(network.throat_ends).reshape(-1, 3), lines.ravel().copy()
    away = source < 0
    away[~away] = np.linalg.norm(ends[~away] - pores[source[~away]], axis=1) > 1e-9
    points, source = ends[away], source[away]
    lines[away.reshape(lines.shape)] = len(pores) + np.arange(len(points))
    periods = np.where(
        source < 0, 0, np.rint((points[:, 0] - pores[source, 0]) / np.ptp(network.box[0]))
    )
    return _Drawing(
        points=np.concatenate([pores, points]), lines=lines, source=source, periods=periods
    )


def _throat_data(analysis: "Analysis") -> dict[str, Array]:
    network, occupancy, count = (
        analysis.network,
        analysis.occupancy,
        len(analysis.network.throat_radius),
    )
    codes = [LAW_CODES.get(str(name), -1) for name in analysis.law_used]
    return {
        "throat_radius_m": network.throat_radius,
        "throat_length_m": network.throat_length,
        "throat_share": network.throat_share,
        "porosity": np.ones(count) if occupancy is None else occupancy.throat_porosity,
        "fines": np.zeros(count, int) if occupancy is None else occupancy.throat_fines,
        "blocked": blocked_throats(analysis).astype(np.uint8),
        "law_used": np.array(codes, np.int8),
        "conductance_initial_m3": analysis.conductance_initial,
        "conductance_damaged_m3": analysis.conductance_damaged,
        "flux_initial_m3": analysis.flow_initial.throat_flux,
        "flux_damaged_m3": analysis.flow_damaged.throat_flux,
        "conductance_lost": _lost(analysis),
    }


def _lost(analysis: "Analysis") -> Array:
    """(T,) share of the conductance that each throat lost; 0 where it had none."""
    clean = np.asarray(analysis.conductance_initial)
    damaged = np.asarray(analysis.conductance_damaged)
    return 1.0 - np.divide(damaged, clean, out=np.ones(len(clean)), where=clean > 0)


def _pore_data(analysis: "Analysis", drawing: _Drawing) -> dict[str, Array]:
    """Values of each point; an extra end has those of its pore or its face, and no volume."""
    network, count = analysis.network, len(analysis.network.pore_radius)
    source, none = drawing.source, np.zeros(len(drawing.source))
    porosity = pore_porosity(analysis)
    pressures = {
        "pressure_initial": analysis.flow_initial.pore_pressure,
        "pressure_damaged": analysis.flow_damaged.pore_pressure,
    }
    fall = (
        drawing.periods if network.periodic[0] else none
    )  # periodic x: the pressure falls by 1 per period
    data = {
        name: np.append(p, _of_ends(p, source, (1.0, 0.0)) - fall) for name, p in pressures.items()
    }
    return data | {
        "radius_m": np.append(
            network.pore_radius, _of_ends(network.pore_radius, source, (0.0, 0.0))
        ),
        "porosity": np.append(porosity, _of_ends(porosity, source, (np.nan, np.nan))),
        "volume_m3": np.append(network.pore_volume, none),
        "share": np.append(network.pore_share, none),
        "end": np.append(np.zeros(count, np.uint8), np.ones(len(source), np.uint8)),
    }


def _of_ends(values: Array, source: Array, faces: tuple[float, float]) -> Array:
    """Value (E,) of the pore that each extra end is an image of, or of its face in `faces`."""
    ends = np.where(source == -1, *faces)
    ends[source >= 0] = np.asarray(values)[source[source >= 0]]
    return ends


def write_flux_vtp(path: str | Path, network: Any, values: Array) -> Path:
    """The throats of a network as lines, m, with `values` (T,) as `value`, for a picture."""
    import pyvista as pv

    drawing = _drawing(network)
    mesh = pv.PolyData(drawing.points, lines=np.insert(drawing.lines, 0, 2, axis=1).ravel())
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


# ------------------------------------------------------------------------------------------------
# The ParaView files of a run as pyvista meshes, ready to plot.


ROUNDNESS = 16
"""Segments around a ball."""


def read_mesh(path: Path) -> Any:
    """The mesh in a .vtp file, m. Raises CaseError when it is missing, unreadable or empty."""
    import pyvista as pv

    if not path.exists():
        raise CaseError(
            f"{path}: is missing; write it with fdnet run CASE.toml --out {path.parent} "
            "--stages report"
        )
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
    import pyvista as pv

    points = read_mesh(path)
    ball = pv.Sphere(radius=1.0, theta_resolution=ROUNDNESS, phi_resolution=ROUNDNESS)
    return points.glyph(geom=ball, scale="radius_m", orient=False)


# ------------------------------------------------------------------------------------------------
# The spheres of the page's 3-D view, as JSON that its script reads.


MM, MICRON = 1e3, 1e6
MOST_SPHERES = 40_000
"""Spheres up to which a page has a 3-D view: half a megabyte."""
UPSTREAM_SHOWN = 0.12
"""Share of the length upstream of the face up to which fines are shown."""
STEPS = 65535


def view_of(spheres: Snapshot) -> Mapping[str, Any] | None:
    """Grains and fines for the view; None where there are more than `MOST_SPHERES`, or none.

    `data` is base64 of (N, 4) unsigned 16-bit numbers, little endian, grains first: x, y and z
    from `low` to `high` (mm), and the radius from 0 to `radius` (mm). `grains` is their number.
    """
    length = float(np.ptp(spheres.box[0]))
    shown = spheres.position[:, 0] > spheres.box[0, 0] - UPSTREAM_SHOWN * length
    grains, fines = spheres.grains(), spheres.where(shown).fines()
    if not 0 < len(grains) + len(fines) <= MOST_SPHERES:
        return None
    position = np.concatenate([grains.position, fines.position]) * MM
    radius = np.concatenate([grains.radius, fines.radius]) * MM
    low, high = position.min(axis=0), position.max(axis=0)
    table = np.column_stack([_steps(position, low, high), _steps(radius, 0.0, radius.max())])
    sizes = np.unique(np.round(fines.radius * MICRON, 6)) if len(fines) else np.zeros(0)
    return {
        "grains": len(grains),
        "spheres": len(radius),
        "low": low.tolist(),
        "high": high.tolist(),
        "radius": float(radius.max()),
        "box": (np.asarray(spheres.box) * MM).tolist(),
        "one_size": len(sizes) <= 1,
        "data": base64.b64encode(table.astype("<u2").tobytes()).decode("ascii"),
    }


def _steps(value: Array, low: Any, high: Any) -> Array:
    """`value` as whole steps of 0 to `STEPS` between `low` and `high`."""
    span = np.where(np.asarray(high) > low, np.asarray(high) - low, 1.0)
    return np.rint((value - low) / span * STEPS)
