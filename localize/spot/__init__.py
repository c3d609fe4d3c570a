"""The fit of a patch that is hardly larger than what spreads its image: a tip near the wall."""
