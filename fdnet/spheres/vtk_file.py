"""Spheres of a VTK file (.vtp or .vtu): points with a radius."""

from pathlib import Path
from typing import Any

import numpy as np

from fdnet.errors import CaseError
from fdnet.spheres.arrays import Array, frozen
from fdnet.spheres.rows import SphereRows, metres_per
from fdnet.spheres.snapshot import Kind

IN_METRES = "radius_m"
"""Point data of fdnet's own files, whose lengths are in m."""
SUFFIXES = (".vtp", ".vtu")


def read_vtk(path: Path, *, units: str | None = None) -> SphereRows:
    """The spheres of a .vtp or .vtu file, in metres.

    The centres are its points; the point data are `radius`, `radius_m` or `diameter`, and, if
    there, `kind` (1 grain, 2 fine), `type` and `id`. `units` is the unit of length of the file, m
    without it; with `radius_m` there is none to give. Raises CaseError where the file cannot be
    read, is empty, or holds no or impossible values.
    """
    scale = 1.0 if units is None else metres_per(units)
    mesh = _mesh(path)
    if IN_METRES in mesh.point_data and units not in (None, "m"):
        raise CaseError(f"{path}: its {IN_METRES} is in m; leave out --units {units}")
    position, radius = np.asarray(mesh.points, dtype=float), _radius(mesh, path)
    for name, values, good in (
        ("a centre that is not finite", position, np.isfinite(position).all(axis=1)),
        ("a radius that is not above 0", radius, np.isfinite(radius) & (radius > 0)),
    ):
        bad = np.flatnonzero(~good)
        if len(bad):
            raise CaseError(f"{path}: point {bad[0]} has {name} ({values[bad[0]]})")
    kind = _whole(mesh, "kind", path)
    if kind is not None and not np.isin(kind, list(Kind)).all():
        raise CaseError(
            f"{path}: kind holds {kind.min()} to {kind.max()}, expected 1 (grain) or 2"
        )
    return SphereRows(
        source=str(path),
        scale=scale,
        position=frozen(scale * position),
        radius=frozen(scale * radius),
        kind=kind,
        type=_whole(mesh, "type", path),
        id=_whole(mesh, "id", path),
        notes=() if units is not None else (f"The lengths of {path} are in m.",),
    )


def _mesh(path: Path) -> Any:
    import pyvista as pv

    if not path.is_file():
        raise CaseError(f"{path}: is no file; expected spheres as .vtp or .vtu")
    with pv.vtk_verbosity("off"):
        try:
            mesh = pv.read(path)
        except Exception as error:
            raise CaseError(f"{path}: cannot be read as a VTK file ({error})") from error
    if not getattr(mesh, "n_points", 0):
        raise CaseError(f"{path}: holds no points; expected spheres, one point each")
    return mesh


def _radius(mesh: Any, path: Path) -> Array:
    for name, factor in (("radius", 1.0), (IN_METRES, 1.0), ("diameter", 0.5)):
        if name in mesh.point_data:
            return factor * _one_each(mesh, name, path).astype(float)
    known = ", ".join(mesh.point_data.keys()) or "none"
    raise CaseError(
        f"{path}: no point data radius, radius_m or diameter (it has: {known}); write one of them"
    )


def _whole(mesh: Any, name: str, path: Path) -> Array | None:
    if name not in mesh.point_data:
        return None
    values = _one_each(mesh, name, path)
    if not np.all(np.isfinite(values)) or np.any(values != np.round(values)):
        raise CaseError(f"{path}: point data {name} holds a number that is not whole")
    return frozen(values, np.int64)


def _one_each(mesh: Any, name: str, path: Path) -> Array:
    values = np.asarray(mesh.point_data[name])
    if values.shape != (mesh.n_points,) or values.dtype.kind not in "iuf":
        raise CaseError(f"{path}: point data {name} is no number for each point")
    return values
