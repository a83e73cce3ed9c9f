"""Decks: the text of a LIGGGHTS input, from a template, and the lines that several decks share."""

import math
from functools import cache
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import numpy as np
from jinja2 import meta

from fdnet.case.case import Case, InvasionCase
from fdnet.errors import DeckError, DumpError
from fdnet.files import write_text
from fdnet.scales.contacts import material_of
from fdnet.scales.drag import COEFFICIENT, EXPONENT
from fdnet.scales.scales import InvasionScales, Scales
from fdnet.spheres.dump import Frame
from fdnet.spheres.geometry import wrapped
from fdnet.spheres.snapshot import Array, Kind, Snapshot


class LeftOut(NamedTuple):
    """Something that a deck does without, and why it is not needed."""

    what: str
    why: str

    def __str__(self) -> str:
        return f"{self.what} ({self.why})"


class Deck(NamedTuple):
    """A rendered deck: LIGGGHTS input, and what a general deck would have and this one has not."""

    text: str
    left_out: tuple[LeftOut, ...]


def _source(name: str, folder: Path | None) -> str | None:
    own = folder / name if folder is not None else None
    entry = own if own is not None and own.is_file() else files("liggghts_templates") / name
    return entry.read_text(encoding="utf-8") if entry.is_file() else None


@cache
def _environment(folder: Path | None) -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: _source(name, folder)),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


@cache
def used_variables(template: str, folder: Path | None = None) -> frozenset[str]:
    """Names the template and everything it includes take from outside."""
    source = _source(template, folder)
    if source is None:
        raise DeckError(f"liggghts_templates/{template}: template not found; reinstall fdnet")
    tree = _environment(folder).parse(source)
    parts = [used_variables(name, folder) for name in meta.find_referenced_templates(tree) if name]
    return frozenset(meta.find_undeclared_variables(tree)).union(*parts)


def render_text(template: str, variables: dict[str, Any], *, folder: Path | None = None) -> str:
    """The template with `variables` put in; one of `folder` comes before a shipped one.

    Raises DeckError: a template or variable is missing, or a variable is offered but never used.
    """
    unused = set(variables) - used_variables(template, folder)
    if unused:
        names = ", ".join(sorted(unused))
        raise DeckError(f"{template}: variables offered but never used: {names}")
    try:
        return _environment(folder).get_template(template).render(variables)
    except jinja2.UndefinedError as error:
        raise DeckError(f"{template}: {error.message}; expected a value from fdnet.dem") from error
    except jinja2.TemplateSyntaxError as error:
        raise DeckError(f"{error.name or template}:{error.lineno}: {error.message}") from error


def number(value: float) -> str:
    """A float as LIGGGHTS reads it back exactly."""
    return repr(float(value))


# ------------------------------------------------------------------------------------------------
# The contact lines of a deck: properties of materials and pairs, and LIGGGHTS's contact model.


_MATERIALS = {"pack": ("grain", "wall"), "invade": ("grain", "fine", "wall")}
SOFTEST, HARDEST = 5e6, 1e9
"""Young's moduli, Pa, beyond which LIGGGHTS asks for a confirmation in the deck."""


