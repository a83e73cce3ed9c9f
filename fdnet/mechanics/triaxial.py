"""The triaxial test: confining stress held on the sides, axial strain rising, quasi-statically.

Each load step raises the axial strain; then the pack is brought to rest at that strain, bonds
beyond their strength break, those nearest to it first, and it is brought to rest again.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fdnet.errors import CaseError, MechanicsError
from fdnet.mechanics.deformed import Deformed, at_rest
from fdnet.mechanics.joints import find_joints
from fdnet.mechanics.rest import Row, Triaxial, brought_to_rest
from fdnet.mechanics.springs import Material
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Snapshot

MOST_OVERLAP = 0.05
"""Overlap over diameter that a confining stress may cause; springs hold no more."""
CONFINING_STEPS = 4
"""Steps in which the confining stress is put on."""
PROBE = 0.1
"""Part of the first load step that gives the initial slope."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sheared:
    """A finished triaxial test.

    Attributes:
        test: what was done.
        rows: the pack after the confining stress, then after each load step.
        confined: the pack under the confining stress.
        pack: at the end.
        bonds: number of bonds at the start.
        restless: load steps that never came within the tolerance.
    """

    test: Triaxial
    rows: tuple[Row, ...]
    confined: Deformed
    pack: Deformed
    bonds: int
    restless: int

    __repr__ = one_line

    @property
    def young(self) -> float:
        """Slope of the first load step, Pa."""
        first, second = self.rows[0], self.rows[1]
        return (second.deviatoric - first.deviatoric) / (second.axial_strain - first.axial_strain)

    @property
    def poisson(self) -> float:
        """Sideways over axial strain of the first load step."""
        first, second = self.rows[0], self.rows[1]
        axial = second.axial_strain - first.axial_strain
        return 0.5 * (1 - (second.volume_strain - first.volume_strain) / axial)

    @property
    def peak(self) -> Row:
        """The row of the largest deviatoric stress."""
        return max(self.rows, key=lambda row: row.deviatoric)


def triaxial(
    grains: Snapshot,
    material: Material,
    test: Triaxial,
    *,
    periodic: tuple[bool, bool, bool],
    follow: Callable[[Row], None] = lambda row: None,
) -> Sheared:
    """Confine a pack of grains and compress it along x.

    Walls are smooth plates that move with the box. `follow` is called with each row.

    Raises CaseError for a stress that the springs cannot hold, MechanicsError for a pack that
    carries none.
    """
    material = replace(material, glued=False)
    refuse_stress(grains, material, test.confining, periodic)
    start = at_rest(grains, material, periodic, relieved=test.relieved)
    pack, row, restless = _confined(start, material, test, periodic)
    begun = pack = replace(pack, strain=np.zeros(3))
    rows = [_since(row, pack)]
    follow(rows[0])
    sides = np.nan if test.sides else 0.0
    for share in _shares(test.steps):
        pack, row, calm = brought_to_rest(
            pack,
            material,
            test,
            periodic,
            strain=np.array([-share * test.strain, sides, sides]),
            stress=np.full(3, -test.confining),
        )
        restless += not calm
        rows.append(_since(row, pack))
        follow(rows[-1])
    return Sheared(
        test=test,
        rows=tuple(rows),
        confined=begun,
        pack=pack,
        bonds=int(pack.bonded.sum()),
        restless=restless,
    )


def _shares(steps: int) -> list[float]:
    """Parts of the strain in each step; the first is divided, for the initial slope."""
    step = 1 / steps
    return [PROBE * step, (1 - PROBE) * step, *[step] * (steps - 1)]


def _confined(
    pack: Deformed, material: Material, test: Triaxial, periodic: tuple[bool, bool, bool]
) -> tuple[Deformed, Row, int]:
    """The pack under the confining stress, its row, and steps that did not come to rest."""
    restless, parts = 0, CONFINING_STEPS if test.relieved else 1
    for part in range(1, parts + 1):
        stress = np.full(3, -test.confining * part / parts)
        pack, row, calm = brought_to_rest(
            pack, material, test, periodic, strain=np.full(3, np.nan), stress=stress
        )
        restless += not calm
    if row.contacts == 0 or not row.axial > 0.5 * test.confining:
        raise MechanicsError(
            f"pack of {len(pack.grains)} grains does not hold {test.confining:.3g} Pa: it bears "
            f"{row.axial:.3g} Pa along x; take a denser pack"
        )
    return pack, row, restless


def confined(
    grains: Snapshot,
    material: Material,
    stress: float,
    *,
    periodic: tuple[bool, bool, bool],
    tolerance: float = 1e-2,
) -> Snapshot:
    """The grains under an isotropic stress, Pa; their box has shrunk with them.

    The overlaps of the pack are its state without stress. Raises what `triaxial` raises.
    """
    material = replace(material, glued=False)
    refuse_stress(grains, material, stress, periodic)
    start = at_rest(grains, material, periodic, relieved=True)
    test = Triaxial(confining=stress, tolerance=tolerance)
    pack, _, _ = _confined(start, material, test, periodic)
    return pack.grains


def _since(row: Row, pack: Deformed) -> Row:
    return replace(
        row, axial_strain=-float(pack.strain[0]), volume_strain=-float(pack.strain.sum())
    )


def refuse_stress(
    grains: Snapshot, material: Material, stress: float, periodic: tuple[bool, bool, bool]
) -> None:
    """Raise CaseError where the mean contact would overlap by more than `MOST_OVERLAP`."""
    joints = find_joints(grains, periodic, gap=material.gap)
    if len(joints) == 0:
        raise MechanicsError(
            f"pack of {len(grains)} grains has no contacts; make it denser, or bridge its gaps "
            "with bonds.gap_ratio"
        )
    volume = float(np.prod(np.diff(grains.box, axis=1)))
    reach = float(np.sum(np.linalg.norm(joints.branch, axis=1)))
    diameter = 2 * float(grains.radius.mean())
    overlap = 3 * stress * volume / reach / material.normal / diameter
    if overlap > MOST_OVERLAP:
        raise CaseError(
            f"--confining_MPa: {stress / 1e6:g} presses grains {100 * overlap:.3g} % of a "
            f"diameter into each other, expected at most {100 * MOST_OVERLAP:g} % "
            f"({stress / 1e6 * MOST_OVERLAP / overlap:.3g} MPa); lower the stress or raise "
            "grains.normal_stiffness_N_m"
        )
