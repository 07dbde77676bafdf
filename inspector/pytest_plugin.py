"""A fixture of pytest that asserts that runs are quiet, or no worse than a stored reference.

`noise.assert_quiet(run)` and `noise.assert_no_worse(run)` fail with the finding, and leave a
recording and a picture below ``noise-artefacts``. ``pytest --noise-update`` stores references.
Files are named after tests, so that the processes of pytest-xdist do not meet.
"""

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import pytest

if TYPE_CHECKING:
    from inspector.analysis.analyse import Analysis
    from inspector.library import Library
    from inspector.regression.difference import Difference
    from noiseclassifier import Event
    from noisemodel import Run

Allowed: TypeAlias = "str | tuple[str, float, float]"
"""A class of findings; or a class, and from when to when, in [s]."""
LONGEST = 120
"""Most characters of a file name that a test's name may take."""
PLAIN = re.compile(
    r"(\w+/)*\w+\.py(::[A-Z]\w*)*::[a-z_]\w*(\[[A-Za-z_]\w*(-[A-Za-z_]\w*)*\])?", re.ASCII
)
"""Node ids that a file name tells apart: what are folders, classes, test and parameters is seen."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("noise", "noise of robots (noise-inspector)")
    group.addoption(
        "--noise-update",
        action="store_true",
        help="store the runs of noise.assert_no_worse as its reference, and compare nothing",
    )
    group.addoption(
        "--noise-reference",
        metavar="DIR",
        help="folder of the references; by default noise-reference beside each test file",
    )
    group.addoption(
        "--noise-artefacts",
        metavar="DIR",
        help="folder of recordings and pictures of failures; by default noise-artefacts in rootdir",
    )
    group.addoption(
        "--noise-model",
        metavar="FILE",
        action="append",
        help="classify by this model only: a file, or the name of a shipped one; repeatable",
    )


@pytest.fixture
def noise(request: pytest.FixtureRequest) -> "Noise":
    """Assertions on the noise of runs: `assert_quiet`, `assert_no_worse`."""
    return Noise(request)


class Noise:
    """Assertions on the noise of runs, for one test.

    Args:
        request: Of the test.
    """

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._node, self._config = request.node, request.config
        self._count = 0

    def assert_quiet(
        self, run: "Run | str | Path", *, allow: "str | Iterable[Allowed]" = ()
    ) -> "Analysis":
        """Fail if a run has a finding, or cannot be classified.

        Args:
            run: A run, or its file.
            allow: A class of findings that may be there, or several; or class, start and stop in
                [s] of a stretch that such a finding has to lie in. "cannot-tell" allows runs that
                no model can classify.

        Returns:
            The analysis.
        """
        __tracebackhide__ = True
        from inspector.analysis.analyse import analyse, analyse_file, with_links
        from inspector.analysis.status import Status

        allowed = self._allowed(allow)
        recording, picture = self._artefacts(self._names()[0])
        with _readable():
            if isinstance(run, (str, Path)):
                found, name = analyse_file(Path(run), self._library), str(run)
            else:
                analysis = analyse(run, self._library, name=self._node.name)
                found, name = with_links(analysis, "normal"), "the run"
        if found.status is Status.CANNOT_TELL and Status.CANNOT_TELL not in allowed:
            pytest.fail(f"cannot tell whether {name} is quiet: {found.reason}", pytrace=False)
        events = [event for event in found.findings if not _allows(allowed, event)]
        if not events:
            return found
        from inspector.recording.run import write

        write(found, recording, overwrite=True)
        if picture:
            from inspector.report.picture import picture as drawn

            picture.write_bytes(drawn(found))
        plural = "" if len(events) == 1 else "s"
        lines = [f"{len(events)} finding{plural} in {name}, by model {found.model}"]
        lines += [f"  {_sentence(event)}" for event in events]
        self._fail(lines, recording, picture)
        return found

    def assert_no_worse(
        self, runs: "Run | str | Path | Sequence[Run | str | Path]", *, name: str = ""
    ) -> "Difference | None":
        """Fail if runs have findings that are new or louder, or levels that are significantly so.

        Findings are compared from one run on. Levels take repetitions, five of the reference and
        five now: a list of runs of one scenario, which differ in their noise or their seed.

        Args:
            runs: A run or its file, or a list of repetitions.
            name: Name of the reference; that of the test unless given.

        Returns:
            The difference; None with ``--noise-update``, which stores the runs as reference.
        """
        __tracebackhide__ = True
        from inspector.regression.difference import Verdict, difference
        from inspector.regression.measure import measure
        from inspector.regression.pairing import Pairing, repetitions
        from noisemodel import Run

        stem, folder = self._names(name)
        given = [runs] if isinstance(runs, (Run, str, Path)) else list(runs)
        if not given:
            raise ValueError("no run to compare with the reference; expected one at least")
        with _readable():
            loaded = [each if isinstance(each, Run) else Run.load(each) for each in given]
        stored = sorted(folder.glob("*.npz")) if folder.is_dir() else []
        if self._config.getoption("--noise-update"):
            _store(loaded, folder, stored)
            return None
        if not stored:
            told = f"no reference in {folder}; `pytest --noise-update` stores this run as one"
            pytest.fail(told, pytrace=False)
        recording, picture = self._artefacts(stem)
        targets = [recording.with_name(f"{stem}-run-{n + 1}.npz") for n in range(len(loaded))]
        paths = [
            target if isinstance(each, Run) else Path(each)
            for each, target in zip(given, targets, strict=True)
        ]
        for target in targets:
            target.unlink(missing_ok=True)
        now = list(zip(loaded, paths, strict=True))
        with _readable():
            before = [(Run.load(path), path) for path in stored]
            sides = [[measure(*each, self._library) for each in side] for side in (before, now)]
        scenario = repetitions(stem, *sides)
        found = difference(Pairing("test", (scenario,), ()))
        if found.unreadable:
            bad = found.unreadable[0]
            pytest.fail(f"cannot compare with {folder}: {bad.path} {bad.problem}", pytrace=False)
        if not found.new and found.verdict is not Verdict.WORSE:
            return found
        from inspector.regression.report import write_pair

        (row,) = found.scenarios
        for (run, path), target in zip(now, targets, strict=True):
            if path == target:
                run.save(target)
        write_pair(row, recording, picture, self._library, overwrite=True)
        number = f"{len(found.new)} new or louder finding{'s' * (len(found.new) > 1)}"
        worse = row.verdict is Verdict.WORSE
        lines = [f"worse than {folder}: {row.reason if worse else number}"]
        lines += [f"  {finding}" for finding in found.new]
        self._fail([*lines, *row.remarks], recording, picture)
        return found

    def _allowed(self, allow: "str | Iterable[Allowed]") -> tuple[Allowed, ...]:
        """What may be there, of classes that there are."""
        __tracebackhide__ = True
        from inspector.analysis.status import Status
        from inspector.reference.verdicts import classes_found
        from noisemodel.errors import hint

        known = (*classes_found(self._library), Status.CANNOT_TELL.value)
        allowed = (allow,) if isinstance(allow, str) else tuple(allow)
        for each in allowed:
            match each:
                case str(name) | (str(name), float() | int(), float() | int()):
                    if name in known:
                        continue
                    told = f"{name!r} is none of {', '.join(known)}{hint(name, known)}"
                case _:
                    told = f"{each!r}, expected a class, or (class, from, to) in [s]"
            pytest.fail(f"allow: {told}", pytrace=False)
        return allowed

    @property
    def _library(self) -> "Library":
        """The models, read once per process."""
        if _LIBRARY not in self._config.stash:
            from inspector import assets
            from inspector.library import load_library

            named = self._config.getoption("--noise-model")
            files = assets.model_files([Path(name) for name in named] if named else None)
            self._config.stash[_LIBRARY] = load_library(files)
        return self._config.stash[_LIBRARY]

    def _names(self, name: str = "") -> tuple[str, Path]:
        """Name of the artefacts of an assertion, and folder of its reference."""
        whole = self._node.nodeid
        file, colons, test = whole.partition("::")
        own = f"{file.rpartition('/')[2]}{colons}{test}"
        if name:
            stem = alone = _file_name(name, plain=name == _slug(name))
        else:
            self._count += 1
            which = "" if self._count == 1 else f"-{self._count}"
            stem, alone = f"{name_of(whole)}{which}", f"{name_of(own)}{which}"
        named = self._config.getoption("--noise-reference")
        if named:
            return stem, self._config.rootpath / named / stem
        return stem, Path(self._node.path).parent / "noise-reference" / alone

    def _artefacts(self, stem: str) -> tuple[Path, Path | None]:
        """Paths of recording and picture, earlier ones removed; no picture without matplotlib."""
        from inspector.regression.picture import drawable

        named = self._config.getoption("--noise-artefacts") or "noise-artefacts"
        folder = self._config.rootpath / named
        folder.mkdir(parents=True, exist_ok=True)
        paths = folder / f"{stem}.rrd", folder / f"{stem}.png"
        for path in paths:
            path.unlink(missing_ok=True)
        return paths[0], paths[1] if drawable() else None

    def _fail(self, lines: Sequence[str], recording: Path, picture: Path | None) -> None:
        """Fail with some lines and where to look."""
        __tracebackhide__ = True
        left = {"recording": recording, **({"picture": picture} if picture else {})}
        for what, path in left.items():
            self._node.user_properties.append((f"noise_{what}", str(path)))
        shown = [f"{what}: {path}" for what, path in left.items()]
        pytest.fail("\n".join([*lines, *shown]), pytrace=False)


@contextmanager
def _readable() -> Iterator[None]:
    """Fail in one line if a run cannot be read, or not be analysed."""
    __tracebackhide__ = True
    from inspector.verdict import EXPECTED

    try:
        yield
    except EXPECTED as error:
        raise pytest.fail.Exception(str(error), pytrace=False) from None


_LIBRARY: "pytest.StashKey[Library]" = pytest.StashKey()


def _allows(allowed: Iterable[Allowed], event: "Event") -> bool:
    return any(
        each == event.label
        if isinstance(each, str)
        else each[0] == event.label and each[1] <= event.start and event.stop <= each[2]
        for each in allowed
    )


def _sentence(event: "Event") -> str:
    from noiseclassifier.labels import interval

    return f"{event.label} from {interval(event.start, event.stop)}{event.novelty}"


def _store(runs: Sequence["Run"], folder: Path, stored: Iterable[Path]) -> None:
    """Write runs in the place of those that were stored."""
    folder.mkdir(parents=True, exist_ok=True)
    targets = [folder / f"run-{number}.npz" for number in range(1, len(runs) + 1)]
    for run, target in zip(runs, targets, strict=True):
        run.save(target, overwrite=True)
    for path in set(stored) - set(targets):
        path.unlink()


def name_of(test: str) -> str:
    """Name the files of a test, those of no two tests alike: its node id.

    Args:
        test: The node id. Where its name could be that of another, a hash of it is added.
    """
    shown = test.replace(".py::", "::").replace("/", ".")
    return _file_name(test, shown, plain=PLAIN.fullmatch(test) is not None)


def _file_name(whole: str, shown: str = "", *, plain: bool) -> str:
    """A name of a file, with a hash of the whole name unless that is plain and short."""
    name = _slug(shown or whole)
    if plain and len(name) <= LONGEST:
        return name
    return f"{name[:LONGEST]}~{hashlib.sha256(whole.encode()).hexdigest()[:12]}"


def _slug(name: str) -> str:
    """Letters, digits, ``.``, ``-`` and ``_`` of a name; others are ``-``."""
    words = re.split(r"[^\w.]+", name, flags=re.ASCII)
    return "-".join(word for word in words if word).lstrip(".") or "run"
