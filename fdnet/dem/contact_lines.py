"""The contact lines of a deck: properties of materials and pairs, and LIGGGHTS's contact model."""

from typing import Any

from fdnet.case.case import Case
from fdnet.dem.deck import number
from fdnet.scales.hertz import restitution_of
from fdnet.scales.hertz_contacts import material_of
from fdnet.scales.scales import Scales
from fdnet.scales.springs import Contact

_MATERIALS = {"pack": ("grain", "wall"), "invade": ("grain", "fine", "wall")}
_NORMAL = {"hooke": "hooke/stiffness", "hertz": "hertz"}
SOFTEST, HARDEST = 5e6, 1e9
"""Young's moduli, Pa, beyond which LIGGGHTS asks for a confirmation in the deck."""


def contact_variables(case: Case, scales: Scales, stage: str, *, friction: bool) -> dict[str, Any]:
    """Variables of `_contacts.in.j2`: symmetric matrices row by row, and the contact model."""
    materials = _MATERIALS[stage]
    size = len(materials)
    shared = {
        "model": case.contact.model,
        "materials": " ".join(materials),
        "size": size,
        "friction": _matrix(scales, stage, "friction") if friction else "",
        "pair_model": _models(case, friction) + _settings(friction),
    }
    if case.contact.model == "hertz":
        return shared | _hertz(case, scales, stage)
    return shared | {
        "normal": _matrix(scales, stage, "normal_stiffness"),
        "damping": _matrix(scales, stage, "damping_rate"),
        "shear": _matrix(scales, stage, "shear_stiffness"),
        "no_damping": " ".join(["0"] * size**2),
    }


def damped_alike(
    case: Case, contacts: dict[str, Any], ratio: float, rate: float
) -> dict[str, Any]:
    """The same contacts with one damping for all pairs.

    `ratio` is over the critical damping, `rate` in 1/s is what linear contacts take for it.
    """
    if case.contact.model == "hertz":
        key, value = "restitution", restitution_of(ratio)
    else:
        key, value = "damping", rate
    return contacts | {key: " ".join([number(value)] * contacts["size"] ** 2)}


def wall_law(case: Case, stage: str, *, friction: bool) -> dict[str, Any]:
    """Contact model, material and settings of a plane."""
    return {
        "model": _models(case, friction),
        "material": len(_MATERIALS[stage]),
        "settings": _settings(friction),
    }


def _models(case: Case, friction: bool) -> str:
    return _NORMAL[case.contact.model] + (" tangential history" if friction else "")


def _settings(friction: bool) -> str:
    return " tangential_damping off limitForce on" if friction else " limitForce on"


def _hertz(case: Case, scales: Scales, stage: str) -> dict[str, Any]:
    materials = [material_of(case, name, scales.stiffness_factor) for name in _MATERIALS[stage]]
    moduli = [modulus for modulus, _ in materials]
    return {
        "modulus": " ".join(number(modulus) for modulus in moduli),
        "poisson": " ".join(number(ratio) for _, ratio in materials),
        "soft": min(moduli) < SOFTEST,
        "hard": max(moduli) > HARDEST,
        "restitution": _matrix(scales, stage, "restitution"),
    }


def _matrix(scales: Scales, stage: str, value: str) -> str:
    """A value of all pairs of the scene's materials, row by row."""
    materials = _MATERIALS[stage]
    return " ".join(
        number(getattr(_contact(scales, a, b), value)) for a in materials for b in materials
    )


def _contact(scales: Scales, first: str, second: str) -> Contact:
    """The pair's contact in either order; walls do not touch each other, so any value serves."""
    for pair in (f"{first}-{second}", f"{second}-{first}"):
        if pair in scales.contacts:
            return scales.contacts[pair]
    return scales.contacts["grain-wall"]
