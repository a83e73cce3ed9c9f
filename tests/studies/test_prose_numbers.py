"""Every number in the prose of the evidence pages is computed, a setting, or named here."""

import re
from pathlib import Path
from string import Template

import pytest

from fdnet.studies.pages.invasion_numbers import invasion_numbers
from fdnet.studies.pages.network_numbers import network_numbers

NUMBER = re.compile(r"(?<![\w.])\d+(?:,\d{3})*(?:\.\d+)?(?:e\d+)?(?:/\d+)?(?!\w)")
SETTINGS = {
    "validation": {
        "": "0.05 0.2 1e4 200 30 95",
        "1. Contact stiffness": "0.10 0.16 0.2 1e2 1e3 1e4 1e6 1e8 2 3e2 94.3e9",
        "2. Time step": "0.1 0.2 0.3 3 0.4 0.5 0.6 24 95",
        "3. Drag": "0.05 0.1 1 2 4 10 20,000 95",
        "4. Frozen or mobile grains, neighbour lists, MPI": "0.1 0.5 2,000 20,000",
        "5. Fines in throats": "0.40 4 10 12 20 1e5",
        "6. Conductance and damage laws": "1 3 4 1/5 1/10 10 20 32 40 48 64 72 95 200",
        "7. Linear solver": "1.41 2 4 6 8 12 16 55 80 100 200 300 1,000 2,000 3,000 5,000 9,000 "
        "10,000 20,000 30,000 100,000",
        "8. Specimen size and seed": "5",
        "9. Economies of full-scale invasions": "0.2 3 6 10 1e3 2e3 3e3 1e4",
        "10. Size ratio of fines and grains": "0.2 1 2 6 60",
        "11. Velocity between the grains": "0.30 20",
        "12. Defaults of an invasion": "0.5 1 2 5 6 4,000",
        "13. Fines that are driven faster than the fluid": "1 3 3.5 5 9 18 95 100 108",
        "14. How often the flow follows its deposit": "1/5 1/10 5 95",
    },
    "accuracy": {
        "": "1 3 7",
        "1. What is compared": "1 1/5 2 13",
        "2. Intact": "0.22 0.30 0.35 0.45 0.55 0.70 3.12 8/3",
        "3. With fines": "0.30 0.40 0.45 1 1.5 5 7 8 9 13 26 30 1/10 1/3 1/40 1/5 1/6 "
        "128 160 1935 2 42 3 408 98 0.1 0.8 0.9 14 48 57 135",
        "4. Walls, cut planes, size": "1 1.5 2 3 8 10 11 20",
        "5. Unequal grains": "1 2 3",
        "7. What remains wrong, and why": "0.30 0.4 0.40 1 1/10 1/3 1/8 3 8 192 0.1",
    },
}
"""What was chosen, not found: values of knobs, sizes, times, years, sections; by page, section."""
MEASURED_APART = {
    "validation": {
        "4. Frozen or mobile grains, neighbour lists, MPI": "7 9",
        "9. Economies of full-scale invasions": "1 7 17,446 17,625 18,667 25,833 26,417",
        "10. Size ratio of fines and grains": "5 229 238 6 816 822",
        "14. How often the flow follows its deposit": "2,469 2,789 3,064",
    },
    "accuracy": {
        "3. With fines": "6 12 18 23 0.2 0.3 0.5 0.7 4.9 5.6 0.93 0.96 10.3 11.0 "
        "4.1 4.4 5.1 6.1 25 0.52 0.6 0.65 10 34 2.4 4.2 0.856 0.869 0.06 0.70 0.83 0.863 0.974 "
        "1.032 1.072 1.4 1.7 2.1 3.3 6.2 6.5",
        "7. What remains wrong, and why": "13 25 34 1.0 2.1 1.3 0.3 0.7",
    },
}
"""Results that no table of the page holds; the prose says that they were measured apart."""


def literals(page: str) -> dict[str, set[str]]:
    """Numbers that stand in the prose of a page's source as they are, by section."""
    result = {}
    for number, part in enumerate(re.split(r"(?m)^## ", page)):
        title, _, body = part.partition("\n")
        body = re.sub(r"(?ms)^```.*?^```", "", body)
        body = re.sub(r"(?m)^\|.*$", "", body)
        body = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", body)
        body = re.sub(r"`[^`]*`|\$\w+", "", body)
        result[title if number else ""] = set(NUMBER.findall(body))
    return result


@pytest.mark.parametrize("page", list(SETTINGS))
def test_numbers_of_the_prose_are_computed_or_chosen(root, page):
    """A result that somebody types into the prose is a number that stands nowhere here."""
    text = (root / "docs" / f"{page}.md.in").read_text(encoding="utf-8")
    for section, numbers in literals(text).items():
        known = f"{SETTINGS[page].get(section, '')} {MEASURED_APART[page].get(section, '')}"
        assert numbers == set(known.split()), section


@pytest.fixture(scope="module")
def numbers(root) -> dict[str, str]:
    validation = root / "docs" / "validation"
    return invasion_numbers(validation) | network_numbers(validation)


def test_every_number_has_its_place(root: Path, numbers):
    page = Template((root / "docs" / "validation.md.in").read_text(encoding="utf-8"))
    assert set(numbers) <= set(page.get_identifiers())


READ_OFF_BY_HAND = {
    "soft_errors": "7 to 28",
    "nominal_hours": "4.5",
    "drag_means": "32",
    "drag_standing_out": "3",
    "viscous_saves": "6 to 12",
    "quick_k": "23",
    "five_k": "11",
    "quick_k_ratio": "38",
    "five_k_ratio": "60",
    "softer_more": "10",
    "soft_same_pack": "3 to 6",
    "softer_same_pack": "10 to 11",
    "step_gain": "1.8",
    "all_gain": "2.6",
    "all_long": "15",
    "ten_points": "1.3e-7",
    "planes_low": "0.05",
    "planes_clogged": "61",
    "exact_clogged": "222",
    "exact_clogged_k": "0.081",
    "law_times": "1.9",
    "resolved_error": "2.2 ± 0.9",
    "kozeny_error": "3.9 ± 1.8",
    "one_64_times": "260",
    "two_72_times": "510",
    "fines_72_times": "490",
    "million": "6, 10, 22",
    "aggregation_steps": "94 and 884",
    "unit_steps": "135",
    "spsolve_growth": "2.4",
    "direct_memory": "0.48",
    "direct_estimate": "0.58",
}
"""From the tables by eye, before these numbers were computed."""


def test_computed_numbers_are_those_read_off_by_hand(numbers):
    assert {name: numbers[name] for name in READ_OFF_BY_HAND} == READ_OFF_BY_HAND
