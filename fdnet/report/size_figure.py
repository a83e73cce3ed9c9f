"""The curves of sizes: asked for, placed, and of the fines that invaded."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from fdnet.report.depth_figure import legend_above
from fdnet.sizes.curve import SizeCurve
from fdnet.spheres.snapshot import Array

MICRON = 1e6
COLOURS = {"grains": "#7F7F7F", "fines": "#D55E00"}
INVADED = "#0072B2"


class Sizes(Protocol):
    """What is drawn of one kind of spheres; see `fdnet.run.placed_sizes`."""

    @property
    def name(self) -> str:
        """Grains or fines."""

    @property
    def asked(self) -> Mapping[float, float]:
        """Diameters, m, by the share that is finer."""

    @property
    def curve(self) -> SizeCurve:
        """The curve of the case."""

    @property
    def placed(self) -> Array:
        """(N,) m, diameters."""

    @property
    def invaded(self) -> Array | None:
        """(M,) m, diameters."""


def fill_size_curves(figure: Any, *, sizes: Sequence[Sizes]) -> None:
    """Share finer by volume, in percent, over the diameter on a logarithmic axis."""
    from matplotlib.ticker import LogLocator, NullLocator

    axes = figure.add_subplot()
    for one in sizes:
        colour, curve = COLOURS[one.name], one.curve
        whole = 100 * (curve.below + curve.kept * curve.finer())
        axes.plot(MICRON * curve.edges, whole, color=colour, alpha=0.5, label=f"{one.name}, asked")
        if one.asked:
            shares, diameters = np.array([*one.asked]), np.array([*one.asked.values()])
            axes.plot(MICRON * diameters, 100 * shares, "o", color=colour, label="given points")
        _stairs(
            axes, one.placed, curve, color=colour, label=f"{len(one.placed)} {one.name} placed"
        )
        if one.invaded is not None and len(one.invaded):
            label = f"{len(one.invaded)} of them invaded"
            _stairs(axes, one.invaded, curve, color=INVADED, linestyle="--", label=label)
    axes.set_xscale("log")
    axes.set(xlabel="diameter (µm)", ylabel="finer by volume (%)", ylim=(0, 100))
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    legend_above(axes, columns=3)


def _stairs(axes: Any, diameter: Array, curve: SizeCurve, **style: Any) -> None:
    """Steps of some spheres, from the share that is left out below to that above."""
    rising = np.sort(diameter)
    finer = curve.below + curve.kept * np.cumsum(rising**3) / np.sum(rising**3)
    axes.step(MICRON * rising, 100 * finer, where="post", linewidth=1.3, **style)
