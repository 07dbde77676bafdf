"""Files made by hand that ask for much time or memory, or hold what no run can be."""

import io
import os
import sqlite3
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fuzz.readers import MJCF, READERS, URDF

DEEP = 100_000


@dataclass(frozen=True)
class Bomb:
    """A malformed file."""

    name: str
    content: bytes | str | Callable[[Path], object]
    refuse: bool = False

    def put(self, path: Path) -> Path:
        """Put it in the place of a whole file; its path."""
        if callable(self.content):
            other = self.content(path)
            return other if isinstance(other, Path) else path
        text = self.content
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path


def bombs(name: str, whole: Path) -> Iterator[Bomb]:
    """Files for a reader."""
    reader, data = READERS[name], whole.read_bytes()
    yield Bomb("empty", b"", refuse=reader.kind != "text")
    yield from _texts(data)
    if not reader.stdin:
        for each in _places():  # what a bag's metadata.yaml says is in its database too
            yield replace(each, refuse=each.refuse and name != "ROS 2, metadata.yaml")
    if reader.kind == "arrays":
        yield from _archives(data)
    makers = {part: make for part, make in BY_NAME.items() if name.startswith(part)}
    yield from chain.from_iterable(make(data) for make in makers.values())


def _texts(data: bytes) -> Iterator[Bomb]:
    for share in (0.1, 0.5, 0.9, 0.99):
        yield Bomb(f"cut at {share}", data[: int(len(data) * share)])
    yield Bomb("its first bytes, then zeros", data[:16] + bytes(10**6))
    yield Bomb("twice", data * 2)
    for sign in (b"[", b'{"a":', b"\n", b" ", b"9", b"a,", b"\0", b"<a>", b"'", b"\xff"):
        yield Bomb(f"20 MB of {sign.decode(errors='replace')!r}", sign * (2 * 10**7 // len(sign)))
    for start in (b"a = ", b"format = ", b"time,a.velocity\n", b"%", b"<robot name='r'>"):
        yield Bomb(f"{start.decode()!r} and {DEEP} brackets", start + b"[" * DEEP)


def _places() -> Iterator[Bomb]:
    def replaced(make: Callable[[Path], object]) -> Callable[[Path], None]:
        def put(path: Path) -> None:
            path.unlink()
            make(path)

        return put

    def named(name: bytes) -> Callable[[Path], Path]:
        return lambda path: path.rename(path.with_name(os.fsdecode(name) + path.suffix))

    yield Bomb("/dev/zero", replaced(lambda path: path.symlink_to("/dev/zero")), refuse=True)
    yield Bomb("/dev/urandom", replaced(lambda path: path.symlink_to("/dev/urandom")), refuse=True)
    yield Bomb("a pipe", replaced(lambda path: os.mkfifo(path)), refuse=True)
    yield Bomb("a folder", replaced(lambda path: path.mkdir()))
    yield Bomb("a link to itself", replaced(lambda path: path.symlink_to(path)))
    yield Bomb("missing", lambda path: path.unlink())
    yield Bomb("3 GB of zeros", lambda path: os.truncate(_emptied(path), 3 * 10**9))
    yield Bomb("3 GB of zeros behind it", lambda path: os.truncate(path, 3 * 10**9))
    yield Bomb("a name that is not UTF-8", named(b"\xff\xfe"))
    yield Bomb("a name with commands", named(b"a\n::error::b\x1b[31m\r"))


def _emptied(path: Path) -> Path:
    path.write_bytes(b"")
    return path


def _packed(members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def _header(text: str, held: bytes = b"") -> bytes:
    line = text.ljust(117).encode() + b"\n"
    return b"\x93NUMPY\1\0" + len(line).to_bytes(2, "little") + line + held


def _array(value: Any) -> bytes:
    stream = io.BytesIO()
    np.save(stream, value)
    return stream.getvalue()


def _archives(data: bytes) -> Iterator[Bomb]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    first = next(name for name in members)

    def zeros(path: Path) -> None:
        with (
            zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as packed,
            packed.open(first, "w", force_zip64=True) as member,
        ):
            size = 700 * 2**20
            head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({size // 8},), }}"
            member.write(_header(head))
            for _ in range(700):
                member.write(bytes(2**20))

    def twice(path: Path) -> None:
        with zipfile.ZipFile(path, "a") as packed:
            packed.writestr(packed.infolist()[0].filename, members[first])

    yield Bomb("700 MB of zeros in it", zeros, refuse=True)
    yield Bomb("two arrays of one name", twice, refuse=True)
    for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        yield Bomb(f"packed by method {method}", _packed(members, method))
    yield Bomb("deflated", _packed(members))
    yield Bomb("20,000 arrays", _packed(members | {f"a{n}.npy": b"" for n in range(20_000)}))
    yield Bomb("no arrays", _packed({}), refuse=True)
    yield Bomb(
        "names with paths", _packed({f"../../{name}": each for name, each in members.items()})
    )
    for shape in ("(1000000000000,)", "(-1,)", "(0, " + "9" * 30 + ")", "(1.5,)", "()", "(1,)" * 9):
        for kind in ("<f8", "<U0", "O", "|V0", "<U1000000000", "<M8[as]"):
            head = f"{{'descr': {kind!r}, 'fortran_order': True, 'shape': {shape}, }}"
            lies = dict.fromkeys(members, _header(head))
            yield Bomb(f"{kind} of {shape[:20]}", _packed(lies), refuse=kind != "<U0")
    for text in ("(" * 1000, "'", "{", "[" * 5000, "{'descr': " + "9" * 5000, "\n\t   ]"):
        yield Bomb(
            f"a header of {text[:12]!r}",
            _packed(dict.fromkeys(members, _header(text))),
            refuse=True,
        )
    texts = ("[" * DEEP, '{"a":' * DEEP, "9" * 5000, '{"a": ' + "9" * 400 + "}", '"\\ud800"', "NaN")
    for text in texts:
        for name in ("meta.npy", "manifest.npy"):
            if name in members:
                changed = members | {name: _array(np.array(text))}
                yield Bomb(f"{name} {text[:12]!r}", _packed(changed, zipfile.ZIP_STORED))


def _runs(data: bytes) -> Iterator[Bomb]:
    time = np.arange(200) / 100
    wave = np.sin(6.0 * time)[:, None]

    def run(**changes: Any) -> bytes:
        stream = io.BytesIO()
        arrays = {"time": time, "velocity": wave, "format": np.array("noise-run/1")} | changes
        np.savez_compressed(stream, **{k: v for k, v in arrays.items() if v is not None})
        return stream.getvalue()

    yield Bomb("100,000 joints", run(velocity=np.ones((200, 100_000))), refuse=True)
    yield Bomb("no joints", run(velocity=np.ones((200, 0))), refuse=True)
    for value in (np.nan, np.inf, 1e308, 1e154, 1e16, 1e200):
        yield Bomb(f"velocities of {value}", run(velocity=wave * value), refuse=True)
    for value in (5e-324, 1e-300, 1e-12, 1e12, 1e300, np.nan, -1.0, 0.0):
        yield Bomb(f"steps of {value} s", run(time=np.arange(200) * value), refuse=True)
    yield Bomb("time from 1e300 s", run(time=time + 1e300), refuse=True)
    names = ("\ud800", "\x1b[31m", "a\n::error::b", "", "=HYPERLINK(1)", "a" * 100_000)
    for name in names:
        with_name = lambda path, name=name: path.write_bytes(_with_name(run(), name))  # noqa: E731
        yield Bomb(f"a joint named {name[:12]!r}", with_name)
    for robot in (
        "/dev/zero",
        "/dev/zero.urdf",
        "/etc/passwd",
        "../x.urdf",
        "menagerie/../..",
        "a\n",
    ):
        yield Bomb(f"robot {robot!r}", run(robot=np.array(robot)))
    yield Bomb("two samples", run(time=time[:2], velocity=wave[:2]))
    yield Bomb("one sample", run(time=time[:1], velocity=wave[:1]), refuse=True)
    for label in ("", "\x1b[31m", "a\nb", "a" * 10_000):
        block = {"block_start": [0.0], "block_stop": [1.0], "block_label": [label]}
        yield Bomb(f"a block of {label[:12]!r}", run(**block))
    yield Bomb("blocks of nan", run(block_start=[np.nan], block_stop=[1.0], block_label=["ok"]))


def _with_name(data: bytes, name: str) -> bytes:
    """A run whose joint has a name, even one that NumPy would not write."""
    codes = np.array([ord(sign) for sign in name or "\0"], dtype="<u4").tobytes()
    head = f"{{'descr': '<U{len(codes) // 4}', 'fortran_order': False, 'shape': (1,), }}"
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {each: archive.read(each) for each in archive.namelist()}
    return _packed(members | {"joint_names.npy": _header(head, codes)})


def _tables(data: bytes) -> Iterator[Bomb]:
    head = "time,a.velocity"
    rows = [f"{n / 100},{n % 7}" for n in range(200)]

    def table(header: str = head, lines: list[str] = rows) -> str:
        return "\n".join([header, *lines]) + "\n"

    wide = ",".join(f"c{n}" for n in range(20_000))
    yield Bomb(
        "20,000 columns",
        table(f"{head},{wide}", [row + ",0" * 20_000 for row in rows]),
        refuse=True,
    )
    yield Bomb("no joints", table("time,b", rows), refuse=True)
    for cell in ("9" * 400, "1e400", "1e308", "1e200", "1e16"):
        yield Bomb(
            f"velocities of {cell[:12]}",
            table(lines=[f"{n / 100},{cell}" for n in range(200)]),
            refuse=True,
        )
    for stamp in ("1e-99999999999999999999", "5e-324", "1e99999999999999999999", "9" * 5000, "nan"):
        yield Bomb(
            f"a stamp of {stamp[:12]}", table(lines=[rows[0], f"{stamp},1", *rows[2:]]), refuse=True
        )
    yield Bomb("a stamp in the future", table(lines=[*rows, "9e9,1"]), refuse=True)
    yield Bomb("a cell of 20 MB", table(lines=[*rows, "2.0," + "a" * 2 * 10**7]))
    yield Bomb("a quotation mark", table(lines=[rows[0], '0.01,"1', *rows[2:]]))
    for encoding in ("utf-16", "utf-32", "utf-7", "latin-1"):
        yield Bomb(encoding, table(f"{head},ä").replace("\n", ",1\n").encode(encoding))
    for name in ("\x1b[31m", "=HYPERLINK(1)", "::error::x", "a" * 10**6, "\u202e"):
        yield Bomb(f"a joint named {name[:12]!r}", table(f"time,{name}.velocity"))
    yield Bomb("a million columns", table(head + ",c" * 10**6, rows))
    yield Bomb("a million lines before the rows", "# a\n" * 10**6 + table())


def _toml(data: bytes) -> Iterator[Bomb]:
    text = data.decode()
    yield Bomb("a key of many parts", "a." * DEEP + "b = 1\n" + text)
    yield Bomb("a table of many parts", f"{text}\n[{'a.' * 20_000}b]\n")
    yield Bomb("100,000 tables", text + "".join(f"[t{n}]\n" for n in range(100_000)))
    yield Bomb("100,000 entries", text + "[[allow]]\nclass = 'a'\n" * 100_000)
    yield Bomb("latin-1", text.encode() + "x = 'ä'\n".encode("latin-1"))


def _live(data: bytes) -> Iterator[Bomb]:
    yield Bomb(
        "100,000 joints", "time," + ",".join(f"j{n}.velocity" for n in range(DEEP)) + "\n1\n"
    )
    yield Bomb("no joints", '{"velocity": []}\n' * 100)
    yield Bomb("a row of 100,000", '{"velocity": [' + ",".join("1" * DEEP) + "]}\n" * 3)


def _columns(data: bytes) -> Iterator[Bomb]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    def written(count: int, **more: Any) -> Callable[[Path], None]:
        def put(path: Path) -> None:
            size = 10**6
            table = pa.table({"time": np.zeros(size), "position": np.zeros(size), **more})
            with pq.ParquetWriter(path, table.schema) as writer:
                for _ in range(count):
                    writer.write_table(table)

        return put

    def of(**columns: Any) -> Callable[[Path], None]:
        return lambda path: pq.write_table(pa.table(columns), path)

    time = np.arange(200) / 100
    yield Bomb("300 million zeros", written(300), refuse=True)
    yield Bomb(
        "2,000 columns", of(time=time, **{f"a{n}.velocity": time for n in range(2000)}), refuse=True
    )
    yield Bomb("no rows", of(time=time[:0], position=time[:0]), refuse=True)
    for value in (np.nan, 1e308, 5e-324, 1e200):
        refuse = value != 5e-324  # which is a position like 0
        yield Bomb(f"{value}", of(time=time, position=np.full(200, value)), refuse=refuse)
        yield Bomb(f"time x {value}", of(time=time * value, position=time), refuse=True)
    nested = pa.array([[[1.0]]] * 200)
    for name, each in {
        "lists": nested,
        "text": ["a"] * 200,
        "null": [None] * 200,
        "empty lists": [[]] * 200,
        "lists of other lengths": [[1.0], *[[1.0, 2.0]] * 199],
        "integers of 64 bits": np.full(200, 2**63 - 1),
    }.items():
        yield Bomb(f"positions of {name}", of(time=time, position=each))
    episode = pa.array([1.5] * 200)
    yield Bomb("episodes that are no numbers", of(time=time, position=time, episode_index=episode))
    yield Bomb(
        "100,000 episodes",
        of(time=np.zeros(DEEP), position=np.zeros(DEEP), episode_index=np.arange(DEEP)),
    )
    for number in (2**31 - 1, 10**6):
        yield Bomb(
            f"pages that state {number} values", lambda p, n=number: p.write_bytes(_lying(n))
        )


def _lying(count: int) -> bytes:
    """A Parquet file whose pages state more values, and more bytes, than there are."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    def varint(number: int) -> bytes:
        number, found = 2 * number, b""  # zigzag
        while number > 127:
            found, number = found + bytes((number & 127 | 128,)), number >> 7
        return found + bytes((number,))

    rows = 70_001  # whose number takes as many bytes as a large one
    stream = io.BytesIO()
    table = pa.table({"time": np.arange(rows) / 100, "position": np.zeros(rows)})
    pq.write_table(table, stream, compression="NONE", use_dictionary=False, data_page_size=10**7)
    data, wanted = stream.getvalue(), varint(count)
    for number in (rows, 8 * rows):
        there = varint(number)
        data = data.replace(
            there, wanted[: len(there) - 1] + wanted[-1:] if len(wanted) >= len(there) else there
        )
    return data


def _hdf5(data: bytes) -> Iterator[Bomb]:
    import h5py

    time = np.arange(200) / 100

    def with_(change: Callable[[Any], object]) -> Callable[[Path], None]:
        def put(path: Path) -> None:
            with h5py.File(path, "a") as file:
                change(file)

        return put

    def replaced(name: str, **how: Any) -> Callable[[Any], object]:
        def change(file: Any) -> None:
            del file[name]
            file.create_dataset(name, **how)

        return change

    joint = "data/demo_0/obs/joint_pos"
    many = {"shape": (10**9, 2), "dtype": "f8", "chunks": (10**6, 2)}
    layout = h5py.VirtualLayout(shape=(200, 2), dtype="f8")
    layout[...] = h5py.VirtualSource("/etc/passwd", "x", shape=(200, 2))
    changes: dict[str, Callable[[Any], object]] = {
        "16 GB that are not there": replaced(joint, **many),
        "16 GB that nobody asks for": lambda f: f.create_dataset("data/demo_0/x", **many),
        "stored in /etc/passwd": replaced(
            joint, shape=(100, 2), dtype="u1", external=[("/etc/passwd", 0, 200)]
        ),
        "zeros, packed": replaced(
            joint, data=np.zeros((10**7, 8)), compression="gzip", chunks=(10**6, 8)
        ),
        "text": replaced(joint, data=["a"] * 200),
        "no rows": replaced(joint, shape=(0, 2), dtype="f8"),
        "no joints": replaced(joint, shape=(200, 0), dtype="f8"),
        "nan": replaced(joint, data=np.full((200, 2), np.nan)),
        "1e308": replaced(joint, data=np.full((200, 2), 1e308)),
        "10,000 joints": replaced(joint, data=np.ones((200, 10_000))),
        "a link in a circle": lambda f: f.__setitem__("data/demo_0/obs/x", h5py.SoftLink("/data")),
        "a link to nothing": lambda f: f.__setitem__("data/demo_1", h5py.SoftLink("/nothing")),
        "a link to another file": lambda f: f.__setitem__(
            "data/demo_1", h5py.ExternalLink("/etc/passwd", "/")
        ),
        "5,000 episodes": lambda f: [f.create_group(f"data/demo_{n}") for n in range(1, 5000)],
        "an attribute of 60 kB": lambda f: f.attrs.__setitem__("x", np.zeros(60_000, "u1")),
        "an empty attribute": lambda f: f.attrs.__setitem__("dt", h5py.Empty("f8")),
        "attributes that are no numbers": lambda f: f["data/demo_0"].attrs.__setitem__("dt", "x"),
        "an attribute of nan": lambda f: f["data/demo_0"].attrs.__setitem__("dt", np.nan),
        "an attribute of 5e-324": lambda f: f["data/demo_0"].attrs.__setitem__("dt", 5e-324),
        "attributes of references": lambda f: f["data/demo_0"].attrs.__setitem__(
            "dt", f["data"].ref
        ),
        "a group for joints": lambda f: (f.__delitem__(joint), f.create_group(joint)),
        "10,000 attributes": lambda f: [f.attrs.__setitem__(f"a{n}", n) for n in range(10_000)],
        "a name of half a pair": lambda f: f[joint].parent.create_dataset(b"\xff\xfe", data=time),
    }
    for name, change in changes.items():
        yield Bomb(name, with_(change))
    yield Bomb("dense attributes of 800 MB", _dense_attributes)

    def virtual(path: Path) -> None:
        with h5py.File(path, "a", libver="latest") as file:
            del file[joint]
            file.create_virtual_dataset(joint, layout)

    yield Bomb("virtual", virtual, refuse=True)
    first = data.index(b"GCOL") + 16
    free = first + 16 + -(-int.from_bytes(data[first + 8 : first + 16], "little") // 8) * 8
    yield Bomb("a heap without end", data[: free + 8] + bytes(8) + data[free + 16 :], refuse=True)


def _dense_attributes(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", libver="latest") as file:
        file["data/demo_0/time"] = np.arange(200) / 100
        file["data/demo_0/obs/joint_pos"] = np.ones((200, 2))
        file["data/demo_0"].attrs.create("x", np.zeros(10**8))


def _mcap(data: bytes) -> Iterator[Bomb]:
    from mcap.writer import CompressionType, Writer

    def zeros(how: CompressionType, cut: int) -> Callable[[Path], None]:
        def put(path: Path) -> None:
            with path.open("wb") as stream:
                writer = Writer(stream, chunk_size=2**30, compression=how)
                writer.start("ros2")
                schema = writer.register_schema(
                    "sensor_msgs/msg/JointState", "ros2msg", b"string[] name"
                )
                topic = writer.register_channel("/joint_states", "cdr", schema)
                for number in range(22):
                    writer.add_message(topic, number, bytes(2**25), number)
                writer.finish()
            os.truncate(path, path.stat().st_size - cut)

        return put

    for how in (CompressionType.ZSTD, CompressionType.LZ4):
        for cut in (0, 8):
            yield Bomb(
                f"{how.name}, 700 MB of zeros{', cut off' * bool(cut)}",
                zeros(how, cut),
                refuse=True,
            )


def _sqlite(data: bytes) -> Iterator[Bomb]:
    for change in (
        "UPDATE messages SET data = NULL WHERE id % 2",
        "UPDATE messages SET data = 'text'",
        "UPDATE messages SET data = zeroblob(500000000) WHERE id = 1",
        "UPDATE messages SET timestamp = 9223372036854775807 WHERE id % 2",
        "UPDATE messages SET timestamp = 'a'",
        "UPDATE topics SET name = NULL",
        "UPDATE topics SET name = x'ff'",
        "UPDATE topics SET name = char(27) || '[31m'",
        "UPDATE topics SET type = NULL",
        "UPDATE topics SET serialization_format = 3",
        "DROP TABLE topics",
        "DROP TABLE messages",
        "CREATE VIEW v AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x+1 FROM c) SELECT * FROM c",
    ):
        yield Bomb(change[:50], lambda path, change=change: _changed(path, change))

    def endless(path: Path) -> None:
        with closing(sqlite3.connect(path)) as database:
            database.execute("DROP TABLE messages")
            database.execute(
                "CREATE VIEW messages AS WITH RECURSIVE c(id) AS (SELECT 1 UNION ALL SELECT id + 1"
                " FROM c) SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM c"
            )
            database.commit()

    yield Bomb("messages without end", endless, refuse=True)


def _changed(path: Path, change: str) -> None:
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA writable_schema = ON")
        database.execute("UPDATE sqlite_master SET sql = replace(sql, 'NOT NULL', '')")
        database.commit()
    with closing(sqlite3.connect(path)) as database:
        database.execute(change)
        database.commit()


def _ros1(data: bytes) -> Iterator[Bomb]:
    import bz2

    import lz4.frame

    # the longest run of the chunk's bytes is replaced by one that unpacks to zeros
    for name, packed in {
        "bz2": bz2.compress(bytes(700 * 2**20)),
        "lz4": lz4.frame.compress(bytes(700 * 2**20)),
    }.items():
        sign = b"compression=" + name.encode()
        if (at := data.find(sign)) >= 0:
            size = at + data[at:].find(b"size=") + 5
            length = int.from_bytes(data[size + 4 : size + 8], "little")
            stop = size + 8 + length
            changed = data[:size] + (700 * 2**20).to_bytes(4, "little")
            changed += len(packed).to_bytes(4, "little") + packed + data[stop:]
            yield Bomb(f"a chunk of 700 MB by {name}", changed, refuse=True)


def _robots(whole: str, joint: str, mesh: str) -> Iterator[Bomb]:
    end = whole.rindex("</")
    laughs = "".join(f'<!ENTITY l{n + 1} "{f"&l{n};" * 10}">' for n in range(9))
    laughing = f'<!DOCTYPE a [<!ENTITY l0 "ha">{laughs}]>' + whole[:end] + "&l9;" + whole[end:]
    yield Bomb("entities", laughing, refuse=True)
    yield Bomb(
        "entities in UTF-16",
        f'<?xml version="1.0" encoding="utf-16"?>{laughing}'.encode("utf-16"),
        refuse=True,
    )
    outside = (
        '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + whole[:end] + "&x;" + whole[end:]
    )
    yield Bomb("an entity of a file", outside, refuse=True)
    yield Bomb(
        "nested",
        whole[:end] + "<link name='x'>" * DEEP + "</link>" * DEEP + whole[end:],
        refuse=True,
    )
    yield Bomb(
        "100,000 joints",
        whole[:end] + "".join(joint.format(n=n) for n in range(DEEP)) + whole[end:],
        refuse=True,
    )
    yield Bomb(
        "100,000 attributes",
        whole[:end] + "<a " + "".join(f'a{n}="" ' for n in range(DEEP)) + "/>" + whole[end:],
    )
    yield Bomb("unclosed comments", "<!--" * 10**6)
    for name in (
        "/dev/zero",
        "../../../../etc/passwd",
        "/etc/passwd",
        "package://etc/passwd",
        "a\0b",
        "\x1b[31m.stl",
    ):
        yield Bomb(
            f"a mesh {name!r}",
            mesh.replace("FILE", name.replace("\0", "").replace("\x1b", "&#27;")),
        )
    for name in ("zero.stl", "zero.obj", "zero.dae", "pipe.stl"):

        def put(path: Path, name: str = name) -> None:
            path.write_text(mesh.replace("FILE", name))
            beside = path.with_name(name)
            os.mkfifo(beside) if name.startswith("pipe") else beside.symlink_to("/dev/zero")

        yield Bomb(f"a mesh {name}, a device", put, refuse=True)


def _urdf(data: bytes) -> Iterator[Bomb]:
    text = data.decode()
    joint = '<joint name="j{n}" type="fixed"><parent link="l0"/><child link="x{n}"/></joint>'
    yield from _robots(text, joint, URDF.replace("<MESH/>", '<mesh filename="FILE"/>'))
    for there, instead in (
        ('<mass value="1.0"/>', '<mass value=""/>'),
        ('<mass value="1.0"/>', '<mass value="nan"/>'),
        ('<mass value="1.0"/>', '<mass value="1e308"/>'),
        ('radius="0.05"', 'radius="-1"'),
        ('radius="0.05"', 'radius="0"'),
        ('radius="0.05"', 'radius="1e200"'),
        ('radius="0.05"', 'radius="nan"'),
        ('radius="0.05"', 'radius="5e-324"'),
        ('xyz="0 1 0"', 'xyz="0 0 0"'),
        ('xyz="0 1 0"', 'xyz="1e308 1e308 0"'),
        ('xyz="0 0 1"', 'xyz="1e300 0 0"'),
        ('lower="-9"', 'lower="a"'),
        ('velocity="9"', 'velocity="' + "9" * 5000 + '"'),
        ('child link="l2"', 'child link="l0"'),
        ('child link="l2"', 'child link="l1"'),
        ('child link="l2"', 'child link="nowhere"'),
        ('<joint name="b"', '<joint name="a"'),
        ('<link name="l2"', '<link name="l1"'),
        ('type="revolute"', 'type="nope"'),
        ('type="revolute"', 'type="floating"'),
        ('type="revolute"', 'type="planar"'),
        ("</joint>", '<mimic joint="a"/></joint>'),
        ("</joint>", '<mimic joint="b" multiplier="1e308"/></joint>'),
        ('name="a"', 'name="&#27;[31m"'),
        ('name="a"', 'name=""'),
        ("<robot name", "<robot x"),
    ):
        yield Bomb(instead[:50], text.replace(there, instead))
    yield Bomb("UTF-16", f'<?xml version="1.0" encoding="utf-16"?>{text}'.encode("utf-16"))
    chain_ = "".join(
        f'<link name="c{n}"/><joint name="f{n}" type="fixed"><parent link="{"l2" if not n else f"c{n - 1}"}"/>'
        f'<child link="c{n}"/></joint>'
        for n in range(990)
    )
    yield Bomb("990 fixed joints in a row", text.replace("</robot>", chain_ + "</robot>"))


def _mjcf(data: bytes) -> Iterator[Bomb]:
    text = data.decode()
    joint = '<body><joint name="j{n}"/><geom size="1"/></body>'
    mesh = MJCF.replace(
        "<default>", '<asset><mesh name="m" file="FILE"/></asset><default>'
    ).replace('type="capsule" size="0.05 0.4"', 'type="mesh" mesh="m"')
    yield from _robots(text, joint, mesh)
    body = "<worldbody>"
    for name, there, instead in (
        (
            "a grid of 27 million",
            body,
            body + '<body name="f"><flexcomp name="f" type="grid" count="300 300 300"/></body>',
        ),
        (
            "a cable of a million",
            body,
            body + '<body name="f"><composite type="cable" prefix="a" count="1000000 1 1"/></body>',
        ),
        (
            "a million replicas",
            body,
            body + '<replicate count="1000000"><body><geom size="1"/></body></replicate>',
        ),
        (
            "replicas of replicas",
            body,
            body + '<replicate count="9999">' * 5 + "<body/>" + "</replicate>" * 5,
        ),
        ("user data", "<default>", '<size nuserdata="1000000000"/><default>'),
        ("memory", "<default>", '<size memory="100G"/><default>'),
        (
            "a height field",
            "<default>",
            '<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset><default>',
        ),
        (
            "a texture",
            "<default>",
            '<asset><texture name="t" type="2d" builtin="flat" width="60000" height="60000"/></asset><default>',
        ),
        ("itself included", "<default>", '<include file="robot.xml"/><default>'),
        (
            "itself as a model",
            "<default>",
            '<asset><model name="m" file="robot.xml"/></asset><default>',
        ),
        ("/dev/zero included", "<default>", '<include file="/dev/zero"/><default>'),
        ("a plugin", "<default>", '<extension><plugin plugin="a.b"/></extension><default>'),
        ("sizes of nan", 'size="0.05 0.4"', 'size="nan 0.4"'),
        ("sizes of 1e200", 'size="0.05 0.4"', 'size="1e200 0.4"'),
        ("sizes below 0", 'size="0.05 0.4"', 'size="-1 0.4"'),
        ("sizes of 5,000 digits", 'size="0.05 0.4"', f'size="{"9" * 5000} 0.4"'),
        ("an axis of 0", 'axis="0 1 0"', 'axis="0 0 0"'),
        ("a name with an escape", 'name="a"', 'name="&#10;::error::"'),
        ("two joints of one name", 'name="b"', 'name="a"'),
        ("a joint of no name", 'name="b"', 'name=""'),
        ("an array of keys", "</mujoco>", "<keyframe>" + "<key/>" * DEEP + "</keyframe></mujoco>"),
        (
            "a mesh of numbers",
            "<default>",
            '<asset><mesh name="m" vertex="' + "0 " * 3 * 10**6 + '"/></asset><default>',
        ),
    ):
        yield Bomb(name, text.replace(there, instead, 1))


def _stl(data: bytes) -> Iterator[Bomb]:
    for count in (0, 2**32 - 1, 5, 10**7):
        yield Bomb(f"{count} facets", data[:80] + count.to_bytes(4, "little") + data[84:])
    yield Bomb("newlines", b"solid a\n" + b"\n" * 10**7 + b"endsolid a\n", refuse=True)
    yield Bomb(
        "corners of newlines", b"solid a\n" + b"vertex \n" * 10**6 + b"endsolid a\n", refuse=True
    )
    yield Bomb(
        "words of spaces", b"solid a\n" + b"vertex" + b" " * 10**7 + b"\nendsolid a\n", refuse=True
    )
    yield Bomb(
        "3 million facets",
        data[:80] + (3 * 10**6).to_bytes(4, "little") + bytes(150 * 10**6),
        refuse=True,
    )
    yield Bomb("flat", data[:84] + bytes(200))


def _obj(data: bytes) -> Iterator[Bomb]:
    yield Bomb("a polygon of 1.8 MB", data + b"f" + b" 1 2 3" * 300_000 + b"\n")
    yield Bomb("2 polygons of 10 MB", data + (b"f" + b" 1 2 3" * 10**6 + b"\n") * 2, refuse=True)
    yield Bomb("a point of 5,000 digits", data + b"f 1 2 " + b"9" * 5000 + b"\n", refuse=True)
    yield Bomb("points of 5,000 digits", data.replace(b"v 1 0 0", b"v " + b"9" * 5000 + b" 0 0"))
    yield Bomb("a line without end", data + b"\\\n" * 10**6)


def _dae(data: bytes) -> Iterator[Bomb]:
    nodes = "".join(
        f'<node id="n{n}"><instance_node url="#n{n + 1}"/><instance_node url="#n{n + 1}"/></node>'
        for n in range(60)
    )
    text = data.decode()
    yield Bomb(
        "instances that double",
        f'<COLLADA><library_nodes>{nodes}<node id="n60"/></library_nodes><library_visual_scenes>'
        '<visual_scene id="s"><node><instance_node url="#n0"/></node></visual_scene>'
        '</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>',
        refuse=True,
    )
    for there, instead in (
        ('stride="3"', 'stride="0"'),
        ('stride="3"', 'stride="-3"'),
        ('stride="3"', f'stride="{"9" * 5000}"'),
        ('count="4"', f'count="{"9" * 5000}"'),
        ('offset="0"', 'offset="1000000000"'),
        ('url="#g"', 'url="#n"'),
        ('url="#vs"', 'url="http://example.invalid/#vs"'),
        ("<instance_geometry", '<instance_node url="#n"/><instance_geometry'),
        ("<matrix>1", "<matrix>nan"),
        ("<matrix>1", "<matrix>1e308"),
        ("<p>0", "<p>-1"),
        ("<p>0", "<p>99999999999999999999"),
        ("<node id", "<node>" * DEEP + "<node id"),
    ):
        yield Bomb(instead[:40], text.replace(there, instead))
    copies = '<instance_geometry url="#g"/>' * 100_000
    yield Bomb("100,000 instances", text.replace('<instance_geometry url="#g"/>', copies))


# By how the names of readers begin.
BY_NAME: dict[str, Callable[[bytes], Iterator[Bomb]]] = {
    "run": _runs,
    "CSV": _tables,
    "NoisyTest, two": _tables,
    "labels, NoisyTest": _toml,
    "mapping": _toml,
    "reference": _toml,
    "NoisyTest labels": _toml,
    "simulated": _toml,
    "live": _live,
    "Parquet": _columns,
    "HDF5": _hdf5,
    "MCAP": _mcap,
    "ROS 2, SQLite": _sqlite,
    "ROS 1": _ros1,
    "URDF": _urdf,
    "MJCF": _mjcf,
    "STL": _stl,
    "OBJ": _obj,
    "DAE": _dae,
}
