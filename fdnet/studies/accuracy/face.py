"""The network over resolved flow in the first millimetre of whole runs, from their table."""

from pathlib import Path

from fdnet.studies.accuracy.goals import span
from fdnet.studies.engine.csv_rows import read_named

TABLE = "stokes_sections.csv"
"""Written by scripts/stokes_sections.py."""


def face_numbers(validation: Path) -> dict[str, str]:
    """The numbers of the prose: spans of the ratio by sides, and points of the share lost."""
    rows = read_named(validation / TABLE)
    numbers = {"face_runs": str(len(rows))}
    for sides in ("periodic", "walls"):
        some = [row for row in rows if row["sides"] == sides]
        for state, name in (("initial", "before"), ("damaged", "after")):
            key = f"k_{state}_m2"
            ratios = [float(row[f"network_{key}"]) / float(row[key]) for row in some]
            numbers[f"face_{sides}_{name}"] = span(ratios)
        points = [float(row["k_reduction"]) - float(row["network_k_reduction"]) for row in some]
        numbers[f"face_{sides}_points"] = f"{100 * max(points):.1f}"
    return numbers
