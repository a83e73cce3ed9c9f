"""The plan of an ensemble: one case with several seeds."""

from collections.abc import Sequence

from fdnet.campaign.plan.job import Plan, Variant, named
from fdnet.campaign.plan.sweep import MOST_JOBS, refuse_many, seeds_of
from fdnet.case.case import Case
from fdnet.errors import CaseError
from fdnet.names import STAGES


def ensemble_plan(
    case: Case,
    seeds: int,
    *,
    limit: int = MOST_JOBS,
    ranks: int = 1,
    stages: Sequence[str] = STAGES,
) -> Plan:
    """`case` with `seeds` seeds, its own the first. Raises CaseError for none or too many."""
    if seeds < 1 or case.seed + seeds > 2**31:
        raise CaseError(f"seeds: {seeds}, expected 1 or more, and no seed above {2**31 - 1}")
    refuse_many(1, seeds, limit)
    return Plan(
        name=case.name,
        variants=named([Variant(name=case.name, keys={}, case=case)]),
        seeds=seeds_of(seeds, case.seed),
        ranks=ranks,
        stages=tuple(stages),
    )
