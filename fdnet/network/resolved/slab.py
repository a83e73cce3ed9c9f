"""A slab across the flow as a specimen of its own: what its two planes cut out of the spheres.

The planes are inlet and outlet: the pressure is held on them, and the fluid crosses them at right
angles. So the slab with its mirror image is a periodic pack, and its network is that of the
spheres in a box of this length (`tessellation.placed_grains`). Cutting the throats of the whole
specimen at the planes instead leaves stumps of oblique throats, and misses that a pore which a
plane cuts is open to it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fdnet.errors import NetworkError
from fdnet.network.cores import on_all_cores
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.slabs import slab_permeability, whole_permeability
from fdnet.network.network import Network, build_network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.images import make_images
from fdnet.spheres.snapshot import Array, Snapshot

Conduct = Callable[[Network], Array]
"""Conductance (T,) m3 of the throats of a network."""


SHALLOW = 1e-6
"""A cap of less height, in radii of its sphere, is none: its sphere touches the plane."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sides:
    """What the sides of a specimen are.

    Attributes:
        periodic: whether x, y and z repeat.
        walls: "slip" or "no-slip", for the y and z sides that do not.
    """

    periodic: tuple[bool, bool, bool]
    walls: str

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CutNetworks:
    """The networks of S slabs, each of its own spheres alone.

    Attributes:
        edges: (S+1,) m.
        networks: S networks; None where the spheres of a slab make none.
        refused: why not, one sentence for each of these.
    """

    edges: Array
    networks: tuple[Network | None, ...]
    refused: tuple[str, ...]

    __repr__ = one_line


def cut_out(spheres: Snapshot, span: tuple[float, float], periodic: Sequence[bool]) -> Snapshot:
    """The spheres that reach between the planes at `span` (low, high) m, in a box of that length.

    Where x is `periodic`, so do their images. Spheres that only touch a plane are left out.
    """
    box = spheres.box.copy()
    box[0] = span
    if periodic[0]:
        margin = np.array([float(spheres.radius.max()), np.nan, np.nan])
        images = make_images(
            spheres.position,
            spheres.box,
            periodic=(True, False, False),
            margin=margin,
            tolerance=0.0,
        )
        spheres = replace(spheres.where(images.owner), position=images.position)
    x, reach = spheres.position[:, 0], (1.0 - SHALLOW) * spheres.radius
    reaches = (x + reach > span[0]) & (x - reach < span[1])
    return replace(spheres.where(reaches), box=box)


def cut_networks(spheres: Snapshot, edges: Array, sides: Sides) -> CutNetworks:
    """The network of each slab between `edges` (S+1,) m, whose skeleton is all of `spheres`."""
    around = (False, *sides.periodic[1:])

    def cut(span: tuple[float, float]) -> Network | NetworkError:
        try:
            alone = cut_out(spheres, span, sides.periodic)
            return build_network(alone, periodic=around, walls=sides.walls)
        except NetworkError as error:
            return error

    results = on_all_cores(cut, pairwise(map(float, edges)))
    refused = [
        f"section {number + 1} is no specimen of its own, so it was cut out of the network of the "
        f"whole, which is less accurate: {error}"
        for number, error in enumerate(results)
        if isinstance(error, NetworkError)
    ]
    networks = (None if isinstance(one, NetworkError) else one for one in results)
    return CutNetworks(edges=edges, networks=tuple(networks), refused=tuple(refused))


def slab_permeabilities(
    slabs: CutNetworks, conduct: Conduct, whole: tuple[Network, Array]
) -> list[tuple[float, Flow]]:
    """Permeability m2 of each of the S slabs cut out, and its flow.

    The throats of a slab have the conductance `conduct`. A slab without a network of its own is
    cut out of that of the `whole` specimen, which is given with its conductances (T,) m3.
    """

    def one(slab: tuple[Network | None, tuple[float, float]]) -> tuple[float, Flow]:
        network, span = slab
        if network is None:
            return slab_permeability(*whole, span)
        return whole_permeability(network, conduct(network))

    spans = pairwise(map(float, slabs.edges))
    return on_all_cores(one, zip(slabs.networks, spans, strict=True))
