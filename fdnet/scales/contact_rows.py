"""Rows of the contacts in the table of scales."""

from fdnet.case.case import Case, InvasionCase
from fdnet.scales.cohesion import pull_off_of
from fdnet.scales.hertz import rayleigh_time
from fdnet.scales.hertz_contacts import material_of
from fdnet.scales.overlaps import LARGEST_CHAIN
from fdnet.scales.quantity import Quantity, row
from fdnet.scales.restitution import LEAST
from fdnet.scales.scales import InvasionScales, Scales
from fdnet.scales.springs import Contact


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
