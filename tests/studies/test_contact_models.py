"""Contact models on the quick specimens: the cases that are run, and the table on the page."""

from fdnet.studies.dem.contact_models import OPTIONS, TRIED, case_of, points, summary
from fdnet.studies.engine.csv_rows import read_named

WET = "rebound in the liquid"
TABLE = "docs/validation/contact_models.csv"


def test_each_option_differs_from_the_specimen_by_its_contacts_alone(root):
    """Hertz contacts take no springs, linear ones keep those that the shipped case names."""
    for option, asked in OPTIONS.items():
        case = case_of(root / "cases", "specimen5", 2, option)
        assert case.seed == 2
        for key, value in asked.items():
            assert getattr(case.contact, key) == value
        assert (case.grains.shear_stiffness_N_m is None) is (case.contact.model == "hertz")
    plain, wet = (
        case_of(root / "cases", "specimen5", 1, name)
        for name in ("hooke", "rebound in the liquid")
    )
    assert plain.digest("pack") == wet.digest("pack")
    assert plain.digest("invade") != wet.digest("invade")


def test_the_table_has_every_run_of_the_study(root):
    rows = read_named(root / TABLE)
    assert [(row["specimen"], int(row["seed"]), row["option"]) for row in rows] == points()


def test_costs_are_ratios_of_sums_over_the_seeds():
    rows = [
        {
            "specimen": "specimen1",
            "seed": seed,
            "option": option,
            "invaded": 10.0 * seed,
            "mean_depth": 1e-4,
            "k_ratio_first": 0.5,
            "k_ratio": 0.7,
            "max_overlap": 0.01,
            "steps": steps,
            "core_s": core,
        }
        for seed in (1, 2)
        for option, steps, core in (("hooke", 100.0, 2.0), ("hertz", 300.0, 4.0))
    ]
    line = summary(rows).splitlines()[-1]
    assert line.startswith("| specimen1 | hertz | 2 | 15 (10 to 20) | 0.1 (0.1 to 0.1) |")
    assert line.endswith("| 1.50 | 2.00 |")
    assert len(summary(rows).splitlines()) == 2 + len(TRIED["specimen1"])
