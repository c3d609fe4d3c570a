"""Campaigns that tests write."""

import pytest

from conespot.campaigns.schema import read_campaign


@pytest.fixture
def campaign(tmp_path):
    """Reads a campaign of a text, from a file of that `name`."""

    def write(text, name="c.yaml"):
        path = tmp_path / name
        path.write_text(text)
        return read_campaign(str(path))

    return write
