"""Campaigns: YAML to cases to rows. Run them with the command `campaign`."""
