"""What exported frames are called: by case and pose, and by a mark that ties them to their run and tells nothing.

The mark comes from a secret of the run, so that frames of one run cannot be scored as another's, and no name can be
turned back into the campaign that made it, whose seed would give the poses away.
"""

from __future__ import annotations

import hashlib
import json
import re
import secrets
from dataclasses import dataclass
from pathlib import Path

from conespot.campaigns.plain_file import open_plain
from conespot.campaigns.plan import Case, Plan
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically

#: in the run folder; whoever is given the frames needs it for nothing
FILE = "exported.json"
_SECRET = re.compile(r"[0-9a-f]{32}")


@dataclass(frozen=True)
class FrameNames:
    """Names of a plan's frames: `secret` is the run's, `numbers` are those of its cases by their keys, from 1."""

    secret: str
    numbers: dict[str, int]

    @classmethod
    def of(cls, folder: Path, plan: Plan) -> FrameNames | None:
        """The names of a run's frames; None if none was ever exported. Raises InputError for a file that is damaged."""
        path = folder / FILE
        if not path.exists():
            return None
        try:
            with open_plain(path) as stream:
                secret = json.loads(stream.read(1000)).get("secret")
            if not isinstance(secret, str) or not _SECRET.fullmatch(secret):
                raise ValueError
        except (OSError, ValueError, AttributeError, RecursionError):
            raise InputError(
                f"{path}: holds no secret of exported frames; remove it and export again, under new names"
            ) from None
        return cls(secret, {case.key: number for number, case in enumerate(plan.cases, start=1)})

    @classmethod
    def begun(cls, folder: Path, plan: Plan) -> FrameNames:
        """The names of a run's frames, from now on these. Raises InputError."""
        if not (folder / FILE).exists():
            write_atomically(folder / FILE, json.dumps({"secret": secrets.token_hex(16)}).encode())
        names = cls.of(folder, plan)
        assert names is not None
        return names

    def frame(self, case: Case, pose: int) -> str:
        """The name of what a case's localizers are given of a pose: number of the case, of the pose, mark."""
        place = f"{self.numbers[case.key]:03d}-{pose:05d}"
        return f"{place}-{hashlib.sha256(f'{self.secret} {place}'.encode()).hexdigest()[:8]}"

    def image(self, case: Case, pose: int) -> str:
        """Its file within an export."""
        return f"images/{self.frame(case, pose)}.png"

    def unlit(self, case: Case, pose: int) -> str:
        """The file of the view without spotlights, where the case's localizers are given one."""
        return f"images/{self.frame(case, pose)}-unlit.exr"
