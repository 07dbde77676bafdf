"""An assertion of pytest that fails where runs are louder than accepted ones.

`noise.check(run)` compares a run with the nearest ``reference/``, and leaves a recording and a
picture of a failure below ``noise-artefacts``. ``pytest --noise-accept "reason"`` accepts the runs
instead. Files are named after tests, so that the processes of pytest-xdist do not meet.
"""

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import date
from importlib.util import find_spec
from pathlib import Path
from typing import TypeAlias

import pytest

from inspector.analysis import Analysis, analyse, with_links
from inspector.errors import Status
from inspector.library import Library, load_library
from inspector.reference import store
from inspector.reference.judging import Comparison, Expected
from inspector.reference.levels import Levels, levels
from inspector.reference.store import Reference
from inspector.reference.verdicts import beside, classes_found, judge
from inspector.report.formats import told
from inspector.text import counted
from inspector.verdict import EXPECTED, Finding, Verdict
from noisemodel import Run

# A class of findings; or a class, and from when to when, in [s].
Allowed: TypeAlias = str | tuple[str, float, float]
Given: TypeAlias = Run | str | Path
Events: TypeAlias = tuple[Finding, ...]
ARTEFACTS = "noise-artefacts"  # folder below rootdir with recordings and pictures of failures
LONGEST = 120  # most characters of a file name that a test's name may take
# Node ids that a file name tells apart: what are folders, classes, test and parameters is seen.
PLAIN = re.compile(
    r"(\w+/)*\w+\.py(::[A-Z]\w*)*::[a-z_]\w*(\[[A-Za-z_]\w*(-[A-Za-z_]\w*)*\])?", re.ASCII
)
LIBRARY = pytest.StashKey[Library]()  # the models, read once per process
# Runs that were accepted in this process, and their findings, by store and scenario.
ACCEPTED = pytest.StashKey[dict[tuple[Path, str], tuple[list[Levels], dict[str, Events]]]]()


