"""`fdnet check`: what is odd about a case, what to do about it, and what the run takes."""

import argparse
import json
from typing import TYPE_CHECKING, Any

from fdnet.commands.case_options import add_case, case_of
from fdnet.errors import CaseError

if TYPE_CHECKING:
    from fdnet.case.case import Case
    from fdnet.scales.check.checked import Checked
    from fdnet.scales.scales import Scales


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    check = commands.add_parser(
        "check", parents=[common], help="say what is odd about a case, and what it takes"
    )
    add_case(check)
    check.add_argument("--json", action="store_true", help="print the findings as JSON")
    check.set_defaults(action=_check)


def _check(options: argparse.Namespace) -> int:
    from fdnet.scales.scales import scales_of

    case = case_of(options)
    result = looked_at(case, scales_of(case))
    if options.json:
        print(json.dumps(result.data(), indent=2))
    else:
        print("\n".join(result.lines()))
    for one in result.findings:
        if one.refused:
            raise CaseError(f"fdnet run refuses this case: {one.what}")
    return 0


def looked_at(case: "Case", scales: "Scales") -> "Checked":
    """The case with all that `fdnet run` would say or refuse."""
    from fdnet.run.pipeline import refusals
    from fdnet.scales.check.checked import checked

    return checked(case, scales, tuple(refusals(case, scales)))
