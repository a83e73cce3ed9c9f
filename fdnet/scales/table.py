"""The scales of a case as rows: name, symbol, value, unit, formula, source."""

from fdnet.case.case import Case
from fdnet.scales.contact_rows import contact_rows, overlap_rows
from fdnet.scales.cost import cost_of, memory_bytes
from fdnet.scales.flow_rows import drive_rows, flow_rows
from fdnet.scales.forces.rows import force_rows
from fdnet.scales.grain_pack import grain_count
from fdnet.scales.quantity import Quantity
from fdnet.scales.quantity import row as _row
from fdnet.scales.scales import InvasionScales, Scales
from fdnet.scales.sizes import size_rows


def scale_rows(case: Case, scales: Scales) -> list[Quantity]:
    """Every scale of the case with its formula and source, in reading order."""
    rows = [_row(*one) for one in size_rows(case)] + flow_rows(case, scales)
    if isinstance(scales, InvasionScales):
        rows += _fine_rows(case, scales)
    rows += contact_rows(case, scales)
    return rows + _cost_rows(case, scales)


def _fine_rows(case: Case, scales: InvasionScales) -> list[Quantity]:
    return [
        *drive_rows(scales),
        *_drag_rows(scales),
        *force_rows(scales),
        *overlap_rows(case, scales),
        *_supply_rows(scales),
        *_time_rows(scales),
    ]


def _drag_rows(scales: InvasionScales) -> list[Quantity]:
    low, high = scales.relaxation_time
    sizes = [("smallest", low), ("largest", high)] if low != high else [("every", low)]
    rows = [
        _row(
            f"drag relaxation time, {name} fine",
            "tau",
            tau,
            "s",
            "2 r^2 rho / (9 mu M)",
            "Stokes 1851",
        )
        for name, tau in sizes
    ]
    return [
        *rows,
        _row(
            "drag held for",
            "N dt / tau",
            scales.hold_steps * scales.time_step / low,
            "-",
            "below 1 stable, 0.1 exact enough",
            "measured, docs/physics.md",
        ),
    ]


def _supply_rows(scales: InvasionScales) -> list[Quantity]:
    return [
        _row("fines supplied", "n", scales.supplied_count, "-", "c A l / v", "slab of suspension"),
        _row("slab length", "l", scales.slab_length, "m", "n v / (c A)", "slab of suspension"),
        _row(
            "time to feed the slab, simulated",
            "t_f",
            scales.slab_length / scales.upstream_velocity,
            "s",
            "l / u",
            "kinematics",
        ),
    ]


def _time_rows(scales: InvasionScales) -> list[Quantity]:
    return [
        _row(
            "plug time, simulated",
            "t_p",
            scales.plug_time,
            "s",
            "4 d_grain / u or 10 arrivals unless given",
            "stop rule",
        ),
        _row(
            "cap or duration, simulated",
            "t_c",
            scales.cap_time,
            "s",
            "3 t_f + 4 t_p + 2 L / u unless given",
            "stop rule",
        ),
        _row(
            "time step",
            "dt",
            scales.time_step,
            "s",
            "factor sqrt(m/k), at most 0.1 tau",
            "measured, docs/physics.md",
        ),
    ]


def _cost_rows(case: Case, scales: Scales) -> list[Quantity]:
    cost = cost_of(case, scales)
    rows = [
        _row("grains, first guess", "N", grain_count(case), "-", "(1-phi) V / v", "plain sum"),
        _row(
            "pack run time, one core",
            "t_pack",
            cost.pack_seconds,
            "s",
            "N steps 1e-7 s an attempt",
            "measured, within a factor of 2",
        ),
        _row(
            "memory",
            "M",
            memory_bytes(case, scales),
            "byte",
            "9 MB + 600 B a sphere",
            "measured",
        ),
    ]
    if isinstance(scales, InvasionScales):
        rows.append(
            _row(
                "invasion run time, one core",
                "t_run",
                cost.invade_seconds,
                "s",
                "steps (2e-6 s + N and n x seconds a sphere)",
                "measured, within a factor of 2",
            )
        )
    return rows
