"""Optic discs under a soft patch: their rim may pass for the end of the light."""
