"""The runs of two folders that belong together: scenarios with repetitions on both sides."""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from inspector.errors import InspectorError
from inspector.logs.read import logs_in
from inspector.regression.measure import Measured
from noisemodel.atomic import also_reading

REPETITION = re.compile(r"(?P<name>.+?)[-_.](?:run|rep|take|seed)?[-_.]?(?P<number>\d+)")
"""Name of a file that is one of several: ``walk-1``, ``walk_run2``, ``walk-seed-003``."""


class PairingError(InspectorError):
    """Two folders whose runs cannot be paired."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """The runs of one scenario on both sides.

    Attributes:
        name: Its name.
        reference: The runs before the change, by repetition.
        candidate: The runs after it.
        paired: Whether the repetitions are pairs of one seed, in one order.
    """

    name: str
    reference: tuple[Measured, ...]
    candidate: tuple[Measured, ...]
    paired: bool


@dataclass(frozen=True, eq=False)
class Pairing:
    """Scenarios that both sides have, and what is left over.

    Attributes:
        by: "scenario and seed" or "file name".
        scenarios: In order of their names.
        missing: Runs of scenarios that only the reference has.
        added: Runs of scenarios that only the candidate has.
    """

    by: str
    scenarios: tuple[Scenario, ...]
    missing: tuple[Measured, ...] = ()
    added: tuple[Measured, ...] = ()


def files_in(path: Path) -> tuple[Path, ...]:
    """List the runs and logs of a folder, however deep, in order; a file is itself.

    Raises:
        PairingError: If there is no such path.
        LogError: If the folder holds no log.
    """
    if not path.exists():
        raise PairingError(f"{path}: no such file or folder")
    logs = logs_in(path)[0]
    also_reading(logs)
    return logs


def paired(
    reference: Sequence[Measured], candidate: Sequence[Measured], roots: tuple[Path, Path]
) -> Pairing:
    """Put the runs of two folders together by scenario.

    By scenario and seed of their meta if all runs have both, none twice on one side, and the sides
    share a scenario; otherwise by the path below the folder, files that differ in a number at the
    end being repetitions. Two files that are named themselves are a pair.

    Args:
        reference: The runs before the change.
        candidate: The runs after it.
        roots: The two folders that they are of.

    Returns:
        The pairing.

    Raises:
        PairingError: If the sides share no scenario, or two runs of a side have one name.
    """
    sides = (reference, candidate)
    if all(run.scenario and run.seed is not None for side in sides for run in side):
        keys = [{_key(run): run for run in side} for side in sides]
        shared = {name for name, _ in keys[0]} & {name for name, _ in keys[1]}
        unique = all(len(key) == len(side) for key, side in zip(keys, sides, strict=True))
        if unique and shared:
            return _pairing("scenario and seed", keys[0], keys[1], seeds=True)
    if all(len(side) == 1 for side in sides) and (reference[0].path, candidate[0].path) == roots:
        alone = Scenario(candidate[0].path.stem, tuple(reference), tuple(candidate), paired=False)
        return Pairing("file name", (alone,))  # as they were named
    named = [_by_name(side, root) for side, root in zip(sides, roots, strict=True)]
    found = _pairing("file name", named[0], named[1], seeds=False)
    if not found.scenarios:
        raise PairingError(
            f"{roots[0]} and {roots[1]} have no run in common, neither by scenario and seed nor by"
            f" file name ({_examples(named[0])} and {_examples(named[1])})"
        )
    return found


def repetitions(
    name: str, reference: Sequence[Measured], candidate: Sequence[Measured]
) -> Scenario:
    """Take all runs of both sides as one scenario; pairs if each side has the same seeds once."""
    before, after = ({run.seed: run for run in side} for side in (reference, candidate))
    seeds = sorted(seed for seed in before if seed is not None)
    twins = before.keys() == after.keys() == set(seeds)
    if twins and len(seeds) == len(reference) == len(candidate):
        ours, others = (tuple(side[seed] for seed in seeds) for side in (before, after))
        return Scenario(name, ours, others, paired=True)
    return Scenario(name, tuple(reference), tuple(candidate), paired=False)


def _key(run: Measured) -> tuple[str, str]:
    robot = Path(run.robot).stem
    return f"{robot} {run.scenario}".strip(), f"{run.seed:09d}"


def _by_name(runs: Sequence[Measured], root: Path) -> dict[tuple[str, str], Measured]:
    """Runs by the name of their scenario and their repetition."""
    found: dict[tuple[str, str], Measured] = {}
    for run in runs:
        inside = run.path.relative_to(root) if run.path != root else Path(root.name)
        name = inside.with_suffix("").as_posix()
        match = REPETITION.fullmatch(name)
        key = (match["name"], match["number"]) if match else (name, "")
        if key in found:
            raise PairingError(f"{found[key].path} and {run.path} are two runs of one name")
        found[key] = run
    return found


def _pairing(
    by: str,
    reference: Mapping[tuple[str, str], Measured],
    candidate: Mapping[tuple[str, str], Measured],
    *,
    seeds: bool,
) -> Pairing:
    ours, others = _scenarios(candidate), _scenarios(reference)
    scenarios = []
    for name in sorted(ours.keys() & others.keys()):
        before, after = others[name], ours[name]
        scenarios.append(
            Scenario(
                name,
                tuple(before[key] for key in sorted(before)),
                tuple(after[key] for key in sorted(after)),
                paired=seeds and before.keys() == after.keys(),
            )
        )
    missing, added = (
        tuple(run for name in sorted(side.keys() - other.keys()) for run in side[name].values())
        for side, other in ((others, ours), (ours, others))
    )
    return Pairing(by, tuple(scenarios), missing, added)


def _scenarios(runs: Mapping[tuple[str, str], Measured]) -> dict[str, dict[str, Measured]]:
    found: dict[str, dict[str, Measured]] = defaultdict(dict)
    for (name, repetition), run in runs.items():
        found[name][repetition] = run
    return found


def _examples(runs: Mapping[tuple[str, str], Measured]) -> str:
    names = list(_names(runs))
    return ", ".join(names[:3]) + (", …" if len(names) > 3 else "")


def _names(runs: Mapping[tuple[str, str], Measured]) -> Iterator[str]:
    yield from sorted(_scenarios(runs))
