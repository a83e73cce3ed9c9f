"""Results that only some runs have: what the clean-up brings back."""

from collections.abc import Iterator
from functools import partial
from typing import Any

from fdnet.report.added import Added, PageTable
from fdnet.report.face_figures import fill_clean_up
from fdnet.run.clean_up import Returned, clean_up_rows, clean_up_summary
from fdnet.run.outputs import Results

_CLEAN_UP_COLUMNS = (
    ("section", "section", "", None),
    ("x_lo_m", "from", "mm", 1e3),
    ("x_hi_m", "to", "mm", 1e3),
    ("k_initial_m2", "k intact", "m²", 1),
    ("k_damaged_m2", "k damaged", "m²", 1),
    ("k_returned_m2", "k after the clean-up", "m²", 1),
    ("damaged_k_over_k0", "k/k0 damaged", "%", 1e2),
    ("return_k_over_k0", "k/k0 after the clean-up", "%", 1e2),
    ("fines_before", "fines before", "", None),
    ("fines_left_it", "of these came out", "", None),
    ("fines_after", "fines after", "", None),
)


def added_results(
    results: Results, after: Returned | None, record: dict[str, Any] | None
) -> Iterator[Added]:
    """The added results; `record` is that of the clean-up `after` which the specimen is."""
    if after is not None and record is not None:
        yield _clean_up(results, after, record)


def _clean_up(results: Results, after: Returned, record: dict[str, Any]) -> Added:
    rows = clean_up_rows(results.analysis, after)
    summary = clean_up_summary(results.analysis, after, record)
    counts = summary["clean_up"]
    whole = counts["damaged_k_over_k0"], summary["return_k_over_k0"]
    said = " and ".join("no path" if share is None else f"{share:.3f}" for share in whole)
    return Added(
        name="clean_up",
        rows=rows,
        summary=summary,
        fill=partial(
            fill_clean_up,
            rows=rows,
            depths=(after.before, after.before[after.stayed]),
            whole=whole,
        ),
        caption="The clean-up: permeability of each section over that of the intact pack, after "
        "the invasion and after the flow was turned back; depth of the fines that were inside "
        "before, and of those of them that stayed.",
        page=PageTable(
            title="Clean-up",
            columns=_CLEAN_UP_COLUMNS,
            rows=rows,
            note=f"The flow was turned back. Of {counts['inside_before']} fines inside, "
            f"{counts['came_out']} came out and {counts['stayed']} stayed. k/k0 of the whole "
            f"specimen before and after: {said}. The damage law is that of the invasion.",
        ),
    )
