"""RO-Crate metadata of a packed run: what its files are, what made them, and how to check it (RO-Crate 1.2)."""

from __future__ import annotations

import json
import mimetypes
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import quote

FILE = "ro-crate-metadata.json"
_CONTEXT = "https://w3id.org/ro/crate/1.2/context"
_PROFILE = "https://w3id.org/ro/crate/1.2"
#: what the files of a run are, by their name or the folder that they lie in
_MEANS = {
    "campaign.yaml": "the campaign as it was resolved, with the versions that began it and its seed",
    "cases.jsonl": "what every case assumes, in words and as a scene",
    "journal.jsonl": "every finished pose with its checksum and what made it",
    "errors.csv": "one row a frame and localizer",
    "errors.parquet": "one row a frame and localizer",
    "makers.json": "what the poses were made with",
    "boxes.csv": "box statistics",
    "crops.json": "pictures of the worst frames of each box",
    "report.html": "the report",
    "side_by_side.html": "the run beside others",
    "inputs": "a file that the campaign names",
    "tables": "a table of the report",
    "figures": "a figure of the report",
    "frames": "a rendered frame",
}
_TYPES = {".jsonl": "application/jsonl", ".yaml": "application/yaml", ".parquet": "application/vnd.apache.parquet"}


def metadata(
    name: str, description: str, date: str, sizes: Mapping[str, int], software: Mapping[str, str], makers: Iterable[str]
) -> bytes:
    """The metadata file of a run of that `name`, finished on a `date`, with its files' `sizes` [bytes] by name.

    `software` are versions by package of who packs it, `makers` what made the rows. Nothing is looked up anywhere.
    """
    files = [_file(path, size) for path, size in sorted(sizes.items())]
    parts = [{"@id": file["@id"]} for file in files]
    tools = [
        {"@id": f"#{package.replace(' ', '-')}", "@type": "SoftwareApplication", "name": package, "version": version}
        for package, version in software.items()
    ]
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": name,
        "description": description or f"A run of the conespot campaign {name}",
        "datePublished": date,
        "hasPart": parts,
        "mentions": [{"@id": "#run"}],
    }
    run = {
        "@id": "#run",
        "@type": "CreateAction",
        "name": f"campaign run {name}",
        "description": "; ".join(makers) or "nothing is finished",
        "endTime": date,
        "instrument": [{"@id": tool["@id"]} for tool in tools],
        "object": [{"@id": "campaign.yaml"}],
        "result": [part for part in parts if part["@id"] != "campaign.yaml"],
    }
    descriptor = {
        "@id": FILE,
        "@type": "CreativeWork",
        "about": {"@id": "./"},
        "conformsTo": {"@id": _PROFILE},
    }
    graph: list[dict[str, Any]] = [descriptor, root, run, *tools, *files]
    return (json.dumps({"@context": _CONTEXT, "@graph": graph}, indent=1, ensure_ascii=False) + "\n").encode()


def _file(path: str, size: int) -> dict[str, Any]:
    suffix = path[path.rfind(".") :] if "." in path else ""
    means = _MEANS.get(path) or _MEANS.get(path.partition("/")[0] if "/" in path else "", "")
    kind = _TYPES.get(suffix) or mimetypes.types_map.get(suffix, "application/octet-stream")
    entity = {"@id": quote(path), "@type": "File", "name": path, "contentSize": str(size)}
    return entity | {"encodingFormat": kind} | ({"description": means} if means else {})
