"""The defaults that `scene.identity.SCHEMA` stands for: who changes one must raise it, or old names mean new things.

New keys and new kinds need nothing. After raising it, `python tests/unit/campaigns/test_defaults.py` writes the file
anew.
"""

import json
from pathlib import Path

from pydantic import BaseModel

from conespot.campaigns.schema import Campaign
from conespot.scene.identity import SCHEMA, essence
from conespot.scene.model import Model

FILE = Path(__file__).parents[2] / "data" / "defaults.json"


def descriptions(model=Model):
    """Every description that a campaign may hold."""
    for kind in model.__subclasses__():
        if kind is Campaign or kind.__module__.startswith(("conespot.scene.", "conespot.campaigns.knowledge")):
            yield kind
        yield from descriptions(kind)


def defaults(kind):
    """What a file would hold of the keys with a default; of a description among them what differs from its own."""
    values = {n: f.get_default(call_default_factory=True) for n, f in kind.model_fields.items() if not f.is_required()}
    written = kind.model_construct(**values).model_dump(mode="json", include=set(values))
    described = {name: essence(value) for name, value in values.items() if isinstance(value, BaseModel)}
    return written | described


def now():
    """Defaults by the kind's name; two kinds of one name (a line of light, a line of tips) share no other key."""
    found = {}
    for kind in descriptions():
        found.setdefault(kind.__name__, {}).update(defaults(kind))
    return dict(sorted(found.items()))


def test_a_default_changes_with_the_schema_version_alone():
    stored = json.loads(FILE.read_text())
    assert stored["schema"] == SCHEMA, "raised: write the file anew, as the docstring says"
    current = now()
    changed = [
        f"{name}.{key}: {value} -> {current.get(name, {}).get(key)}"
        for name, keys in stored["defaults"].items()
        for key, value in keys.items()
        if current.get(name, {}).get(key) != value
    ]
    assert not changed, "a default is another one, or its key or kind has another name: raise scene.identity.SCHEMA"


if __name__ == "__main__":
    FILE.write_text(json.dumps({"schema": SCHEMA, "defaults": now()}, indent=1) + "\n")
