"""The runs of a campaign, or run folders of anywhere, as the entries of a comparison."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from fdnet.campaign.plan.folder import RUNS, read_plan_record
from fdnet.campaign.plan.job import Plan
from fdnet.campaign.plan.state import state_of
from fdnet.campaign.result.comparison import RANKED_BY, Comparison
from fdnet.campaign.result.entry import Entry, numbers_of
from fdnet.case.case import Case
from fdnet.errors import CaseError
from fdnet.files import refuse_folder_name
from fdnet.run.folder import MANIFEST, check_finished, is_run_folder

_NOT_COMPARED = ("name", "seed", "given")
_RESULTS = {"table.csv", "table.parquet", "summary.json", "compare.html"}


def gather_plan(path: Path, plan: Plan, *, ranked_by: str = RANKED_BY) -> Comparison:
    """The comparison of all runs of the campaign in `path`, done or not.

    Raises CaseError when a summary cannot be read.
    """
    entries = []
    packs = {one.name: {} for one in plan.variants}  # type: dict[str, dict[int, str]]
    for job in plan.jobs:
        state, folder = state_of(path, plan, job), path / RUNS / job.name
        packs[job.variant.name][job.seed] = job.case.digest("pack")
        entries.append(
            Entry(
                name=job.name,
                variant=job.variant.name,
                seed=job.seed,
                keys=job.variant.keys,
                folder=folder,
                status=state.status,
                reason=state.reason,
                pack=packs[job.variant.name][job.seed],
                numbers=numbers_of(folder) if state.status == "done" else {},
            )
        )
    return Comparison(
        title=plan.name, path=path, keys=plan.keys, entries=tuple(entries), ranked_by=ranked_by
    )


def gather_runs(runs: Sequence[Path], out: Path, *, ranked_by: str = RANKED_BY) -> Comparison:
    """The comparison of finished run folders; a folder of a campaign stands for all its runs.

    Runs whose cases differ by the seed alone are one variant. Raises CaseError for a folder that
    holds no finished run or one whose files were changed, for one given twice, and for two runs
    of the same case and seed.
    """
    left_out: list[str] = []
    folders = [folder for run in runs for folder in _folders(run, left_out)]
    _refuse_twice(folders)
    cases = {folder: check_finished(folder)[1] for folder in folders}
    keys = _differing(list(cases.values()))
    names = _variant_names(cases, keys)
    entries = tuple(
        Entry(
            name=folder.name,
            variant=names[folder],
            seed=case.seed,
            keys={key: _key(case, key) for key in keys},
            folder=folder.absolute(),
            pack=case.digest("pack"),
            numbers=numbers_of(folder),
        )
        for folder, case in cases.items()
    )
    _refuse_same(entries)
    return Comparison(
        title=f"{len(entries)} runs",
        path=out,
        keys=keys,
        entries=entries,
        ranked_by=ranked_by,
        left_out=tuple(left_out),
    )


@contextlib.contextmanager
def result_folder(out: Path) -> Iterator[None]:
    """Make the folder of a comparison, unless it is there from an earlier one.

    Raises CaseError for a folder that holds something else.
    """
    refuse_folder_name(out)
    if out.exists() and not out.is_dir():
        raise CaseError(f"{out}: is a file, expected a folder for --out")
    others = {path.name for path in out.iterdir()} - _RESULTS if out.is_dir() else set()
    if others:
        raise CaseError(
            f"{out}: is not empty and holds no comparison of fdnet; give another --out (nothing "
            "was changed)"
        )
    out.mkdir(parents=True, exist_ok=True)
    yield


def _folders(run: Path, left_out: list[str]) -> Iterator[Path]:
    """The run folders that `run` stands for; runs of a campaign without a result are left out."""
    plan = None if not run.is_dir() or is_run_folder(run) else read_plan_record(run)
    if plan is None:
        yield run
        return
    below = [run / RUNS / one["name"] for one in plan["runs"]]
    having = [folder for folder in below if (folder / MANIFEST).exists()]
    if not having:
        raise CaseError(f"{run}: this campaign has no finished run yet; run it first")
    left_out += [str(folder) for folder in below if folder not in having]
    yield from having


def _refuse_twice(folders: Sequence[Path]) -> None:
    seen: set[Path] = set()
    for folder in folders:
        if folder.resolve() in seen:
            raise CaseError(f"{folder}: is given twice, and would be counted twice")
        seen.add(folder.resolve())


def _refuse_same(entries: Sequence[Entry]) -> None:
    seen: dict[tuple[str, int], Entry] = {}
    for entry in entries:
        first = seen.setdefault((entry.variant, entry.seed), entry)
        if first is not entry:
            raise CaseError(
                f"{entry.folder}: is the same case with the same seed as {first.folder}, and "
                "would be counted twice; leave one out"
            )


def _data(case: Case) -> dict[str, Any]:
    """Every key of a case but those that name it, dotted."""
    result: dict[str, Any] = {}
    for table, keys in case.data().items():
        if table in _NOT_COMPARED:
            continue
        if isinstance(keys, Mapping):
            result |= {f"{table}.{key}": value for key, value in keys.items()}
        else:
            result[table] = keys
    return result


def _key(case: Case, key: str) -> Any:
    return _data(case).get(key)


def _differing(cases: Sequence[Case]) -> tuple[str, ...]:
    """The keys that not all cases have in common."""
    data = [_data(case) for case in cases]
    keys = dict.fromkeys(key for one in data for key in one)
    return tuple(key for key in keys if any(one.get(key) != data[0].get(key) for one in data[1:]))


def _variant_names(cases: Mapping[Path, Case], keys: Sequence[str]) -> dict[Path, str]:
    """A name for each run: what its case has of its own; equal cases share one.

    It is the name of the case where names tell the variants apart, and else the differing keys.
    """
    of_keys = {
        folder: tuple(repr(_key(case, key)) for key in keys) for folder, case in cases.items()
    }
    by_name = {(cases[folder].name, values) for folder, values in of_keys.items()}
    distinct = len({name for name, _ in by_name}) == len(set(of_keys.values())) == len(by_name)
    if distinct:
        return {folder: case.name for folder, case in cases.items()}
    return {
        folder: "+".join(f"{key.rsplit('.', 1)[-1]}={_key(case, key)}" for key in keys)
        or case.name
        for folder, case in cases.items()
    }
