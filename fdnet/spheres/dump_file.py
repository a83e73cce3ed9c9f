"""Spheres of a LIGGGHTS or LAMMPS text dump."""

from fdnet.errors import CaseError, DumpError
from fdnet.spheres.dump import DumpReader, Head
from fdnet.spheres.rows import SphereRows, columns_of, metres_per, rows_from

DUMP_UNITS = {"si": 1.0, "cgs": 1e-2, "micro": 1e-6}
"""Metres in the unit of length of the unit systems that a dump may name."""
_MOST_NAMED, _MOST_SHOWN = 5, 40


def dump_spheres(
    data: bytes, source: str, *, units: str | None = None, step: int | None = None
) -> SphereRows:
    """The spheres of one frame of a dump, in metres: the last whole frame, or the one of `step`.

    Columns: x y z (or xu yu zu, or xs ys zs or xsu ysu zsu in parts of the box), radius or
    diameter, and type and id if they are there; others are not read. `units` is the unit of length
    of the dump. Without it the unit is that of the dump's own unit system, or m where it names
    none. Raises DumpError where the file is malformed or holds no whole frame, CaseError where
    `step`, a column or the unit is missing.
    """
    reader = DumpReader(data, source, own=False)
    heads, cut = _heads(reader)
    head = _chosen(heads, cut, source, step)
    where = f"{source}: step {head.step}"
    scale = _scale(head, where) if units is None else metres_per(units)
    columns = columns_of(head.columns, where, box=True, units=False)
    frame = reader.frame(head, columns.needed)
    notes = [f"The lengths of {source} are in m."] if units is None and not head.units else []
    if len(heads) > 1 and step is None:
        notes.append(f"The last of {len(heads)} frames of {source} was used, step {head.step}.")
    warnings = [
        f"{text}; this frame was left out and that of step {head.step} used" for text in cut
    ]
    warnings = warnings if step is None else []
    end = data[head.body][-_MOST_SHOWN:]
    if end and not end[-1:].isspace():
        last = end.split()[-1].decode("utf-8", "replace")
        warnings.append(f"{source} ends without a line feed: its last number, {last}, may be cut")
    return rows_from(
        columns,
        dict(zip(columns.needed, frame.rows.T, strict=True)),
        lambda row: f"{where}: row {row + 1} by id",
        scale=scale,
        box=frame.box,
        boundary=head.boundary,
        source=source,
        step=head.step,
        notes=tuple(notes),
        warnings=tuple(warnings),
    )


def _heads(reader: DumpReader) -> tuple[list[Head], list[str]]:
    """The whole frames, and of each frame that is cut what is wrong with it.

    Raises DumpError where all are cut.
    """
    heads, cut = [], []
    while reader.goes_on():
        before = reader.position
        try:
            heads.append(reader.head())
        except DumpError as error:
            if not error.cut:
                raise
            cut.append(error)
            reader.to_next(before)
    if cut and not heads:
        raise cut[0]
    return heads, [str(error) for error in cut]


def _chosen(heads: list[Head], cut: list[str], source: str, step: int | None) -> Head:
    chosen = heads if step is None else [head for head in heads if head.step == step]
    if not chosen:
        known = ", ".join(str(head.step) for head in heads[:_MOST_NAMED])
        known += ", ..." if len(heads) > _MOST_NAMED else ""
        more = f" ({cut[-1]})" if cut else ""
        raise CaseError(f"{source}: no frame of step {step}; the file has {known}{more}")
    if not chosen[-1].count:
        raise CaseError(f"{source}: step {chosen[-1].step} holds no spheres; choose another step")
    return chosen[-1]


def _scale(head: Head, where: str) -> float:
    if head.units and head.units not in DUMP_UNITS:
        raise CaseError(
            f"{where}: its units are {head.units!r}, which fdnet cannot convert to m; give the "
            "unit of length of the file (units)"
        )
    return DUMP_UNITS.get(head.units, 1.0)
