"""What `fdnet init` asks for."""

import re
from contextlib import suppress
from typing import NamedTuple

from fdnet.case.units import converted, share_of


class Question(NamedTuple):
    """One thing to ask for."""

    key: str  # of the option, "sand_d50" for --sand-d50
    text: str  # what is asked on a terminal
    example: str  # a value, which is the default where there is one
    # the case's unit in which it is read; "%" for a share, "%_kg_m3" for a share or a mass
    unit: str = "_mm"
    default: str | None = None  # the value of an empty answer; None where an answer is needed
    group: str = ""  # questions of one group may be answered by a file instead

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
        suffix = self.unit.removeprefix("%")
        try:
            if "%" in self.unit and (not suffix or text.endswith("%")):
                share_of(text)
            else:
                converted(text, suffix)
        except ValueError as error:
            plain = ", or a number below 1" if "%" in self.unit else ""
            return text, f"{self.option}: {text!r}: {error}{plain}"
        return text, ""


QUESTIONS = (
    Question("sand_d10", "Sand, D10 (10 % are finer)", "0.25 mm", group="sand"),
    Question("sand_d50", "Sand, D50 (the median)", "0.40 mm", group="sand"),
    Question("sand_d90", "Sand, D90", "0.60 mm", group="sand"),
    Question("porosity", "Porosity of the sand", "38 %", "%"),
    Question("mud_d50", "Solids of the mud, D50", "40 um", group="mud"),
    Question("mud_d10", "Solids, D10", "20 um", default="half of D50", group="mud"),
    Question("mud_d90", "Solids, D90", "80 um", default="twice D50", group="mud"),
    Question("solids", "Solids in the mud, by volume or mass", "5 %", "%_kg_m3"),
    Question(
        "solids_density",
        "Density of the solids (CaCO3 2.71 g/cc, barite 4.2 g/cc)",
        *("2.71 g/cc", "_kg_m3", "2.71 g/cc"),
    ),
    Question("viscosity", "Viscosity of the liquid", "10 cP", "_cP"),
    Question("liquid_density", "Density of the liquid", "1050 kg/m3", "_kg_m3", "1050 kg/m3"),
    Question("overbalance", "Overbalance", "300 psi", "_MPa"),
    Question(
        "well_radius",
        "Radius of the well (8 1/2 inches across: 108 mm)",
        *("108 mm", "_mm", "108 mm"),
    ),
    Question("drainage_radius", "Drainage radius", "100 m", default="100 m"),
    Question(
        "formation_permeability",
        "Permeability of the formation (nothing: that of the sand)",
        *("500 mD", "_mD", ""),
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
