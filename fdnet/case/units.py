"""Values with their units as people write them, such as "80 um" or "25 lb/bbl".

Conversions are decimal, so that "40 um" is exactly the number 0.04 in mm.
"""

import re
from decimal import Decimal

_POUND, _INCH = Decimal("0.45359237"), Decimal("0.0254")
_BARREL = 42 * 231 * _INCH**3  # The oil barrel of 42 US gallons of 231 cubic inches, m3
_PSI = _POUND * Decimal("9.80665") / _INCH**2
_DARCY = Decimal("1e-3") * Decimal("1e-4") / Decimal("101325")
"""The darcy, m2: 1 cP times 1 cm2/s over 1 atm (API RP 27)."""

_FACTORS = {
    "psi": _PSI,
    "ksi": 1000 * _PSI,
    "lb/bbl": _POUND / _BARREL,
    "lb/gal": 42 * _POUND / _BARREL,
    "ppg": 42 * _POUND / _BARREL,
    "lb/ft3": _POUND / (12 * _INCH) ** 3,
    "D": _DARCY,
    "mD": _DARCY / 1000,
    "ft/min": 12 * _INCH / 60,
    "ml/min": Decimal("1e-6") / 60,
    "mL/min": Decimal("1e-6") / 60,
    "cc/min": Decimal("1e-6") / 60,
}
_UNITS = """
length: m 1, cm 0.01, mm 1e-3, um 1e-6, micron 1e-6, microns 1e-6, nm 1e-9, in 0.0254,
    inch 0.0254, ft 0.3048
pressure: Pa 1, kPa 1e3, MPa 1e6, GPa 1e9, bar 1e5, atm 101325, psi, ksi, J/m3 1
viscosity: Pa s 1, mPa s 1e-3, cP 1e-3, P 0.1
density: kg/m3 1, g/cm3 1000, g/cc 1000, g/ml 1000, kg/l 1000, g/l 1, lb/bbl, lb/gal, ppg, lb/ft3
permeability: m2 1, um2 1e-12, D, mD
volume: m3 1, l 1e-3, L 1e-3, ml 1e-6, mL 1e-6, cc 1e-6, cm3 1e-6
time: s 1, ms 1e-3, us 1e-6, min 60, h 3600, hours 3600
flow rate: m3/s 1, ml/s 1e-6, ml/min, mL/min, cc/min
velocity: m/s 1, cm/s 0.01, mm/s 1e-3, ft/s 0.3048, ft/min
acceleration: m/s2 1
stiffness: N/m 1, kN/m 1e3, MN/m 1e6, GN/m 1e9
stiffness per area: Pa/m 1, MPa/m 1e6, GPa/m 1e9
share: % 1
"""


def _units(text: str) -> dict[str, Decimal]:
    """Units and factors of a line of `_UNITS`; those without a factor are in `_FACTORS`."""
    units = {}
    for word in map(str.strip, text.split(",")):
        name, _, factor = word.rpartition(" ")
        units[word if word in _FACTORS else name] = _FACTORS.get(word) or Decimal(factor)
    return units


UNITS = {
    line.split(":")[0]: _units(line.split(":")[1])
    for line in _UNITS.strip().replace(",\n", ",").splitlines()
}
"""Units by dimension, each with its factor to SI; a share is kept in percent."""

SUFFIXES = {
    f"_{suffix}": (dimension, UNITS[dimension][unit])
    for dimension, suffix, unit in (
        ("stiffness per area", "GPa_m", "GPa/m"),
        ("density", "kg_m3", "kg/m3"),
        ("pressure", "J_m3", "J/m3"),
        ("acceleration", "m_s2", "m/s2"),
        ("stiffness", "N_m", "N/m"),
        ("flow rate", "m3_s", "m3/s"),
        ("velocity", "m_s", "m/s"),
        ("pressure", "GPa", "GPa"),
        ("pressure", "MPa", "MPa"),
        ("pressure", "Pa", "Pa"),
        ("viscosity", "cP", "cP"),
        ("permeability", "mD", "mD"),
        ("length", "mm", "mm"),
        ("length", "um", "um"),
        ("time", "ms", "ms"),
        ("time", "hours", "hours"),
        ("share", "percent", "%"),
        ("time", "s", "s"),
        ("permeability", "m2", "m2"),
        ("volume", "m3", "m3"),
        ("length", "m", "m"),
    )
}
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
    """The value of `text` in the unit of the end of a key. Raises ValueError with the reason."""
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
    others = [dimension for dimension, units in UNITS.items() if unit in units]
    what = f"{unit!r} is a unit of {others[0]}" if others else f"{unit!r} is no unit that is known"
    raise ValueError(f"{what}, expected {example}")


def _spelled(unit: str) -> str:
    for written, plain in _SPELLINGS.items():
        unit = unit.replace(written, plain)
    return " ".join(unit.split())
