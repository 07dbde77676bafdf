"""Give thousands of malformed files to the commands that read them, and count what becomes of them.

    python -m benchmarks.fuzz.malformed  # all readers
    python -m benchmarks.fuzz.malformed --only URDF --count 10 --keep found/

Every file is read by the real command line in a process of its own, forked from this one.
"""

import argparse
import gc
import json
import os
import pkgutil
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from random import Random

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads would not survive the forks

from benchmarks.fuzz.bombs import Bomb, bombs
from benchmarks.fuzz.damage import damaged
from benchmarks.fuzz.readers import READERS, Reader

# Processor time in [s] and resident memory in [byte] that a command may take.
SECONDS, BYTES = 20, 2 * 10**9
WALL = 150.0  # time that it may take in all, in [s]: one that waits takes no processor time

# Result or one line; a bug; above ``SECONDS``; above ``BYTES``; a result of what cannot have one;
# control characters or commands of a CI system in the output.
OUTCOMES = ("handled", "traceback", "hang", "memory", "nonsense", "raw text")
RAW = re.compile(r"[\x00-\x08\x0b-\x1f\x7f\x9b]|^::", re.M)
NOT_FINITE = re.compile(r"\b(nan|inf) (√W|W|rad|m|s|Hz|dB|ms)\b")


@dataclass(frozen=True)
class Result:
    """What became of a file."""

    reader: str
    case: str
    outcome: str
    status: int
    seconds: float  # processor time, in [s]
    megabytes: float  # peak of the resident memory, in [MB]
    said: str


