"""The tables of the accuracy page on other tools, from the CSV file of the network benchmark."""

from pathlib import Path

from fdnet.studies.accuracy.boundary_tables import Line, grouped
from fdnet.studies.accuracy.goals import ratio
from fdnet.studies.engine.csv_rows import read_named
from fdnet.studies.engine.markdown import markdown_table

OWN_TOOL = "fdnet"
COST_STEPS = ("total", "total intact", "solve", "solve stiff", "solve clogged")
NO_BENCHMARK = (
    "`docs/benchmark_network.csv` is not there yet; `scripts/benchmark_network.py` writes it."
)


def benchmark_tables(path: Path, own: dict[str, float]) -> str:
    """Errors, and costs, of every tool in the network benchmark; a sentence without its file.

    `own`: model over truth by case, as computed for the page.
    """
    if not path.exists():
        return NO_BENCHMARK
    rows = read_named(path)
    return (
        "Model over truth, with fines where the pack has fines. The column of fdnet is by "
        "`lubrication` and, with fines, `side-kozeny`.\n\n"
        + _error_table(rows, own)
        + "\n\nCPU seconds on one core and peak memory in MB of the same tools "
        f'(`{path.name}`, as its command left it). The steps "solve" are the solve alone, on the '
        'network that fdnet built; "total" starts from the spheres.\n\n'
        + _cost_table([row for row in rows if row["step"] in COST_STEPS])
    )


def _error_table(rows: list[Line], own: dict[str, float]) -> str:
    peers = [row for row in rows if row["step"] == "error" and row["tool"] != OWN_TOOL]
    tools = list(dict.fromkeys(row["tool"] for row in peers))
    lines = []
    for of in grouped(peers, lambda row: row["case"].removeprefix("pack")).values():
        case = of[0]["case"].removeprefix("pack")
        by_tool = {row["tool"]: row["k_over_truth"] or row["status"] for row in of}
        mine = ratio(own.get(case, float("nan")))
        cells = (by_tool.get(tool, "-") for tool in tools)
        lines.append([case, of[0]["grains"], of[0]["fines"], mine, *cells])
    return markdown_table(["case", "grains", "fines", OWN_TOOL, *tools], lines)


def _cost_table(rows: list[Line]) -> str:
    """CPU seconds and memory, or how it ended: packs and steps down, tools across."""
    tools = list(dict.fromkeys(row["tool"] for row in rows))
    packs: dict[tuple[str, int, str], list[Line]] = {}
    for row in rows:
        packs.setdefault((row["case"], int(row["grains"]), row["step"]), []).append(row)
    lines = []
    for (case, grains, step), of in sorted(packs.items()):
        fines = max(of, key=lambda row: int(row["fines"] or 0))["fines"]
        by_tool = {row["tool"]: _cost(row) for row in of}
        cells = (by_tool.get(tool, "-") for tool in tools)
        lines.append([case, str(grains), fines, step, *cells])
    return markdown_table(["case", "grains", "fines", "step", *tools], lines)


def _cost(row: Line) -> str:
    if row["status"] != "ok":
        return row["status"]
    return f"{float(row['cpu_s']):.3g} s, {float(row['peak_MB']):.0f}"
