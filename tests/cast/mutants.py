"""Broken input for fuzzing: files of ours with bytes lost, doubled and strewn in, and values of other types."""

from __future__ import annotations

import random
import re

#: what is put in place of a value, or somewhere
_VALUES = [
    "", "~", "[]", "{}", "true", "-1", "0", "1e400", "-1e300", ".nan", ".inf", "1e-320", "9" * 400, "0x" + "f" * 400,
    "9 deg", "0 mm", "-5 mm", "1e9 mm", "1 W", "[1, 2]", "{kind: csv, file: /dev/zero}", "{kind: csv, file: x.csv}",
    "paper", "box", "triple", "linear", "*a", "&a 1", "!!python/name:os.system", "<<", "'", '"', "\\x1b[31m", "é" * 50,
    "[" * 60, "{a: " * 60, "2026-11-25", "null", "100000", "10000000", "0.1", "1/0", "NaN", "x" * 3000,
]  # fmt: skip
_BYTES = [b"\0", b"\t", b"\n", b"\r", b"\xff", b"\xef\xbb\xbf", b":", b"- ", b"#", b"'", b'"', b"{", b"]", b",", b";"]
_TOKEN = re.compile(r"[^\s,:\[\]{}#]+(?: (?:mm|deg|W|nm|um))?")


def mutated_text(text: str, moment: random.Random) -> bytes:
    """The text with one to four things wrong with it."""
    for _ in range(moment.randint(1, 4)):
        tokens = list(_TOKEN.finditer(text))
        match moment.randrange(5):
            case 0 if tokens:  # another type
                token = moment.choice(tokens)
                text = text[: token.start()] + moment.choice(_VALUES) + text[token.end() :]
            case 1 if len(tokens) > 1:  # two tokens change places
                a, b = sorted(moment.sample(tokens, 2), key=lambda token: token.start())
                text = text[: a.start()] + b[0] + text[a.end() : b.start()] + a[0] + text[b.end() :]
            case 2:  # a line goes, or comes twice
                lines = text.splitlines(keepends=True) or [""]
                i = moment.randrange(len(lines))
                lines[i : i + 1] = lines[i : i + 1] * moment.choice([0, 2])
                text = "".join(lines)
            case _:
                text = mutated_bytes(text.encode(), moment, times=1).decode(errors="replace")
    return text.encode() if moment.random() < 0.9 else mutated_bytes(text.encode(), moment)


def mutated_bytes(data: bytes, moment: random.Random, times: int | None = None) -> bytes:
    """The bytes with spans deleted, doubled, strewn in or overwritten, and sometimes cut short."""
    for _ in range(times or moment.randint(1, 6)):
        start = moment.randrange(len(data) + 1)
        end = min(len(data), start + moment.choice([1, 1, 2, 4, 30, 300]))
        match moment.randrange(6):
            case 0:
                data = data[:start] + data[end:]
            case 1:
                data = data[:end] + data[start:end] + data[end:]
            case 2:
                data = data[:start] + moment.choice(_BYTES) + data[start:]
            case 3:
                data = data[:start] + moment.randbytes(end - start) + data[end:]
            case 4:
                data = data[:start] + bytes([0xFF] * (end - start)) + data[end:]
            case _:
                data = data[:start] if moment.random() < 0.2 else data
    return data
