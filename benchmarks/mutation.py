"""Mutation testing: the share of small changes to the code that the tests notice.

    python -m benchmarks.mutation FOLDER [--seed 27] [--from 0] [--number 500] [--only FILE ...]

The mutants are cosmic-ray's (extra `mutation`), in `noisemodel`, `noiseclassifier` without its
scenarios, and `inspector.analysis`.
All places that it can change stand in one random order; at each, one of its changes is drawn, too.
So any first N are a fair sample. Left out is what any test would see (arithmetic that becomes
shifts or bitwise operations, order that becomes identity, what does not compile), and what no
statement depends on: annotations, options of dataclasses and others that `unread` lists.

In FOLDER, a copy of the tree is tested once with coverage.py, to know which test executes which
line; what is not marked `slow` only. Then a process imports the code and all tests, and forks for
each mutant. The child gives the changed function its new code, runs the tests that execute the
changed statement, and ends with the first that fails. A statement that runs at import (constants,
defaults) needs a process of its own; its tests are those that execute a line which reads the name.
Where no test executes the statement, its tests are those that enter the function, else the module,
in a process of their own, too. So are, once more, the tests of what survives though it runs while
tests are collected or is cached: its old result may have been kept.
Tests of files that are named by the module come first, then those named by its package, then the
others, each by the CPU time of their file: up to 5 s of measured CPU time, then up to 40 s of the
rest (`--seconds`). What survives may still be noticed by a test that was not run: the share that is
killed is a lower bound.
"""

import argparse
import ast
import gc
import json
import os
import random
import resource
import select
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
SEED = 27
MEASURED = ("noisemodel", "models/noiseclassifier", "inspector/analysis.py")
ARITHMETIC = {"Add", "Sub", "Mul", "Div", "FloorDiv", "Mod", "Pow"}
IDENTITY = {"Is", "IsNot"}
MEMORY = 12 << 30  # address space of a child, in [byte]
# Tests of simulators and of the wheel, which take a third of the time; and of viewers, which hang
# in a process that was forked.
LEFT_OUT = (
    *("scenarios", "domains", "humanoid", "quadruped", "wheel"),
    *("*viewer", "*screenshot", "*picture"),
)
# Tests that hang or fail without a change in a process that was forked: they have threads.
ALONE = (
    "inspector_cli.py::test_the_viewer_is_started_on_loopback_and_not_waited_for",
    "noisemodel_compare.py::test_robots_are_compared_many_at_once_and_alike",
)
OPTIONS = (
    *("tests", "-q", "-m", "not slow", "-p", "no:cacheprovider", "--hypothesis-seed=0"),
    *(f"--ignore-glob=*/test_{name}*.py" for name in LEFT_OUT),
    *(f"--deselect=tests/test_{name}" for name in ALONE),
)

CONTROL = 50  # before one of so many mutants, its tests are run without a change: all have to pass

Lines = dict[str, dict[int, list[str]]]


@dataclass(frozen=True)
class Mutant:
    """A change at a place of a file; lines from 1, columns from 0."""

    path: str
    line: int
    column: int
    operator: str
    occurrence: int


def places() -> list[list[Mutant]]:
    """All that cosmic-ray can change, by place: the changes that are possible there."""
    import cosmic_ray.plugins as plugins
    from cosmic_ray.ast import ast_nodes, get_ast

    operators = {name: plugins.get_operator(name) for name in plugins.operator_names()}
    operators = {name: each() for name, each in operators.items() if wanted(name)}
    found: dict[tuple[str, int, int], list[Mutant]] = defaultdict(list)
    for path in sorted(each for place in MEASURED for each in modules(Path(place))):
        source, seen = path.read_text(), Counter[str]()
        typed = unread(ast.parse(source))
        for node in ast_nodes(get_ast(source)):
            for name, operator in operators.items():
                if "BinaryOperator" in name and node.type != "operator":
                    continue
                if "ComparisonOperator" in name and node.type != "comparison":
                    continue
                for (line, column), _ in operator.mutation_positions(node):
                    mutant = Mutant(str(path), line, column, name, seen[name])
                    seen[name] += 1
                    if node.parent and node.parent.type == "parameters":  # the * before names
                        continue
                    if not any(start <= (line, column) < stop for start, stop in typed):
                        found[str(path), line, column].append(mutant)
    return [found[key] for key in sorted(found)]


