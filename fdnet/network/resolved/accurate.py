"""The most accurate law of damage that "auto" can afford.

That is the network of all spheres, up to the number of spheres that its cost allows. Above that
number it is the damage law `section-archie` of the network of the grains, which comes nearest to
it in specimens of full size (docs/accuracy.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass

from fdnet.case.analysis import AnalysisChoices
from fdnet.case.names import ALL_SPHERES, AUTO, DEFAULT_LAW, SECTION_ARCHIE
from fdnet.network.flow.depth import Solved
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.slabs import SlabK
from fdnet.network.resolved.all_spheres import AllSpheres
from fdnet.network.resolved.measured import Measured
from fdnet.network.resolved.state import Log, State, capped
from fdnet.network.specimen.specimen import Specimen
from fdnet.spheres.arrays import one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AccurateLaw:
    """What the most accurate law gives.

    Attributes:
        name: of the law.
        k: m2, at most that of the grains.
        slabs: of each section, cut out and in place.
        flow: through the whole specimen.
        solved: the network of all spheres, where that was solved.
        counts: of that network, or of the damage law.
        refused: sections whose spheres make no network of their own, one sentence each.
    """

    name: str
    k: float
    slabs: SlabK
    flow: Flow
    solved: Solved | None
    counts: Mapping[str, int]
    refused: tuple[str, ...]

    __repr__ = one_line


def accurate_law(
    measured: Measured, choices: AnalysisChoices, before: SlabK, log: Log
) -> AccurateLaw | None:
    """The most accurate law where the damage law of `choices` asks for it, else None.

    `before` are the sections without fines.
    """
    base = measured.base(choices.law, log)
    whole = measured.wanted(choices, log)
    if whole is not None:
        return _of_all_spheres(whole, base, (before, measured.specimen))
    fines = measured.specimen.fines
    if fines is None or not len(fines) or choices.damage_law != AUTO or choices.law != DEFAULT_LAW:
        return None
    state, damage = measured.damaged(choices, SECTION_ARCHIE, log)
    return AccurateLaw(
        name=SECTION_ARCHIE,
        k=min(state.k, base.k),
        slabs=measured.damaged_slabs(state, choices, SECTION_ARCHIE, log),
        flow=state.flow,
        solved=None,
        counts={} if damage is None else damage.counts,
        refused=(),
    )


def _of_all_spheres(whole: AllSpheres, base: State, before: tuple[SlabK, Specimen]) -> AccurateLaw:
    """The network of all spheres, at most the permeability of the grains.

    Fines never raise the permeability. Where few of them make the network of all spheres finer,
    its k may be above that of the grains by the difference of two errors; it is then set to that
    of the grains, and counted. `before` are the sections without fines, and the specimen.
    """
    clean_slabs, specimen = before
    slabs, above = whole.slabs, 0
    if not specimen.moved:
        slabs, above = capped(clean_slabs, whole.slabs, specimen.empty_sections())
    network = whole.solved.network
    return AccurateLaw(
        name=ALL_SPHERES,
        k=min(whole.k, base.k),
        slabs=slabs,
        flow=whole.solved.flow,
        solved=whole.solved,
        counts={
            "all_spheres_pores": len(network.pore_radius),
            "all_spheres_throats": len(network.throat_radius),
            "all_spheres_hidden": network.counts["grains_hidden"],
            "all_spheres_above_grains": int(whole.k > base.k),
            "all_spheres_sections_above_grains": above,
        },
        refused=whole.refused,
    )
