"""What must hold between the keys that say how fast the fluid moves, and how it is simulated."""

from collections.abc import Iterator

from fdnet.case.contact import ContactLaw
from fdnet.case.fluid import Fluid, Well
from fdnet.case.parts import Drag
from fdnet.case.rule import Rule


def _one_drive(well: Well, fluid: Fluid) -> Iterator[str]:
    """A well gives the velocity, so nothing else may."""
    given = [
        f"fluid.{name} = {value:g}"
        for name in ("velocity_m_s", "darcy_length_mm")
        if (value := getattr(fluid, name)) is not None
    ]
    if given:
        yield (
            f"well: the table [well] with {' and '.join(given)}: each gives the velocity of the "
            "fluid; keep one of them"
        )


def _radii_of_well(well: Well) -> Iterator[str]:
    if well.drainage_radius_m <= well.radius_m:
        yield (
            f"well.drainage_radius_m: {well.drainage_radius_m:g} m is not above the radius of the "
            f"well, well.radius_mm = {well.radius_mm:g} ({well.radius_m:g} m)"
        )


def _driven_cohesion(drag: Drag, contact: ContactLaw) -> Iterator[str]:
    if drag.drive_velocity_m_s is not None and contact.cohesion_J_m3 is not None:
        yield (
            f"drag.drive_velocity_m_s: {drag.drive_velocity_m_s} with contact.cohesion_J_m3: the "
            "forces of the fluid are scaled, cohesion is not, so their ratio would be wrong; "
            "leave out one of the two"
        )


FLOW_RULES = (
    Rule(("well", "fluid.velocity_m_s", "fluid.darcy_length_mm"), _one_drive),
    Rule(("well.radius_mm", "well.drainage_radius_m"), _radii_of_well),
    Rule(("drag.drive_velocity_m_s", "contact.cohesion_J_m3"), _driven_cohesion),
)
