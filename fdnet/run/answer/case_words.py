"""The case in sentences: sand, mud, drive and specimen, in the units of the field."""

from collections.abc import Iterator, Mapping

from fdnet.case.case import Case, InvasionCase
from fdnet.case.spheres import Spheres
from fdnet.scales.scales import InvasionScales
from fdnet.scales.sizes import SHARES

UM, MM = 1e6, 1e3
PSI = 6894.757
"""Pascal."""


def case_words(case: Case, scales: object = None) -> list[str]:
    """Some sentences that say what was run; `scales` adds the velocity of the fluid."""
    return list(_sentences(case, scales))


def _sentences(case: Case, scales: object) -> Iterator[str]:
    porosity = case.grains.porosity
    packed = f"packed to a porosity of {100 * porosity:.3g} %" if porosity else "packed by number"
    yield f"Sand: grains of {_sizes(case.grains)}, {packed}."
    if not isinstance(case, InvasionCase):
        yield f"No mud. {_box(case)}"
        return
    share = 100 * case.fines.volume_fraction
    yield (
        f"Mud: fines of {_sizes(case.fines)}, {share:.3g} % of solids by volume, in a liquid of "
        f"{1e3 * case.fluid.viscosity_Pa_s:.3g} cP."
    )
    yield _drive(case, scales)
    yield _box(case)


def _sizes(spheres: Spheres) -> str:
    if spheres.one_size:
        return f"{2 * MM * spheres.mean_radius_m:.3g} mm ({2 * UM * spheres.mean_radius_m:.4g} µm)"
    if not spheres.measured:
        low, high = (2 * UM * radius for radius in spheres.radius_range_m)
        return f"{low:.3g} to {high:.3g} µm"
    return _quantiles(spheres)


def _quantiles(spheres: Spheres) -> str:
    """D10, D50 and D90 as the case gives them, where it does, and of what is placed."""
    placed = {share: spheres.curve.size_at(share) for share in SHARES}
    asked = dict(spheres.sizes.asked or {}) if spheres.sizes is not None else {}
    if set(asked) >= set(SHARES):
        return f"{_three(asked)} (of what is placed: {_three(placed)})"
    return f"{_three(placed)} (of what is placed)"


def _three(sizes: Mapping[float, float]) -> str:
    texts = (f"D{100 * share:.0f} {UM * sizes[share]:.3g}" for share in SHARES)
    return f"{', '.join(texts)} µm"


def _drive(case: InvasionCase, scales: object) -> str:
    fluid, well = case.fluid, case.well
    pressure = f"{fluid.overbalance_Pa / 1e6:.3g} MPa ({fluid.overbalance_Pa / PSI:.3g} psi)"
    if fluid.velocity_m_s is not None:
        text = "Drive: a given velocity of the fluid"
    elif well is not None:
        text = (
            f"Drive: an overbalance of {pressure} around a well of {MM * well.radius_m:.3g} mm "
            f"radius with a drainage radius of {well.drainage_radius_m:.3g} m"
        )
    else:
        length = MM * (fluid.darcy_length_m or case.size_m[0])
        text = f"Drive: an overbalance of {pressure}, lost over {length:.3g} mm"
    speed = ""
    if isinstance(scales, InvasionScales):
        speed = f"; between the grains the fluid moves at {scales.interstitial_velocity:.2g} m/s"
    return f"{text}{speed}."


def _box(case: Case) -> str:
    sides = " x ".join(f"{MM * side:.3g}" for side in case.size_m)
    held = {"walls": "between walls", "periodic": "periodic across the flow"}[case.box.sides]
    return f"Specimen: {sides} mm, {held}; the flow goes along the first side. Seed {case.seed}."
