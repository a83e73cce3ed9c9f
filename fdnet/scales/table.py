"""The table of scales that `fdnet render` prints.

One row of the table of scales.
"""

from dataclasses import dataclass

from fdnet.case.case import Case, InvasionCase
from fdnet.scales.contacts import (
    LARGEST_CHAIN,
    LEAST,
    Contact,
    material_of,
    pull_off_of,
    rayleigh_time,
)
from fdnet.scales.cost import cost_of, memory_bytes
from fdnet.scales.drag import MOST_RATIO, held_factor
from fdnet.scales.pack import grain_count, size_rows
from fdnet.scales.scales import InvasionScales, Scales


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One row of the table of scales.

    Attributes:
        name: what it is, in words.
        symbol: as in the formulas.
        value: in `unit`.
        unit: SI; "-" for a number without a unit.
        formula: how it follows from the case.
        source: author and year, or where it was measured.
    """

    name: str
    symbol: str
    value: float
    unit: str
    formula: str
    source: str


def row(name: str, symbol: str, value: float, unit: str, formula: str, source: str) -> Quantity:
    return Quantity(
        name=name, symbol=symbol, value=value, unit=unit, formula=formula, source=source
    )


# ------------------------------------------------------------------------------------------------
# Rows of the contacts in the table of scales.


def contact_rows(case: Case, scales: Scales) -> list[Quantity]:
    """What the contacts of the case are, and the bounds on its time step."""
    hertz = case.contact.model == "hertz"
    rows = [
        row(
            "stiffness factor",
            "f_k",
            scales.stiffness_factor,
            "-",
            "run.stiffness / stiffest pair" + (" of a fine, at delta = 0.01 d" if hertz else ""),
            "scaling",
        )
    ]
    for contact in scales.contacts.values():
        rows += _hertz_rows(contact) if hertz else _hooke_rows(contact)
        if contact.stokes is not None:
            rows += _rebound_rows(contact, contact.stokes)
    if case.contact.cohesion_J_m3 and isinstance(case, InvasionCase):
        rows.append(_pull_off_row(case, scales))
    if hertz and isinstance(case, InvasionCase):
        rows.append(_rayleigh_row(case, scales))
    return rows


def overlap_rows(case: Case, scales: InvasionScales) -> list[Quantity]:
    """How deep impact and drag press a fine into a grain."""
    hertz = case.contact.model == "hertz"
    rows = [
        row(
            "impact overlap over diameter",
            "delta/d",
            scales.impact_overlap,
            "-",
            "(15 m v^2 / (16 E* sqrt(R*)))^(2/5) / 2r" if hertz else "v sqrt(m/k) / 2r, v <= w",
            "Hertz 1882" if hertz else "linear spring",
        ),
        row(
            "drag overlap over diameter",
            "delta/d",
            scales.drag_overlap,
            "-",
            "(3 F / (4 E* sqrt(R*)))^(2/3) / 2r" if hertz else "F / (2 k r), F of a fine at rest",
            "Hertz 1882" if hertz else "linear spring",
        ),
    ]
    if case.drag.field == "network":
        rows.append(
            row(
                "overlap in the deposit over diameter",
                "delta/d",
                scales.deposit_overlap,
                "-",
                f"as by drag, F = {LARGEST_CHAIN:g} dp pi D^2 / 4, D of a throat",
                "measured, docs/how-to",
            )
        )
    return rows


def _hooke_rows(contact: Contact) -> list[Quantity]:
    return [
        row(
            f"{contact.pair} stiffness used",
            "k",
            contact.normal_stiffness,
            "N/m",
            "f_k kA kB / (kA + kB)",
            "series springs",
        ),
        row(
            f"{contact.pair} contact time",
            "t_c",
            contact.contact_time,
            "s",
            "pi / (sqrt(k/m_eff) sqrt(1-zeta^2))",
            "damped oscillator",
        ),
        row(
            f"{contact.pair} stable step",
            "dt_s",
            0.2 * contact.step_limit,
            "s",
            "0.2 sqrt(m/k)",
            "measured, docs/physics.md",
        ),
    ]


def _hertz_rows(contact: Contact) -> list[Quantity]:
    assert contact.elastic is not None
    return [
        row(
            f"{contact.pair} modulus used",
            "E*",
            contact.elastic.modulus,
            "Pa",
            "f_k / ((1-nuA^2)/EA + (1-nuB^2)/EB)",
            "Hertz 1882",
        ),
        row(
            f"{contact.pair} stiffness at 0.01 d",
            "k",
            contact.normal_stiffness,
            "N/m",
            "4/3 E* sqrt(R* 0.01 d)",
            "Hertz 1882",
        ),
        row(
            f"{contact.pair} contact time",
            "t_c",
            contact.contact_time,
            "s",
            "2.87 (m_eff^2 / (R* E*^2 u))^(1/5)",
            "Hertz 1882",
        ),
        row(
            f"{contact.pair} stable step",
            "dt_s",
            0.2 * contact.step_limit,
            "s",
            "0.2 sqrt(m/k), k = 2 E* sqrt(R* 0.04 d)",
            "measured, docs/physics.md",
        ),
    ]


def _rayleigh_row(case: InvasionCase, scales: Scales) -> Quantity:
    modulus, ratio = material_of(case, "fine", scales.stiffness_factor)
    density = min(one.density for one in case.fines.components)
    return row(
        "Rayleigh time of the smallest fine",
        "t_R",
        rayleigh_time(case.fines.radius_range_m[0], density, modulus, ratio),
        "s",
        "pi r sqrt(rho/G) / (0.1631 nu + 0.8766)",
        "Thornton and Randall 1988",
    )


def _rebound_rows(contact: Contact, stokes: float) -> list[Quantity]:
    least = LEAST["hertz" if contact.elastic else "hooke"]
    return [
        row(
            f"{contact.pair} impact Stokes number",
            "St",
            stokes,
            "-",
            "m_eff u / (6 pi mu R*^2)",
            "Joseph and others 2001",
        ),
        row(
            f"{contact.pair} restitution in the liquid",
            "e",
            contact.restitution,
            "-",
            f"e_dry exp(-35 / St), at least {least:g}",
            "Legendre and others 2005",
        ),
    ]


def _pull_off_row(case: InvasionCase, scales: Scales) -> Quantity:
    return row(
        "pull-off force of a fine from a grain",
        "F_c",
        pull_off_of(case, scales.contacts["grain-fine"]).force,
        "N",
        "2/3 (pi c)^3 R*^2 / E*^2",
        "Hertz and LIGGGHTS's SJKR",
    )


# ------------------------------------------------------------------------------------------------
# How the fluid moves and how the simulation is driven, as rows of the table of scales.


def flow_rows(case: Case, scales: Scales) -> list[Quantity]:
    """Permeability, velocities, pressure gradient and loss by inertia."""
    darcy, interstitial, source = _velocity_formulas(case)
    return [
        row(
            "Carman-Kozeny permeability",
            "k_CK",
            scales.permeability,
            "m2",
            "d^2 phi^3 / (180 (1-phi)^2)",
            "Carman 1937",
        ),
        row("Darcy velocity", "q", scales.darcy_velocity, "m/s", darcy, source),
        row(
            "interstitial velocity",
            "u",
            scales.interstitial_velocity,
            "m/s",
            interstitial,
            "Dupuit 1863",
        ),
        row(
            "pressure gradient in the pack",
            "-dp/dx",
            scales.pressure_gradient,
            "Pa/m",
            "mu q / k" if case.fluid.darcy_law == "darcy" else "mu q / k + b q^2",
            source,
        ),
        row(
            "loss of velocity by inertia",
            "1 - q_E/q_D",
            scales.inertial_loss,
            "-",
            "b = 1.75/150 rho_f d / (k (1-phi))",
            "Ergun 1952",
        ),
    ]


def _velocity_formulas(case: Case) -> tuple[str, str, str]:
    """Formulas of the Darcy and of the interstitial velocity, and the source of the first."""
    ergun = case.fluid.darcy_law == "ergun"
    source = "Ergun 1952" if ergun else "Darcy 1856"
    if case.fluid.velocity_m_s is not None:
        return "q = u phi", "given in the case", source
    length = "L" if case.well is None else "r_w ln(r_e/r_w)"
    if not ergun:
        return f"q = k dP / (mu {length})", "u = q / phi", source
    second = "L" if case.well is None else "r_w^2 (1/r_w - 1/r_e)"
    return f"mu q {length} / k + b q^2 {second} = dP", "u = q / phi", source


def drive_rows(scales: InvasionScales) -> list[Quantity]:
    """How the simulation is driven; no rows where it moves as fast as the fluid."""
    if scales.force_factor == 1.0:
        return []
    return [
        row(
            "velocity in the simulation",
            "u_DEM",
            scales.drive_velocity,
            "m/s",
            "as given, or impact Stokes number 0.1",
            "similarity without inertia",
        ),
        row(
            "factor on the forces and on time",
            "s",
            scales.force_factor,
            "-",
            "u_DEM / u; physical time = s t",
            "similarity without inertia",
        ),
    ]


# ------------------------------------------------------------------------------------------------
# The forces on a fine as rows of the table of scales.


def force_rows(scales: InvasionScales) -> list[Quantity]:
    """Ratios of the forces on the largest fine, and how fast it is."""
    return [
        row(
            "particle Reynolds number",
            "Re",
            scales.reynolds,
            "-",
            "rho_f u 2r / mu",
            "Stokes drag holds below about 1",
        ),
        row(
            "Stokes number",
            "St",
            scales.stokes,
            "-",
            "tau u / d_grain, as simulated",
            "inertia over drag at a grain",
        ),
        row(
            "impact Stokes number",
            "St_i",
            scales.impact_stokes,
            "-",
            "tau w / r, as simulated",
            "Joseph 2001; inertia does not matter well below 1",
        ),
        row(
            "pressure gradient over drag",
            "P",
            scales.gradient_over_drag,
            "-",
            "2 r^2 phi / (9 k M)",
            "V (-grad p) over Stokes's drag at rest",
        ),
        row(
            "gravity over drag",
            "G",
            scales.gravity_over_drag,
            "-",
            "2 r^2 (rho - rho_f) g / (9 mu u M)",
            "force ratio",
        ),
        row(
            "velocity of a free fine",
            "w",
            scales.drift_velocity,
            "m/s",
            "u (1 + P) where the gradient acts, as simulated",
            "balance of drag and gradient",
        ),
        *_throat_rows(scales),
    ]


def _throat_rows(scales: InvasionScales) -> list[Quantity]:
    """The walls of the throats; no factor for a fine that closes them."""
    rows = [
        row(
            "largest fine over throat",
            "d/D",
            scales.throat_ratio,
            "-",
            "2r / sqrt(32 k / phi)",
            "tubes of the pack's permeability",
        )
    ]
    if scales.throat_ratio <= MOST_RATIO:
        rows.append(
            row(
                "drag in a throat over a lone sphere's",
                "K",
                held_factor(scales.throat_ratio),
                "-",
                "at rest on the axis",
                "Haberman & Sayre 1958, solved anew",
            )
        )
    return rows


# ------------------------------------------------------------------------------------------------
# The scales of a case as rows: name, symbol, value, unit, formula, source.


def scale_rows(case: Case, scales: Scales) -> list[Quantity]:
    """Every scale of the case with its formula and source, in reading order."""
    rows = [row(*one) for one in size_rows(case)] + flow_rows(case, scales)
    if isinstance(scales, InvasionScales):
        rows += _fine_rows(case, scales)
    rows += contact_rows(case, scales)
    return rows + _cost_rows(case, scales)


def _fine_rows(case: Case, scales: InvasionScales) -> list[Quantity]:
    return [
        *drive_rows(scales),
        *_drag_rows(scales),
        *force_rows(scales),
        *overlap_rows(case, scales),
        *_supply_rows(scales),
        *_time_rows(scales),
    ]


def _drag_rows(scales: InvasionScales) -> list[Quantity]:
    low, high = scales.relaxation_time
    sizes = [("smallest", low), ("largest", high)] if low != high else [("every", low)]
    rows = [
        row(
            f"drag relaxation time, {name} fine",
            "tau",
            tau,
            "s",
            "2 r^2 rho / (9 mu M)",
            "Stokes 1851",
        )
        for name, tau in sizes
    ]
    return [
        *rows,
        row(
            "drag held for",
            "N dt / tau",
            scales.hold_steps * scales.time_step / low,
            "-",
            "below 1 stable, 0.1 exact enough",
            "measured, docs/physics.md",
        ),
    ]


def _supply_rows(scales: InvasionScales) -> list[Quantity]:
    return [
        row("fines supplied", "n", scales.supplied_count, "-", "c A l / v", "slab of suspension"),
        row("slab length", "l", scales.slab_length, "m", "n v / (c A)", "slab of suspension"),
        row(
            "time to feed the slab, simulated",
            "t_f",
            scales.slab_length / scales.upstream_velocity,
            "s",
            "l / u",
            "kinematics",
        ),
    ]


def _time_rows(scales: InvasionScales) -> list[Quantity]:
    return [
        row(
            "plug time, simulated",
            "t_p",
            scales.plug_time,
            "s",
            "4 d_grain / u or 10 arrivals unless given",
            "stop rule",
        ),
        row(
            "cap or duration, simulated",
            "t_c",
            scales.cap_time,
            "s",
            "3 t_f + 4 t_p + 2 L / u unless given",
            "stop rule",
        ),
        row(
            "time step",
            "dt",
            scales.time_step,
            "s",
            "factor sqrt(m/k), at most 0.1 tau",
            "measured, docs/physics.md",
        ),
    ]


def _cost_rows(case: Case, scales: Scales) -> list[Quantity]:
    cost = cost_of(case, scales)
    rows = [
        row("grains, first guess", "N", grain_count(case), "-", "(1-phi) V / v", "plain sum"),
        row(
            "pack run time, one core",
            "t_pack",
            cost.pack_seconds,
            "s",
            "N steps 1e-7 s an attempt",
            "measured, within a factor of 2",
        ),
        row(
            "memory",
            "M",
            memory_bytes(case, scales),
            "byte",
            "9 MB + 600 B a sphere",
            "measured",
        ),
    ]
    if isinstance(scales, InvasionScales):
        rows.append(
            row(
                "invasion run time, one core",
                "t_run",
                cost.invade_seconds,
                "s",
                "steps (2e-6 s + N and n x seconds a sphere)",
                "measured, within a factor of 2",
            )
        )
    return rows
