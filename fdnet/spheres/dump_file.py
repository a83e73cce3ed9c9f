"""Spheres of a LIGGGHTS or LAMMPS text dump."""

from pathlib import Path

import numpy as np

from fdnet.errors import CaseError
from fdnet.spheres.arrays import Array, frozen
from fdnet.spheres.dump import Frame, read_dump
from fdnet.spheres.rows import SphereRows, metres_per

PLACES = (("x", "y", "z"), ("xu", "yu", "zu"))
SCALED = ("xs", "ys", "zs")
"""Columns of the centres: as they are, unwrapped across periods, or in parts of the box."""
_LARGEST_WHOLE = 2.0**53
DUMP_UNITS = {"si": 1.0, "cgs": 1e-2, "micro": 1e-6}
"""Metres in the unit of length of the unit systems that a dump may name."""


def read_dump_spheres(
    path: Path, *, units: str | None = None, step: int | None = None
) -> SphereRows:
    """The spheres of one frame of a dump, in metres: the last frame, or the one of `step`.

    Columns: type, x y z (or xu yu zu, or xs ys zs in parts of the box), radius or diameter, and id
    if there is one. `units` is the unit of length of the dump. Without it the unit is that of the
    dump's own unit system, or m where it names none. Raises DumpError where
    the file is malformed or cut, CaseError where `step`, a column or the unit is missing.
    """
    frames = read_dump(path)
    frame = _chosen(frames, path, step)
    scale = _scale(frame, path) if units is None else metres_per(units)
    radius = _radius(frame, path)
    bad = np.flatnonzero(~(radius > 0))
    if len(bad):
        raise CaseError(
            f"{path}: step {frame.step}: row {bad[0] + 1} by id has the radius "
            f"{radius[bad[0]]:g}, expected a number above 0"
        )
    assumed = units is None and not frame.units
    notes = [f"The lengths of {path} are in m."] if assumed else []
    if len(frames) > 1 and step is None:
        notes.append(f"The last of {len(frames)} frames of {path} was used, step {frame.step}.")
    return SphereRows(
        source=str(path),
        scale=scale,
        position=frozen(scale * _position(frame, path)),
        radius=frozen(scale * radius),
        type=_whole(frame, "type", path),
        id=_whole(frame, "id", path),
        box=frozen(scale * frame.box),
        step=frame.step,
        notes=tuple(notes),
    )


def _chosen(frames: list[Frame], path: Path, step: int | None) -> Frame:
    if not frames:
        raise CaseError(f"{path}: the dump holds no frame; expected ITEM: TIMESTEP and its rows")
    chosen = frames if step is None else [frame for frame in frames if frame.step == step]
    if not chosen:
        steps = [frame.step for frame in frames]
        known = ", ".join(map(str, steps[:5])) + (", ..." if len(steps) > 5 else "")
        raise CaseError(f"{path}: no frame of step {step}; the file has {known}")
    if not len(chosen[-1].rows):
        raise CaseError(f"{path}: step {chosen[-1].step} holds no spheres; choose another step")
    return chosen[-1]


def _scale(frame: Frame, path: Path) -> float:
    if frame.units and frame.units not in DUMP_UNITS:
        raise CaseError(
            f"{path}: its units are {frame.units!r}, which fdnet cannot convert to m; give the "
            "unit of length of the file (units)"
        )
    return DUMP_UNITS.get(frame.units, 1.0)


def _position(frame: Frame, path: Path) -> Array:
    for names in PLACES:
        if set(names) <= set(frame.columns):
            return np.column_stack([frame.column(name) for name in names])
    if set(SCALED) <= set(frame.columns):
        parts = np.column_stack([frame.column(name) for name in SCALED])
        return frame.box[:, 0] + parts * np.ptp(frame.box, axis=1)
    raise CaseError(
        f"{path}: step {frame.step}: no columns x y z (or xu yu zu, or xs ys zs) among "
        f"{' '.join(frame.columns)}; dump them with the spheres"
    )


def _radius(frame: Frame, path: Path) -> Array:
    if "radius" in frame.columns:
        return frame.column("radius")
    if "diameter" in frame.columns:
        return 0.5 * frame.column("diameter")
    raise CaseError(
        f"{path}: step {frame.step}: no column radius or diameter among "
        f"{' '.join(frame.columns)}; dump one of them with the spheres"
    )


def _whole(frame: Frame, name: str, path: Path) -> Array | None:
    if name not in frame.columns:
        return None
    values = frame.column(name)
    if np.any((values != np.round(values)) | (np.abs(values) > _LARGEST_WHOLE)):
        raise CaseError(
            f"{path}: step {frame.step}: column {name} holds a number that is not whole, or too "
            "large"
        )
    return frozen(values, np.int64)
