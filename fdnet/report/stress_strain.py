"""The stress-strain curve of a triaxial test, as a figure."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from fdnet.files.atomic import replacing
from fdnet.report.figures import BLUE, GREEN, ORANGE, STYLE


class Row(Protocol):
    """One load step; see `fdnet.mechanics.triaxial`."""

    @property
    def axial_strain(self) -> float:
        """Compression above 0."""

    @property
    def volume_strain(self) -> float:
        """Compression above 0."""

    @property
    def deviatoric(self) -> float:
        """Pa."""

    @property
    def tension(self) -> int:
        """Bonds broken in tension."""

    @property
    def shear(self) -> int:
        """Bonds broken in shear."""


def draw_stress_strain(rows: Sequence[Row], path: Path, *, bonds: int) -> None:
    """Deviatoric stress and volume strain over axial strain; broken bonds where there are any."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    strain = [100 * row.axial_strain for row in rows]
    panels = 3 if bonds else 2
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 2.6 * panels), layout="constrained", dpi=130)
        axes = figure.subplots(panels, 1, sharex=True)
        axes[0].plot(strain, [1e-6 * row.deviatoric for row in rows], color=BLUE, marker=".")
        axes[0].set_ylabel("deviatoric stress (MPa)")
        axes[1].plot(strain, [100 * row.volume_strain for row in rows], color=GREEN, marker=".")
        axes[1].set_ylabel("volume strain (%),\ncompression above 0")
        if bonds:
            axes[2].plot(strain, [row.tension for row in rows], color=ORANGE, label="in tension")
            axes[2].plot(strain, [row.shear for row in rows], color=BLUE, label="in shear")
            axes[2].set_ylabel(f"bonds broken, of {bonds}")
            axes[2].legend()
        axes[-1].set_xlabel("axial strain (%)")
        with replacing(path) as temporary:
            figure.savefig(temporary, format="png")
