"""The skin of a damaged zone around a well, and the share of its flow that it costs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

SMALL, LARGE = 0.02, 0.2
"""Shares of the flow that a skin costs, below and above which words call it small and large."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A layer of one permeability behind the formation face.

    Attributes:
        near: m, depth where it begins.
        far: m, depth where it ends.
        before: m2, without fines.
        after: m2, with fines.
    """

    near: float
    far: float
    before: float
    after: float

    @property
    def lost(self) -> float:
        """Share of the permeability that is lost; 1 where nothing flows."""
        return 1.0 - self.after / self.before if self.before > 0 else 0.0


def hawkins(ratio: float, *, well: float, damaged: float) -> float:
    """s = (k / k_d - 1) ln(r_d / r_w) (Hawkins 1956, Trans. AIME 207, 356-357).

    Args:
        ratio: k_d / k, permeability of the damaged zone over that of the formation.
        well: radius of the well, m.
        damaged: radius to which the damage reaches, m.

    Returns:
        The skin factor; infinite where the ratio is 0.
    """
    return (1.0 / ratio - 1.0) * math.log(damaged / well) if ratio > 0 else math.inf


def layered_skin(steps: Sequence[Step], well: float) -> float:
    """Sum of (k / k_i - k / k_0i) ln(r_{i+1} / r_i) over layers behind the face of a well.

    It is Hawkins's formula for rings in series, with the permeability k of the formation, that of
    all layers before the fines in series: a layer that was more open than the formation, as those
    at the face are, counts no more for that. `well` is the radius of the well, m. Layers without
    permeability before the fines count nothing.
    """
    rings = [one for one in steps if one.before > 0]
    lengths = [one.far - one.near for one in rings]
    inverse = sum(far / one.before for far, one in zip(lengths, rings, strict=True))
    k = sum(lengths) / inverse if rings else 0.0
    return sum(
        k
        / one.before
        * hawkins(one.after / one.before, well=well + one.near, damaged=well + one.far)
        for one in rings
    )


def flow_lost(skin: float, *, well: float, drainage: float) -> float:
    """Share of the steady radial flow that a skin costs: s / (ln(r_e / r_w) + s).

    From Darcy's law for a well of radius r_w `well` m in a formation whose pressure is held at
    r_e `drainage` m (Muskat 1937), with and without the skin.
    """
    if math.isinf(skin):
        return 1.0
    return skin / (math.log(drainage / well) + skin)


def size_words(lost: float) -> str:
    """Small, moderate or large, by the share of the flow that is lost."""
    return "small" if lost < SMALL else "large" if lost > LARGE else "moderate"
