"""A fixture of pytest that fails where runs are louder than accepted ones.

`noise.check(run)` compares a run with the nearest ``reference/``, and leaves a recording and a
picture of a failure below ``noise-artefacts``. ``pytest --noise-accept "reason"`` accepts the runs
instead. Files are named after tests, so that the processes of pytest-xdist do not meet.
"""

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import pytest

if TYPE_CHECKING:
    from inspector.analysis import Analysis
    from inspector.library import Library
    from inspector.reference.judging import Comparison
    from inspector.reference.levels import Levels
    from inspector.reference.store import Reference
    from inspector.verdict import Finding, Verdict
    from noiseclassifier import Event
    from noisemodel import Run

# A class of findings; or a class, and from when to when, in [s].
Allowed: TypeAlias = "str | tuple[str, float, float]"
ARTEFACTS = "noise-artefacts"  # folder below rootdir with recordings and pictures of failures
LONGEST = 120  # most characters of a file name that a test's name may take
# Node ids that a file name tells apart: what are folders, classes, test and parameters is seen.
PLAIN = re.compile(
    r"(\w+/)*\w+\.py(::[A-Z]\w*)*::[a-z_]\w*(\[[A-Za-z_]\w*(-[A-Za-z_]\w*)*\])?", re.ASCII
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("noise", "noise of robots (noise-inspector)")
    group.addoption(
        "--noise-accept",
        metavar="REASON",
        help="accept the runs of noise.check into the reference, and compare nothing",
    )
    group.addoption(
        "--noise-model",
        metavar="FILE",
        action="append",
        help="classify by this model only: a file, or the name of a shipped one; repeatable",
    )


@pytest.fixture
def noise(request: pytest.FixtureRequest) -> "Noise":
    """An assertion on the noise of runs: `check`."""
    return Noise(request)


class Noise:
    """An assertion on the noise of runs, for one test."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._node, self._config = request.node, request.config
        self._count = 0

    def check(
        self,
        runs: "Run | str | Path | Sequence[Run | str | Path]",
        *,
        name: str = "",
        allow: "str | Iterable[Allowed]" = (),
    ) -> "list[Verdict]":
        """Fail if a run is louder than accepted ones, or has a finding where there are none.

        Args:
            runs: A run or its file, or several repetitions.
            name: Name of the scenario; by default the test's.
            allow: A class of findings that may be there, or several; or class, start and stop in
                [s] of a stretch that such a finding has to lie in. "cannot-tell" allows runs that
                no model can classify.

        Returns:
            The verdicts; none with ``--noise-accept``, which accepts the runs.
        """
        __tracebackhide__ = True
        from inspector.errors import Status
        from noisemodel import Run

        allowed = self._allowed(allow)
        self._count += 1
        scenario = name or self._stem
        given = [runs] if isinstance(runs, (Run, str, Path)) else list(runs)
        if not given:
            raise ValueError("no run to check; expected one at least")
        with _readable():
            loaded = [each if isinstance(each, Run) else Run.load(each) for each in given]
            if reason := self._config.getoption("--noise-accept"):
                self._accept(loaded, given, scenario, reason)
                return []
            reference = self._reference()
        verdicts = []
        for run, source in zip(loaded, given, strict=True):
            shown = "the run" if isinstance(source, Run) else str(source)
            with _readable():
                analysis, verdict, comparison = self._judged(run, scenario, reference)
            events = [event for event in verdict.failing if not _allows(allowed, event)]
            if verdict.status is Status.CANNOT_TELL and Status.CANNOT_TELL not in allowed:
                told = f"cannot tell whether {shown} is quiet: {analysis.reason}"
                pytest.fail(told, pytrace=False)
            if events or verdict.missing:
                self._fail(analysis, verdict, events, comparison, shown)
            verdicts.append(verdict)
        return verdicts

    def _judged(
        self, run: "Run", scenario: str, reference: "Reference | None" = None
    ) -> "tuple[Analysis, Verdict, Comparison | None]":
        """Analysis of a run, the verdict on it, and how it compares; None without a reference."""
        from datetime import date

        from inspector.analysis import analyse, with_links
        from inspector.reference.verdicts import beside, judge
        from inspector.verdict import Verdict

        analysis = with_links(analyse(run, self._library, name=self._node.name), "normal")
        verdict, comparison = Verdict.of(Path(scenario), analysis), None
        if reference is not None and reference.scenarios:
            comparison = reference.compare(self._levels(run, scenario))
            verdict = beside(verdict, comparison, reference, analysis.labels)
        return (
            analysis,
            judge(verdict, reference, today=date.today()),
            comparison,
        )

    def _levels(self, run: "Run", scenario: str, **known: str) -> "Levels":
        from inspector.audit.signals import without_placeholder
        from inspector.reference.levels import levels

        return levels(without_placeholder(run)[0], name=scenario, **known)

    def _store(self) -> Path:
        """The store that is nearest to the test, or one beside it."""
        from inspector.reference.store import FOLDER, find

        folder = Path(self._node.path).parent
        return find(folder) or folder / FOLDER

    def _reference(self) -> "Reference":
        """What was accepted; nothing if there is no store yet."""
        from inspector.reference.store import Reference

        store = self._store()
        return Reference.load(store) if store.exists() else Reference(store, (), stored=True)

    def _accept(
        self,
        runs: "Sequence[Run]",
        given: "Sequence[Run | str | Path]",
        scenario: str,
        reason: str,
    ) -> None:
        """Accept runs as repetitions of a scenario; another test process may do so, too."""
        from inspector.reference.store import accept_into, digest, wanted_in, who

        measured, events = [], {}
        for place, (run, source) in enumerate(zip(runs, given, strict=True), 1):
            file = str(source) if source is not run else f"{self._node.nodeid} {place}"
            measured.append(self._levels(run, scenario, file=file, sha256=digest(run)))
            events[file] = self._judged(run, scenario)[1].events
        found = wanted_in(measured, events)
        accept_into(self._store(), measured, wanted=found, reason=reason, by=who(), renames=False)

    def _allowed(self, allow: "str | Iterable[Allowed]") -> tuple[Allowed, ...]:
        """What may be there, of classes that there are."""
        __tracebackhide__ = True
        from inspector.errors import Status
        from inspector.reference.verdicts import classes_found

        known = (*classes_found(self._library), Status.CANNOT_TELL.value)
        allowed = (allow,) if isinstance(allow, str) else tuple(allow)
        for each in allowed:
            match each:
                case str(name) | (str(name), float() | int(), float() | int()) if name in known:
                    continue
            told = f"allow: {each!r}, expected a class, or (class, from, to) in [s]"
            pytest.fail(f"{told}; classes are {', '.join(known)}", pytrace=False)
        return allowed

    @property
    def _library(self) -> "Library":
        """The models, read once per process."""
        if _LIBRARY not in self._config.stash:
            from inspector.library import load_library

            named = self._config.getoption("--noise-model")
            self._config.stash[_LIBRARY] = load_library(named)
        return self._config.stash[_LIBRARY]

    @property
    def _stem(self) -> str:
        """Name of the latest check: the test's, with a number from the second one on."""
        which = "" if self._count == 1 else f"-{self._count}"
        return f"{name_of(self._node.nodeid)}{which}"

    def _artefacts(self) -> dict[str, Path]:
        """Paths of recording and picture, if matplotlib draws one; earlier ones are removed."""
        from importlib.util import find_spec

        folder = self._config.rootpath / ARTEFACTS
        folder.mkdir(parents=True, exist_ok=True)
        paths = {"recording": folder / f"{self._stem}.rrd", "picture": folder / f"{self._stem}.png"}
        for path in paths.values():
            path.unlink(missing_ok=True)
        if not find_spec("matplotlib"):
            del paths["picture"]
        return paths

    def _fail(
        self,
        analysis: "Analysis",
        verdict: "Verdict",
        events: "Sequence[Finding]",
        comparison: "Comparison | None",
        shown: str,
    ) -> None:
        """Fail with the findings, and leave a recording and a picture."""
        __tracebackhide__ = True
        from inspector.recording.run import write
        from inspector.report.findings import told

        left = self._artefacts()
        write(analysis, left["recording"], overwrite=True)
        if "picture" in left:
            from inspector.report.picture import over_reference, picture

            drawn = picture(analysis)
            if comparison is not None and not comparison.empty:
                drawn = over_reference(comparison, f"{shown}: {comparison}")
            left["picture"].write_bytes(drawn)
        number = len(events) + len(verdict.missing)
        by = f", {verdict.beside.words}" if verdict.beside else f", by model {analysis.model}"
        first = told(events[0], verdict.beside, short=True) if events else str(verdict.missing[0])
        lines = [f"noise: {first} ({verdict.path})"]
        lines += [f"{number} finding{'s' * (number != 1)} in {shown}{by}"]
        lines += [f"  {told(event, verdict.beside)}" for event in events]
        lines += [f"  {each}" for each in verdict.missing]
        for what, path in left.items():
            self._node.user_properties.append((f"noise_{what}", str(path)))
            lines.append(f"{what}: {path}")
        lines += ['meant to be so? pytest --noise-accept "reason" accepts it']
        pytest.fail("\n".join(lines), pytrace=False)


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


def name_of(test: str) -> str:
    """Name the files of a test by its node id, differently for each test.

    Args:
        test: The node id. Where another test could have its name, a hash of it is added.
    """
    shown = test.replace(".py::", "::").replace("/", ".")
    words = re.split(r"[^\w.]+", shown, flags=re.ASCII)
    name = "-".join(word for word in words if word).lstrip(".") or "run"
    if PLAIN.fullmatch(test) and len(name) <= LONGEST:
        return name
    return f"{name[:LONGEST]}~{hashlib.sha256(test.encode()).hexdigest()[:12]}"
