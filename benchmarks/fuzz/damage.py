"""Damage to a whole file: bytes that change, words that no writer writes, arrays of other kinds."""

import re
from collections.abc import Callable
from io import BytesIO
from random import Random
from typing import Any

import numpy as np

# What a number, a word or a value is replaced by.
WORDS = (
    *(b"1" * 400, b"-" + b"9" * 5000, b"9223372036854775808", b"-9223372036854775809", b"1e19"),
    *(b"1e400", b"-1e308", b"1e154", b"5e-324", b"1e-99999999999999999999", b"1e99999999999999"),
    *(b"nan", b"-inf", b"Infinity", b"0x10", b"1_000", b"-1", b"0", b"1.5", "٣".encode(), b"1,5"),
    *(b"", b'""', b"null", b"true", b"[]", b"{}", b"[[]]", b'{"":{}}', b"2027-01-31", b"a=b"),
    *(b"[" * 100_000, b'{"a":' * 50_000, b"a" * 100_000, b"[1]" * 2000, b"," * 20_000),
    *(b'"\\ud800"', b'"\\u0000"', b"\xff\xfe", b"\x00", b"\xed\xa0\x80", "\u2028".encode()),
    *(b"\x1b[31m", b"\n::error::x\n", b"=HYPERLINK(1)", b"../../../etc/passwd", b"/dev/zero"),
    *(b"'''", b'"', b"\\", b"#", b"<!--", b"&a;", b"]]>", b"%s", b"{0}", b"*", b"[a-"),
)
TOKEN = re.compile(rb"""[-+]?\d[\d.]*(?:e[-+]?\d+)?|"[^"\n]*"|'[^'\n]*'|[A-Za-z_][\w.-]*""", re.I)

NUMBERS = (np.nan, np.inf, -np.inf, 1e308, -1e154, 1e15, 5e-324, 2.0**63, -1.0, 0.0, 1e-30)
KINDS = ("<f4", ">f8", "<f2", "<i8", "u1", "?", "<c16", "<U3", "S3", "<M8[ns]", "<m8[s]")


def damaged(data: bytes, kind: str, random: Random) -> bytes:
    """Damage a file."""
    of_kind = {"text": _words, "arrays": _arrays}.get(kind, _bytes)
    return (of_kind if random.random() < 0.7 else _bytes)(data, random)


def _bytes(data: bytes, random: Random) -> bytes:
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 10))):
        size = len(changed)
        at = random.randrange(min(size, random.choice((64, 1000, 10**9))) + 1)
        if random.random() < 0.1:
            at = max(0, size - at)
        length = random.choice((1, 4, 8, 100, 4096))
        part = bytes(changed[at : at + length])
        pieces = (
            lambda part=part: (
                bytes(each ^ (1 << random.randrange(8)) for each in part[:1]) + part[1:]
            ),
            lambda part=part: random.randbytes(len(part)),
            lambda part=part: bytes(len(part)),
            lambda part=part: b"\xff" * len(part),
            lambda part=part: part * random.choice((0, 2, 50)),
            lambda part=part: part[:4][::-1] + part[4:],
            lambda: random.choice(WORDS)[:1000],
        )
        if random.random() < 0.15:
            del changed[at:]
        else:
            changed[at : at + length] = random.choice(pieces)()
    return bytes(changed)


def _words(data: bytes, random: Random) -> bytes:
    for _ in range(random.choice((1, 1, 1, 2, 5))):
        tokens = list(TOKEN.finditer(data[: 10**5]))
        if not tokens:
            return data + random.choice(WORDS)
        # a column of numbers holds most tokens, and the first ones decide most
        token = random.choice(tokens[: random.choice((10, 40, len(tokens)))])
        data = data[: token.start()] + random.choice(WORDS) + data[token.end() :]
        if len(data) > 2**20:
            break
    return data


def _arrays(data: bytes, random: Random) -> bytes:
    with np.load(BytesIO(data)) as archive:
        arrays = dict(archive)
    for _ in range(random.choice((1, 1, 2))):
        name = random.choice(sorted(arrays))
        if random.random() < 0.1:
            array = arrays.pop(name)
            if random.random() < 0.5 or not arrays:
                arrays[random.choice((*arrays, "x", "time"))] = array
        else:
            arrays[name] = _array(arrays[name], random)
    stream = BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def _array(array: Any, random: Random) -> Any:
    words = [
        word.decode(errors="replace") for word in WORDS if len(word) < 200_000 and b"\0" not in word
    ]
    ways: list[Callable[[], Any]] = [
        lambda: array.astype(random.choice(KINDS)),
        lambda: array.T,
        lambda: array.ravel(),
        lambda: array[None],
        lambda: array[:0],
        lambda: array[..., :0],
        lambda: array[:1],
        lambda: array[::-1],
        lambda: np.repeat(array, 3, axis=-1),
        lambda: np.array(random.choice(NUMBERS)),
        lambda: np.full(array.shape, random.choice(NUMBERS)),
        lambda: _set(array, random.choice(NUMBERS), random),
        lambda: _set(array, random.choice(words), random),
        lambda: np.array(random.choice(words)),
        lambda: np.array([("a", 1.0)], dtype=[("x", "<U1"), ("y", "<f8")]),
        lambda: np.zeros((2,) * 20, dtype="u1"),
    ]
    while True:
        try:
            with np.errstate(all="ignore"):
                return random.choice(ways)()
        except (ValueError, TypeError, IndexError, OverflowError):
            continue  # such an array does not take such a change


def _set(array: Any, value: Any, random: Random) -> Any:
    """An array with one value replaced."""
    changed = array.astype(np.asarray(value).dtype if isinstance(value, str) else array.dtype)
    changed[tuple(random.randrange(size) for size in changed.shape)] = value
    return changed