def modules(place: Path) -> list[Path]:
    """A module, or those of a folder, without scenarios, whose tests are left out."""
    if place.suffix:
        return [place]
    return [p for p in place.rglob("*.py") if "scenarios" not in p.relative_to(place).parts]


def wanted(operator: str) -> bool:
    """Whether a change is none that every test would see."""
    kind, *pair = operator.removeprefix("core/").split("_")
    if kind == "ReplaceBinaryOperator":
        return len(ARITHMETIC & set(pair)) != 1 and not {"RShift", "LShift"} & set(pair)
    if kind == "ReplaceComparisonOperator":
        return len(IDENTITY & set(pair)) != 1
    return kind not in ("NoOp", "VariableReplacer", "VariableInserter")


def unread(tree: ast.AST) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Start and end, line and column, of what no statement depends on.

    Annotations, `if TYPE_CHECKING`, options of dataclasses, decorators of protocols, `strict=` of
    `zip`, which guards against bugs alone, and the -1 of `reshape`, which may be any negative one.
    """
    nodes: list[ast.expr | None] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword) and node.arg == "strict":
            nodes.append(node.value)
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            nodes.append(node.test)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".reshape"):
            nodes += [each for each in node.args if ast.unparse(each) == "-1"]
        elif isinstance(node, ast.ClassDef) and "Protocol" in map(ast.unparse, node.bases):
            inner = [each for each in node.body if isinstance(each, ast.FunctionDef)]
            nodes += [decorator for each in inner for decorator in each.decorator_list]
        if isinstance(node, ast.arg | ast.AnnAssign):
            nodes.append(node.annotation)
        elif isinstance(node, ast.FunctionDef):
            nodes.append(node.returns)
        elif isinstance(node, ast.ClassDef):
            nodes += [each for each in node.decorator_list if isinstance(each, ast.Call)]
    return [
        ((node.lineno, node.col_offset), (node.end_lineno or 0, node.end_col_offset or 0))
        for node in nodes
        if node is not None
    ]


def changed(mutant: Mutant) -> str | None:
    """The source of the file with the change, None if it does not compile."""
    import cosmic_ray.plugins as plugins
    from cosmic_ray.mutating import mutate_code

    operator = plugins.get_operator(mutant.operator)()
    try:
        source = mutate_code(Path(mutant.path).read_text(), operator, mutant.occurrence)
        compile(source, mutant.path, "exec")
    except (SyntaxError, AttributeError):  # the latter of cosmic-ray, at some exceptions
        return None
    return str(source)


def drawn(
    seed: int, first: int, number: int, only: Sequence[str] = ()
) -> Iterator[tuple[int, Mutant, str]]:
    """Mutants of the seeded order, of some files only if named: index, mutant, changed source."""
    dice = random.Random(seed)
    found = [each for each in places() if not only or each[0].path in only]
    dice.shuffle(found)
    index = 0
    for each in found:
        mutant = dice.choice(each)
        if index >= first + number:
            return
        source = changed(mutant)
        if source is None:
            continue
        if index >= first:
            yield index, mutant, source
        index += 1


class Measuring:
    """A plugin of pytest: which test executes which line, and the CPU time of each.

    What a fixture of a module or of the session executes counts for all tests that use it.
    """

    def __init__(self, switch: Callable[[str], None]) -> None:
        self.switch = switch
        self.names: list[str] = [""]
        self.seconds: dict[str, float] = defaultdict(float)
        self.needs: dict[str, list[str]] = {}
        self.failed: list[str] = []

    def _timed(self, name: str) -> Any:
        self.names.append(name)
        self.switch(name)
        start, before = time.process_time(), sum(self.seconds.values())
        try:
            return (yield)
        finally:
            inner = sum(self.seconds.values()) - before
            self.seconds[name] += time.process_time() - start - inner
            self.names.pop()
            self.switch(self.names[-1])

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: Any) -> Any:
        """Note what a test executes."""
        known = item._fixtureinfo.name2fixturedefs.values()
        shared = {fixture(each) for several in known for each in several}
        self.needs[item.nodeid] = sorted(shared - {""})
        return (yield from self._timed(item.nodeid))

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Any:
        """Note what a shared fixture executes."""
        name = fixture(fixturedef)
        return (yield from self._timed(name)) if name else (yield)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Note a test that fails without a change: it can notice none."""
        if report.failed:
            self.failed.append(report.nodeid)