class Noise:
    """An assertion on the noise of runs, for one test."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._node, self._config = request.node, request.config
        if LIBRARY not in self._config.stash:
            named = self._config.getoption("--noise-model")
            with _readable():
                self._config.stash[LIBRARY] = load_library(named)
        self._library = self._config.stash[LIBRARY]
        self._count = 0

    def check(
        self, runs: Given | Sequence[Given], *, name: str = "", allow: str | Iterable[Allowed] = ()
    ) -> list[Verdict]:
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
        allowed = self._allowed(allow)
        self._count += 1
        # The test's name, with a number from the second check on.
        stem = name_of(self._node.nodeid) + (f"-{self._count}" if self._count > 1 else "")
        scenario = name or stem
        given = [runs] if isinstance(runs, (Run, str, Path)) else list(runs)
        if not given:
            raise ValueError("no run to check; expected one at least")
        folder = Path(self._node.path).parent
        with _readable():
            loaded = [(each if isinstance(each, Run) else Run.load(each), each) for each in given]
            accepted = store.find(folder) or folder / store.FOLDER
            if reason := self._config.getoption("--noise-accept"):
                self._accept(loaded, scenario, reason, accepted)
                return []
            there = accepted.exists()
            reference = Reference.load(accepted) if there else Reference(accepted, stored=True)
        stretches = [Expected(*((each,) if isinstance(each, str) else each)) for each in allowed]
        verdicts = []
        for run, source in loaded:
            shown = "the run" if isinstance(source, Run) else str(source)
            with _readable():
                analysis, verdict, comparison = self._judged(run, scenario, reference)
            if verdict.status is Status.CANNOT_TELL and Status.CANNOT_TELL not in allowed:
                cause = f"cannot tell whether {shown} is quiet: {analysis.reason}"
                pytest.fail(cause, pytrace=False)
            events = [e for e in verdict.failing if not any(each.covers(e) for each in stretches)]
            if events or verdict.missing:
                left = self._leave(stem, analysis, comparison, shown)
                pytest.fail(_told(verdict, events, shown, left), pytrace=False)
            verdicts.append(verdict)
        return verdicts

    def _judged(
        self, run: Run, scenario: str, reference: Reference | None = None
    ) -> tuple[Analysis, Verdict, Comparison | None]:
        """Analysis of a run, the verdict on it, and how it compares; None without a reference."""
        analysis = with_links(analyse(run, self._library, name=self._node.name), "normal")
        verdict, comparison = Verdict.of(Path(scenario), analysis), None
        if reference is not None and reference.scenarios:
            comparison = reference.compare(levels(analysis.run, name=scenario))
            verdict = beside(verdict, comparison, reference, analysis.labels)
        return analysis, judge(verdict, reference, today=date.today()), comparison

    def _accept(
        self, runs: Sequence[tuple[Run, Given]], scenario: str, reason: str, accepted: Path
    ) -> None:
        """Accept runs as repetitions of a scenario, with those that other tests accepted before."""
        session, key = self._config.stash.setdefault(ACCEPTED, {}), (accepted.resolve(), scenario)
        earlier, events = session.get(key, ([], {}))
        found = [*earlier]
        for place, (run, source) in enumerate(runs, len(found) + 1):
            file = str(source) if source is not run else f"{self._node.nodeid} {place}"
            analysis, verdict, _ = self._judged(run, scenario)
            digest = hashlib.sha256(run.velocity.tobytes()).hexdigest()
            found.append(levels(analysis.run, name=scenario, file=file, sha256=digest))
            events[file] = verdict.events
        store.accept_into(accepted, found, events=events, reason=reason, by=store.who())
        session[key] = found, events  # what cannot be accepted stands in no other test's way

    def _allowed(self, allow: str | Iterable[Allowed]) -> tuple[Allowed, ...]:
        """What may be there, of classes that there are."""
        __tracebackhide__ = True
        known = (*classes_found(self._library), Status.CANNOT_TELL.value)
        allowed = (allow,) if isinstance(allow, str) else tuple(allow)
        for each in allowed:
            match each:
                case str(name) | (str(name), float() | int(), float() | int()) if name in known:
                    continue
            expected = f"allow: {each!r}, expected a class, or (class, from, to) in [s]"
            pytest.fail(f"{expected}; classes are {', '.join(known)}", pytrace=False)
        return allowed

    def _leave(
        self, stem: str, analysis: Analysis, comparison: Comparison | None, shown: str
    ) -> dict[str, Path]:
        """Write a recording, and a picture if matplotlib draws one, instead of earlier ones."""
        from inspector.recording.run import write
        from inspector.report.picture import over_reference, picture

        folder = self._config.rootpath / ARTEFACTS
        folder.mkdir(parents=True, exist_ok=True)
        left = {"recording": folder / f"{stem}.rrd", "picture": folder / f"{stem}.png"}
        for path in left.values():
            path.unlink(missing_ok=True)
        write(analysis, left["recording"], overwrite=True)
        if not find_spec("matplotlib"):
            del left["picture"]
        elif comparison is not None and not comparison.empty:
            left["picture"].write_bytes(over_reference(comparison, f"{shown}: {comparison}"))
        else:
            left["picture"].write_bytes(picture(analysis))
        for what, path in left.items():
            self._node.user_properties.append((f"noise_{what}", str(path)))
        return left


def _told(verdict: Verdict, events: Sequence[Finding], shown: str, left: dict[str, Path]) -> str:
    """What fails a test, the worst in the first line, and the files that are left."""
    by = verdict.beside.words if verdict.beside else f"by model {verdict.model}"
    number = counted(len(events) + len(verdict.missing), "finding")
    first = told(events[0], verdict.beside, short=True) if events else str(verdict.missing[0])
    lines = [f"noise: {first} ({verdict.path})", f"{number} in {shown}, {by}"]
    lines += [f"  {told(event, verdict.beside)}" for event in events]
    lines += [f"  {each}" for each in verdict.missing]
    lines += [f"{what}: {path}" for what, path in left.items()]
    return "\n".join([*lines, 'meant to be so? pytest --noise-accept "reason" accepts it'])


@contextmanager
def _readable() -> Iterator[None]:
    """Fail in one line if a run cannot be read, or not be analysed."""
    __tracebackhide__ = True
    try:
        yield
    except EXPECTED as error:
        raise pytest.fail.Exception(str(error), pytrace=False) from None


def name_of(test: str) -> str:
    """Name files by the id of a test, with a hash where another test could have its name."""
    shown = test.replace(".py::", "::").replace("/", ".")
    words = re.split(r"[^\w.]+", shown, flags=re.ASCII)
    name = "-".join(word for word in words if word).lstrip(".") or "run"
    if PLAIN.fullmatch(test) and len(name) <= LONGEST:
        return name
    return f"{name[:LONGEST]}~{hashlib.sha256(test.encode()).hexdigest()[:12]}"
