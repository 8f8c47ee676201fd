"""Dry runs of studies: how many jobs of each rule Snakemake plans."""

import pytest
from study_folder import planned

PLANS = [
    # Finished samples of the frictions 0 and 0.4 are in the project; cases 3 and 4 also have the
    # pulse of 100 kHz.
    pytest.param(
        {"stage": "page"},
        {
            "states": 5,
            "committed_sample": 8,
            "sample": 20,
            "measure": 32,
            "yade_wave": 32,
            "further_wave": 2,
            "measure_state": 7,
            "band_modes": 2,
            "page": 1,
            "crystal": 4,
            "all_modes": 4,
            "translations": 4,
        },
        id="each friction is compressed once",
    ),
    pytest.param(
        {"stage": "page", "spheres": 1000},
        {"states": 7, "measure": 32, "measure_state": 7, "page": 1, "total": 48},
        id="a small packing is made where it is measured",
    ),
    pytest.param(
        {"stage": "response", "spheres": 1000, "cases": [2, 6]},
        {"gain": 1, "spectra": 1, "crystal": 1, "states": 1, "sample": 1, "network": 1, "total": 7},
        id="a stage has its own rule",
    ),
    pytest.param(
        {"cases": [6, 30], "seed": 2},
        {"states": 2, "sample": 2, "network": 2, "highest_mode": 2, "measure": 2, "total": 11},
        id="another seed takes no committed sample and shows a scatter alone",
    ),
    pytest.param({"cases": [6], "stage": "split"}, {"further_wave": 6}, id="six further waves"),
    pytest.param(
        {"study": "studies/friction_width.yaml", "stage": "page"},
        {"states": 18, "sample": 18, "measure": 18, "page": 1, "total": 56},
        id="neither YADE nor stages of its own",
    ),
]


@pytest.mark.parametrize(("settings", "expected"), PLANS)
def test_dry_run_plans_jobs(settings, expected, study):
    assert expected.items() <= planned(study, **settings).items()
