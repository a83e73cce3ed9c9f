"""The specimens of the Stokes truth whose deposits LIGGGHTS makes.

Every specimen is a run of fdnet's own chain: a pack in a box whose sides are periodic, then an
invasion under a uniform drag, or by a flow that follows the deposit. The seeds are those of the
specimens, so that a specimen is made again by one command (docs/stokes.md). Their table is
`specimens.csv` in the folder of the slabs.
"""

from dataclasses import dataclass

from fdnet.case.case import Case
from fdnet.case.file import case_from
from validation.engine.csv_rows import read_named
from validation.truth.slabs import SLAB_FOLDER, SLAB_SPECIMENS, YES

BOX_MM = (2.5, 1.2, 1.2)
DARCY_LENGTH_MM = 8.0
SECTIONS = 5
UNIFORM = {"upstream": "interstitial", "pressure_gradient": False}
FOLLOWED = {
    "field": "network",
    "update_travel": 0.5,
    "upstream": "darcy",
    "crowd": "beetstra",
    "pressure_gradient": True,
    "scheme": "implicit",
}
STIFF = {"stiffness_N_m": 1e5}
Radius = float | list[float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Specimen:
    """What the case of a specimen says; the rest of it is the same for all.

    Attributes:
        seed: of the case.
        fine_mm: radius of the fines, or smallest and largest, mm.
        supplied: number of fines.
        friction: of grains and fines.
        pack: porosity of the grains, or their number where no whole number of grains meets the
            porosity within fdnet's bound of 0.003.
        grain_mm: radius of the grains, or smallest and largest, mm.
        followed: whether the flow follows the deposit (`drag.field = "network"`), with contacts
            ten times as stiff, so that its larger forces press no fine far into another.
    """

    seed: int
    fine_mm: Radius
    supplied: int
    friction: float
    pack: float | int
    grain_mm: Radius = 0.25
    followed: bool = False

    def case(self, name: str) -> Case:
        """The case of the specimen, with the default of every key that is not named here."""
        grains = {"radius_mm": self.grain_mm, "friction": self.friction}
        grains["count" if isinstance(self.pack, int) else "porosity"] = self.pack
        return case_from(
            {
                "name": name,
                "seed": self.seed,
                "box": {"size_mm": list(BOX_MM), "sides": "periodic", "wall_friction": 0.0},
                "grains": grains,
                "fines": {
                    "radius_mm": self.fine_mm,
                    "count": self.supplied,
                    "supply": "slab",
                    "friction": self.friction,
                },
                "fluid": {"darcy_length_mm": DARCY_LENGTH_MM},
                "drag": FOLLOWED if self.followed else UNIFORM,
                "run": {"time_step_factor": 0.1} | (STIFF if self.followed else {}),
                "analysis": {"sections": SECTIONS},
            }
        )


def _radius(cell: str) -> Radius:
    """A radius, or the smallest and the largest of a range, mm."""
    numbers = [float(number) for number in cell.split()]
    return numbers[0] if len(numbers) == 1 else numbers


def _specimen(row: dict[str, str]) -> Specimen:
    """The specimen of a line of the table."""
    return Specimen(
        seed=int(row["seed"]),
        fine_mm=_radius(row["fine_mm"]),
        supplied=int(row["supplied"]),
        friction=float(row["friction"]),
        pack=int(row["grains"]) if row["grains"] else float(row["porosity"]),
        grain_mm=_radius(row["grain_mm"]),
        followed=row["followed"] == YES,
    )


SPECIMENS = {row["name"]: _specimen(row) for row in read_named(SLAB_FOLDER / SLAB_SPECIMENS)}
"""The specimens by name: r5 are fines of a fifth of a grain, mu0 is no friction, a range is one of
radii (ranges: of grains too), a cake remains upstream of the face; followed: by the flow."""
