"""What fdnet chooses for a case, and the tables of the case file."""

from dataclasses import dataclass
from typing import Any

from fdnet.case.case import InvasionCase
from fdnet.scales.design.answers import Answers
from fdnet.scales.scales import InvasionScales

PLUG_RATE = 0.05
"""Share of the supply that still enters a plugged face."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """How large a specimen may be, and how long it may take.

    Attributes:
        name: as --size takes it.
        width: in mean grain diameters (by volume over surface).
        length: likewise.
        seconds: of one core.
    """

    name: str
    width: float
    length: float
    seconds: float


BUDGETS = {
    "quick": Budget(name="quick", width=5.0, length=8.0, seconds=600.0),
    "standard": Budget(name="standard", width=8.0, length=10.0, seconds=4 * 3600.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What fdnet chose for a case.

    Attributes:
        width: m. length: m. sections: their number.
        sand_cut: percent of the sand left out at the fine end.
        mud_cut: percent of the solids below the coarse cut.
        cut: m, diameter below which solids are left out; 0 for none.
        slab: m of mud.
        supply_share: solids supplied over those that are expected to plug the face.
        stiffness: N/m.
        driven: whether the fines are driven faster than the fluid.
        inertia: whether drag is that of Schiller and Naumann.
        cap: s, or None.
        passing: m, diameter up to which solids pass the throats.
    """

    width: float
    length: float
    sections: int
    sand_cut: float
    mud_cut: float
    cut: float
    slab: float
    supply_share: float
    stiffness: float
    driven: bool = False
    inertia: bool = False
    cap: float | None = None
    passing: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A case with the reasons for its sizes.

    Attributes:
        answers: what was given.
        choice: what fdnet chose.
        case: the two together.
        scales: of the case.
        budget: that the case was fitted to.
        seconds: expected on one core.
    """

    answers: Answers
    choice: Choice
    case: InvasionCase
    scales: InvasionScales
    budget: Budget
    seconds: float


def tables_of(answers: Answers, choice: Choice) -> dict[str, Any]:
    """The tables of the case file."""
    drive = {"drive_velocity_m_s": "auto"} if choice.driven else {}
    inertia = {"inertia": "schiller-naumann"} if choice.inertia else {}
    kept = {"cut_percent": [1.0, choice.mud_cut]} if choice.mud_cut != 99.0 else {}
    sand = {"cut_percent": [choice.sand_cut, 99.0]} if choice.sand_cut != 1.0 else {}
    known = answers.formation_permeability
    return {
        "name": answers.name,
        "seed": 1,
        "box": {"size": [mm(choice.length), mm(choice.width), mm(choice.width)]},
        "grains": {"sizes": answers.sand.table | sand, "porosity": answers.porosity},
        "fines": {
            "sizes": answers.mud.table | kept,
            **({"cut": um(choice.cut)} if choice.cut else {}),
            answers.solids_key: answers.solids,
            "density": answers.solids_density,
            "slab": mm(choice.slab),
        },
        "fluid": {
            "viscosity": answers.viscosity,
            "density": answers.liquid_density,
            "overbalance": answers.overbalance,
        },
        "well": {
            "radius": answers.well_radius,
            "drainage_radius": answers.drainage_radius,
            **({"formation_permeability": known} if known else {}),
        },
        "drag": drive | inertia,
        "run": {
            "stiffness": f"{choice.stiffness:g} N/m",
            "plug_rate": PLUG_RATE,
            **({"cap": f"{1e3 * choice.cap:.3g} ms"} if choice.cap else {}),
        },
        "analysis": {"sections": choice.sections},
    }


def mm(length: float) -> str:
    """A length in m as a text in mm."""
    return f"{1e3 * length:.3g} mm"


def um(length: float) -> str:
    """A length in m as a text in um."""
    return f"{1e6 * length:.3g} um"
