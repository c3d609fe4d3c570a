"""Units that wait to be measured, by the scene they need, so that whoever measures them seldom loads another."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from conespot.campaigns.plan import Plan, Unit


class Waiting:
    """A queue of the units of each scene."""

    def __init__(self, plan: Plan, units: Iterable[Unit]) -> None:
        self._plan = plan
        self._scenes: dict[str, deque[Unit]] = {}
        self._alone: set[str] = set()
        for unit in units:
            self._scenes.setdefault(self.scene(unit), deque()).append(unit)

    def __len__(self) -> int:
        return sum(map(len, self._scenes.values()))

    def scene(self, unit: Unit) -> str:
        """The key of the scene that a unit needs."""
        return self._plan.groups[unit.group].scene_key

    def many(self, scene: str, than: int) -> bool:
        """Whether more units of a scene wait `than` so many, none of them suspect."""
        return len(self._scenes.get(scene, ())) > than and self._scenes[scene][0].key not in self._alone

    def put_back(self, units: Sequence[Unit], *, alone: bool = False) -> None:
        """Let units be the next of their scene; with `alone` no batch will hold one of them and anything else."""
        for unit in reversed(units):
            self._scenes.setdefault(self.scene(unit), deque()).appendleft(unit)
        if alone:
            self._alone.update(unit.key for unit in units)

    def next_scene(self, loaded: str | None, elsewhere: Sequence[str | None]) -> str | None:
        """The scene to go on with: the one that is `loaded`, else the one that is loaded least `elsewhere`."""
        if not self._scenes:
            return None
        return loaded if loaded in self._scenes else min(self._scenes, key=elsewhere.count)

    def take(self, scene: str, most: int = 1) -> list[Unit]:
        """The next units of a scene, `most` of them, but a suspect one alone."""
        queue = self._scenes[scene]
        batch = [queue.popleft()]
        while queue and len(batch) < most and not self._alone & {batch[0].key, queue[0].key}:
            batch.append(queue.popleft())
        if not queue:
            del self._scenes[scene]
        return batch
