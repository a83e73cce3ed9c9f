"""Permeabilities by a network of its own, where resolved flow knows sections better.

A section through which few throats carry the flow is small, so resolved flow costs little there,
and the errors of its throats do not average out.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fdnet.case.analysis import AnalysisChoices
from fdnet.network.flow.slabs import SlabK
from fdnet.network.resolved.combined import carried_slabs, in_series, over, replaced
from fdnet.network.resolved.measured import Measured
from fdnet.network.resolved.state import Log, capped
from fdnet.network.specimen.specimen import Specimen
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

FEW_THROATS = 100
"""Number of throats that carry the flow of a section (`Flow.carrying_throats`) below which the
network of all spheres is off by 5 % (rms), above which by 2 % (docs/accuracy.md). The throats
between grains, by which `upscaled` is judged, are fewer, so the limit is stricter for it."""
LEAST_LEFT, MOST_LEFT = 0.1, 0.9
"""Shares of the permeability left, by the network, between which resolved flow is worth its cost.
Below, the channels between the fines are narrower than a few of its cells. Above, the errors with
and without fines are alike, and k/k0 is known as well from the two laws of `combined`."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Permeabilities:
    """Of one state of a specimen: k of the whole, m2, and of its sections."""

    k: float
    slabs: SlabK

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Known:
    """Permeabilities with fines by a network of their own, and what resolved flow adds.

    Attributes:
        before: without fines, by resolved flow where that is known.
        own: with fines, by their network alone, at most that of the grains.
        after: with fines, carried over to `before`, or by resolved flow where that is known.
        resolved: (S,) m2, sections with fines by resolved flow, at most those without; not a
            number where they are by the network.
        above: 1 where their network had more than the grains as a whole, else 0.
        sections_above: in how many sections it had more.
        counts: how many sections are by resolved flow, without fines and with them.
        doubts: sections that resolved flow gave no value for, or whose flow few throats carry,
            one sentence each.
    """

    before: Permeabilities
    own: Permeabilities
    after: Permeabilities
    resolved: Array
    above: int
    sections_above: int
    counts: Mapping[str, int]
    doubts: tuple[str, ...]

    __repr__ = one_line


def known_permeabilities(
    measured: Measured, damaged: Permeabilities, choices: AnalysisChoices, log: Log
) -> Known:
    """Permeabilities with fines, at most those of the grains, and as far as resolved flow knows.

    Fines never raise the permeability. Where few of them make the network of all spheres finer,
    its k may be above that of the grains by the difference of two errors; it is then set to that
    of the grains, and counted. `damaged` are those of that network.
    """
    specimen, base = measured.specimen, measured.base(choices.law, log)
    clean, clean_slabs = measured.clean(choices.law, log)
    slabs, sections_above = damaged.slabs, 0
    if not specimen.moved:
        slabs, sections_above = capped(clean_slabs, damaged.slabs, specimen.empty_sections())
    own = after = Permeabilities(k=min(damaged.k, base.k), slabs=slabs)
    before = Permeabilities(k=clean.k, slabs=clean_slabs)
    intact, unsolved = measured.intact(log)
    known = np.isfinite(intact) & (clean_slabs.cut_out > 0.0)
    left = over(slabs.cut_out, clean_slabs.cut_out)
    few = few_throats(damaged.slabs) & (left < MOST_LEFT)
    resolved, refused = measured.resolved(few & known & (left >= LEAST_LEFT), log)
    if np.any(known):
        grains = replaced(clean_slabs, np.where(known, intact, np.nan))
        before = series_of(grains, specimen)
        resolved = frozen(np.minimum(resolved, before.slabs.cut_out))
        carried = carried_slabs(clean_slabs, before.slabs, slabs)
        after = series_of(replaced(carried, resolved), specimen, before.k)
    few[[*np.flatnonzero(np.isfinite(resolved)), *refused]] = False
    return Known(
        before=before,
        own=own,
        after=after,
        resolved=resolved,
        above=int(damaged.k > base.k),
        sections_above=sections_above,
        counts={
            "sections_resolved": int(known.sum()),
            "sections_resolved_with_fines": int(np.isfinite(resolved).sum()),
            "sections_resolved_above_grains": int(np.sum(resolved == before.slabs.cut_out)),
        },
        doubts=(*unsolved.values(), *refused.values(), *_few_doubts(damaged.slabs, few)),
    )


def few_throats(slabs: SlabK) -> Array:
    """Whether flow crosses a section (S,) and fewer than `FEW_THROATS` throats carry it."""
    carrying = np.array([flow.carrying_throats for flow in slabs.flows])
    return (carrying > 0.0) & (carrying < FEW_THROATS)


def _few_doubts(slabs: SlabK, some: Array) -> Iterator[str]:
    """One sentence on `some` (S,) sections whose flow few throats carry; none without any."""
    numbers = [int(number) for number in np.flatnonzero(some)]
    if numbers:
        each = ", ".join(
            f"{int(slabs.flows[number].carrying_throats)} in section {number + 1}"
            for number in numbers
        )
        yield (
            f"few throats carry the flow with fines ({each}): the errors of single throats do not "
            f"average out below {FEW_THROATS} of them"
        )


def series_of(slabs: SlabK, specimen: Specimen, most: float = np.inf) -> Permeabilities:
    """The sections, and the whole from those in place, at most `most` m2."""
    return Permeabilities(k=min(in_series(slabs.inplace, specimen.edges), most), slabs=slabs)
