"""How well a scene could be localized at all: closed forms, bounds, error budget, design."""