def fixture(definition: Any) -> str:
    """Name of a fixture that several tests share, else nothing."""
    shared = definition.scope != "function"
    return f"fixture {definition.baseid}::{definition.argname}" if shared else ""


def measure(folder: Path) -> None:
    """Write `lines.json`; the working directory is the copy of the tree."""
    import coverage

    include = [str(each) for place in MEASURED for each in modules(Path(place))]
    cover = coverage.Coverage(data_file=None, include=include, config_file=False)
    plugin = Measuring(cover.switch_context)
    cover.start()
    pytest.main([*OPTIONS, f"--basetemp={folder / 'tmp'}"], plugins=[plugin])
    cover.stop()
    data = cover.get_data()
    lines = {
        str(Path(file).relative_to(Path.cwd())): data.contexts_by_lineno(file)
        for file in data.measured_files()
    }
    told = {"seconds": plugin.seconds, "needs": plugin.needs, "failed": plugin.failed}
    (folder / "lines.json").write_text(json.dumps({**told, "lines": lines}))


class Chosen:
    """A plugin of pytest: runs some tests only, in the order of a list."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = names

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        """Keep what was chosen."""
        known = {item.nodeid: item for item in items}
        items[:] = [known[name] for name in self.names if name in known]


class Mutating:
    """A plugin of pytest: runs for each mutant the tests that may notice it."""

    def __init__(self, folder: Path, args: argparse.Namespace) -> None:
        told = json.loads((folder / "lines.json").read_text())
        self.seconds, self.needs = told["seconds"], told["needs"]
        self.lines: Lines = {
            path: {int(line): names for line, names in of.items()}
            for path, of in told["lines"].items()
        }
        self.users = defaultdict(list)
        for test, needs in self.needs.items():
            for need in needs:
                self.users[need].append(test)
        self.failed = set(told["failed"])
        self.place: dict[str, int] = {}
        self.trees = {path: ast.parse(Path(path).read_text()) for path in self.lines}
        self.folder, self.args = folder, args
        self.functions: dict[str, list[FunctionType]] = defaultdict(list)
        self.killer = ""

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Note the first test that fails."""
        if report.failed and not self.killer:
            crash = getattr(report.longrepr, "reprcrash", None)
            said = crash.message if crash else str(report.longrepr)
            self.killer = f"{report.nodeid} {' '.join(said.split())[:200]}"

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: Any) -> bool:
        """Try all mutants in place of running all tests."""
        items = {item.nodeid: item for item in session.items}
        self.place = {name: place for place, name in enumerate(items)}
        for each in gc.get_objects():
            if isinstance(each, FunctionType):
                self.functions[each.__code__.co_filename].append(each)
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # the changed file is put back
        gc.freeze()  # children copy no page for the sake of the collector
        end = time.monotonic() + 60.0 * self.args.minutes
        results = self.folder / "results.jsonl"
        done = {row["index"] for row in rows_of(results)}
        args = self.args
        for index, mutant, source in drawn(args.seed, args.first, args.number, args.only):
            if index in done:
                continue
            if time.monotonic() > end:
                break
            if index % CONTROL == 0:
                found = self.tried(mutant, Path(mutant.path).read_text(), items)
                assert found["outcome"] == "survived", f"without a change: {found['by']}"
            row = asdict(mutant) | self.tried(mutant, source, items)
            with results.open("a") as file:
                print(json.dumps({"index": index, **row}), file=file)
        return True

    def tried(self, mutant: Mutant, source: str, items: dict[str, Any]) -> dict[str, Any]:
        """Outcome of a mutant, and how it came about."""
        path = Path(mutant.path).absolute()
        original, stat = path.read_text(), path.stat()
        function = enclosing(self.trees[mutant.path], mutant.line, mutant.column)
        how, names = self.tests(mutant, function)
        started, ran, said = time.monotonic(), list[str](), "survived"
        path.write_text(source)
        try:
            for seconds in self.args.seconds:
                chosen, planned = self.ordered(
                    names & set(items) - set(ran), Path(mutant.path), seconds
                )
                if not chosen or said != "survived":
                    break
                ran += chosen
                limit = 10.0 + 3.0 * planned
                said = "cold"
                if how == "statement":
                    run = partial(self.hot, path, source, [items[name] for name in chosen])
                    said = alone(run, limit)
                if said == "cold":
                    said = alone(partial(self.cold, chosen), limit + 20.0)
            if said == "survived" and how == "statement" and self.kept(mutant, function):
                how, names = "kept", names | self.callers(function)
                chosen, planned = self.ordered(
                    names & set(items), Path(mutant.path), self.args.seconds[0]
                )
                said = alone(partial(self.cold, chosen), 30.0 + 3.0 * planned)
        finally:
            path.write_text(original)
            os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
        outcome, _, killer = said.partition(" ")
        pair = [
            text.splitlines()[mutant.line - 1].strip()
            for text in (original, source)
            if len(text.splitlines()) >= mutant.line
        ]
        facts = {"outcome": outcome, "by": killer, "covered": how, "lines": pair}
        counts = {"tests": len(ran), "of": len(names), "seconds": time.monotonic() - started}
        return facts | counts

    def hot(self, path: Path, source: str, items: Sequence[Any]) -> str:
        """Run tests in this process, which ends afterwards."""
        if not swapped(self.functions[str(path)], str(path), source):
            return "cold"
        for item, following in zip(items, [*items[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.killer:
                return f"killed {self.killer}"
        return "survived"

    def cold(self, chosen: Sequence[str]) -> str:
        """Run tests in a fresh process."""
        if not chosen:
            return "survived"
        (self.folder / "chosen.json").write_text(json.dumps(chosen))
        command = [sys.executable, "-m", "benchmarks.mutation", str(self.folder)]
        done = subprocess.run([*command, "--stage", "chosen"], capture_output=True, text=True)
        if done.returncode < 0:
            return "timeout"
        said = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        said += [line for line in done.stderr.splitlines() if line.strip()][-1:]
        return f"killed {said[0][:300] if said else ''}" if done.returncode else "survived"

    def kept(self, mutant: Mutant, function: ast.AST | None) -> bool:
        """Whether what a statement gave may be older than its change."""
        assert isinstance(function, ast.FunctionDef)
        if any("cache" in ast.unparse(each) for each in function.decorator_list):
            return True
        first, last = statement(self.trees[mutant.path], mutant.line)
        lines = self.lines[mutant.path]
        return any("" in lines.get(line, ()) for line in range(first, last + 1))

    def callers(self, function: ast.AST | None) -> set[str]:
        """Tests that execute a line which reads the name of a function."""
        assert isinstance(function, ast.FunctionDef)
        return self.readers(function.name) - self.failed

    def readers(self, name: str) -> set[str]:
        """Tests that execute a line which reads a name."""
        return {
            test
            for path, tree in self.trees.items()
            for line in reading(tree, name)
            for test in self.of(self.lines[path], (line, line))
        }

    def tests(self, mutant: Mutant, function: ast.AST | None) -> tuple[str, set[str]]:
        """Tests that may notice a mutant, and by what they were chosen."""
        lines = self.lines[mutant.path]
        tree = self.trees[mutant.path]
        start, stop = statement(tree, mutant.line)
        if function is None:
            name = assigned(tree, mutant.line)
            if isinstance(name, ast.FunctionDef):
                found = self.of(lines, body(name))
            else:
                found = self.readers(name) if name else set()
            how = "readers"
        else:
            how, found = "statement", self.of(lines, (start, stop))
            if not found:
                how, found = "function", self.of(lines, body(function))
        if not found:
            how, found = "module", self.of(lines, (1, max(lines, default=1)))
        return how, found - self.failed

    def of(self, lines: dict[int, list[str]], span: tuple[int, int]) -> set[str]:
        """Tests that execute one of these lines."""
        names = {name for line in range(span[0], span[1] + 1) for name in lines.get(line, ())}
        shared = {test for name in names for test in self.users.get(name, ())}
        return {name for name in names | shared if name in self.needs}

    def ordered(self, names: set[str], path: Path, limit: float) -> tuple[list[str], float]:
        """Tests within a limit of CPU time, in the order to run, and their CPU time in [s]."""
        files: dict[str, list[str]] = defaultdict(list)
        for name in sorted(names, key=lambda name: self.seconds.get(name, 0.0)):
            files[name.split("::")[0]].append(name)
        costs = {file: sum(self.seconds.get(n, 0.0) for n in of) for file, of in files.items()}
        total, ready, chosen = 0.0, set[str](), list[str]()
        near = (path.stem, path.parent.name, path.parts[0])
        for file in sorted(files, key=lambda f: (*(name not in f for name in near), costs[f])):
            first = len(chosen)
            for name in files[file]:
                needs = set(self.needs[name]) - ready
                cost = sum(self.seconds.get(each, 0.0) for each in (name, *needs))
                if total + cost <= limit or not chosen:
                    total, ready = total + cost, ready | needs
                    chosen.append(name)
            # As collected: a change to another parameter of a shared fixture sets it up again.
            chosen[first:] = sorted(chosen[first:], key=self.place.__getitem__)
        return chosen, total


def alone(run: Callable[[], str], limit: float) -> str:
    """What a function returns in a child process: `timeout` past its CPU time, in [s]."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.setsid()
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit) + 1, resource.RLIM_INFINITY))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.RLIM_INFINITY))
        try:
            said = run()
        except BaseException as error:
            said = f"killed {error!r}"
        os.write(write, said.encode()[:4000])
        os._exit(0)
    os.close(write)
    waited = bool(select.select([read], [], [], 40.0 * limit + 60.0)[0])
    said = os.read(read, 4000).decode(errors="replace") if waited else ""
    os.close(read)
    with suppress(ProcessLookupError):  # it has ended, and left nobody behind
        os.killpg(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return said or ("timeout" if not waited or status == signal.SIGXCPU else f"killed {status}")


def swapped(functions: Sequence[FunctionType], path: str, source: str) -> bool:
    """Give the functions of a file the code of a changed source, False if that cannot be done."""
    codes: dict[tuple[str, int], CodeType] = {}
    several: set[tuple[str, int]] = set()

    def walk(code: CodeType) -> None:
        for const in code.co_consts:
            if isinstance(const, CodeType):
                key = (const.co_qualname, const.co_firstlineno)
                several.update([key] if key in codes else [])
                codes[key] = const
                walk(const)

    walk(compile(source, path, "exec"))
    for each in functions:
        key = (each.__code__.co_qualname, each.__code__.co_firstlineno)
        code = codes.get(key)
        if code is None or key in several or code.co_freevars != each.__code__.co_freevars:
            return False
        each.__code__ = code
    return bool(functions)


def enclosing(tree: ast.AST, line: int, column: int) -> ast.FunctionDef | None:
    """The outermost function whose body has a position, None where code runs at import."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            first, last = node.body[0], node.body[-1]
            start = (first.lineno, first.col_offset)
            if start <= (line, column) < (last.end_lineno or 0, last.end_col_offset or 0):
                return node
    return None


def body(function: ast.AST) -> tuple[int, int]:
    """First and last line of the body of a function."""
    assert isinstance(function, ast.FunctionDef)
    return function.body[0].lineno, function.body[-1].end_lineno or 0


def statement(tree: ast.AST, line: int) -> tuple[int, int]:
    """First and last line of the innermost statement at a line; of a compound one, of its head."""
    span = (line, line)
    for node in ast.walk(tree):  # outer nodes come first
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or 0):
            inner = getattr(node, "body", None)
            last = inner[0].lineno - 1 if inner else node.end_lineno or 0
            span = (node.lineno, max(last, node.lineno))
    return span if span[0] <= line <= span[1] else (line, line)


def assigned(tree: ast.AST, line: int) -> str | ast.FunctionDef | None:
    """The name that a line at module or class level gives a value, or the function it declares."""
    said: str | ast.FunctionDef | None = None
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            top = min([node.lineno, *(each.lineno for each in node.decorator_list)])
            if top <= line < node.body[0].lineno:
                said = node if isinstance(node, ast.FunctionDef) else node.name
        elif isinstance(node, ast.Assign | ast.AnnAssign) and (
            node.lineno <= line <= (node.end_lineno or 0)
        ):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            said = target.id if isinstance(target, ast.Name) else None
    return said


def reading(tree: ast.AST, name: str) -> set[int]:
    """Lines that read a name or an attribute of this name."""
    return {
        node.lineno
        for node in ast.walk(tree)
        if (isinstance(node, ast.Name) and node.id == name)
        or (isinstance(node, ast.Attribute) and node.attr == name)
    }


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Results so far."""
    lines = path.read_text().splitlines() if path.exists() else []
    return [json.loads(line) for line in lines]


def interval(part: int, whole: int) -> tuple[float, float]:
    """Exact bounds of a share with 95 % (Clopper and Pearson, 1934)."""
    from scipy.special import betaincinv

    low = float(betaincinv(part, whole - part + 1, 0.025)) if part else 0.0
    return low, float(betaincinv(part + 1, whole - part, 0.975)) if part < whole else 1.0


def table(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """The outcomes by package, in Markdown, then the survivors."""
    yield "| package | mutants | killed | of them by time | survived | share killed, 95 % |"
    yield "|---|---|---|---|---|---|"
    for package in (*MEASURED, ""):
        own = [row for row in rows if row["path"].startswith(package)]
        if own:
            count = Counter(row["outcome"] for row in own)
            killed = count["killed"] + count["timeout"]
            low, high = interval(killed, len(own))
            yield (
                f"| {package or 'all'} | {len(own)} | {killed} | {count['timeout']} |"
                f" {count['survived']} | {killed / len(own):.1%} ({low:.1%} to {high:.1%}) |"
            )
    for row in rows:
        if row["outcome"] == "survived":
            yield f"\n{row['index']} {row['path']}:{row['line']} {row['operator']}"
            yield f"    {row['tests']} of {row['of']} tests of its {row['covered']}"
            yield from (
                f"    {sign} {line}" for sign, line in zip("-+", row["lines"], strict=False)
            )


def main() -> None:
    """Copy, measure, try, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=SEED, help="of the random order")
    parser.add_argument("--from", type=int, default=0, dest="first", help="first of the order")
    parser.add_argument("--number", type=int, default=500, help="how many")
    parser.add_argument("--only", nargs="+", default=(), help="files, as noisemodel/mjcf.py")
    parser.add_argument(
        "--seconds", type=float, nargs="+", default=[5.0, 40.0], help="CPU time of tests, see above"
    )
    parser.add_argument("--minutes", type=float, default=1e6, help="begin no mutant later")
    parser.add_argument("--stage", choices=("measure", "try", "chosen"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    folder = args.folder.absolute()
    if args.stage == "measure":
        return measure(folder)
    if args.stage == "chosen":
        names = json.loads((folder / "chosen.json").read_text())
        files = list(dict.fromkeys(name.split("::")[0] for name in names))
        options = (*files, "-x", *OPTIONS[1:], f"--basetemp={folder / 'tmp'}")
        sys.exit(pytest.main([*options], plugins=[Chosen(names)]))
    if args.stage == "try":
        plugin = Mutating(folder, args)
        pytest.main([*OPTIONS, f"--basetemp={folder / 'tmp'}"], plugins=[plugin])
        return None
    tree = folder / "tree"
    if not tree.exists():
        ignored = shutil.ignore_patterns(".git", ".venv", "build", "__pycache__", ".*_cache")
        shutil.copytree(ROOT, tree, ignore=ignored)
    stages = ["measure"] if not (folder / "lines.json").exists() else []
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    environment["PYTHONPATH"] = f"{tree}:{tree / 'models'}"  # the copy, not what is installed
    for stage in [*stages, "try"]:
        # Code of a mutant is never kept: its file may have the size and second of the next one's.
        environment["PYTHONDONTWRITEBYTECODE"] = "" if stage == "measure" else "1"
        command = [sys.executable, "-m", "benchmarks.mutation", *sys.argv[1:], "--stage", stage]
        command[3] = str(folder)
        with (folder / f"{stage}.log").open("w") as log:
            subprocess.run(command, cwd=tree, env=environment, stdout=log, stderr=log, check=True)
    wanted_rows = range(args.first, args.first + args.number)
    rows = [row for row in rows_of(folder / "results.jsonl") if row["index"] in wanted_rows]
    rows.sort(key=lambda row: row["index"])
    print("\n".join(table(rows)))
    return None


if __name__ == "__main__":
    main()
