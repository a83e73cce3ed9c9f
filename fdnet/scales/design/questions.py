"""What `fdnet init` asks for."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """One thing to ask for.

    Attributes:
        key: of the option, "sand_d50" for --sand-d50.
        text: what is asked on a terminal.
        example: a value, which is the default where there is one.
        default: the value of an empty answer; None where an answer is needed.
        group: questions of one group may be answered by a file instead.
    """

    key: str
    text: str
    example: str
    default: str | None = None
    group: str = ""


QUESTIONS = (
    Question(key="sand_d10", text="Sand, D10 (10 % are finer)", example="0.25 mm", group="sand"),
    Question(key="sand_d50", text="Sand, D50 (the median)", example="0.40 mm", group="sand"),
    Question(key="sand_d90", text="Sand, D90", example="0.60 mm", group="sand"),
    Question(key="porosity", text="Porosity of the sand", example="38 %"),
    Question(key="mud_d50", text="Solids of the mud, D50", example="40 um", group="mud"),
    Question(
        key="mud_d10", text="Solids, D10", example="20 um", default="half of D50", group="mud"
    ),
    Question(key="mud_d90", text="Solids, D90", example="80 um", default="twice D50", group="mud"),
    Question(key="solids", text="Solids in the mud, by volume or mass", example="5 %"),
    Question(
        key="solids_density",
        text="Density of the solids (CaCO3 2.71 g/cc, barite 4.2 g/cc)",
        example="2.71 g/cc",
        default="2.71 g/cc",
    ),
    Question(key="viscosity", text="Viscosity of the liquid", example="10 cP"),
    Question(
        key="liquid_density",
        text="Density of the liquid",
        example="1050 kg/m3",
        default="1050 kg/m3",
    ),
    Question(key="overbalance", text="Overbalance", example="300 psi"),
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
        default="",
    ),
)
"""In the order in which they are asked."""
