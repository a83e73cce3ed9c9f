"""How the fluid moves and how the simulation is driven, as rows of the table of scales."""

from fdnet.case.case import Case
from fdnet.scales.quantity import Quantity, row
from fdnet.scales.scales import InvasionScales, Scales


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