def contact_variables(case: Case, scales: Scales, stage: str, *, friction: bool) -> dict[str, Any]:
    """Variables of `_contacts.in.j2`: symmetric matrices row by row, and the contact model."""
    names, contact = _MATERIALS[stage], case.contact
    size = len(names)

    known, between = scales.contacts, list(product(names, names))
    # two walls never touch: any value serves
    pairs = [
        known.get(f"{a}-{b}") or known.get(f"{b}-{a}") or known["grain-wall"] for a, b in between
    ]

    def matrix(value: str) -> str:
        """A value of all pairs, row by row."""
        return " ".join(number(getattr(pair, value)) for pair in pairs)

    rolling = contact.rolling_friction if friction else None
    shared = {
        "model": contact.model,
        "materials": " ".join(names),
        "size": size,
        "friction": matrix("friction") if friction else "",
        "rolling": "" if rolling is None else " ".join([number(rolling)] * size**2),
        "cohesion": _cohesion(case, stage),
        "pair_model": "".join(_law(case, stage, friction)),
    }
    if contact.model == "hooke":
        return shared | {
            "normal": matrix("normal_stiffness"),
            "damping": matrix("damping_rate"),
            "shear": matrix("shear_stiffness"),
            "no_damping": " ".join(["0"] * size**2),
        }
    elastic = [material_of(case, name, scales.stiffness_factor) for name in names]
    moduli = [modulus for modulus, _ in elastic]
    return shared | {
        "modulus": " ".join(number(modulus) for modulus in moduli),
        "poisson": " ".join(number(ratio) for _, ratio in elastic),
        "soft": min(moduli) < SOFTEST,
        "hard": max(moduli) > HARDEST,
        "restitution": matrix("restitution"),
    }


def wall_law(case: Case, stage: str, *, friction: bool) -> dict[str, Any]:
    """Contact model, material and settings of a plane."""
    model, settings = _law(case, stage, friction)
    return {"model": model, "material": len(_MATERIALS[stage]), "settings": settings}


def _law(case: Case, stage: str, friction: bool) -> tuple[str, str]:
    """LIGGGHTS's models in its order, and settings; packing knows no friction or cohesion.

    A contact that a liquid damps may pull: the film resists parting as it does approach.
    """
    contact = case.contact
    words = ["hertz" if contact.model == "hertz" else "hooke/stiffness"]
    words += ["tangential history"] if friction else []
    words += ["cohesion sjkr"] if _cohesion(case, stage) else []
    words += ["rolling_friction epsd2"] if friction and contact.rolling_friction else []
    pulls = stage == "invade" and contact.restitution == "liquid"
    tangential = " tangential_damping off" if friction else ""
    return " ".join(words), tangential + (" limitForce off" if pulls else " limitForce on")


def _cohesion(case: Case, stage: str) -> str:
    """Of the pairs with a fine; grains do not attract each other or a wall."""
    density, materials = case.contact.cohesion_J_m3, _MATERIALS[stage]
    if density is None or "fine" not in materials:
        return ""
    pairs = product(materials, materials)
    return " ".join(number(density if "fine" in pair else 0.0) for pair in pairs)


# ------------------------------------------------------------------------------------------------
# Gravity and buoyancy in the invasion deck: what acts on the fines, and on grains that move.
#
# A sphere of density rho_p in a fluid of density rho_f at rest feels m g (1 - rho_f / rho_p), in
# any direction of g: LIGGGHTS's `fix gravity` with a magnitude for each group of equal density.
# Fines of several densities have the whole of gravity, and buoyancy as a force of its own.


def gravity_variables(
    case: InvasionCase, scales: InvasionScales
) -> tuple[list[dict[str, Any]], list[LeftOut]]:
    """One `fix gravity` for each group that it moves, and what is left out of the deck."""
    gravity, what = case.gravity, "gravity and buoyancy"
    size = math.hypot(*gravity.acceleration_m_s2)
    if gravity.mode == "off" or size == 0:
        return [], [LeftOut(what, "switched off")]
    if gravity.mode == "auto" and scales.gravity_over_drag < gravity.negligible_below:
        below = f"below {gravity.negligible_below:g}"
        why = f"gravity is {scales.gravity_over_drag:.1e} of the drag, {below}"
        return [], [LeftOut(what, why)]
    groups = {"fines": {one.density for one in case.fines.components}}
    if case.grains.motion == "mobile":
        groups["grains"] = {case.grains.density_kg_m3}
    pulls, fluid = [], case.fluid.density_kg_m3
    for name, densities in groups.items():
        mixed = len(densities) > 1
        # below 0 they rise
        share = 1.0 if mixed else 1 - fluid / min(densities) * gravity.buoyancy
        turn = math.copysign(1.0, scales.force_factor * share)
        # buoyancy over the cube of the radius, N/m3, as simulated
        rate = 4 / 3 * math.pi * fluid * scales.force_factor
        lifted = gravity.acceleration_m_s2 if mixed and gravity.buoyancy else ()
        way = [number(turn * one / size + 0.0) for one in gravity.acceleration_m_s2]
        pull = {"group": name, "magnitude": number(abs(scales.force_factor * share) * size)}
        lift = [number(-rate * one + 0.0) for one in lifted]
        pulls.append(pull | {"direction": " ".join(way), "lift": lift})
    return pulls, [] if gravity.buoyancy else [LeftOut("buoyancy", "switched off")]


