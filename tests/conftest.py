"""Settings for every test."""

from hypothesis import settings

# a machine that renders beside the tests may be slow for any single example
settings.register_profile("conespot", deadline=None)
settings.load_profile("conespot" if settings.get_current_profile_name() == "default" else "ci")
