"""The ParaView files of a run as pyvista meshes, ready to plot."""

from pathlib import Path
from typing import Any

from fdnet.errors import CaseError

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
    """The spheres in a .vtp file as balls, m, with `radius_m`, `kind` and `id` on them.

    In files of earlier versions the array is named `radius`.
    """
    import pyvista as pv

    points = read_mesh(path)
    ball = pv.Sphere(radius=1.0, theta_resolution=ROUNDNESS, phi_resolution=ROUNDNESS)
    name = "radius_m" if "radius_m" in points.point_data else "radius"
    return points.glyph(geom=ball, scale=name, orient=False)
