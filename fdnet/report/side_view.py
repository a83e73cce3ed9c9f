"""The true cut through the specimen in the x-z plane of its middle."""

from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array, Snapshot

MM, MICRON = 1e3, 1e6
GRAIN_FACE, GRAIN_EDGE, FINE_FACE = "#D9D9D9", "#8C8C8C", "#D55E00"


def cut_circles(spheres: Snapshot, plane: float) -> tuple[Array, Array, Array]:
    """The circles in which the plane y = `plane` m cuts the spheres.

    Returns the index of the sphere (M,), the centre (M, 2) along x and z, m, and the radius (M,),
    m. A sphere of radius r at distance d < r from the plane is cut in a circle of radius
    sqrt(r^2 - d^2).
    """
    squared = spheres.radius**2 - (spheres.position[:, 1] - plane) ** 2
    index = np.flatnonzero(squared > 0)
    return index, spheres.position[index][:, ::2], np.sqrt(squared[index])


def fill_side_view(figure: Any, *, snapshot: Snapshot) -> None:
    """Draw grains (grey) cut at mid-width, and the fines (by radius) that the plane meets whole.

    All is to scale, and the formation face is marked.
    """
    axes = figure.add_subplot()
    plane = float(snapshot.box[1].mean())
    grains, fines = snapshot.grains(), snapshot.fines()
    _circles(axes, grains, plane, facecolor=GRAIN_FACE, edgecolor=GRAIN_EDGE, linewidth=0.5)
    _fines(figure, axes, fines, plane)
    _frame(figure, axes, snapshot)
    title = f"section at y = {plane * MM:.3g} mm: {_grain_words(grains)}"
    axes.set_title(title, fontsize=10, loc="left", pad=22)


def _grain_words(grains: Snapshot) -> str:
    """The radius of the grains, so that those that are cut off their middle mislead nobody."""
    if not len(grains):
        return "no grains"
    low, high = grains.radius.min() * MICRON, grains.radius.max() * MICRON
    if high - low < 0.02 * high:
        return f"all grains have a radius of {high:.3g} µm, some are cut off their middle"
    return f"grains of {low:.3g} to {high:.3g} µm radius, cut by the plane"


def _circles(axes: Any, spheres: Snapshot, plane: float, **style: Any) -> Any:
    from matplotlib.collections import EllipseCollection

    index, centre, radius = cut_circles(spheres, plane)
    if style.pop("whole", False):
        radius = spheres.radius[index]
    values = style.pop("values", None)
    circles = EllipseCollection(
        2 * radius * MM,
        2 * radius * MM,
        np.zeros(len(index)),
        units="xy",
        offsets=centre * MM,
        offset_transform=axes.transData,
        **style,
    )
    if values is not None:
        circles.set_array(values[index])
    axes.add_collection(circles)
    return circles


def _fines(figure: Any, axes: Any, fines: Snapshot, plane: float) -> None:
    """Fines coloured by their radius; in one colour when they are (nearly) of one size."""
    if not len(fines):
        return
    low, high = fines.radius.min() * MICRON, fines.radius.max() * MICRON
    if high - low < 0.02 * high:
        style = {"facecolor": FINE_FACE, "edgecolor": "black", "linewidth": 0.3}
        _circles(axes, fines, plane, whole=True, **style)
        axes.plot([], [], "o", color=FINE_FACE, label=f"fines, radius {high:.3g} µm")
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), fontsize=9, frameon=False)
        return
    circles = _circles(
        axes,
        fines,
        plane,
        whole=True,
        values=fines.radius * MICRON,
        cmap="plasma",
        edgecolor="black",
        linewidth=0.3,
    )
    circles.set_clim(low, high)
    figure.colorbar(circles, ax=axes, label="radius of the fine (µm)", shrink=0.8)


def _frame(figure: Any, axes: Any, snapshot: Snapshot) -> None:
    box = np.asarray(snapshot.box) * MM
    (x_lo, x_hi), (z_lo, z_hi) = box[0], box[2]
    margin = 0.02 * (x_hi - x_lo)
    reach = (snapshot.position - snapshot.radius[:, None]).min(axis=0, initial=np.inf) * MM
    overhang = snapshot.grains().radius.max(initial=0.0) * MM
    start = max(min(x_lo, float(reach[0])), x_lo - 0.35 * (x_hi - x_lo)) - margin
    axes.plot([x_lo, x_hi, x_hi, x_lo], [z_lo, z_lo, z_hi, z_hi], color="black", linewidth=1)
    axes.axvline(x_lo, color="#0072B2", linestyle="--", linewidth=1.6)
    axes.annotate(
        "formation face",
        (x_lo, z_hi),
        (3, 3),
        textcoords="offset points",
        color="#0072B2",
        fontsize=9,
    )
    axes.set(
        xlim=(start, x_hi + overhang),
        ylim=(z_lo - overhang, z_hi + overhang),
        aspect="equal",
        xlabel="x, depth from the formation face (mm)",
        ylabel="z (mm)",
    )
    axes.grid(False)
    width, height = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    figure.set_size_inches(9.0, min(9.0, max(3.0, 7.2 * height / width + 1.6)))
