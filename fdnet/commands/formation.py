"""`fdnet core` and `fdnet well`: what a finished run means for a core and for a well."""

import argparse
import json
import sys
from functools import partial
from inspect import signature
from typing import Any

from fdnet.case.units import converted
from fdnet.commands.options import new_command
from fdnet.files import path_option


def add_formation(commands: Any) -> None:
    """Adds `fdnet core` and `well` to the command line."""
    about = "flood a core of a run's sand with its mud, and turn the flow back"
    example = "fdnet core runs/mine --length 76mm --rate 1ml/min"
    core = new_command(commands, "core", partial(_finish, "core"), about, example)
    about = "carry a run to a well: filtrate, invaded radius, k by depth, cake, skin"
    example = "fdnet well runs/mine --hours 12 --api-filtrate 8ml"
    well = new_command(commands, "well", partial(_finish, "well"), about, example)
    length, pressure = partial(_si, "_m"), partial(_si, "_Pa")
    for parser, spec, text, kind in (
        (core, "--length LENGTH", "of the core, as 76mm", length),
        (core, "--diameter LENGTH", "of the core (default 38 mm)", length),
        (core, "--rate RATE", "of the flood, as 1ml/min", partial(_si, "_m3_s")),
        (core, "--pressure PRESSURE", "over core and cake, as 7bar", pressure),
        (core, "--minutes N", "length of the flood (default 30)", float),
        (core, "--back-flow N", "pore volumes of back-flow after [clean_up] (default 10)", float),
        (core, "--sections N", "between pressure taps (default 4)", int),
        (well, "--hours N", "that the mud stands (default 12)", float),
        (well, "--pressure PRESSURE", "overbalance, as 300psi (default: of the case)", pressure),
        (well, "--radius LENGTH", "of the well (default: of the case)", length),
    ):
        required: Any = {"required": True} if spec.startswith("--length") else {}
        parser.add(f"the {parser.prog.split()[-1]}", spec, text, kind, **required)
    run = "run folder, or the folder of an ensemble, whose seeds then give the bands"
    api = "of the mud in 30 minutes, as 8ml: gives the permeability of the cake"
    for parser, group in ((core, "the core"), (well, "the well")):
        parser.add(group, "run RUN", run, path_option)
        parser.add(group, "--api-filtrate VOLUME", api, partial(_si, "_m3"))
        parser.share("--json", "--quiet")


def _si(suffix: str, text: str) -> float:
    """A value with its unit in SI."""
    try:
        return converted(text, suffix)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}") from error


def _finish(name: str, options: argparse.Namespace) -> int:
    """Compute, keep the numbers and the figure in the folder, print them."""
    import pandas as pd

    from fdnet.formation.scale_up import core_flood, hand_up, keep, well_invasion, with_band

    model: Any = core_flood if name == "core" else well_invasion
    asked = {key: value for key, value in vars(options).items() if value is not None}
    known = {key: one.default for key, one in signature(model).parameters.items()}
    given = {key: asked.get(key, default) for key, default in known.items() if key != "source"}
    handed = hand_up(options.run, api_filtrate=options.api_filtrate)
    found = model(handed, **given)
    keep(options.run, name, {"given": given, **found}, handed)
    if options.json:
        print(json.dumps(found, indent=2))
        return 0
    table = found["sections" if name == "core" else "k_over_k0"]
    keys = [key for key in table[0] if not key.endswith(("_low", "_high", "_of"))]
    rows = [{key: with_band(row, key) for key in keys} for row in table]
    print(*found["words"], "", pd.DataFrame(rows).to_string(index=False), sep="\n")
    for warning in () if options.quiet else found["warnings"]:
        print(f"fdnet: {warning}", file=sys.stderr)
    return 0
