"""The moduli of a pack as keys of mechanics.json."""

from typing import Any

from fdnet.mechanics.elastic import Elastic
from fdnet.mechanics.triaxial import Sheared


def elastic_numbers(result: Elastic) -> dict[str, Any]:
    """Moduli, velocities and counts in SI; the moduli are those of the isotropic average."""
    along = result.young_along or (None, None, None)
    p_wave, s_wave = result.waves
    return {
        "young_modulus_Pa": result.averaged.young,
        "poisson_ratio": result.averaged.poisson,
        "bulk_modulus_Pa": result.averaged.bulk,
        "shear_modulus_Pa": result.averaged.shear,
        "p_wave_m_s": p_wave,
        "s_wave_m_s": s_wave,
        "density_kg_m3": result.density,
        "young_modulus_x_Pa": along[0],
        "young_modulus_y_Pa": along[1],
        "young_modulus_z_Pa": along[2],
        "tensor_Pa": result.tensor.tolist(),
        "anisotropy": result.anisotropy,
        "affine_young_modulus_Pa": result.affine_averaged.young,
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


def triaxial_warnings(result: Sheared) -> list[str]:
    """What a reader of the curve must know, one sentence each."""
    warnings: list[str] = []
    if result.restless:
        warnings.append(
            f"{result.restless} of {len(result.rows)} load steps of the triaxial test did not "
            f"come to rest within the tolerance {result.test.tolerance:g}: the curve is uncertain "
            "there; take more load steps"
        )
    if result.peak is result.rows[-1]:
        warnings.append(
            "the largest deviatoric stress of the triaxial test is that of its last step: the "
            "peak may lie beyond; raise --strain"
        )
    return warnings
