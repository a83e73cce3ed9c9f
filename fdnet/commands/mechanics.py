"""`fdnet mechanics`: elastic moduli and triaxial tests of a pack, without time steps."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from fdnet.commands.options import OUTPUT, THE_CASE, THE_TEST, new_command, overrides_of
from fdnet.errors import CaseError
from fdnet.files import path_option


def add_mechanics(commands: Any) -> None:
    """Adds the command to the command line."""
    about = "measure elastic moduli of a pack, and its triaxial test, without time steps"
    example = "fdnet mechanics runs/mine --set bonds.radius_ratio=0.5"
    parser = new_command(commands, "mechanics", _mechanics, about, example)
    parser.add(THE_CASE, "source CASE.toml", "the case file, or a run folder", path_option)
    parser.share("--seed", "--set", "--liggghts")
    confining = (
        "stress on the sides in the triaxial test; sets the stiffness of Hertz contacts too"
    )
    parser.add(THE_TEST, "--confining-MPa MPA", confining, float)
    triaxial = "compress the pack along x with the confining stress on its sides, until --strain"
    parser.add(THE_TEST, "--triaxial", triaxial)
    strain = "axial strain at the end of the triaxial test (default 0.01)"
    parser.add(THE_TEST, "--strain SHARE", strain, float, 0.01)
    parser.add(THE_TEST, "--steps N", "load steps of the triaxial test (default 20)", int, 20)
    parser.add(OUTPUT, "--out DIR", "run folder of a case file (default runs/NAME)", path_option)
    parser.share("--json", "--quiet")


def _mechanics(options: argparse.Namespace) -> int:
    from fdnet.mechanics.triaxial import LoadStep
    from fdnet.run.mechanics import measure_elastic, measure_triaxial, packed_case, write_mechanics
    from fdnet.run.records import RunOptions

    given = options.confining_MPa
    pressure = None if given is None else 1e6 * given
    if given is not None and not 0 < given < 1e9:
        raise CaseError(f"--confining-MPa: {given}, expected a stress above 0, in MPa")
    if options.triaxial and given is None:
        raise CaseError("--triaxial: needs the stress on the sides; give --confining-MPa")
    if options.triaxial and not 0 < options.strain <= 0.3:
        raise CaseError(f"--strain: {options.strain}, expected a share above 0, at most 0.3")
    if options.triaxial and not 1 <= options.steps <= 10_000:
        raise CaseError(f"--steps: {options.steps}, expected 1 to 10000 load steps")

    def follow(row: LoadStep) -> None:
        if not options.quiet:
            print(
                f"triaxial: strain {row.axial_strain:.3e}, deviatoric {row.deviatoric / 1e6:.4g} "
                f"MPa, bonds broken {row.tension + row.shear}",
                file=sys.stderr,
                flush=True,
            )

    chosen = RunOptions(
        out=options.out or Path("runs"),
        liggghts=options.liggghts,
        show_progress=not options.quiet,
        command=options.command_line,
    )
    packed = packed_case(options.source, chosen, overrides_of(options))
    numbers = measure_elastic(packed, pressure)
    if options.triaxial:
        asked = {"confining_Pa": pressure, "strain": options.strain, "steps": options.steps}
        numbers["triaxial"] = measure_triaxial(packed, **asked, follow=follow)
    path = write_mechanics(packed, numbers)
    for warning in [*numbers["warnings"], *numbers.get("triaxial", {}).get("warnings", [])]:
        print(f"fdnet: warning: {warning}", file=sys.stderr)
    if options.json:
        print(json.dumps(numbers, indent=2))
    else:
        _print(numbers)
        print(f"written: {path}")
    return 0


def _print(numbers: dict[str, Any]) -> None:
    print(f"Young's modulus       {numbers['young_modulus_Pa'] / 1e9:.4g} GPa")
    print(f"Poisson's ratio       {numbers['poisson_ratio']:.3f}")
    print(f"bulk modulus          {numbers['bulk_modulus_Pa'] / 1e9:.4g} GPa")
    print(f"shear modulus         {numbers['shear_modulus_Pa'] / 1e9:.4g} GPa")
    print(f"P wave, S wave        {numbers['p_wave_m_s']:.4g}, {numbers['s_wave_m_s']:.4g} m/s")
    print(f"joints of a grain     {numbers['coordination']:.3g}, {numbers['bonds']} bonds")
    print(f"grains without load   {numbers['rattlers']} of {numbers['grains']}")
    test = numbers.get("triaxial")
    if test:
        print(f"triaxial, {test['confining_Pa'] / 1e6:g} MPa:")
        print(f"  initial slope       {test['young_modulus_Pa'] / 1e9:.4g} GPa")
        print(
            f"  largest stress      {test['peak_Pa'] / 1e6:.4g} MPa deviatoric at a strain of "
            f"{test['peak_strain']:.3g}"
        )
        print(
            f"  bonds broken        {test['broken_in_tension']} in tension, "
            f"{test['broken_in_shear']} in shear, of {test['bonds']}"
        )
