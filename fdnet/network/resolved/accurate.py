"""The most accurate law of damage that "auto" can afford.

That is `combined` up to the number of spheres that its cost allows: the mean of the network of all
spheres and of the damage law `section-archie` of the network of the grains. Above that number it
is `section-archie` alone, the nearest to all spheres in specimens of full size (docs/accuracy.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fdnet.case.analysis import AnalysisChoices
from fdnet.case.names import (
    ALL_SPHERES,
    AUTO,
    COMBINED,
    DEFAULT_DAMAGE_LAW,
    DEFAULT_LAW,
    SECTION_ARCHIE,
    UPSCALED,
)
from fdnet.network.flow.depth import Solved
from fdnet.network.flow.flow import Flow
from fdnet.network.resolved.all_spheres import AllSpheres
from fdnet.network.resolved.combined import combined_slabs, over, replaced, scaled
from fdnet.network.resolved.known import Permeabilities, known_permeabilities, series_of
from fdnet.network.resolved.measured import Measured
from fdnet.network.resolved.state import Log, capped
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AccurateLaw:
    """What the most accurate law gives.

    Attributes:
        name: of the law.
        second: name of the damage law of the network of the grains that is given next to it; None
            where the law itself is of that network.
        before: without fines, by resolved flow where that is known.
        after: with fines, at most that of the grains.
        flow: through the whole specimen.
        solved: the network of all spheres, where that was solved.
        all_spheres: with fines, by that network alone, at most that of the grains; None without
            it.
        resolved: (S,) m2, sections with fines by resolved flow, at most those without; not a
            number where they are by the law.
        counts: of that network, or of the damage law.
        doubts: sections whose spheres make no network of their own, that resolved flow gave no
            value for, or whose flow few throats carry, one sentence each.
    """

    name: str
    second: str | None
    before: Permeabilities
    after: Permeabilities
    flow: Flow
    solved: Solved | None
    all_spheres: Permeabilities | None
    resolved: Array
    counts: Mapping[str, int]
    doubts: tuple[str, ...]

    __repr__ = one_line


def accurate_law(measured: Measured, choices: AnalysisChoices, log: Log) -> AccurateLaw | None:
    """The most accurate law where the damage law of `choices` asks for it, else None."""
    whole = measured.wanted(choices, log)
    if whole is not None:
        finest = _of_all_spheres(measured, whole, choices, log)
        alone = choices.damage_law == ALL_SPHERES
        return finest if alone else _combined(measured, finest, choices, log)
    fines = measured.specimen.fines
    if fines is None or not len(fines):
        return None
    if choices.damage_law == UPSCALED:
        return _upscaled(measured, choices, log)
    if choices.damage_law != AUTO or choices.law != DEFAULT_LAW:
        return None
    state, damage = measured.damaged(choices, SECTION_ARCHIE, log)
    clean, slabs = measured.clean(choices.law, log)
    return AccurateLaw(
        name=SECTION_ARCHIE,
        second=DEFAULT_DAMAGE_LAW,
        before=Permeabilities(k=clean.k, slabs=slabs),
        after=Permeabilities(
            k=min(state.k, measured.base(choices.law, log).k),
            slabs=measured.damaged_slabs(state, choices, SECTION_ARCHIE, log),
        ),
        flow=state.flow,
        solved=None,
        all_spheres=None,
        resolved=frozen(np.full(len(measured.specimen.edges) - 1, np.nan)),
        counts={} if damage is None else damage.counts,
        doubts=(),
    )


def _of_all_spheres(
    measured: Measured, whole: AllSpheres, choices: AnalysisChoices, log: Log
) -> AccurateLaw:
    """The network of all spheres, at most the permeability of the grains."""
    alone = Permeabilities(k=whole.k, slabs=whole.slabs)
    known = known_permeabilities(measured, alone, choices, log)
    network = whole.solved.network
    return AccurateLaw(
        name=ALL_SPHERES,
        second=SECTION_ARCHIE,
        before=known.before,
        after=known.after,
        flow=whole.solved.flow,
        solved=whole.solved,
        all_spheres=known.own,
        resolved=known.resolved,
        counts={
            "all_spheres_pores": len(network.pore_radius),
            "all_spheres_throats": len(network.throat_radius),
            "all_spheres_hidden": network.counts["grains_hidden"],
            "all_spheres_above_grains": known.above,
            "all_spheres_sections_above_grains": known.sections_above,
            **known.counts,
        },
        doubts=(*whole.refused, *known.doubts),
    )


def _upscaled(measured: Measured, choices: AnalysisChoices, log: Log) -> AccurateLaw:
    """The network of the grains with upscaled throats, at most the permeability of the grains."""
    state, _ = measured.damaged(choices, UPSCALED, log)
    slabs = measured.damaged_slabs(state, choices, UPSCALED, log)
    known = known_permeabilities(measured, Permeabilities(k=state.k, slabs=slabs), choices, log)
    return AccurateLaw(
        name=UPSCALED,
        second=None,
        before=known.before,
        after=known.after,
        flow=state.flow,
        solved=None,
        all_spheres=None,
        resolved=known.resolved,
        counts={
            "upscaled_above_grains": known.above,
            "upscaled_sections_above_grains": known.sections_above,
            **known.counts,
        },
        doubts=known.doubts,
    )


def _combined(
    measured: Measured, finest: AccurateLaw, choices: AnalysisChoices, log: Log
) -> AccurateLaw:
    """The mean of all spheres (`finest`) and `section-archie`, section by section."""
    specimen, first, whole = measured.specimen, finest.before.slabs, finest.after.slabs
    clean = measured.clean(choices.law, log)[1]
    state, _ = measured.damaged(choices, SECTION_ARCHIE, log)
    two_scale = measured.damaged_slabs(state, choices, SECTION_ARCHIE, log)
    limit = finest.before.k
    if specimen.moved:  # the fines are weighed by what the grains have where they ended
        first, limit = measured.base_slabs(choices.law, log), measured.base(choices.law, log).k
    else:  # all spheres in place may be above the grains, which is no gain
        whole = replace(whole, inplace=frozen(np.minimum(whole.inplace, first.inplace)))
    factor = over(finest.before.slabs.cut_out, clean.cut_out)
    slabs = replaced(combined_slabs(first, whole, scaled(two_scale, factor)), finest.resolved)
    if not specimen.moved:
        slabs, _ = capped(first, slabs, specimen.empty_sections())
    return replace(finest, name=COMBINED, after=series_of(slabs, specimen, limit))
