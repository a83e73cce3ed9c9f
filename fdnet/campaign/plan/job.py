"""The plan of a campaign: which cases are run with which seeds, frozen before the first run."""

import hashlib
import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fdnet.case.case import Case
from fdnet.names import STAGES

LONGEST_NAME = 80
_UNSAFE = re.compile(r"[^A-Za-z0-9.=+_-]+")
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
"""What the name of a campaign may hold, as that of a case: nothing that a shell could take for
more than a word."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Variant:
    """One case of a campaign; its runs differ by the seed alone.

    Attributes:
        name: short name, which also begins the names of its run folders.
        keys: the keys that are varied, dotted, with their values.
        case: the case; its seed is that of the first run.
    """

    name: str
    keys: Mapping[str, Any]
    case: Case


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Job:
    """One run of a plan.

    Attributes:
        name: of its folder below `runs/`.
        variant: the variant that it belongs to.
        case: the case with the seed of this run.
    """

    name: str
    variant: Variant
    case: Case

    @property
    def seed(self) -> int:
        """Seed of the run."""
        return self.case.seed


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Plan:
    """All runs of a campaign: every variant with every seed.

    Attributes:
        name: of the campaign.
        variants: in the order in which they are shown.
        seeds: of each variant.
        ranks: MPI ranks of each run.
        stages: of each run.
    """

    name: str
    variants: tuple[Variant, ...]
    seeds: tuple[int, ...]
    ranks: int = 1
    stages: tuple[str, ...] = STAGES

    @property
    def digest(self) -> str:
        """Hash of what is run, whatever the number of seeds."""
        what = [(one.name, _with_seed(one.case, 0).digest()) for one in self.variants]
        text = json.dumps([sorted(what), self.ranks, sorted(self.stages)])
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that are varied."""
        return tuple(dict.fromkeys(key for one in self.variants for key in one.keys))

    @property
    def jobs(self) -> tuple[Job, ...]:
        """Every run; those of one seed stand together, so that few seeds of all come first."""
        return tuple(
            Job(name=f"{one.name}-seed-{seed}", variant=one, case=_with_seed(one.case, seed))
            for seed in self.seeds
            for one in self.variants
        )


def shared_packs(jobs: Sequence[Job]) -> dict[str, Job]:
    """The packs that several of `jobs` have in common: digest, and a job that has it."""
    digests = [(job.case.digest("pack"), job) for job in jobs]
    counts = Counter(digest for digest, _ in digests)
    first: dict[str, Job] = {}
    for digest, job in digests:
        if counts[digest] > 1:
            first.setdefault(digest, job)
    return first


def _with_seed(case: Case, seed: int) -> Case:
    return case.model_copy(update={"seed": seed})


def safe(text: str) -> str:
    """`text` as the name of a folder or a job: any other sign becomes an underscore."""
    return _UNSAFE.sub("_", text).strip("._") or "variant"


def named(variants: Sequence[Variant]) -> tuple[Variant, ...]:
    """The variants with names that are fit for folders, each its own."""
    result: list[Variant] = []
    used: set[str] = set()
    for one in variants:
        name = safe(one.name)
        if len(name) > LONGEST_NAME or name in used:
            name = f"{name[: LONGEST_NAME - 9]}-{_hash(one)}"
        number, base = 2, name
        while name in used:
            name, number = f"{base}-{number}", number + 1
        used.add(name)
        result.append(Variant(name=name, keys=one.keys, case=one.case))
    return tuple(result)


def _hash(variant: Variant) -> str:
    text = json.dumps([variant.case.digest(), dict(variant.keys)], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:8]
