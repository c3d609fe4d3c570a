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
