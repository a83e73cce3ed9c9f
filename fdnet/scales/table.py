"""The scales of a case as rows: name, symbol, value, unit, formula, source."""

from dataclasses import dataclass

from fdnet.case.case import Case
from fdnet.scales.cost import cost_of, memory_bytes
from fdnet.scales.grain_pack import grain_count
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


def _row(name: str, symbol: str, value: float, unit: str, formula: str, source: str) -> Quantity:
    return Quantity(
        name=name, symbol=symbol, value=value, unit=unit, formula=formula, source=source
    )


def scale_rows(case: Case, scales: Scales) -> list[Quantity]:
    """Every scale of the case with its formula and source, in reading order."""
    rows = _flow_rows(case, scales)
    if isinstance(scales, InvasionScales):
        rows += _fine_rows(scales)
    rows += _contact_rows(scales)
    return rows + _cost_rows(case, scales)


def _flow_rows(case: Case, scales: Scales) -> list[Quantity]:
    darcy, interstitial, source = _velocity_formulas(case)
    return [
        _row(
            "Carman-Kozeny permeability",
            "k_CK",
            scales.permeability,
            "m2",
            "d^2 phi^3 / (180 (1-phi)^2)",
            "Carman 1937",
        ),
        _row("Darcy velocity", "q", scales.darcy_velocity, "m/s", darcy, source),
        _row(
            "interstitial velocity",
            "u",
            scales.interstitial_velocity,
            "m/s",
            interstitial,
            "Dupuit 1863",
        ),
        _row(
            "pressure gradient in the pack",
            "-dp/dx",
            scales.pressure_gradient,
            "Pa/m",
            "mu q / k" if case.fluid.darcy_law == "darcy" else "mu q / k + b q^2",
            source,
        ),
        _row(
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


def _fine_rows(scales: InvasionScales) -> list[Quantity]:
    return [
        *_drag_rows(scales),
        *_ratio_rows(scales),
        *_supply_rows(scales),
        *_time_rows(scales),
    ]


def _drag_rows(scales: InvasionScales) -> list[Quantity]:
    low, high = scales.relaxation_time
    sizes = [("smallest", low), ("largest", high)] if low != high else [("every", low)]
    rows = [
        _row(
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
        _row(
            "drag held for",
            "N dt / tau",
            scales.hold_steps * scales.time_step / low,
            "-",
            "below 1 stable, 0.1 exact enough",
            "measured, docs/physics.md",
        ),
    ]


def _ratio_rows(scales: InvasionScales) -> list[Quantity]:
    return [
        _row(
            "particle Reynolds number",
            "Re",
            scales.reynolds,
            "-",
            "rho_f u 2r / mu",
            "Stokes drag holds below about 1",
        ),
        _row(
            "Stokes number",
            "St",
            scales.stokes,
            "-",
            "tau u / d_grain",
            "inertia over drag at a grain",
        ),
        _row(
            "gravity over drag",
            "G",
            scales.gravity_over_drag,
            "-",
            "2 r^2 (rho - rho_f) g / (9 mu u M)",
            "force ratio",
        ),
        _row(
            "impact overlap over diameter",
            "delta/d",
            scales.impact_overlap,
            "-",
            "u sqrt(m/k) / 2r",
            "linear spring",
        ),
        _row(
            "drag overlap over diameter",
            "delta/d",
            scales.drag_overlap,
            "-",
            "6 pi mu M u / 2k",
            "linear spring",
        ),
    ]


def _supply_rows(scales: InvasionScales) -> list[Quantity]:
    return [
        _row("fines supplied", "n", scales.supplied_count, "-", "c A l / v", "slab of suspension"),
        _row("slab length", "l", scales.slab_length, "m", "n v / (c A)", "slab of suspension"),
        _row(
            "time to feed the slab",
            "t_f",
            scales.slab_length / scales.upstream_velocity,
            "s",
            "l / u",
            "kinematics",
        ),
    ]


def _time_rows(scales: InvasionScales) -> list[Quantity]:
    return [
        _row(
            "plug time",
            "t_p",
            scales.plug_time,
            "s",
            "4 d_grain / u or 10 arrivals unless given",
            "stop rule",
        ),
        _row(
            "cap or duration",
            "t_c",
            scales.cap_time,
            "s",
            "3 t_f + 4 t_p + 2 L / u unless given",
            "stop rule",
        ),
        _row(
            "time step",
            "dt",
            scales.time_step,
            "s",
            "factor sqrt(m/k), at most 0.1 tau",
            "measured, docs/physics.md",
        ),
    ]


def _contact_rows(scales: Scales) -> list[Quantity]:
    rows = [
        _row(
            "stiffness factor",
            "f_k",
            scales.stiffness_factor,
            "-",
            "run.stiffness / stiffest pair",
            "scaling",
        )
    ]
    for contact in scales.contacts.values():
        rows += [
            _row(
                f"{contact.pair} stiffness used",
                "k",
                contact.normal_stiffness,
                "N/m",
                "f_k kA kB / (kA + kB)",
                "series springs",
            ),
            _row(
                f"{contact.pair} contact time",
                "t_c",
                contact.contact_time,
                "s",
                "pi / (sqrt(k/m_eff) sqrt(1-zeta^2))",
                "damped oscillator",
            ),
            _row(
                f"{contact.pair} stable step",
                "dt_s",
                0.2 * contact.step_limit,
                "s",
                "0.2 sqrt(m/k)",
                "measured, docs/physics.md",
            ),
        ]
    return rows


def _cost_rows(case: Case, scales: Scales) -> list[Quantity]:
    cost = cost_of(case, scales)
    rows = [
        _row("grains, first guess", "N", grain_count(case), "-", "(1-phi) V / v", "plain sum"),
        _row(
            "pack run time, one core",
            "t_pack",
            cost.pack_seconds,
            "s",
            "N steps 1e-7 s an attempt",
            "measured, within a factor of 3",
        ),
        _row(
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
            _row(
                "invasion run time, one core",
                "t_run",
                cost.invade_seconds,
                "s",
                "steps (2e-6 s + N and n x seconds a sphere)",
                "measured, within a factor of 3",
            )
        )
    return rows
