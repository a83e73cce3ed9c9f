"""What must hold between the keys of a case.

What must hold between the table [contact] and the materials of a case.
"""

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

from fdnet.case.spheres import Fines, Grains, Spheres
from fdnet.case.tables import (
    CLEAN_UP_RULES,
    DEEPEST_DAMPING,
    LEAST_SKIN,
    MAX_CONCENTRATION,
    MODEL_KEYS,
    MOST_BINS,
    MOST_FINES,
    MOST_GRAINS,
    MOST_NEIGHBOUR_BINS,
    MOST_SLAB,
    AnalysisChoices,
    Bonds,
    Box,
    ContactLaw,
    Drag,
    Fluid,
    Rule,
    Run,
    Well,
)


def of_the_model(name: str) -> Callable[[ContactLaw, Spheres], Iterator[str]]:
    """A check that the contact model takes what the table `name` ("grains", "fines") gives."""

    def check(contact: ContactLaw, spheres: Spheres) -> Iterator[str]:
        unread = sorted(contact.other_keys & spheres.model_fields_set)
        if unread:
            keys = ", ".join(f"{name}.{key}" for key in unread)
            yield (
                f"{keys}: not read by contact.model {contact.model!r}; leave out, or choose the "
                "other contact.model"
            )
        if contact.model == "hertz" and spheres.damping_ratio > DEEPEST_DAMPING:
            yield (
                f"{name}.damping_ratio: {spheres.damping_ratio:g} with contact.model 'hertz', "
                f"expected at most {DEEPEST_DAMPING:g} (LIGGGHTS takes a restitution above 0.05)"
            )

    return check


def of_cohesion(contact: ContactLaw) -> Iterator[str]:
    """Cohesion has something to act against."""
    if contact.cohesion_J_m3 is not None and contact.model == "hooke":
        yield (
            f"contact.cohesion_J_m3: {contact.cohesion_J_m3:g} with contact.model 'hooke': the "
            "attraction of LIGGGHTS's SJKR grows with the overlap as a linear spring does, so it "
            "would only soften the contact and never pull; take contact.model = 'hertz'"
        )


def of_rolling(contact: ContactLaw, grains: Grains, fines: Fines) -> Iterator[str]:
    """Rolling friction has sliding friction that makes fines roll."""
    least = min(grains.friction, fines.friction)
    if contact.rolling_friction is not None and least == 0:
        yield (
            f"contact.rolling_friction: {contact.rolling_friction:g} without friction "
            "(grains.friction or fines.friction is 0): spheres that slide do not roll; give both "
            "a friction, or leave contact.rolling_friction out"
        )


# ------------------------------------------------------------------------------------------------
# What must hold between the keys of an invasion whose forces fdnet computes.


def flow_field(drag: Drag) -> Iterator[str]:
    """The network moves the mud at the rate over the cross-section; it alone knows the drive."""
    if drag.field == "network" and drag.upstream != "darcy":
        yield (
            f"drag.upstream: {drag.upstream!r}, but with drag.field 'network' the mud moves at "
            "the rate over the cross-section; set drag.upstream = 'darcy'"
        )
    if drag.field != "network" and drag.drive is not None:
        yield (
            f"drag.drive: {drag.drive!r} belongs to drag.field 'network'; the uniform field "
            "always has its first velocity; leave it out"
        )


def network_grains(drag: Drag, grains: Grains) -> Iterator[str]:
    """The pores of the network are those of grains that stay."""
    if drag.field == "network" and grains.motion == "mobile":
        yield (
            "grains.motion: 'mobile' with drag.field 'network', whose pores are those of grains "
            "that stay; take 'fixed'"
        )


def stop_rate(run: Run, drag: Drag) -> Iterator[str]:
    """Only a rate that falls can end a run."""
    if run.stop_rate is not None and not drag.slowed:
        yield (
            f"run.stop_rate: {run.stop_rate:g} needs a rate that falls; leave it out, or set "
            "drag.field = 'network' with drag.drive = 'pressure'"
        )


def stop_volume(run: Run, drag: Drag) -> Iterator[str]:
    """The uniform field keeps no account of the volume: it is the rate times the time."""
    if run.stop_pore_volumes is not None and drag.field != "network":
        yield (
            f"run.stop_pore_volumes: {run.stop_pore_volumes:g} needs drag.field = 'network', but "
            f"it is {drag.field!r}; set run.duration_ms, since the uniform field keeps its rate"
        )


