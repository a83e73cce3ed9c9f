"""Spheres of a VTK file (.vtp, .vtu or .vtk): points with a radius.

VTK ends its process on some malformed files, so that they are read in a process of their own,
which hands back the points and their data as arrays.
"""

import os
import re
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.errors import VIEW, CaseError
from fdnet.spheres.rows import PLACES, RADII, SphereRows, columns_of, named, rows_from, scale_of
from fdnet.spheres.snapshot import Array

SUFFIXES = (".vtp", ".vtu", ".vtk")
LEGACY, XML = b"# vtk DataFile", b"<VTKFile"
_COORDINATES = {name for names in PLACES for name in names}
_KIND = re.compile(rb"<VTKFile[^>]*\btype\s*=\s*[\"'](PolyData|UnstructuredGrid)\b")
_SECONDS = 600
_MEMORY, _GROWTH = 2**30, 20
"""Memory that the child may take, bytes, besides this many times the size of the file."""


def vtk_spheres(data: bytes, source: str, *, units: str | None = None) -> SphereRows:
    """The spheres of a .vtp, .vtu or legacy .vtk file, in metres; `kind` is 1 or 2 there.

    Raises CaseError where the file cannot be read, is empty, or holds no or impossible values.
    """
    arrays = _read_apart(data, source)
    points = arrays.pop("points")
    if not len(points):
        raise CaseError(f"{source}: holds no points; expected spheres, one point each")
    plain = {name: named(name) for name in arrays}
    unit = next((f"_{unit}" for one, unit in plain.values() if unit and one in RADII), "")
    data_names = [name for name, (one, _) in plain.items() if one not in _COORDINATES]
    names = (*(f"{axis}{unit}" for axis in "xyz"), *data_names)
    sized = columns_of(names, f"{source}: point data")
    values = dict(enumerate(points.astype(float).T))
    for index in sized.needed[3:]:
        values[index] = one = arrays[names[index]]
        if one.shape != (len(points),) or one.dtype.kind not in "iuf":
            raise CaseError(f"{source}: point data {names[index]} is no number for each point")
    scale = scale_of(sized, units, source)
    return rows_from(
        sized,
        values,
        lambda row: f"{source}: point {row}",
        scale=1.0 if scale is None else scale,
        source=source,
        notes=(f"The lengths of {source} are in m.",) if scale is None else (),
    )


def _read_apart(data: bytes, source: str) -> dict[str, Array]:
    """The arrays of the points of a file, and its points, read by VTK in a process of its own.

    Raises CaseError, with VTK's own words, where that process fails.
    """
    reader = "vtkGenericDataObjectReader"
    if not data.startswith(LEGACY):
        kind = _KIND.search(data[:10_000])
        if kind is None:
            raise CaseError(
                f"{source}: cannot be read as a VTK file of points; expected .vtp, .vtu or a "
                "legacy .vtk file"
            )
        reader = f"vtkXML{kind[1].decode()}Reader"
    if find_spec("vtkmodules") is None:
        raise CaseError(f"{source}: needs VTK, which is not installed; {VIEW}, or give a table")
    root, given = str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH")
    paths = os.pathsep.join([root, given] if given else [root])
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "in").write_bytes(data)
        try:
            done = subprocess.run(
                [sys.executable, "-m", "fdnet.spheres.vtk_file", reader, folder],
                capture_output=True,
                check=False,
                stdin=subprocess.DEVNULL,
                timeout=_SECONDS,
                env=os.environ | {"PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"},
            )
        except subprocess.TimeoutExpired as error:
            raise CaseError(f"{source}: VTK does not end reading it; write it again") from error
        said = re.sub(r"\x1b\[[0-9;]*m", "", done.stderr.decode("utf-8", "replace"))
        if done.returncode or "ERR|" in said:
            why = re.search(r"ERR\|\s*(.*)", said) or re.search(r"(\S.*)\s*$", said)
            how = why[1].strip()[:200] if why else "VTK failed"
            how = f"VTK ended by signal {-done.returncode}" if done.returncode < 0 else how
            raise CaseError(f"{source}: cannot be read as a VTK file ({how}); write it again")
        with np.load(Path(folder) / "out.npz", allow_pickle=False) as arrays:
            return {str(name): arrays[str(k)] for k, name in enumerate(arrays["names"])}


def _child(reader_name: str, folder: Path) -> None:
    """Read `in` of the folder, write its points and point data as `out.npz`."""
    import resource

    from vtkmodules import vtkIOLegacy, vtkIOXML
    from vtkmodules.util.numpy_support import vtk_to_numpy

    statm = Path("/proc/self/statm")
    if statm.is_file():
        taken = int(statm.read_text().split()[0]) * resource.getpagesize()
        most = taken + _MEMORY + _GROWTH * (folder / "in").stat().st_size
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    module = vtkIOXML if hasattr(vtkIOXML, reader_name) else vtkIOLegacy
    reader: Any = getattr(module, reader_name)()
    reader.SetFileName(str(folder / "in"))
    if module is vtkIOLegacy:
        reader.ReadAllScalarsOn()
        reader.ReadAllFieldsOn()
    reader.Update()
    mesh = reader.GetOutput()
    if reader.GetErrorCode() or mesh is None:
        sys.exit(f"VTK reports the error {reader.GetErrorCode()}")
    points = mesh.GetPoints() if hasattr(mesh, "GetPoints") else None
    if points is None:
        sys.exit("it holds no points")
    data = mesh.GetPointData()
    given = filter(None, map(data.GetArray, range(data.GetNumberOfArrays())))
    by_name = {array.GetName(): vtk_to_numpy(array) for array in given if array.GetName()}
    by_name["points"] = vtk_to_numpy(points.GetData())
    arrays: dict[str, Any] = {str(k): one for k, one in enumerate(by_name.values())}
    np.savez(folder / "out.npz", names=np.array(list(by_name)), **arrays)


if __name__ == "__main__":
    _child(sys.argv[1], Path(sys.argv[2]))
