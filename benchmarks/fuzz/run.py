"""Fuzz the readers with atheris, which needs the extra `fuzz`.

    python -m benchmarks.fuzz.run "live rows, JSON" "reference.toml" --seconds 15
    python -m benchmarks.fuzz.run "labels, CSV" --seconds 600 --found found/
    python -m benchmarks.fuzz.run --executions 2000  # all readers

The corpus begins with a whole file of each reader and with damaged ones. An error that is not
expected is kept by its place, and fuzzing goes on; the exit status is 1 if there is one.
`--executions` instead of `--seconds` gives the same inputs on any machine (PYTHONHASHSEED=0).
"""

import argparse
import os
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import atheris

with atheris.instrument_imports(include=["inspector", "noiseclassifier", "noisemodel"]):
    from benchmarks.fuzz.damage import damaged
    from benchmarks.fuzz.readers import EXPECTED, READERS, compile_in_fork

SEEDS = 30  # damaged files of each reader to begin with

# Bytes that a long text is cut to, and that an input has at most: short ones are read faster.
SHORT, LONGEST = 1000, 20_000


def main() -> None:
    """Fuzz, print executions and places found by reader."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("readers", nargs="*", metavar="READER", help=", ".join(READERS))
    end = parser.add_mutually_exclusive_group()
    end.add_argument("--seconds", type=int, default=15)
    end.add_argument("--executions", type=int, help="end after so many, however long they take")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--found", type=Path, help="folder for inputs that raise what is not expected"
    )
    options = parser.parse_args()
    names = tuple(options.readers or READERS)
    if set(names) - set(READERS):
        parser.error(f"name some of {', '.join(READERS)}")
    with tempfile.TemporaryDirectory(
        dir="/dev/shm" if Path("/dev/shm").is_dir() else None
    ) as folder:
        fuzz(names, Path(folder), options)


def fuzz(names: tuple[str, ...], folder: Path, options: argparse.Namespace) -> None:
    """Fuzz some readers; ends the process."""
    found = options.found
    corpus, paths = folder / "corpus", []
    corpus.mkdir()
    compile_in_fork()
    if found:
        found.mkdir(parents=True, exist_ok=True)
    for place, name in enumerate(names):
        home = folder / str(place)
        home.mkdir()
        paths.append(READERS[name].make(home))
        whole = paths[-1].read_bytes()
        READERS[name].read(paths[-1])
        if READERS[name].kind == "text":
            whole = whole[:SHORT].rpartition(b"\n")[0] if len(whole) > 3 * SHORT else whole
        (corpus / f"{place}").write_bytes(bytes((place,)) + whole)
        for number in range(SEEDS):
            data = damaged(whole, READERS[name].kind, Random(f"{name} {number}"))
            if len(data) < LONGEST:
                (corpus / f"{place}-{number}").write_bytes(bytes((place,)) + data)
    until = time.monotonic() + options.seconds

    def ended(executions: int) -> bool:
        if options.executions is None:
            return time.monotonic() > until
        return executions >= options.executions

    one = target(names, paths, ended, found, folder)
    atheris.Setup(
        [
            *("fuzz", str(corpus), f"-seed={options.seed}", "-verbosity=0", "-rss_limit_mb=2048"),
            *(
                "-timeout=60",
                "-reload=0",
                f"-max_len={LONGEST}",
                "-len_control=0",
                "-print_final_stats=0",
            ),
            f"-artifact_prefix={found or folder}/",
        ],
        one,
    )
    atheris.Fuzz()


def target(
    names: tuple[str, ...],
    paths: list[Path],
    ended: Callable[[int], bool],
    found: Path | None,
    folder: Path,
) -> Callable[[bytes], None]:
    """A function that gives an input to one of the readers, and notes what it raises."""
    counts, places = Counter[str](), dict[str, str]()

    def one(data: bytes) -> None:
        if ended(counts.total()):
            for name in names:
                print(f"{name}: {counts[name]} executions")
            for where, text in places.items():
                print(f"FOUND {where}: {text}")
            sys.stdout.flush()
            shutil.rmtree(folder, ignore_errors=True)
            os._exit(bool(places))  # libFuzzer ends the process without unwinding it
        place = data[0] % len(names) if data else 0
        name, path = names[place], paths[place]
        path.write_bytes(data[1:])
        counts[name] += 1
        try:
            READERS[name].read(path)
        except EXPECTED as error:
            if "\n" not in str(error):
                return
            note(name, data, error, "more than one line: ")
        except Exception as error:
            note(name, data, error)

    def note(name: str, data: bytes, error: Exception, more: str = "") -> None:
        frames = traceback.extract_tb(error.__traceback__)
        ours = [each for each in frames if "/site-packages/" not in each.filename]
        where = f"{ours[-1].filename}:{ours[-1].lineno} {type(error).__name__}"
        if where not in places:
            places[where] = f"{name}: {more}{error!r}"[:300]
            print(f"FOUND {where}: {places[where]}", file=sys.stderr, flush=True)
            if found:
                (found / f"{len(places)}-{type(error).__name__}").write_bytes(data)

    return one


if __name__ == "__main__":
    main()