# ------------------------------------------------------------------------------------------------
# The fluid in the invasion deck: what each scheme of `drag.scheme` puts into `_drag.in.j2`.
#
# The force of the pressure gradient is the same in all schemes: constant on each fine, and only
# inside the pack. It acts on the fines alone, as the drag does.


BELOW_ZERO = -5e-324  # The largest number below 0: a region that ends here holds exactly x < 0


def drag_variables(case: InvasionCase, scales: InvasionScales) -> dict[str, Any]:
    """Variables of the drag block: the scheme and, as text, the numbers that it needs.

    The drag on a fine of radius r and velocity v is 6 pi mu M r (u - v): mu the viscosity, M the
    multiplier, u the velocity of the fluid, at x < 0 that of the mud.
    """
    if case.drag.coupled:
        return {"coupled": True}
    coefficient = case.fluid.stokes_coefficient_Pa_s * case.drag.multiplier
    slower, slope = scales.drive_velocity - scales.upstream_velocity, scales.push.reynolds_slope
    shared = {
        "coupled": False,
        "scheme": case.drag.scheme,
        "coefficient": number(coefficient),
        "velocity": number(scales.drive_velocity),
        "gradient": _gradient(case, scales),
    }
    if case.drag.scheme == "viscous":
        # for fines of one radius, as a constant force and viscous damping
        damping = coefficient * case.fines.mean_radius_m
        return shared | {
            "damping": number(damping),
            "push": number(damping * scales.drive_velocity),
            "slower": number(-damping * slower) if slower else "",
            "face": number(BELOW_ZERO),
        }
    law = {"factor": COEFFICIENT, "exponent": EXPONENT, "reynolds": slope}
    return shared | {
        "fluid_x": f"(f_uf[1]-(x<0.0)*{number(slower)})" if slower else "f_uf[1]",
        "hold_steps": scales.hold_steps if scales.hold_steps > 1 else 0,
        "inertia": {name: number(value) for name, value in law.items()} if slope else None,
    }


def _gradient(case: InvasionCase, scales: InvasionScales) -> dict[str, str] | None:
    """V (-grad p) inside the pack: one force, or a formula for fines of many sizes.

    Where all have one density V is taken from the mass, which is the cheaper formula.
    """
    push, densities = scales.push, {one.density for one in case.fines.components}
    if not push.gradient:
        return None
    force, formula = "", f"{number(push.gradient_force(1.0))}*r*r*r"
    if case.fines.one_size:
        force, formula = number(push.gradient_force(case.fines.mean_radius_m)), ""
    elif len(densities) == 1:
        formula = f"{number(push.gradient / min(densities))}*mass"
    end = number(np.nextafter(case.size_m[0], 0))
    return {"pores": f"0.0 {end} INF INF INF INF", "force": force, "formula": formula}


def forces_left_out(case: InvasionCase) -> list[LeftOut]:
    """The forces of the fluid that the deck does without."""
    drag, on_grains = case.drag, "force of the pressure gradient on the grains"
    pushed = drag.pressure_gradient and case.grains.motion == "mobile"
    reasons = [
        ("force of the pressure gradient", "switched off", not drag.pressure_gradient),
        (on_grains, "the fluid pushes the fines only", pushed),
        ("drag at finite Reynolds numbers", "not asked for", drag.inertia == "none"),
        ("drag in a crowd", "the uniform field has none", not drag.coupled),
    ]
    return [LeftOut(what, why) for what, why, left in reasons if left]


