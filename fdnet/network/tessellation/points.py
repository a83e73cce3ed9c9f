"""The points that are tessellated: the centres of the grains and of their images near the box.

Along a periodic axis a grain has images shifted by whole periods. A face that is not periodic is
a mirror plane: it separates every grain from its own mirror image, so the power centres of what
lies inside the box are inside too, and those of what the face cuts lie on the face.

A shake of 1e-7 mean grain radii, for the tessellation alone and the same for all periodic images
of a grain, splits cospherical sets of grains (lattices, and always the prisms cut by a face) in
the same manner everywhere.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network.tessellation.placed_grains import ON_FACE_TOLERANCE
from fdnet.spheres.arrays import one_line
from fdnet.spheres.images import label, make_images, packed_shift
from fdnet.spheres.snapshot import Array, Snapshot

SHAKE = 1e-7
"""Largest displacement of a point along an axis, in mean grain radii."""
SHAKE_SEED = 3_141_592


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Points:
    """M images of n grains, the grains themselves among them.

    Attributes:
        owner: (M,) index of the grain.
        position: (M, 3) m, centre of the image.
        shift: (M, 3) whole periods by which the image is moved along each axis.
        mirror: (M, 3) one of INSIDE, MIRROR_LOW, MIRROR_HIGH, ON_FACE of `spheres.images`.
        radius: (M,) m.
        shaken: (M, 3) m, centre after the shake.
        scaled: (M, 3) shaken centre from the low corner of the box, in mean grain radii.
        name: (M,) integer of grain and mirror image; images that differ by periods share it.
        key: (M,) integer that orders the images by name, then by shift.
    """

    owner: Array
    position: Array
    shift: Array
    mirror: Array
    radius: Array
    shaken: Array
    scaled: Array
    name: Array
    key: Array

    __repr__ = one_line


def make_points(grains: Snapshot, *, periodic: tuple[bool, ...], margin: Array) -> Points:
    """All images of `grains` within `margin` (3,) m of the box."""
    scale = float(grains.radius.mean())
    images = make_images(
        grains.position,
        grains.box,
        periodic=periodic,
        margin=margin,
        tolerance=ON_FACE_TOLERANCE * scale,
    )
    name = label(images)
    key = name.astype(np.int64) * 2**30 + packed_shift(images.shift)
    shake = _shake(grains, images.owner, name)
    scaled = (images.position - grains.box[:, 0]) / scale + shake
    return Points(
        owner=images.owner,
        position=images.position,
        shift=images.shift,
        mirror=images.mirror,
        radius=grains.radius[images.owner],
        shaken=scaled * scale + grains.box[:, 0],
        scaled=scaled,
        name=name,
        key=key,
    )


def _shake(grains: Snapshot, owner: Array, name: Array) -> Array:
    """Displacement (M, 3) of the images in mean radii, the same for those that differ by periods.

    It is drawn by the rank of the grain in the order of x, y, z, so that another numbering of the
    grains changes nothing.
    """
    rank = np.empty(len(grains), int)
    rank[np.lexsort(grains.position.T[::-1])] = np.arange(len(grains))
    mirrors, code = np.unique(name % 27, return_inverse=True)
    noise = np.random.default_rng(SHAKE_SEED).uniform(
        -SHAKE, SHAKE, (len(mirrors), len(grains), 3)
    )
    return noise[code, rank[owner]]
