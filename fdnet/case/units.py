"""Values with their units as people write them, such as "80 um" or "25 lb/bbl".

A small table instead of a unit library: importing pint takes 0.3 s, and it reads mD as
millidebye. Conversions are decimal, so that "40 um" is exactly the number 0.04 in mm.
"""

import re
from collections.abc import Iterator
from decimal import Decimal
from types import MappingProxyType

_POUND, _INCH = Decimal("0.45359237"), Decimal("0.0254")
_BARREL = 42 * 231 * _INCH**3
"""The oil barrel of 42 US gallons of 231 cubic inches, m3."""
_PSI = _POUND * Decimal("9.80665") / _INCH**2
_DARCY = Decimal("1e-3") * Decimal("1e-4") / Decimal("101325")
"""The darcy, m2: 1 cP times 1 cm2/s over 1 atm (API RP 27)."""

UNITS: dict[str, dict[str, Decimal]] = {
    "length": {
        "m": Decimal(1),
        "cm": Decimal("0.01"),
        "mm": Decimal("1e-3"),
        "um": Decimal("1e-6"),
        "micron": Decimal("1e-6"),
        "microns": Decimal("1e-6"),
        "nm": Decimal("1e-9"),
        "in": _INCH,
        "inch": _INCH,
        "ft": 12 * _INCH,
    },
    "pressure": {
        "Pa": Decimal(1),
        "kPa": Decimal("1e3"),
        "MPa": Decimal("1e6"),
        "GPa": Decimal("1e9"),
        "bar": Decimal("1e5"),
        "atm": Decimal(101325),
        "psi": _PSI,
        "ksi": 1000 * _PSI,
        "J/m3": Decimal(1),
    },
    "viscosity": {
        "Pa s": Decimal(1),
        "mPa s": Decimal("1e-3"),
        "cP": Decimal("1e-3"),
        "P": Decimal("0.1"),
    },
    "density": {
        "kg/m3": Decimal(1),
        "g/cm3": Decimal(1000),
        "g/cc": Decimal(1000),
        "g/ml": Decimal(1000),
        "kg/l": Decimal(1000),
        "g/l": Decimal(1),
        "lb/bbl": _POUND / _BARREL,
        "lb/gal": 42 * _POUND / _BARREL,
        "ppg": 42 * _POUND / _BARREL,
        "lb/ft3": _POUND / (12 * _INCH) ** 3,
    },
    "permeability": {
        "m2": Decimal(1),
        "um2": Decimal("1e-12"),
        "D": _DARCY,
        "mD": _DARCY / 1000,
    },
    "time": {
        "s": Decimal(1),
        "ms": Decimal("1e-3"),
        "us": Decimal("1e-6"),
        "min": Decimal(60),
        "h": Decimal(3600),
        "hours": Decimal(3600),
    },
    "velocity": {
        "m/s": Decimal(1),
        "cm/s": Decimal("0.01"),
        "mm/s": Decimal("1e-3"),
        "ft/s": 12 * _INCH,
        "ft/min": 12 * _INCH / 60,
    },
    "acceleration": {"m/s2": Decimal(1)},
    "stiffness": {
        "N/m": Decimal(1),
        "kN/m": Decimal("1e3"),
        "MN/m": Decimal("1e6"),
        "GN/m": Decimal("1e9"),
    },
    "stiffness per area": {"Pa/m": Decimal(1), "MPa/m": Decimal("1e6"), "GPa/m": Decimal("1e9")},
    "share": {"%": Decimal(1)},
}
"""Units by dimension, each with its factor to SI; a share is kept in percent."""

SUFFIXES = MappingProxyType(
    {
        "_GPa_m": ("stiffness per area", Decimal("1e9")),
        "_kg_m3": ("density", Decimal(1)),
        "_J_m3": ("pressure", Decimal(1)),
        "_m_s2": ("acceleration", Decimal(1)),
        "_N_m": ("stiffness", Decimal(1)),
        "_m_s": ("velocity", Decimal(1)),
        "_GPa": ("pressure", Decimal("1e9")),
        "_MPa": ("pressure", Decimal("1e6")),
        "_Pa": ("pressure", Decimal(1)),
        "_cP": ("viscosity", Decimal("1e-3")),
        "_mD": ("permeability", _DARCY / 1000),
        "_mm": ("length", Decimal("1e-3")),
        "_um": ("length", Decimal("1e-6")),
        "_ms": ("time", Decimal("1e-3")),
        "_hours": ("time", Decimal(3600)),
        "_percent": ("share", Decimal(1)),
        "_s": ("time", Decimal(1)),
        "_m": ("length", Decimal(1)),
    }
)
"""Ends of keys, longer ones first, with the dimension and the factor to SI that they stand for."""

_VALUE = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(\D.*?)?\s*")
_SPELLINGS = {"µ": "u", "μ": "u", "³": "3", "²": "2", "^": "", "·": " ", "Pa.s": "Pa s"}
_AMBIGUOUS = {
    "ppb": "pounds per barrel or parts per billion; write lb/bbl",
    "gal": "a US or an imperial gallon",
    "d": "a day or a darcy; write D for darcy",
    "md": "millidarcy; write mD",
    "M": "metre; write m",
    "cp": "centipoise; write cP",
    "Mpa": "megapascal; write MPa",
    "mpa": "megapascal; write MPa",
    "PSI": "pound per square inch; write psi",
}
_LONGEST = 60


def suffix_of(key: str) -> str:
    """The unit at the end of a key, such as "_mm"; empty where it has none."""
    return next((suffix for suffix in SUFFIXES if key.endswith(suffix) and key != suffix), "")


def stem_of(key: str) -> str:
    """The key without its unit."""
    return key.removesuffix(suffix_of(key))


def converted(text: str, suffix: str) -> float:
    """The value of `text` in the unit that the end of a key stands for.

    Raises ValueError, with the reason in words, where the text is no number with a unit of that
    dimension.
    """
    dimension, own = SUFFIXES[suffix]
    number, factor = _read(text, dimension)
    return float(number * factor / own)


def share_of(text: str) -> float:
    """The share (0 to 1) that a text such as "5 %" stands for. Raises ValueError otherwise."""
    number, _ = _read(text, "share")
    return float(number / 100)


def length_factor(unit: str) -> float | None:
    """Factor of a unit of length to mm; None where it is none."""
    factor = UNITS["length"].get(_spelled(unit))
    return None if factor is None else float(factor * 1000)


def _read(text: str, dimension: str) -> tuple[Decimal, Decimal]:
    known = ", ".join(UNITS[dimension])
    example = f"a number and a unit of {dimension} ({known})"
    match = _VALUE.fullmatch(text) if len(text) <= _LONGEST else None
    if match is None:
        raise ValueError(f"expected {example}")
    if match[2] is None:
        raise ValueError(f"has no unit, expected {example}")
    unit = _spelled(match[2])
    if unit in UNITS[dimension]:
        return Decimal(match[1]), UNITS[dimension][unit]
    if unit in _AMBIGUOUS:
        raise ValueError(f"{unit!r} may mean {_AMBIGUOUS[unit]}; expected {example}")
    others = list(_dimensions_of(unit))
    what = f"{unit!r} is a unit of {others[0]}" if others else f"{unit!r} is no unit that is known"
    raise ValueError(f"{what}, expected {example}")


def _spelled(unit: str) -> str:
    for written, plain in _SPELLINGS.items():
        unit = unit.replace(written, plain)
    return " ".join(unit.split())


def _dimensions_of(unit: str) -> Iterator[str]:
    return (dimension for dimension, units in UNITS.items() if unit in units)
