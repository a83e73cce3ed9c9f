"""`fdnet core` and `fdnet well`: what a finished run means for a core and for a well."""

import argparse
import json
import sys
from collections.abc import Callable
from typing import Any

from fdnet.case.units import converted
from fdnet.commands.options import new_command
from fdnet.files import path_option

CORE, MUD = "the core", "the mud"


def add_formation(commands: Any) -> None:
    """Adds `fdnet core` and `well` to the command line."""
    about = "flood a core of a run's sand with its mud, and turn the flow back"
    core = new_command(
        commands, "core", _core, about, "fdnet core runs/mine --length 76mm --rate 1ml/min"
    )
    core.add(CORE, "run RUN", _RUN, path_option)
    core.add(CORE, "--length LENGTH", "of the core, as 76mm", _si("_m"), required=True)
    core.add(CORE, "--diameter LENGTH", "of the core (default 38 mm)", _si("_m"), 0.038)
    core.add(CORE, "--rate RATE", "of the flood, as 1ml/min", _si("_m3_s"))
    core.add(CORE, "--pressure PRESSURE", "over core and cake, as 7bar", _si("_Pa"))
    core.add(CORE, "--minutes N", "length of the flood (default 30)", float, 30.0)
    back = "pore volumes that flow back, where the run had a [clean_up] (default 10)"
    core.add(CORE, "--back-flow N", back, float, 10.0)
    core.add(CORE, "--sections N", "between pressure taps (default 4)", int, 4)

    about = "carry a run to a well: filtrate, invaded radius, k by depth, cake, skin"
    well = new_command(
        commands, "well", _well, about, "fdnet well runs/mine --hours 12 --api-filtrate 8ml"
    )
    well.add("the well", "run RUN", _RUN, path_option)
    well.add("the well", "--hours N", "that the mud stands (default 12)", float, 12.0)
    well.add("the well", "--height LENGTH", "of the well (default 1 m)", _si("_m"), 1.0)
    over = "overbalance, as 300psi (default: of the case)"
    well.add("the well", "--pressure PRESSURE", over, _si("_Pa"))
    well.add("the well", "--radius LENGTH", "of the well (default: of the case)", _si("_m"))
    for parser in (core, well):
        k = "permeability of the cake, as '1e-18 m2' (default: of the run's fines alone)"
        parser.add(MUD, "--cake-permeability K", k, _si("_m2"))
        api = (
            "filtrate of the API's test in 30 minutes, as 8ml: gives the permeability of the cake"
        )
        parser.add(MUD, "--api-filtrate VOLUME", api, _si("_m3"))
        parser.add(MUD, "--classes N", "classes of size of the fines (default 1)", int, 1)
        parser.share("--json", "--quiet")


_RUN = "run folder, or the folder of an ensemble, whose seeds then give the bands"


def _si(suffix: str) -> Callable[[str], float]:
    """Reads a value with its unit in SI."""

    def value(text: str) -> float:
        try:
            return converted(text, suffix)
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{text!r}: {error}") from error

    return value


def _core(options: argparse.Namespace) -> int:
    from fdnet.formation.scale_up import core_flood

    names = ("length", "diameter", "rate", "pressure", "minutes", "back_flow", "sections")
    return _finish(options, "core", core_flood, names, "sections")


def _well(options: argparse.Namespace) -> int:
    from fdnet.formation.scale_up import well_invasion

    return _finish(
        options, "well", well_invasion, ("hours", "height", "pressure", "radius"), "k_over_k0"
    )


def _finish(
    options: argparse.Namespace, name: str, model: Callable[..., Any], names: Any, table: str
) -> int:
    """Compute, keep the numbers and the figure in the folder, print them."""
    from fdnet.formation.scale_up import keep

    mud = ("cake_permeability", "api_filtrate", "classes")
    given = {one: getattr(options, one) for one in (*names, *mud)}
    found = model(options.run, **given)
    keep(options.run, name, found, given)
    if options.json:
        print(json.dumps(found, indent=2))
        return 0
    print(*found["words"], "", *_lines(found[table]), sep="\n")
    for warning in () if options.quiet else found["warnings"]:
        print(f"fdnet: {warning}", file=sys.stderr)
    return 0


def _lines(rows: Any) -> list[str]:
    from fdnet.formation.scale_up import with_band

    ends = ("_low", "_high")
    keys = [key for key, one in rows[0].items() if one is not None and not key.endswith(ends)]
    table = [keys, *([with_band(row, key) for key in keys] for row in rows)]
    wide = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(map(str.rjust, line, wide)) for line in table]