def crowd_scheme(drag: Drag) -> Iterator[str]:
    """One damping for all fines cannot carry a coefficient of each."""
    if drag.coupled and drag.scheme == "viscous":
        yield (
            "drag.scheme: 'viscous' has one damping for all fines, drag.crowd "
            f"{drag.crowd!r} one for each; take 'implicit' or 'held'"
        )


def update_travel(drag: Drag) -> Iterator[str]:
    """Only coupled forces are computed anew."""
    if drag.update_travel is not None and not drag.coupled:
        yield (
            f"drag.update_travel: {drag.update_travel:g} belongs to a drag that is computed while "
            "LIGGGHTS waits; leave it out, or set drag.crowd = 'beetstra'"
        )


def coupled_inertia(drag: Drag) -> Iterator[str]:
    """The Reynolds number of coupled drag is that of the law of the crowd."""
    if drag.field == "network" and drag.crowd == "none" and drag.inertia != "none":
        yield (
            f"drag.inertia: {drag.inertia!r} with drag.field 'network' is part of the law of the "
            "crowd; set drag.crowd = 'beetstra', or drag.inertia = 'none'"
        )


# ------------------------------------------------------------------------------------------------
# What must hold between the keys that say how fast the fluid moves, and how it is simulated.


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


# ------------------------------------------------------------------------------------------------
# What must hold of the sizes of grains and fines, and of the solids in the mud.


WIDEST_THROAT = math.sqrt(2) - 1
"""Radius of the widest throat between touching grains over their radius: four in a square."""


def size_text(name: str, spheres: Spheres) -> str:
    """The sizes of grains or fines as the case gives them, for a message."""
    if not spheres.measured:
        radius = spheres.radius_mm
        shown = list(radius) if isinstance(radius, tuple) else radius
        return f"{name}.radius_mm: {shown}" if name == "fines" else f"{name}.radius_mm {shown}"
    low, high = (2e3 * radius for radius in spheres.radius_range_m)
    return f"{name}.sizes: diameters of {low:.3g} to {high:.3g} mm"


def concentration_text(fines: Fines) -> str:
    """The solids of the mud as the case gives them, for a message."""
    if fines.solids_kg_m3 is not None:
        return f"fines.solids_kg_m3: {fines.solids_kg_m3:g}"
    return f"fines.concentration: {fines.concentration:g}"


def _one_curve(name: str) -> Rule:
    keys = ("radius_mm", "sizes", "materials") if name == "fines" else ("radius_mm", "sizes")

    def check(spheres: Spheres) -> Iterator[str]:
        given = [key for key in keys if getattr(spheres, key) is not None]
        *others, last = keys
        choice = f"give exactly one of {', '.join(others)} and {last}"
        if not given:
            yield f"{name}.radius_mm: missing, {choice}"
        elif len(given) > 1:
            yield f"{name}.{given[1]}: given beside {name}.{given[0]}, {choice}"

    return Rule(tuple(f"{name}.{key}" for key in keys), check)


def _cut(fines: Fines) -> Iterator[str]:
    if fines.cut_um is not None and not fines.measured and fines.has_one_curve:
        yield (
            f"fines.cut_um: {fines.cut_um:g} cuts measured sizes, but the case gives "
            "fines.radius_mm; leave it out or give fines.sizes"
        )


def _solids(fines: Fines) -> Iterator[str]:
    """The solids are given once, and are no more than fit."""
    if not fines.has_one_concentration:
        yield (
            f"fines.solids_kg_m3: {fines.solids_kg_m3} with fines.concentration: "
            f"{fines.concentration}, give exactly one of the two"
        )
    elif fines.solids_kg_m3 is not None and fines.volume_fraction > MAX_CONCENTRATION:
        most = MAX_CONCENTRATION * fines.solids_density_kg_m3
        yield (
            f"fines.solids_kg_m3: {fines.solids_kg_m3:g} of solids of "
            f"{fines.solids_density_kg_m3:.4g} kg/m3 is {100 * fines.volume_fraction:.3g} % by "
            f"volume; expected at most {most:.3g} ({100 * MAX_CONCENTRATION:.0f} %: more do not "
            "fit at random places)"
        )


def _friction(fines: Fines) -> Iterator[str]:
    for number, one in enumerate(fines.materials or ()):
        if one.friction is not None and one.friction != fines.friction:
            yield (
                f"fines.materials.{number}.friction: {one.friction:g} of {one.name!r}, but all "
                f"fines are of one contact material with fines.friction {fines.friction:g}; set "
                "fines.friction for all"
            )


