"""What follows from a case in closed form: velocities, times, stable steps, dimensionless numbers.

Every formula and its source is also a row of `scale_rows`, which `fdnet render` prints and the report repeats.
"""

import math
from dataclasses import dataclass
from typing import Any

from fdnet.case.case import Case
from fdnet.errors import CaseError
from fdnet.scales.springs import Contact, contacts_of, mass_range, stiffness_factor
from fdnet.scales.time_step import drag_warnings, hold_steps, time_step

MOST_OVERLAP = 0.5
"""Predicted overlap over a fine's diameter from which a case is refused: beyond it a fine could pass a grain."""
ARRIVALS = 10
"""The default plug time lets at least this many fines of the undisturbed suspension arrive."""
MOST_STEPS = 2**31 - 1
_NO_FINES: dict[str, Any] = {
    "supplied_count": 0,
    "slab_length": 0.0,
    "relaxation_time": (0.0, 0.0),
    "time_step": 0.0,
    "hold_steps": 0,
    "plug_time": 0.0,
    "cap_time": 0.0,
    "checkpoint_steps": 0,
    "reynolds": 0.0,
    "stokes": 0.0,
    "gravity_over_drag": 0.0,
    "impact_overlap": 0.0,
    "drag_overlap": 0.0,
    "warnings": (),
}
PACK_STAGES, PACK_STAGE_STEPS, PACK_RELAX_STEPS, PACK_START, PACK_STEP = 30, 300, 20_000, 0.6, 0.15
"""Growth of a pack: stages and their steps, first run of relaxation, first size, step over sqrt(m/k)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One row of the table of scales."""

    name: str
    symbol: str
    value: float
    unit: str
    formula: str
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Closed-form consequences of a case, SI. Fields about fines are 0 when the case has none."""

    porosity: float
    permeability: float
    darcy_velocity: float
    interstitial_velocity: float
    upstream_velocity: float
    stiffness_factor: float
    contacts: dict[str, Contact]
    pack_step: float
    supplied_count: int
    slab_length: float
    relaxation_time: tuple[float, float]
    time_step: float
    hold_steps: int
    plug_time: float
    cap_time: float
    checkpoint_steps: int
    reynolds: float
    stokes: float
    gravity_over_drag: float
    impact_overlap: float
    drag_overlap: float
    warnings: tuple[str, ...]


def carman_kozeny(porosity: float, diameter: float) -> float:
    """k = d^2 phi^3 / (180 (1 - phi)^2), m2 (Carman 1937; 180 = 72 x tortuosity 2.5)."""
    return diameter**2 * porosity**3 / (180 * (1 - porosity) ** 2)


def relaxation_time(
    radius: float, density: float, viscosity: float, multiplier: float = 1.0
) -> float:
    """tau = m / (6 pi mu r M) = 2 r^2 rho / (9 mu M), s (Stokes 1851)."""
    return 2 * radius**2 * density / (9 * viscosity * multiplier)


def scales_of(case: Case) -> Scales:
    """All scales of a case.

    Raises CaseError when a time step or drag refresh breaks a stability bound (the message gives the bound), when drag
    would press contacts shut, or when numbers are so extreme that a formula overflows.
    """
    try:
        return _scales(case)
    except (OverflowError, ZeroDivisionError) as error:
        raise CaseError(
            f"case {case.name}: a formula leaves the range of numbers ({error}); check units and magnitudes of "
            "fluid, fines and run"
        ) from error


def _scales(case: Case) -> Scales:
    porosity = target_porosity(case)
    permeability = carman_kozeny(porosity, case.grains.sauter_diameter_m)
    darcy, interstitial = _velocities(case, porosity, permeability)
    upstream = interstitial if case.drag.upstream == "interstitial" else darcy
    contacts = contacts_of(case)
    pack_step = PACK_STEP * math.sqrt(
        mass_range(case.grains)[0] / contacts["grain-grain"].normal_stiffness
    )
    fine = _fine_scales(case, contacts, interstitial, upstream)
    return Scales(
        porosity=porosity,
        permeability=permeability,
        darcy_velocity=darcy,
        interstitial_velocity=interstitial,
        upstream_velocity=upstream,
        stiffness_factor=stiffness_factor(case),
        contacts=contacts,
        pack_step=pack_step,
        **fine,
    )


def target_porosity(case: Case) -> float:
    """The porosity asked for; with `grains.count` the plain sum of its spheres (above 0 in any Case)."""
    if case.grains.count is not None:
        return 1 - case.grains.count * case.grains.mean_volume_m3 / math.prod(case.size_m)
    assert case.grains.porosity is not None
    return case.grains.porosity


def _velocities(case: Case, porosity: float, permeability: float) -> tuple[float, float]:
    if case.fluid.velocity_m_s is not None:
        return case.fluid.velocity_m_s * porosity, case.fluid.velocity_m_s
    given = case.fluid.darcy_length_m
    darcy = case.fluid.darcy_velocity(permeability, case.size_m[0] if given is None else given)
    return darcy, darcy / porosity


def _fine_scales(
    case: Case, contacts: dict[str, Contact], velocity: float, upstream: float
) -> dict[str, Any]:
    if case.fines is None:
        return dict(_NO_FINES)
    fines, viscosity = case.fines, case.fluid.viscosity_Pa_s
    low, high = fines.radius_range_m
    tau = tuple(
        relaxation_time(r, fines.density_kg_m3, viscosity, case.drag.multiplier)
        for r in (low, high)
    )
    step = time_step(case, contacts, tau[0])
    count, slab = _supply(case)
    plug, cap, chunk = _times(case, slab, velocity, upstream)
    hold = hold_steps(case, step, tau[0], chunk)
    stiffness = contacts["grain-fine"].normal_stiffness
    result: dict[str, Any] = {
        "supplied_count": count,
        "slab_length": slab,
        "relaxation_time": tau,
        "time_step": step,
        "hold_steps": hold,
        "plug_time": plug,
        "cap_time": cap,
        "checkpoint_steps": _chunk_steps(case, chunk, step * hold) * hold,
        "reynolds": case.fluid.density_kg_m3 * velocity * 2 * high / viscosity,
        "stokes": tau[1] * velocity / (2 * case.grains.mean_radius_m),
        "gravity_over_drag": _gravity_over_drag(case, velocity),
        "impact_overlap": velocity * math.sqrt(mass_range(fines)[1] / stiffness) / (2 * high),
        "drag_overlap": 6
        * math.pi
        * viscosity
        * case.drag.multiplier
        * velocity
        / (2 * stiffness),
    }
    _refuse_deep_overlap(result)
    if result["checkpoint_steps"] > MOST_STEPS:
        raise CaseError(
            f"run.time_step_s: {step:.3g} s needs {result['checkpoint_steps']:.3g} steps between checkpoints (limit "
            f"{MOST_STEPS:.3g}); raise the step or shorten run.checkpoint_ms"
        )
    warnings = _warnings(case, result)
    if plug < ARRIVALS * arrival_time(case, upstream):
        warnings.append(
            f"run.plug_time_ms: in {1e3 * plug:.3g} ms fewer than {ARRIVALS} fines of the suspension arrive at "
            "the face: "
            "the invasion may be called plugged too early"
        )
    return result | {"warnings": tuple(warnings)}


def _refuse_deep_overlap(fine: dict[str, Any]) -> None:
    for name in ("drag", "impact"):
        if fine[f"{name}_overlap"] > MOST_OVERLAP:
            raise CaseError(
                f"run.stiffness_N_m: {name} alone would press a fine {100 * fine[f'{name}_overlap']:.3g} % of its "
                f"diameter into a grain (limit {100 * MOST_OVERLAP:.0f} %); raise it, or lower "
                + (
                    "drag.multiplier, viscosity or velocity"
                    if name == "drag"
                    else "the velocity (fluid.velocity_m_s)"
                )
            )


def _gravity_over_drag(case: Case, velocity: float) -> float:
    assert case.fines is not None
    excess = abs(case.fines.density_kg_m3 - case.fluid.density_kg_m3 * case.gravity.buoyancy)
    weight = math.hypot(*case.gravity.acceleration_m_s2) * excess
    viscosity = case.fluid.viscosity_Pa_s
    return (
        2
        * case.fines.radius_range_m[1] ** 2
        * weight
        / (9 * viscosity * velocity * case.drag.multiplier)
    )


def _supply(case: Case) -> tuple[int, float]:
    """Number of fines and slab length: n v = c A l; a slab is never shorter than a fine (`_warnings` tells)."""
    fines = case.fines
    assert fines is not None
    area, volume = case.size_m[1] * case.size_m[2], fines.mean_volume_m3
    least = 2 * fines.radius_range_m[1]
    if fines.count is not None:
        return fines.count, max(fines.count * volume / (fines.concentration * area), least)
    assert fines.slab_m is not None
    slab = max(fines.slab_m, least)
    return max(1, round(fines.concentration * area * slab / volume)), slab


def arrival_time(case: Case, upstream: float) -> float:
    """Mean time between two fines arriving at the face, v / (c A u), s."""
    assert case.fines is not None
    return case.fines.mean_volume_m3 / (
        case.fines.concentration * case.size_m[1] * case.size_m[2] * upstream
    )


def _times(
    case: Case, slab: float, velocity: float, upstream: float
) -> tuple[float, float, float]:
    """Plug time, cap and chunk, s: the fluid passes about one grain diameter in a chunk.

    A given duration is cut into equal chunks, so that it is met within one drag refresh a chunk.
    """
    passage = 2 * case.grains.mean_radius_m / velocity
    plug = max(4 * passage, ARRIVALS * arrival_time(case, upstream))
    if case.run.plug_time_s is not None:
        plug = case.run.plug_time_s
    cap = 3 * slab / upstream + 4 * plug + 2 * case.size_m[0] / velocity
    given = case.run.duration_s or case.run.cap_s
    cap = cap if given is None else given
    asked = case.run.checkpoint_s
    chunk = min(min(passage, plug / 4) if asked is None else asked, cap)
    return plug, cap, chunk if case.run.duration_s is None else cap / math.ceil(cap / chunk)


def _chunk_steps(case: Case, chunk: float, refresh: float) -> int:
    """Drag refreshes in a chunk: rounded where a duration must be met, else up."""
    refreshes = chunk / refresh
    return max(1, math.ceil(refreshes) if case.run.duration_s is None else round(refreshes))


def _warnings(case: Case, fine: dict[str, Any]) -> list[str]:
    found = []
    if fine["reynolds"] > 1:
        found.append(
            f"particle Reynolds number {fine['reynolds']:.2g} is outside the range of Stokes drag (below 1)"
        )
    for name in ("impact", "drag"):
        if fine[f"{name}_overlap"] > case.run.max_overlap:
            found.append(
                f"predicted overlap under {name} is {100 * fine[f'{name}_overlap']:.2g} % of a fine's diameter (above "
                f"run.max_overlap, {100 * case.run.max_overlap:.3g} %): raise run.stiffness_N_m"
            )
    assert case.fines is not None
    diameter = 2 * case.fines.radius_range_m[1]
    if fine["slab_length"] <= diameter:
        found.append(
            f"the slab is lengthened to one fine's diameter, {1e3 * diameter:.3g} mm, so it is thinner than "
            "fines.concentration"
        )
    return found + drag_warnings(
        case, fine["hold_steps"] * fine["time_step"] / fine["relaxation_time"][0]
    )


def grain_count(case: Case) -> int:
    """First guess of the number of grains, (1 - phi) V / v, or the count given."""
    if case.grains.count is not None:
        return case.grains.count
    return max(
        1, round((1 - target_porosity(case)) * math.prod(case.size_m) / case.grains.mean_volume_m3)
    )
