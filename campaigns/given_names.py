"""Names of frames as people see them: the file's, or the path as it was given where several files have one name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from conespot.campaigns.streams import shown
from conespot.localize.frames.reader import GivenFrame, files_of
from conespot.scene.text_file import at_home


class GivenNames:
    """Those of the frames of sources. Raises InputError for a folder without frames."""

    def __init__(self, sources: Sequence[Path]) -> None:
        paths = [at_home(source) for source in sources]
        names = Counter(file.name for path in paths for file in (files_of(path) if path.is_dir() else [path]))
        self._repeated = [name for name, count in names.items() if count > 1]

    def of(self, frame: GivenFrame) -> str:
        """A frame's name, on one line and without what a terminal obeys."""
        name = Path(frame.name).name
        # of several frames in a file each has its number behind the file's name
        repeated = any(name == other or name.startswith(f"{other}, ") for other in self._repeated)
        return shown(frame.name if repeated else name)