def _names(fines: Fines) -> Iterator[str]:
    names = [one.name for one in fines.materials or ()]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        yield f"fines.materials: {twice[0]!r} is listed twice, give each material once"


def _some_throat(grains: Grains, fines: Fines) -> Iterator[str]:
    """Measured fines of which none fits through any throat between touching grains."""
    if not fines.measured:
        return
    widest = 2 * WIDEST_THROAT * grains.radius_range_m[1]
    smallest = 2 * fines.radius_range_m[0]
    if smallest > widest:
        yield (
            f"fines.sizes: the smallest fine has {1e3 * smallest:.3g} mm, above every throat "
            f"between touching grains of up to {2e3 * grains.radius_range_m[1]:.3g} mm (at most "
            f"{1e3 * widest:.3g} mm): nothing could invade; check the units of both curves"
        )


SIZE_RULES = (
    _one_curve("grains"),
    _one_curve("fines"),
    Rule(("fines.radius_mm", "fines.cut_um"), _cut),
    Rule(
        (
            "fines.concentration",
            "fines.solids_kg_m3",
            "fines.materials",
            "fines.density_kg_m3",
        ),
        _solids,
    ),
    Rule(("fines.materials", "fines.friction"), _friction),
    Rule(("fines.materials",), _names),
)
"""Rules of sizes, in the order in which their problems are reported."""
SOME_THROAT = Rule(("grains.radius_mm", "fines.radius_mm"), _some_throat)
"""Some fine fits through some throat."""


# ------------------------------------------------------------------------------------------------
# What must hold between the keys of a case.


def cross_problems(tables: Mapping[str, Any], bad: Collection[str] = ()) -> Iterator[str]:
    """What is wrong between the keys of a case.

    A rule is passed over where one of its tables is absent or None, or one of its keys is among
    `bad`: keys whose own value was refused, so that nothing can be said about them.
    """
    unsized = {f"{name}.radius_mm" for name in _SPHERES if not _has_one_curve(tables.get(name))}
    if (fines := tables.get("fines")) is None or not fines.has_one_concentration:
        unsized.add("fines.concentration")
    for rule in RULES:
        given = [tables.get(name) for name in rule.tables]
        silent = set(bad) if rule in SIZE_RULES else unsized | set(bad)
        if all(table is not None for table in given) and not set(rule.keys) & silent:
            yield from rule.check(*given)


def _has_one_curve(spheres: Spheres | None) -> bool:
    return spheres is not None and spheres.has_one_curve


def _rising(name: str) -> Rule:
    def check(spheres: Spheres) -> Iterator[str]:
        pair = spheres.radius_mm
        if isinstance(pair, tuple) and pair[0] >= pair[1]:
            yield f"{name}.radius_mm: {list(pair)} must rise, [smallest, largest]"

    return Rule((f"{name}.radius_mm",), check)


def _number_of_grains(grains: Grains) -> Iterator[str]:
    if grains.porosity is None and grains.count is None:
        yield "grains.porosity: missing, give it (0 to 1) or grains.count"


def _number_of_fines(fines: Fines) -> Iterator[str]:
    if (fines.count is None) == (fines.slab_mm is None):
        yield (
            f"fines.count: {fines.count} with fines.slab_mm: {fines.slab_mm}, "
            "give exactly one of the two"
        )


def _room_for_grains(box: Box, grains: Grains) -> Iterator[str]:
    """Their number is bounded by memory, their plain sum of volumes by the box."""
    volume, grain = math.prod(box.size_mm), grains.mean_volume_m3 * 1e9
    solid = 1 - grains.porosity if grains.porosity is not None else 0.0
    expected = grains.count or solid * volume / grain
    if expected > MOST_GRAINS:
        yield (
            f"box.size_mm: {list(box.size_mm)} holds {expected:.3g} grains; expected at most "
            f"{MOST_GRAINS:.0e}"
        )
    if grains.count is not None and grains.count * grains.mean_volume_m3 * 1e9 >= volume:
        yield (
            f"grains.count: {grains.count} spheres sum to more than the box; expected at most "
            f"{int(volume / grain)}"
        )


