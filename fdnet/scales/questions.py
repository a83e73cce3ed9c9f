"""What `fdnet init` asks for."""

import re
from contextlib import suppress
from dataclasses import dataclass

from fdnet.case.units import converted, share_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """One thing to ask for.

    Attributes:
        key: of the option, "sand_d50" for --sand-d50.
        text: what is asked on a terminal.
        example: a value, which is the default where there is one.
        default: the value of an empty answer; None where an answer is needed.
        group: questions of one group may be answered by a file instead.
        unit: end of a case's key in whose unit it is read; "%" for a share, "%_kg_m3" for a share
            or a mass.
    """

    key: str
    text: str
    example: str
    unit: str = "_mm"
    default: str | None = None
    group: str = ""

    @property
    def option(self) -> str:
        """As on the command line."""
        return f"--{self.key.replace('_', '-')}"

    def read(self, text: str) -> tuple[str, str]:
        """An answer as it is read, and why it is none; that is empty for one that can be read.

        A share may be a number between 0 and 1, which becomes a percentage.
        """
        text = text.strip()
        if "%" in self.unit:
            with suppress(ValueError):
                text = f"{100 * float(text):g} %" if 0 < float(text) < 1 else text
        if text in ("", self.default):
            return text, ""
        _, _, suffix = self.unit.rpartition("%")
        try:
            if "%" in self.unit and (not suffix or text.rstrip().endswith("%")):
                share_of(text)
            else:
                converted(text, suffix)
        except ValueError as error:
            return text, f"{self.option}: {text!r}: {error}"
        return text, ""


QUESTIONS = (
    Question(key="sand_d10", text="Sand, D10 (10 % are finer)", example="0.25 mm", group="sand"),
    Question(key="sand_d50", text="Sand, D50 (the median)", example="0.40 mm", group="sand"),
    Question(key="sand_d90", text="Sand, D90", example="0.60 mm", group="sand"),
    Question(key="porosity", text="Porosity of the sand", example="38 %", unit="%"),
    Question(key="mud_d50", text="Solids of the mud, D50", example="40 um", group="mud"),
    Question(
        key="mud_d10", text="Solids, D10", example="20 um", default="half of D50", group="mud"
    ),
    Question(key="mud_d90", text="Solids, D90", example="80 um", default="twice D50", group="mud"),
    Question(
        key="solids", text="Solids in the mud, by volume or mass", example="5 %", unit="%_kg_m3"
    ),
    Question(
        key="solids_density",
        text="Density of the solids (CaCO3 2.71 g/cc, barite 4.2 g/cc)",
        example="2.71 g/cc",
        unit="_kg_m3",
        default="2.71 g/cc",
    ),
    Question(key="viscosity", text="Viscosity of the liquid", example="10 cP", unit="_cP"),
    Question(
        key="liquid_density",
        text="Density of the liquid",
        example="1050 kg/m3",
        unit="_kg_m3",
        default="1050 kg/m3",
    ),
    Question(key="overbalance", text="Overbalance", example="300 psi", unit="_MPa"),
    Question(
        key="well_radius",
        text="Radius of the well (8 1/2 inches across: 108 mm)",
        example="108 mm",
        default="108 mm",
    ),
    Question(key="drainage_radius", text="Drainage radius", example="100 m", default="100 m"),
    Question(
        key="formation_permeability",
        text="Permeability of the formation (nothing: that of the sand)",
        example="500 mD",
        unit="_mD",
        default="",
    ),
)
"""In the order in which they are asked."""


OPTIONS = {
    "grains.sizes": "--sand",
    "grains.porosity": "--porosity",
    "fines.sizes": "--mud",
    "fines.concentration": "--solids",
    "fines.solids": "--solids",
    "fines.density": "--solids-density",
    "fluid.viscosity": "--viscosity",
    "fluid.density": "--liquid-density",
    "fluid.overbalance": "--overbalance",
    "well.radius": "--well-radius",
    "well.drainage_radius": "--drainage-radius",
    "well.formation_permeability": "--formation-permeability",
}
"""The option, or group of options, that gives each key of the case."""


def by_options(text: str) -> str:
    """A message about a case with the options of `fdnet init` for the keys that they give."""
    for key, option in OPTIONS.items():
        text = re.sub(rf"\b{re.escape(key)}(?:_[a-zA-Z]\w*)?(?!\w)", option, text)
    return text


def named_in(text: str) -> list[Question]:
    """The questions whose options a message names."""
    names = set(re.findall(r"--([a-z0-9-]+)", text))
    return [one for one in QUESTIONS if {one.option[2:], one.group} & names]
