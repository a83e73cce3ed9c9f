"""The table of scales that `fdnet run --dry-run` prints; its words are in `table.csv`."""

import csv
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from fdnet.case.case import Case, InvasionCase
from fdnet.scales.contacts import LARGEST_CHAIN, Contact, least_restitution, pull_off_of
from fdnet.scales.cost import cost_of, peak_memory
from fdnet.scales.drag import MOST_RATIO, held_factor
from fdnet.scales.pack import SHARES, curves_of, diameter_at, grain_count
from fdnet.scales.scales import InvasionScales, Scales


class Quantity(NamedTuple):
    """One row of the table of scales."""

    name: str  # what it is, in words
    symbol: str  # as in the formulas
    value: float  # in `unit`
    unit: str  # SI; "-" for a number without a unit
    formula: str  # how it follows from the case
    source: str  # author and year, or where it was measured


@cache
def _words() -> dict[str, list[str]]:
    """Name, symbol, unit, formula and source by key, with {...} for what differs by case."""
    text = files("fdnet").joinpath("scales/table.csv").read_text(encoding="utf-8")
    return {key: words for key, *words in csv.reader(text.splitlines())}


def row(key: str, value: float, **words: Any) -> Quantity:
    """The row `key` of `table.csv` with its value; `words` fill in what differs by case."""
    name, symbol, unit, formula, source = (text.format(**words) for text in _words()[key])
    return Quantity(name, symbol, value, unit, formula, source)


def scale_rows(case: Case, scales: Scales) -> list[Quantity]:
    """Every scale of the case with its formula and source, in reading order."""
    rows, cost = [*_size_rows(case), *_flow_rows(case, scales)], cost_of(case, scales)
    invaded = isinstance(scales, InvasionScales) and isinstance(case, InvasionCase)
    if isinstance(scales, InvasionScales) and isinstance(case, InvasionCase):
        rows += _fine_rows(case, scales)
    if not (isinstance(case, InvasionCase) and case.by_classes):
        rows += _contact_rows(case, scales)
    rows += [row("grains", grain_count(case)), row("pack_time", cost.pack_seconds)]
    rows.append(row("memory", peak_memory(case, scales)))
    return [*rows, row("run_time", cost.invade_seconds)] if invaded else rows


_SOURCES = {
    "log-normal": "Hatch & Choate 1929",
    "rosin-rammler": "Rosin & Rammler 1933",
    "measured": "as measured, straight over ln d",
}


def _size_rows(case: Case) -> Iterator[Quantity]:
    """The diameters of every measured curve next to those given, and its ends."""
    for name, spheres in curves_of(case).items():
        law, asked = "measured", dict[float, float]()
        if spheres.sizes is not None and spheres.sizes.fit is not None:
            law, asked = spheres.sizes.fit.name, spheres.sizes.asked
        for share in SHARES:
            value, given = diameter_at(spheres.curve, share), ""
            if value is None:
                continue
            if share in asked:
                off = 100 * (value / asked[share] - 1)
                given = f", given {asked[share]:.4g} m ({off:+z.1f} %)"
            words = {"name": name, "law": law, "given": given, "source": _SOURCES[law]}
            yield row("finer", value, share=100 * share, **words)
        curve = spheres.curve
        yield row("smallest", curve.low, name=name, share=100 * curve.below)
        yield row("largest", curve.high, name=name, share=100 * curve.above)
        yield row("mean", curve.mean(1), name=name)


def _flow_rows(case: Case, scales: Scales) -> Iterator[Quantity]:
    """Permeability, velocities, pressure gradient and loss by inertia."""
    ergun, around = case.fluid.darcy_law == "ergun", case.well is not None
    source, interstitial = ("Ergun 1952" if ergun else "Darcy 1856"), "u = q / phi"
    length = "r_w ln(r_e/r_w)" if around else "L"
    if case.fluid.velocity_m_s is not None:
        darcy, interstitial = "q = u phi", "given in the case"
    elif ergun:
        second = "r_w^2 (1/r_w - 1/r_e)" if around else "L"
        darcy = f"mu q {length} / k + b q^2 {second} = dP"
    else:
        darcy = f"q = k dP / (mu {length})"
    gradient = "mu q / k + b q^2" if ergun else "mu q / k"
    yield row("permeability", scales.permeability)
    yield row("darcy", scales.darcy_velocity, formula=darcy, source=source)
    yield row("interstitial", scales.interstitial_velocity, formula=interstitial)
    yield row("gradient", scales.pressure_gradient, formula=gradient, source=source)
    yield row("inertia", scales.inertial_loss)


def _fine_rows(case: InvasionCase, scales: InvasionScales) -> Iterator[Quantity]:
    """How the simulation is driven, the forces on a fine, its overlaps, the supply, the times."""
    if scales.force_factor != 1.0:
        yield row("drive", scales.drive_velocity)
        yield row("factor", scales.force_factor)
    low, high = scales.relaxation_time
    for name, tau in (
        {"smallest": low, "largest": high}.items() if low != high else [("every", low)]
    ):
        yield row("relaxation", tau, name=name)
    if not case.by_classes:
        yield row("held", scales.hold_steps * scales.time_step / low)
    yield row("reynolds", scales.reynolds)
    yield row("stokes", scales.stokes)
    yield row("impact_stokes", scales.impact_stokes)
    yield row("gradient_over_drag", scales.gradient_over_drag)
    yield row("gravity_over_drag", scales.gravity_over_drag)
    yield row("free_fine", scales.drift_velocity)
    yield row("throat", scales.throat_ratio)
    if scales.throat_ratio <= MOST_RATIO:  # a wider fine closes the throat
        yield row("throat_drag", held_factor(scales.throat_ratio))
    if not case.by_classes:
        yield row(f"{case.contact.model}_impact", scales.impact_overlap)
        yield row(f"{case.contact.model}_drag", scales.drag_overlap)
        if case.drag.coupled:
            yield row("deposit", scales.deposit_overlap, chain=LARGEST_CHAIN)
        yield row("time_step", scales.time_step)
    most = ", at most" * case.fines.endless
    yield row("fines", scales.supplied_count, most=most)
    yield row("slab", scales.slab_length, most=most)
    yield row("feeding", scales.slab_length / scales.upstream_velocity)
    yield row("plug_time", scales.plug_time)
    yield row("cap_time", scales.cap_time)


def _contact_rows(case: Case, scales: Scales) -> Iterator[Quantity]:
    """What the contacts of the case are, and the bounds on its time step."""
    model = case.contact.model
    yield row(f"{model}_factor", scales.stiffness_factor)
    for contact in scales.contacts.values():
        yield from _rows_of_pair(model, contact, least_restitution(case))
    if isinstance(case, InvasionCase) and case.contact.cohesion_J_m3:
        yield row("pull_off", pull_off_of(case, scales.contacts["grain-fine"]).force)


def _rows_of_pair(model: str, contact: Contact, least: float) -> Iterator[Quantity]:
    pair = contact.pair
    if contact.elastic is not None:
        yield row("hertz_modulus", contact.elastic.modulus, pair=pair)
    yield row(f"{model}_stiffness", contact.normal_stiffness, pair=pair)
    yield row(f"{model}_time", contact.contact_time, pair=pair)
    yield row(f"{model}_step", 0.2 * contact.step_limit, pair=pair)
    if contact.stokes is not None:
        yield row("pair_stokes", contact.stokes, pair=pair)
        yield row("restitution", contact.restitution, pair=pair, least=least)
