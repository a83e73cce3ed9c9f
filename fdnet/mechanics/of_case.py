"""The moduli of a pack as keys of mechanics.json."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from fdnet.case.case import Case
from fdnet.errors import CaseError, Doubt
from fdnet.mechanics.elastic import Elastic, elastic_of, voigt_average
from fdnet.mechanics.springs import Cement, PackMaterial, find_joints, mean_force
from fdnet.mechanics.triaxial import LoadStep, Sheared, Triaxial, triaxial
from fdnet.scales import contacts
from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Snapshot


def elastic_numbers(result: Elastic) -> dict[str, Any]:
    """Moduli, velocities and counts in SI; the moduli are those of the isotropic average."""
    along, mean = result.young_along or (None, None, None), result.averaged
    p_wave, s_wave = result.waves
    return {
        "young_modulus_Pa": mean.young,
        "poisson_ratio": mean.poisson,
        "bulk_modulus_Pa": mean.bulk,
        "shear_modulus_Pa": mean.shear,
        "p_wave_m_s": p_wave,
        "s_wave_m_s": s_wave,
        "density_kg_m3": result.density,
        "young_modulus_x_Pa": along[0],
        "young_modulus_y_Pa": along[1],
        "young_modulus_z_Pa": along[2],
        "tensor_Pa": result.tensor.tolist(),
        "anisotropy": result.anisotropy,
        "affine_young_modulus_Pa": voigt_average(result.affine).young,
        "coordination": result.coordination,
        "grains": result.grains,
        "rattlers": result.rattlers,
        "contacts": result.contacts,
        "bonds": result.bonds,
    }


def triaxial_numbers(result: Sheared) -> dict[str, Any]:
    """What a triaxial test gave, in SI; stresses and strains of compression are above 0."""
    peak, last, test = result.peak, result.rows[-1], result.test
    return {
        "confining_Pa": test.confining,
        "young_modulus_Pa": result.young,
        "poisson_ratio": result.poisson,
        "peak_Pa": peak.deviatoric,
        "peak_strain": peak.axial_strain,
        "at_end_Pa": last.deviatoric,
        "strain_at_end": last.axial_strain,
        "volume_strain_at_end": last.volume_strain,
        "bonds": result.bonds,
        "broken_in_tension": last.tension,
        "broken_in_shear": last.shear,
        "load_steps": test.steps,
        "tolerance": test.tolerance,
        "restless": result.restless,
    }


def triaxial_warnings(result: Sheared) -> Iterator[str]:
    """What a reader of the curve must know, one sentence each."""
    if result.restless:
        yield Doubt(
            "load-steps-not-at-rest",
            f"{result.restless} of {len(result.rows)} load steps of the triaxial test did not "
            f"come to rest within the tolerance {result.test.tolerance:g}: the curve is uncertain "
            "there; take more load steps",
        )
    if result.peak is result.rows[-1]:
        yield Doubt(
            "peak-at-the-last-step",
            "the largest deviatoric stress of the triaxial test is that of its last step: the "
            "peak may lie beyond; raise --strain",
        )


# ---- The material of a case's grains and bonds, and the moduli of its pack.
QUARTZ_YOUNG = 94.3e9  # Young's modulus of quartz, Pa (Shi 2011, section 2.3.1)
MANY_RATTLERS = 0.05  # Share of grains that carry nothing above which a result warns


def elastic_moduli(grains: Snapshot, case: Case, *, pressure_Pa: float | None = None) -> Elastic:
    """Elastic moduli of a pack, by one sparse solve for each of six uniform strains.

    Args:
        grains: the pack; fines among the spheres are left out. Its box is the cell.
        case: gives contacts, bonds and which sides are periodic; the others are plates to which
            the grains are glued.
        pressure_Pa: isotropic pressure, Pa, that sets the stiffness of Hertz contacts; linear ones
            do not depend on it.

    Returns:
        The (6, 6) tensor in Pa, its isotropic average, velocities of waves in m/s and counts.

    Raises:
        CaseError: Hertz contacts without a pressure.
        MechanicsError: the pack carries no load along an axis.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml", assignments=["bonds.radius_ratio=0.5"])
        >>> pack = fdnet.open_run("runs/quick").spheres("initial")
        >>> 0 < fdnet.elastic_moduli(pack, case).averaged.poisson < 0.5
        True
    """
    pack = grains.grains()
    material = pack_material(case, pack, pressure_Pa)
    porosity = measure_porosity(pack, periodic=case.periodic).mean if len(pack) else 1.0
    return elastic_of(pack, material, periodic=case.periodic, porosity=porosity)


def triaxial_test(
    grains: Snapshot,
    case: Case,
    *,
    confining_Pa: float,
    strain: float = 0.01,
    steps: int = 20,
    follow: Callable[[LoadStep], None] = lambda row: None,
) -> Sheared:
    """Confine a pack and compress it along x, quasi-statically; all in SI units.

    Args:
        grains: the pack; fines among the spheres are left out.
        case: gives contacts, friction, bonds and which sides are periodic.
        confining_Pa: stress on the sides, Pa.
        strain: axial strain at the end.
        steps: load steps to it.
        follow: is called with each row as it comes.

    Returns:
        `rows` (stresses in Pa and strains, compression above 0, bonds broken), `peak`, `young` in
        Pa, and the pack at the end.

    Raises:
        CaseError: a stress that the springs cannot hold.
        MechanicsError: the pack carries none.

    Examples:
        >>> import fdnet
        >>> settings = ["bonds.radius_ratio=0.5", "grains.normal_stiffness_N_m=1e8"]
        >>> case = fdnet.read_case("cases/quick.toml", assignments=settings)
        >>> pack = fdnet.open_run("runs/quick").spheres("initial")
        >>> test = fdnet.triaxial_test(pack, case, confining_Pa=1e4, strain=1e-3, steps=1)
        >>> test.bonds > 100
        True
    """
    pack = grains.grains()
    test = Triaxial(confining=confining_Pa, strain=strain, steps=steps)
    material = pack_material(case, pack, confining_Pa)
    return triaxial(pack, material, test, periodic=case.periodic, follow=follow)


def pack_material(case: Case, grains: Snapshot, pressure_Pa: float | None = None) -> PackMaterial:
    """Contacts and bonds of the grains of a case, at its nominal stiffness, in SI.

    Two grains, or a grain and a wall, act as two springs in series. Hertz contacts have the
    tangent stiffness under the mean force of the pack at an isotropic pressure. Raises CaseError
    for Hertz contacts without a pressure in Pa.
    """
    one, bonds = case.grains, case.bonds
    if case.contact.model != "hertz":
        normal = contacts.series(one.normal_stiffness_N_m, one.normal_stiffness_N_m)
        shear = contacts.series(one.tangential_stiffness, one.tangential_stiffness)
    elif pressure_Pa is None:
        raise CaseError(
            "contact.model: 'hertz' contacts have no stiffness without a load; give "
            "--confining-MPa, or take contact.model = 'hooke'"
        )
    elif not np.any((joints := find_joints(grains, case.periodic)).branch):
        normal, shear = 1.0, 1.0
    else:
        elastic, radius = (
            contacts.pair_elastic(case, ("grain", "grain"), 1.0),
            0.5 * one.mean_radius_m,
        )
        force = mean_force(grains, joints, pressure_Pa)
        overlap = contacts.overlap_under(force, elastic.modulus, radius)
        normal = 1.5 * contacts.secant_stiffness(elastic.modulus, radius, overlap)
        shear = contacts.tangential_stiffness(elastic.shear, radius, overlap)
    cement = None
    if bonds is not None:
        strengths = bonds.tensile_strength_Pa, bonds.shear_strength_Pa
        tensile, sheared = (np.inf if one is None else one for one in strengths)
        cement = Cement(
            radius_ratio=bonds.radius_ratio,
            normal=bonds.normal_stiffness_Pa_m,
            shear=bonds.shear_stiffness_Pa_m,
            tensile_strength=tensile,
            shear_strength=sheared,
            gap_ratio=bonds.gap_ratio,
        )
    return PackMaterial(
        normal=normal,
        shear=shear,
        friction=one.friction,
        wall_friction=case.wall_friction,
        density=one.mean_density_kg_m3,
        cement=cement,
    )


def warnings_of(result: Elastic, case: Case) -> Iterator[str]:
    """What a reader of the moduli must know, one sentence each."""
    young = result.averaged.young
    if young > QUARTZ_YOUNG:
        real = 4 * QUARTZ_YOUNG * case.grains.mean_radius_m
        yield Doubt(
            "stiffer-than-quartz",
            f"Young's modulus {young:.3g} Pa is above that of solid quartz, {QUARTZ_YOUNG:.3g} "
            "Pa: no sand is as stiff as these contacts make it; for quartz grains of this size "
            f"take grains.normal_stiffness_N_m = {real:.2g} (4 E R)",
        )
    if result.rattlers > MANY_RATTLERS * result.grains:
        yield Doubt(
            "loose-grains",
            f"{result.rattlers} of {result.grains} grains carry nothing; the moduli are those of "
            "a loose pack and change with the seed: run several seeds",
        )
    if case.bonds is None:
        yield Doubt(
            "no-bonds",
            "no table [bonds]: the moduli hold while a pressure keeps every contact closed; add "
            "[bonds] for cemented grains",
        )