def main() -> None:
    """Run the cases, print the table, end with 1 if a file was not handled."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", action="append", choices=READERS, help="repeatable")
    parser.add_argument("--count", type=int, default=60, help="random files per reader")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for the files that were not handled")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    _imported()
    found: list[Result] = []
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None  # faster than a disk
    with tempfile.TemporaryDirectory(dir=memory) as scratch:
        for name in options.only or [each for each in READERS if READERS[each].command]:
            for result in results(name, options.count, options.seed, Path(scratch), options.keep):
                found.append(result)
                if result.outcome != "handled":
                    print(json.dumps(asdict(result)), file=sys.stderr, flush=True)
    print(table(found))
    sys.exit(any(each.outcome != "handled" for each in found))


def table(found: list[Result]) -> str:
    """Readers by outcomes, in Markdown."""
    counts = {name: Counter[str]() for name in (*READERS, "all")}
    for each in found:
        counts[each.reader][each.outcome] += 1
        counts["all"][each.outcome] += 1
    rows = [("reader", "files", *OUTCOMES), ("---", *["---:"] * (1 + len(OUTCOMES)))]
    for name, count in counts.items():
        if count:
            rows.append((name, str(count.total()), *(str(count[each]) for each in OUTCOMES)))
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def results(
    name: str, count: int, seed: int, scratch: Path, keep: Path | None = None
) -> Iterator[Result]:
    """Read the malformed files of one reader."""
    reader = READERS[name]
    whole = scratch / "whole"
    whole.mkdir()
    _forked(lambda: (whole / ".made").write_text(str(reader.make(whole).relative_to(whole))))
    place = (whole / ".made").read_text()
    data = (whole / place).read_bytes()
    for case in (
        Bomb("whole", data),
        *bombs(name, whole / place),
        *_random(reader, data, name, count, seed),
    ):
        folder = scratch / "case"
        shutil.copytree(whole, folder, symlinks=True)
        _forked(lambda: (scratch / "path").write_bytes(os.fsencode(case.put(folder / place))))  # noqa: B023
        path = Path(os.fsdecode((scratch / "path").read_bytes()))
        result = judged(name, case, *_run(reader, folder, path))
        if keep and result.outcome != "handled" and path.is_file() and path.stat().st_size < 10**8:
            keep.mkdir(parents=True, exist_ok=True)
            slug = re.sub(r"\W+", "-", f"{name}-{case.name}")
            shutil.copy(path, keep / f"{slug}{path.suffix}")
        shutil.rmtree(folder)
        yield result
    shutil.rmtree(whole)


def _random(reader: Reader, data: bytes, name: str, count: int, seed: int) -> Iterator[Bomb]:
    for number in range(count):
        yield Bomb(
            f"random {number}", damaged(data, reader.kind, Random(f"{seed} {name} {number}"))
        )


def _run(reader: Reader, folder: Path, path: Path) -> tuple[int, float, int, str, str]:
    """Status, processor time in [s], peak memory in [byte], output and errors of the command."""
    texts = (folder / ".out", folder / ".err")

    def command() -> None:
        from inspector.cli import main as inspector

        reader.before()
        places = {"folder": folder, "parent": path.parent}
        sys.argv = ["inspector"]
        sys.argv += [str(path) if a == "{}" else a.format(**places) for a in reader.command]
        os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))
        if reader.stdin:
            stream = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
            os.set_blocking(stream, True)
            os.dup2(stream, 0)
        for number, text in enumerate(texts, start=1):
            os.dup2(os.open(text, os.O_WRONLY | os.O_CREAT), number)
        with (
            os.fdopen(1, "w", closefd=False) as out,
            os.fdopen(2, "w", closefd=False) as err,
            redirect_stdout(out),
            redirect_stderr(err),
        ):
            sys.__stdout__, sys.__stderr__ = out, err
            inspector()

    status, usage, peak = _forked(command)
    seconds = usage.ru_utime + usage.ru_stime
    out, err = (text.read_text(errors="replace") if text.exists() else "" for text in texts)
    return status, seconds, peak, out, err


def _forked(work: Callable[[], object]) -> tuple[int, resource.struct_rusage, int]:
    """Run in a process of its own; its status, what it took, and its peak memory in [byte]."""
    sys.stdout.flush()
    if not (pid := os.fork()):
        os.setsid()
        status = 0
        try:
            work()
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
        except BaseException as error:
            print(f"Traceback: {error!r}", file=sys.stderr)
            status = 70
        with suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)
    begin, peak = time.monotonic(), 0
    while True:
        done, status, usage = os.wait4(pid, os.WNOHANG)
        if done:
            break
        with suppress(OSError, ValueError, IndexError):
            resident = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
            peak = max(peak, resident * resource.getpagesize())
        if peak > BYTES or time.monotonic() - begin > WALL:
            os.killpg(pid, signal.SIGKILL)
        time.sleep(0.005)
    with suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)  # what it has started
    return os.waitstatus_to_exitcode(status), usage, max(peak, usage.ru_maxrss * 1024)


def judged(
    name: str, case: Bomb, status: int, seconds: float, peak: int, out: str, err: str
) -> Result:
    """What became of a file.

    Args:
        seconds: Processor time, in [s].
        peak: Peak of the resident memory, in [byte].
    """
    lines = (err.strip() or out.strip()).splitlines()
    if peak > BYTES:
        outcome = "memory"
    elif status in (-signal.SIGXCPU, -signal.SIGKILL) or seconds > SECONDS:
        outcome = "hang"
    elif status < 0 or status == 70 or "Traceback" in err or "Traceback" in out:
        outcome = "traceback"
    elif RAW.search(out + err):
        outcome = "raw text"
    elif status in (0, 1, 4) and (case.refuse or NOT_FINITE.search(out)):
        outcome = "nonsense"
    elif status not in (0, 1, 2, 3, 4, 5) or (status in (3, 5) and not lines):
        outcome = "traceback"
    else:
        outcome = "handled"
    said = lines[-1][:300] if lines else ""
    return Result(name, case.name, outcome, status, round(seconds, 2), round(peak / 1e6), said)


def _imported() -> None:
    """Import once what every command would import again."""
    for package in ("noisemodel", "noiseclassifier", "inspector"):
        path = import_module(package).__path__
        for each in pkgutil.walk_packages(path, f"{package}."):
            if "pytest" not in each.name and "__main__" not in each.name:
                import_module(each.name)
    from commandline import call

    call("noise", "/nowhere.npz")  # what the command line itself imports when it is used
    gc.collect()
    gc.freeze()


if __name__ == "__main__":
    main()
