"""The summary of a run as lines for a terminal."""

from typing import Any

from fdnet.case.stages import STAGES


def summary_lines(summary: dict[str, Any]) -> list[str]:
    """Headline numbers, the table of sections, warnings."""
    lines = _headline(summary)
    lines += [_section(row) for row in summary["sections"]]
    seconds = summary["seconds"]
    outside = sum(seconds.get(stage, 0.0) for stage in STAGES) - seconds["liggghts"]
    lines += ["", f"seconds       {seconds['liggghts']:.1f} in LIGGGHTS, {outside:.1f} outside"]
    return lines + [f"warning: {warning}" for warning in summary["warnings"]]


def _headline(summary: dict[str, Any]) -> list[str]:
    stopped = summary["stop_reason"] or "no invasion"
    depth, depth_p95 = 1e3 * summary["invasion_depth_m"], 1e3 * summary["invasion_depth_p95_m"]
    return [
        f"case {summary['case']}, seed {summary['seed']}, laws {summary['law']} / "
        f"{summary['damage_law_used'] or summary['damage_law']}",
        f"porosity      {summary['porosity_initial']:.4f} -> {summary['porosity_damaged']:.4f}",
        f"permeability  {summary['k_initial_m2']:.4g} -> {summary['k_damaged_m2']:.4g} m2  "
        f"(reduction {_share(summary['k_reduction'])})",
        *_other(summary),
        f"fines         {summary['invaded_count']} invaded, {summary['passed_count']} passed, "
        f"{summary['upstream_count']} upstream of {summary['supplied_count']} supplied; "
        f"stopped: {stopped}",
        f"depth         deepest {depth:.2f} mm, 95 % above {depth_p95:.2f} mm, "
        f"cake {1e3 * summary['cake_thickness_m']:.2f} mm",
        "",
        f"{'depth mm':>11} {'porosity':>8} {'damaged':>8} {'k m2':>10} {'damaged':>10} "
        f"{'loss':>7} {'in place':>8} {'fines':>6}",
    ]


def _other(summary: dict[str, Any]) -> list[str]:
    """The damaged permeability by the other law, as a measure of the error."""
    if summary["k_damaged_other_m2"] is None:
        return []
    after = summary["k_damaged_other_m2"]
    return [f"              by {summary['damage_law_other']}: {after:.4g} m2 with fines"]


def _section(row: dict[str, Any]) -> str:
    inplace = (
        1 - row["k_damaged_inplace_m2"] / row["k_initial_inplace_m2"]
        if row["k_initial_inplace_m2"]
        else None
    )
    return (
        f"{1e3 * row['x_lo_m']:>5.2f}-{1e3 * row['x_hi_m']:<5.2f} "
        f"{row['porosity_initial']:>8.4f} {row['porosity_damaged']:>8.4f} "
        f"{row['k_initial_m2']:>10.3g} {row['k_damaged_m2']:>10.3g} "
        f"{_share(row['k_reduction']):>7} {_share(inplace):>8} {row['fines_count']:>6}"
    )


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"
