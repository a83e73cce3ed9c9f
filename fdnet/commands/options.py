"""The parser of a command: a sentence, an example, and options in groups."""

import argparse
import difflib
import shlex
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NoReturn

from fdnet.errors import CaseError
from fdnet.files import path_option
from fdnet.names import STAGES

THE_CASE, THE_SPHERES, THE_FLOW = "the case", "the spheres", "the flow"
THE_TEST, THE_PICTURE, LIGGGHTS = "the test", "the picture", "LIGGGHTS"
OUTPUT, MANY = "output", "many runs"  # Titles of the groups of options


class Parser(argparse.ArgumentParser):
    """The parser of `fdnet` or of a command; a bad command line is one line on stderr."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        self._groups: dict[str, Any] = {}

    def error(self, message: str) -> NoReturn:
        """End with exit code 2."""
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")

    def add(
        self, group: str, spec: str, text: str, kind: Any = None, default: Any = None, **more: Any
    ) -> None:
        """Add an option to the group of this title; the `spec` is its name and its metavar.

        Without metavar and choices it takes no value. `kind` is the type of the value.
        """
        name, _, metavar = spec.partition(" ")
        how = more | {"help": text.replace("%", "%%")}
        if metavar:
            how |= {"metavar": metavar, "type": kind}
        elif "choices" not in more:
            how["action"] = "store_true"
        if name.startswith("-"):
            how.setdefault("default", default if metavar or "choices" in more else False)
        if group not in self._groups:
            self._groups[group] = self.add_argument_group(group)
        self._groups[group].add_argument(name, **how)

    def share(self, *names: str) -> None:
        """Add options that several commands have, by their names."""
        for name in names:
            option = SHARED[name]
            more = option[-1] if isinstance(option[-1], dict) else {}
            self.add(*option[: -1 if more else None], **more)

    def refuse(self, unknown: Sequence[str]) -> NoReturn:
        """End for arguments that nothing takes, with the option that may have been meant."""
        near = meant(unknown[0].partition("=")[0], self._option_string_actions)
        self.error(f"{shlex.join(unknown)}: not an argument of this command{near}")


def new_command(
    commands: Any, name: str, action: Callable[[Any], int], about: str, *examples: str
) -> Parser:
    """Add the command `name`, done by `action`; `about` is one sentence without its full stop.

    The list of commands leaves `render` out, the long form of another.
    """
    parser: Parser = commands.add_parser(
        name,
        **({} if name == "render" else {"help": about.replace("%", "%%")}),
        description=f"{about[0].upper()}{about[1:]}.",
        epilog="\n  ".join(["examples:" if examples[1:] else "example:", *examples]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--debug", action="store_true", help="show a traceback on errors")
    parser.set_defaults(action=action, parser=parser)
    return parser


def meant(word: str, known: Iterable[str]) -> str:
    """The known word that is most like this one, as the end of a message; "" without one."""
    near = difflib.get_close_matches(word, list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""


def overrides_of(options: argparse.Namespace) -> list[str]:
    """The assignments of --set, then those of --seed and --fast."""
    seed = [] if options.seed is None else [f"seed={options.seed}"]
    fast = ['invasion.method="network"'] if getattr(options, "fast", False) else []
    return [*options.set, *seed, *fast]


def case_of(options: argparse.Namespace) -> Any:
    """The case that the options name, with --set and --seed applied."""
    from fdnet.case.file import read_case

    return read_case(options.case, assignments=overrides_of(options))


def stages_of(text: str) -> tuple[str, ...]:
    """The stages that --stages names. Raises CaseError for others, and for none."""
    names = [part.strip() for part in text.split(",") if part.strip()]
    unknown = [name for name in names if name not in STAGES]
    if unknown or not names:
        raise CaseError(
            f"--stages: {text!r} has {unknown or 'nothing'}, expected some of {','.join(STAGES)}"
        )
    return tuple(stage for stage in STAGES if stage in names)


def _ranks(text: str) -> int:
    if not text.isdecimal() or len(text) > 9 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text[:40]!r}, expected a number of ranks, 1 or more")
    return int(text)


_ROWS: tuple[tuple[Any, ...], ...] = (
    (THE_CASE, "case CASE.toml", "the case file", path_option),
    (THE_CASE, "--seed N", "overrides the seed of the case", int),
    (
        *(THE_CASE, "--set KEY=VALUE"),
        "overrides a key of the case, e.g. fines.count=500; may be given again",
        *(str, [], {"action": "append"}),
    ),
    (THE_CASE, "--fast", "size classes on the pore network instead of spheres in LIGGGHTS"),
    (
        *(LIGGGHTS, "--np N"),
        "MPI ranks for invasion and clean-up (default 1); packing takes one, and a cut invasion "
        "is continued with the number it was begun with",
        *(_ranks, 1),
    ),
    (LIGGGHTS, "--liggghts PATH", "the LIGGGHTS binary"),
    (
        *(LIGGGHTS, "--launcher TEMPLATE"),
        "how several MPI ranks are started, with {ranks} for their number, e.g. "
        "'srun -n {ranks}' (default: the mpirun of LIGGGHTS)",
    ),
    (LIGGGHTS, "--timeout SECONDS", "stop LIGGGHTS then in a stage; --resume continues it", float),
    (
        *(OUTPUT, "--stages STAGES"),
        f"some of {','.join(STAGES)} (default: all that the case has; without report nothing is "
        "drawn)",
        *(str, ",".join(STAGES)),
    ),
    (OUTPUT, "--out DIR", "folder of the results", path_option, None, {"required": True}),
    (OUTPUT, "--force", "replace what is there"),
    (OUTPUT, "--json", "print the result as JSON"),
    (OUTPUT, "--quiet", "no progress"),
    (
        *(OUTPUT, "--rank-by QUANTITY"),
        "number of the summaries that orders the variants, smallest first (default k_reduction)",
        *(str, "k_reduction"),
    ),
    (MANY, "--jobs N", "runs at the same time (default: cores over ranks; 100 on a cluster)", int),
    (
        *(MANY, "--engine"),
        "what starts the runs: Snakemake if it is installed, or processes of fdnet (local)",
        *(str, "auto", {"choices": ("auto", "local", "snakemake")}),
    ),
    (
        *(MANY, "--slurm RESOURCES"),
        "submit the runs to Slurm through Snakemake, with its default resources, e.g. "
        "slurm_partition=short,runtime=60",
        *(str, None, {"nargs": "?", "const": ""}),
    ),
    (MANY, "--jobs-limit N", "most runs of a plan (default 1000)", int, 1000),
    (MANY, "--gather", "run nothing; gather the runs that are there"),
)
SHARED = {row[1].split()[0]: row for row in _ROWS}
"""Options that several commands have: what `Parser.add` takes, more for argparse at the end."""