def _room_for_one_grain(box: Box, grains: Grains) -> Iterator[str]:
    """A grain fits, and does not meet its own image across a periodic side."""
    diameter = 2e3 * grains.radius_range_m[1]
    for axis, side in zip("xyz", box.size_mm, strict=True):
        imaged = box.sides == "periodic" and axis != "x"
        least = diameter * (2.0 if imaged else 1.0)
        if side < least:
            why = "a grain would meet its own image" if imaged else "a grain does not fit"
            yield (
                f"box.size_mm: side {axis} is {side:g} mm, expected at least {least:g} mm ({why})"
            )


def _slab(box: Box, fines: Fines) -> Iterator[str]:
    """The slab must hold its fines and stay a slab; their number is bounded by memory."""
    area = box.size_mm[1] * box.size_mm[2]
    volume, fraction = fines.mean_volume_m3 * 1e9, fines.placed_fraction
    count = fines.count or fraction * area * (fines.slab_mm or 0.0) / volume
    length = fines.slab_mm or count * volume / (fraction * area)
    if count > MOST_FINES:
        yield (
            f"fines.count: {count:.3g} fines, expected at most {MOST_FINES:.0e}; shorten the slab"
            + (" or raise fines.cut_um" if fines.measured else "")
        )
    if length > MOST_SLAB * box.size_mm[0]:
        yield (
            f"{concentration_text(fines)} makes a slab of {length:.3g} mm, "
            f"expected at most {MOST_SLAB} box lengths; raise it or supply fewer fines"
        )


def _gap_of_sizes(grains: Grains, fines: Fines) -> Iterator[str]:
    none_fits = any(True for _ in SOME_THROAT.check(grains, fines))
    if fines.radius_range_m[1] >= grains.radius_range_m[0] and not none_fits:
        yield (
            f"{size_text('fines', fines)} is not below {size_text('grains', grains)} "
            "(the network needs a clear gap)"
            + ("; narrow sizes.cut_percent of one" if fines.measured or grains.measured else "")
        )


def _skin(run: Run, grains: Grains, fines: Fines) -> Iterator[str]:
    """The skin lies between a hundredth of a fine and a grain."""
    low, high = LEAST_SKIN * 1e3 * fines.radius_range_m[0], 1e3 * grains.radius_range_m[1]
    if run.skin_mm is not None and not low <= run.skin_mm <= high:
        yield (
            f"run.skin_mm: {run.skin_mm:g} mm, expected {low:.3g} ({LEAST_SKIN:g} of the smallest "
            "fine's radius: else neighbours are searched anew nearly every step) to "
            f"{high:.3g} (a grain's radius)"
        )


def _neighbour_bins(run: Run, box: Box, fines: Fines) -> Iterator[str]:
    """The bins of an invasion's neighbour search lie between memory's limit and the box."""
    least, most = (math.prod(box.size_mm) / MOST_NEIGHBOUR_BINS) ** (1 / 3), min(box.size_mm)
    if run.neighbour_bin_mm is not None and not least <= run.neighbour_bin_mm <= most:
        yield (
            f"run.neighbour_bin_mm: {run.neighbour_bin_mm:g} mm, expected {least:.3g} "
            f"({MOST_NEIGHBOUR_BINS:.0e} bins in the box) to {most:.3g} (its shortest side)"
        )


def _refresh(drag: Drag) -> Iterator[str]:
    if drag.scheme != "held" and drag.refresh_steps not in (None, 1):
        yield (
            f"drag.refresh_steps: {drag.refresh_steps} belongs to drag.scheme 'held', not "
            f"{drag.scheme!r}"
        )


def _viscous(drag: Drag, fines: Fines) -> Iterator[str]:
    if drag.scheme == "viscous" and not fines.one_size:
        yield (
            f"drag.scheme: 'viscous' needs fines of one size, {size_text('fines', fines)} "
            "(LIGGGHTS's viscous force is one number a material); take 'held' or 'implicit'"
        )


def _implicit(drag: Drag) -> Iterator[str]:
    if drag.scheme == "implicit" and drag.upstream == "darcy" and not drag.coupled:
        yield (
            "drag.upstream: 'darcy' changes the fluid's velocity at x = 0, drag.scheme "
            "'implicit' keeps one a fine; take 'interstitial', or another drag.scheme"
        )


def _inertia(drag: Drag) -> Iterator[str]:
    if drag.inertia != "none" and drag.scheme in ("viscous", "implicit") and not drag.coupled:
        yield (
            f"drag.inertia: {drag.inertia!r} makes the drag coefficient depend on the slip, "
            f"drag.scheme {drag.scheme!r} keeps one a fine; take 'held'"
        )


