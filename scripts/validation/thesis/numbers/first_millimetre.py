"""The first millimetre of a specimen.

The thesis examines it in detail (Shi 2011, section 3.3).
"""

from dataclasses import dataclass

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.pore_sizes import PoreSizes
from validation.thesis.numbers.values import thesis_values


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FirstMillimetre:
    """The P pores and T throats of the whole network, weighted for the first millimetre.

    Facets within one polyhedron, which may be split in several ways, are no throats.

    Attributes:
        network: the pores and throats of the whole specimen.
        occupancy: what the fines fill in them.
        pore_weight: (P,) 1 for a pore that counts whole, 0 for one centred elsewhere.
        throat_weight: (T,) likewise for throats.
        whole: True when only pores of four grains of the specimen, and throats between two such
            pores, count. False when those cut by a face of the specimen count too, each by the
            part inside (1/2, 1/4 or 1/8); together these fill the section.
    """

    network: Network
    occupancy: Occupancy
    pore_weight: Array
    throat_weight: Array
    whole: bool

    @property
    def sizes(self) -> PoreSizes:
        """Sizes of its pores and throats."""
        return PoreSizes(
            pore_radius=self.network.pore_radius,
            pore_volume=self.network.pore_volume,
            throat_radius=self.network.throat_radius,
            throat_length=self.network.throat_length,
            pore_weight=self.pore_weight,
            sphere_weight=self.pore_weight,
            throat_weight=self.throat_weight,
        )

    @property
    def tube(self) -> Array:
        """(T,) m3, volume of the throats' cylinders."""
        return np.pi * self.network.throat_radius**2 * self.network.throat_length

    @property
    def has_fines(self) -> Array:
        """(T,) True for throats that a fine reaches into."""
        return self.occupancy.throat_fines > 0


def first_millimetre(examined: Examined, *, whole: bool) -> FirstMillimetre:
    """The pores and throats centred within 1 mm of the formation face.

    A throat's centre is midway between those of its pores. Raises CaseError on a specimen without
    fines, whose occupancy was not measured.
    """
    network, occupancy = examined.thesis.network, examined.thesis.occupancy
    if occupancy is None:
        raise CaseError(
            f"{examined.id}: the specimen holds no fines, so what they fill was not measured; "
            "examine an invaded specimen"
        )
    end = network.box[0, 0] + 1e-3 * thesis_values().first_section_mm
    pore = network.pore_position[:, 0] < end
    throat = network.throat_ends[:, :, 0].mean(axis=1) < end
    group = network.pore_group[network.throat_pores]
    throat &= group[:, 0] != group[:, 1]
    if whole:
        uncut = network.pore_share == 1.0
        weights = (
            (pore & uncut).astype(float),
            (throat & uncut[network.throat_pores].all(axis=1)).astype(float),
        )
    else:
        weights = (
            np.where(pore, network.pore_share, 0.0),
            np.where(throat, network.throat_share, 0.0),
        )
    return FirstMillimetre(
        network=network,
        occupancy=occupancy,
        pore_weight=weights[0],
        throat_weight=weights[1],
        whole=whole,
    )
