"""A packed run: a zip file that is the same to the byte for the same content, and a careful reader of strangers'.

`manifest-sha256.txt` has the checksum of every other file, a line each, as `sha256sum -c` reads them.
"""

from __future__ import annotations

import hashlib
import os
import stat
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import IO

from conespot.scene import InputError

MANIFEST = "manifest-sha256.txt"
_EPOCH = (1980, 1, 1, 0, 0, 0)
_CHUNK = 1 << 20
#: more than any run has, and what no run's files are packed to: deflate's own limit is 1032
_MOST_FILES, _MOST_RATIO, _RATIO_FROM = 200_000, 500, 16_000_000
_LONGEST_MANIFEST = 60_000_000


def write_archive(stream: IO[bytes], files: Mapping[str, bytes | Path]) -> None:
    """Write files, given by their content or where they lie, and a manifest of them, into a zip file."""
    manifest = []
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as packed:
        for name, content in sorted(files.items()):
            digest = hashlib.sha256()
            with packed.open(_entry(name), "w", force_zip64=isinstance(content, Path)) as target:
                for chunk in _chunks(content):
                    digest.update(chunk)
                    target.write(chunk)
            manifest.append(f"{digest.hexdigest()}  {name}\n")
        packed.writestr(_entry(MANIFEST), "".join(manifest))


def _entry(name: str) -> zipfile.ZipInfo:
    """An entry that says nothing of when, where and by whom it was packed."""
    entry = zipfile.ZipInfo(name, _EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.create_system, entry.external_attr = 3, (stat.S_IFREG | 0o644) << 16
    return entry


def _chunks(content: bytes | Path) -> Iterator[bytes]:
    if isinstance(content, bytes):
        yield content
        return
    with open(content, "rb") as stream:
        while chunk := stream.read(_CHUNK):
            yield chunk


class Archive:
    """The files of a packed run, whose names and sizes were looked at before anything is unpacked.

    Raises InputError for what is no such archive, or may do harm: names that lead out of a folder, links, names that
    stand twice, encryption, files that unpack to hundreds of times their size.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise InputError(f"{path}: no such archive; `campaign pack RUN` makes one")
        try:
            self._packed = zipfile.ZipFile(path)
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
            raise InputError(f"{path}: is no archive that can be read: {error}") from None
        self.entries = {entry.filename: entry for entry in self._looked_at(self._packed.infolist())}
        if MANIFEST not in self.entries:
            raise InputError(f"{path}: holds no {MANIFEST}, so it was not packed by `campaign pack`")

    def _looked_at(self, entries: list[zipfile.ZipInfo]) -> Iterator[zipfile.ZipInfo]:
        if len(entries) > _MOST_FILES:
            raise InputError(f"{self.path}: holds more than {_MOST_FILES} files, which no run does")
        seen: set[str] = set()
        for entry in entries:
            if wrong := _harm(entry, seen):
                raise InputError(f"{self.path}: {entry.filename[:100]}: {wrong}; nothing was unpacked")
            seen.add(entry.filename.casefold())
            yield entry

    def manifest(self) -> dict[str, str]:
        """The checksum of every file by its name, as the manifest states it. Raises InputError if it is none."""
        if self.entries[MANIFEST].file_size > _LONGEST_MANIFEST:
            raise InputError(f"{self.path}: {MANIFEST} is longer than any run's")
        stated: dict[str, str] = {}
        text = b"".join(self.chunks(MANIFEST)).decode("utf-8", "replace")
        for number, line in enumerate(text.splitlines(), 1):
            digest, mark, name = line[:64], line[64:66], line[66:]
            if mark != "  " or not name or set(digest) - set("0123456789abcdef") or name in stated:
                raise InputError(f"{self.path}: {MANIFEST}:{number}: is no checksum and name")
            stated[name] = digest
        return stated

    def damage(self) -> Iterator[str]:
        """What does not agree with the manifest, a sentence each."""
        stated = self.manifest()
        for name in sorted(stated.keys() - self.entries.keys()):
            yield f"{name}: stands in the manifest and is missing"
        for name in sorted(self.entries.keys() - stated.keys() - {MANIFEST}):
            yield f"{name}: does not stand in the manifest"
        for name in sorted(stated.keys() & self.entries.keys()):
            digest = hashlib.sha256()
            try:
                for chunk in self.chunks(name):
                    digest.update(chunk)
            except InputError as error:
                yield str(error)
                continue
            if digest.hexdigest() != stated[name]:
                yield f"{name}: is not what its checksum says"

    def chunks(self, name: str) -> Iterator[bytes]:
        """A file's content, piece by piece and never more than it states. Raises InputError if it is damaged."""
        left = self.entries[name].file_size
        try:
            with self._packed.open(name) as stream:
                while chunk := stream.read(min(_CHUNK, left + 1)):
                    left -= len(chunk)
                    if left < 0:
                        raise InputError(f"{name}: holds more than it states")
                    yield chunk
        except (zipfile.BadZipFile, OSError, EOFError, ValueError, NotImplementedError, RuntimeError) as error:
            raise InputError(f"{name}: cannot be unpacked: {error}") from None
        except Exception as error:  # zlib's own error has no base but Exception
            if isinstance(error, InputError):
                raise
            raise InputError(f"{name}: cannot be unpacked: {error}") from None

    def unpack(self, names: Iterator[str], folder: Path) -> None:
        """Put some of its files below a folder."""
        for name in names:
            target = folder.joinpath(*PurePosixPath(name).parts)
            target.parent.mkdir(parents=True, exist_ok=True)
            with open(target, "xb") as stream:
                for chunk in self.chunks(name):
                    stream.write(chunk)

    def digest(self) -> str:
        """The checksum of the archive as a whole."""
        digest = hashlib.sha256()
        for chunk in _chunks(self.path):
            digest.update(chunk)
        return digest.hexdigest()


def _harm(entry: zipfile.ZipInfo, seen: set[str]) -> str:
    """Why an entry is not to be unpacked; empty for a plain file."""
    name, mode = entry.filename, entry.external_attr >> 16
    parts = PurePosixPath(name).parts
    if not name or name.startswith("/") or ".." in parts or "\\" in name or ":" in name or not name.isprintable():
        return "its name leads out of the folder, or is none"
    if name != "/".join(parts) or len(name) > 1000:
        return "its name is no plain path to a file"
    if mode and not stat.S_ISREG(mode) and stat.S_IFMT(mode):
        return "is a link or no plain file"
    if name.casefold() in seen:
        return "stands twice"
    if entry.flag_bits & 0x1:
        return "is encrypted"
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return "is packed in a way that is not read"
    if entry.file_size > _RATIO_FROM and entry.file_size > _MOST_RATIO * max(entry.compress_size, 1):
        return f"unpacks to more than {_MOST_RATIO} times its size"
    return ""


def plain_files(folder: Path) -> Iterator[tuple[str, Path]]:
    """Name and place of every file of a folder but hidden ones. Raises InputError for links and what is no file."""
    for root, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(files + [name for name in folders if Path(root, name).is_symlink()]):
            path = Path(root, name)
            if name.startswith("."):
                continue
            if path.is_symlink() or not path.is_file():
                raise InputError(f"{path}: is a link or no plain file, which an archive cannot hold; take it away")
            yield path.relative_to(folder).as_posix(), path