# ---- What both scenes share in a deck: header, walls, and the data file of spheres.
def header_variables(
    case: Case, stage: str, left_out: list[LeftOut], ranks: int
) -> dict[str, Any]:
    """Variables of `_header.in.j2`.

    Several ranks never cut the box across the flow, because the fines crowd at the face.
    """
    sideways = "p p" if case.box.sides == "periodic" else "f f"
    return {
        "stage": stage,
        "case_name": case.name,
        "digest": case.digest(stage),
        "left_out": left_out,
        "boundary": f"f {sideways}",
        "processors": "1 * *" if ranks > 1 else "",
    }


def wall_variables(case: Case, stage: str, *, friction: bool) -> list[dict[str, Any]]:
    """Planes at the sides, and at both ends for grains that move; fines pass the ends freely."""
    size, law = case.size_m, wall_law(case, stage, friction=friction)
    mobile = case.grains.motion == "mobile"
    ends_hold = "all" if stage == "pack" else "grains" if mobile else ""
    sides_hold = "all" if stage == "pack" or mobile else "fines"
    sides_hold = "" if case.box.sides == "periodic" else sides_hold
    return [
        {
            "id": f"w{'xyz'[axis]}{end}",
            "group": held,
            "plane": f"{'xyz'[axis]}plane",
            "position": number(position),
            **law,
        }
        for axis, held in ((0, ends_hold), (1, sides_hold), (2, sides_hold))
        for end, position in enumerate((0.0, size[axis]))
        if held
    ]


def write_data(
    path: Path, spheres: Snapshot, *, bounds: Array, density: Array, types: int
) -> None:
    """Write the spheres (N) as a LIGGGHTS data file of so many `types` of atoms.

    `bounds` (3, 2) m are those of the simulation box, `density` (N,) is in kg/m3.
    """
    lines = ["spheres", "", f"{len(spheres)} atoms", f"{types} atom types", ""]
    for (low, high), axis in zip(bounds, "xyz", strict=True):
        lines.append(f"{number(low)} {number(high)} {axis}lo {axis}hi")
    lines += ["", "Atoms", ""]
    columns = [spheres.id, spheres.kind, 2 * spheres.radius, density, spheres.position]
    for atom, kind, *rest in np.column_stack(columns):
        lines.append(f"{atom:.0f} {kind:.0f} " + " ".join(f"{value:.17g}" for value in rest))
    write_text(path, "\n".join(lines) + "\n")


def specimen_box(case: Case) -> Array:
    """Corners (3, 2) m of the specimen's box."""
    return np.column_stack([np.zeros(3), case.size_m])


def snapshot_of(frame: Frame, case: Case, *, time_s: float) -> Snapshot:
    """A frame of a dump as a Snapshot in the specimen's box.

    Positions beyond a periodic side are moved into the box. Raises DumpError on a type that is
    neither grain nor fine, or a radius not above 0.
    """
    for name, good, expected in (
        ("type", np.isin(frame.column("type"), list(Kind)), "1 (grain) or 2 (fine)"),
        ("radius", frame.column("radius") > 0, "a number above 0"),
    ):
        for bad in np.flatnonzero(~good)[:1]:
            raise DumpError(
                f"dump at step {frame.step}: the sphere with id {frame.column('id')[bad]:.0f} "
                f"has {name} {frame.column(name)[bad]:g}, expected {expected}; the file was "
                "changed, start over with --force"
            )
    position, box = np.column_stack([frame.column(c) for c in "xyz"]), specimen_box(case)
    return Snapshot(
        step=frame.step,
        time_s=time_s,
        box=box,
        id=frame.column("id"),
        kind=frame.column("type"),
        position=wrapped(position, box, case.periodic),
        radius=frame.column("radius"),
        velocity=np.column_stack([frame.column(f"v{c}") for c in "xyz"]),
    )
