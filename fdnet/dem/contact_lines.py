"""The contact lines of a deck: properties of materials and pairs, and LIGGGHTS's contact model."""

from typing import Any

from fdnet.case.case import Case
from fdnet.dem.deck import LeftOut, number
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
        "rolling": _rolling(case, size) if friction else "",
        "cohesion": _cohesion(case, stage),
        "pair_model": _models(case, stage, friction) + _settings(case, stage, friction),
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
        "model": _models(case, stage, friction),
        "material": len(_MATERIALS[stage]),
        "settings": _settings(case, stage, friction),
    }


def left_out_of_contacts(case: Case) -> list[LeftOut]:
    """What contacts could do and the case does not ask for."""
    contact = case.contact
    asked = {
        "loss of rebound in the liquid": contact.restitution == "liquid",
        "rolling resistance": contact.rolling_friction is not None,
        "cohesion": contact.cohesion_J_m3 is not None,
    }
    return [LeftOut(what=what, why="not asked for") for what, given in asked.items() if not given]


def _models(case: Case, stage: str, friction: bool) -> str:
    """LIGGGHTS's models in its order; packing knows neither friction nor cohesion."""
    words = [_NORMAL[case.contact.model]]
    if friction:
        words.append("tangential history")
    if _cohesion(case, stage):
        words.append("cohesion sjkr")
    if friction and case.contact.rolling_friction:
        words.append("rolling_friction epsd2")
    return " ".join(words)


def _settings(case: Case, stage: str, friction: bool) -> str:
    """A contact that a liquid damps may pull: the film resists parting as it does approach."""
    pulls = stage == "invade" and case.contact.restitution == "liquid"
    tangential = " tangential_damping off" if friction else ""
    return tangential + (" limitForce off" if pulls else " limitForce on")


def _rolling(case: Case, size: int) -> str:
    """The same coefficient for all pairs."""
    if case.contact.rolling_friction is None:
        return ""
    return " ".join([number(case.contact.rolling_friction)] * size**2)


def _cohesion(case: Case, stage: str) -> str:
    """Of the pairs with a fine; grains do not attract each other or a wall."""
    density, materials = case.contact.cohesion_J_m3, _MATERIALS[stage]
    if density is None or "fine" not in materials:
        return ""
    return " ".join(
        number(density if "fine" in (a, b) else 0.0) for a in materials for b in materials
    )


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
