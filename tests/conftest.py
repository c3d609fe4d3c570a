"""Settings for every test."""

import os
import sys

from hypothesis import settings

# their many processes would each compile every module again, and pytest rewrite every test
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# tests render for themselves, and leave what the user's runs have kept alone
os.environ["CONESPOT_CACHE"] = "off"

# a machine that renders beside the tests may be slow for any single example
settings.register_profile("conespot", deadline=None)
settings.load_profile("conespot" if settings.get_current_profile_name() == "default" else "ci")

#: files that take longest begin first, so that no process is left with one of them when the others are done
LONG = (
    "test_examples.py",
    "test_dask_losses.py",
    "test_blender.py",
    "test_command_run.py",
    "test_command_streams.py",
    "test_pages.py",
    "test_tissue.py",
    "test_spectral.py",
    "test_report_browser.py",
    "test_command_places.py",
    "test_command_cluster.py",
    "test_package.py",
    "test_fuzz.py",
    "test_figures.py",
    "test_writing.py",
)


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: LONG.index(item.path.name) if item.path.name in LONG else len(LONG))