def _strengths(bonds: Bonds) -> Iterator[str]:
    """Bonds have both strengths or neither."""
    if (bonds.tensile_strength_MPa is None) != (bonds.shear_strength_MPa is None):
        absent = "tensile" if bonds.tensile_strength_MPa is None else "shear"
        yield (
            f"bonds.{absent}_strength_MPa: missing next to the other strength; give both, or "
            "neither for bonds that never break"
        )


def _end(run: Run) -> Iterator[str]:
    if run.duration_ms is not None and run.cap_ms is not None:
        yield (
            f"run.cap_ms: {run.cap_ms} together with run.duration_ms {run.duration_ms}: "
            "give one of the two"
        )


def _sections(analysis: AnalysisChoices) -> Iterator[str]:
    if isinstance(analysis.sections, tuple):
        yield f"analysis.sections: {analysis.sections}: a case gives the number of sections"


def _laws(analysis: AnalysisChoices) -> Iterator[str]:
    yield from analysis.refusals()


def _profile_bins(box: Box, analysis: AnalysisChoices) -> Iterator[str]:
    thickness = analysis.profile_bin_mm
    if thickness is None:
        yield "analysis.profile_bin_mm: missing, a case gives the thickness of its bins"
    elif box.size_mm[0] / thickness > MOST_BINS:
        yield (
            f"analysis.profile_bin_mm: {thickness:g} cuts {box.size_mm[0]:g} mm into more than "
            f"{MOST_BINS} bins; expected at least {box.size_mm[0] / MOST_BINS:.3g}"
        )


def _of_the_contact(name: str) -> Rule:
    keys = sorted(MODEL_KEYS["hooke"] | MODEL_KEYS["hertz"] | {"damping_ratio"})
    return Rule(("contact.model", *(f"{name}.{key}" for key in keys)), of_the_model(name))


_SPHERES = ("grains", "fines")
_SLAB_KEYS = (
    *("fines.radius_mm", "fines.count", "fines.slab_mm"),
    *("fines.concentration", "fines.solids_kg_m3"),
)
RULES = (
    *SIZE_RULES,
    _rising("grains"),
    _rising("fines"),
    Rule(("grains.porosity", "grains.count"), _number_of_grains),
    Rule(("fines.count", "fines.slab_mm"), _number_of_fines),
    Rule(("box.size_mm", "grains.radius_mm", "grains.porosity", "grains.count"), _room_for_grains),
    Rule(("box.size_mm", "box.sides", "grains.radius_mm"), _room_for_one_grain),
    Rule(("box.size_mm", *_SLAB_KEYS), _slab),
    Rule(("grains.radius_mm", "fines.radius_mm"), _gap_of_sizes),
    SOME_THROAT,
    Rule(("run.skin_mm", "grains.radius_mm", "fines.radius_mm"), _skin),
    Rule(("run.neighbour_bin_mm", "box.size_mm", "fines"), _neighbour_bins),
    *FLOW_RULES,
    *CLEAN_UP_RULES,
    Rule(("drag.field", "drag.upstream", "drag.drive"), flow_field),
    Rule(("drag.field", "grains.motion"), network_grains),
    Rule(("drag.field", "drag.crowd", "drag.inertia"), coupled_inertia),
    Rule(("run.stop_rate", "drag.field", "drag.drive"), stop_rate),
    Rule(("run.stop_pore_volumes", "drag.field"), stop_volume),
    Rule(("drag.scheme", "drag.crowd", "drag.field"), crowd_scheme),
    Rule(("drag.update_travel", "drag.crowd", "drag.field"), update_travel),
    Rule(("drag.scheme", "drag.refresh_steps"), _refresh),
    Rule(("drag.scheme", "fines.radius_mm"), _viscous),
    Rule(("drag.scheme", "drag.upstream"), _implicit),
    Rule(("drag.scheme", "drag.inertia"), _inertia),
    *(_of_the_contact(name) for name in ("grains", "fines")),
    Rule(("contact.model", "contact.cohesion_J_m3"), of_cohesion),
    Rule(("contact.rolling_friction", "grains.friction", "fines.friction"), of_rolling),
    Rule(("bonds.tensile_strength_MPa", "bonds.shear_strength_MPa"), _strengths),
    Rule(("run.duration_ms", "run.cap_ms"), _end),
    Rule(("analysis.sections",), _sections),
    Rule(("analysis.law", "analysis.damage_law"), _laws),
    Rule(("box.size_mm", "analysis.profile_bin_mm"), _profile_bins),
)
"""All rules, in the order in which their problems are reported."""
