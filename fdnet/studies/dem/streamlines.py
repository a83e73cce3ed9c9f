"""The flow through a finished run before and after: speed and streamlines in a plane."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.network.field.field import velocity_field
from fdnet.report.figures import draw
from fdnet.run.finished import open_run
from fdnet.spheres.snapshot import Array, Snapshot

MM = 1e3
CELLS = 240
"""Points of the plane along x."""
FASTEST = 99.0
"""Percentile of the clean speeds at which the colours end."""


def draw_streamlines(run: Path, path: Path) -> Path:
    """Draw the fluid's velocity in the plane y = middle of the run in a folder, without and with
    its fines, each over its own mean velocity.

    Raises CaseError when the folder holds no finished run.
    """
    done = open_run(run)
    before, after = done.spheres("initial"), done.spheres("damaged")
    fields = [
        velocity_field(after.grains(), periodic=done.case.periodic, fines=fines)
        for fines in (None, _inside(after))
    ]
    x, z, points = plane(before.box)
    shape = len(z), len(x)
    flows = [field.at(points).reshape(*shape, 3) for field in fields]
    return draw(path, partial(fill_streamlines, x=x, z=z, flows=flows))


def plane(box: Array) -> tuple[Array, Array, Array]:
    """x (A,), z (B,) and the points (A B, 3) m of the plane through the middle of the box."""
    step = float(np.ptp(box[0])) / CELLS
    x = np.linspace(box[0, 0] + 0.5 * step, box[0, 1] - 0.5 * step, CELLS)
    count = max(2, round(float(np.ptp(box[2])) / step))
    z = np.linspace(box[2, 0], box[2, 1], count)
    at_x, at_z = np.meshgrid(x, z)
    middle = np.full(at_x.size, float(box[1].mean()))
    return x, z, np.column_stack([at_x.ravel(), middle, at_z.ravel()])


def fill_streamlines(figure: Any, *, x: Array, z: Array, flows: list[Array]) -> None:
    """Speed and streamlines of the `flows` (B, A, 3), over the mean velocity; white is solid."""
    rows = figure.subplots(2, 1, sharex=True, sharey=True)
    speeds = [np.linalg.norm(flow, axis=2) for flow in flows]
    most = float(np.percentile(speeds[0][speeds[0] > 0], FASTEST))
    for axes, flow, speed, name in zip(
        rows, flows, speeds, ("intact", "with the fines"), strict=True
    ):
        shown = np.where(speed > 0, speed, np.nan)
        mesh = axes.pcolormesh(
            MM * x, MM * z, shown, cmap="viridis_r", vmin=0, vmax=most, rasterized=True
        )
        axes.streamplot(
            MM * x,
            MM * z,
            flow[..., 0],
            flow[..., 2],
            color="black",
            linewidth=0.5,
            density=(2.0, 1.2),
            arrowsize=0.5,
        )
        axes.set(ylabel="z (mm)", title=name, aspect="equal")
        axes.grid(visible=False)
    figure.colorbar(mesh, ax=rows, label="speed / mean (–)")
    rows[-1].set_xlabel("depth from the formation face (mm)")


def _inside(spheres: Snapshot) -> Snapshot:
    fines = spheres.fines()
    return fines.where(fines.position[:, 0] > spheres.box[0, 0])
