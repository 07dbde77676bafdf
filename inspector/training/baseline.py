"""Baselines trained on good runs only, from files."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import models
import noisemodel as nm
from inspector.errors import InspectorError
from inspector.progress import progress
from inspector.training.part import Part
from inspector.training.recordings import in_part, of_run, of_sample
from models.estimators.baseline import MOTION, NOISE_ALONE
from noisemodel.atomic import refuse_existing
from scenarios.sample import Sample, is_sample
from scenarios.signals import WHOLE

PROFILES: dict[str, models.LogBands] = {"general": MOTION, "scalar": NOISE_ALONE}
"""Profiles of baselines, by the names of the classifier profiles with the same signals."""


class Source(NamedTuple):
    """The properties that all good runs must share."""

    path: Path
    """The file."""
    rate: float
    """In [Hz]."""
    robot: str = ""
    """Empty if the file does not name it."""
    joints: frozenset[str] = frozenset()
    """Their names; empty if there is only a noise."""


def train(
    inputs: Sequence[Path],
    output: Path,
    *,
    alarms: float = 1.0,
    profile: str = "",
    rate: float | None = None,
    part: Part = Part.ALL,
    overwrite: bool = False,
) -> models.Learnt:
    """Train a baseline and write it.

    Args:
        inputs: Run files of good motion, samples, folders of them, or NoisyTest folders; of
            annotated runs, only the blocks `ok` count.
        output: The model file to write.
        alarms: False-alarm budget, per hour of good motion.
        profile: One of ``PROFILES``; by default the richest that the first run has the signals for.
        rate: Rate of the model, in [Hz], to which faster runs are decimated; by default that of
            the runs, which must be equal.
        part: The part of the recordings to train on.
        overwrite: Whether a file that exists may be replaced.

    Returns:
        The baseline, and its measures on the good runs.

    Raises:
        InspectorError: If runs are of different rates or robots, or there is no such profile.
        OutputError: If the file exists or cannot be written.
        ModelsError: If there is too little good motion.
    """
    if profile and profile not in PROFILES:
        raise InspectorError(f"a baseline has no profile {profile!r}; expected general or scalar")
    refuse_existing(output, overwrite=overwrite)
    files = list(_files(inputs))
    found = progress(_recordings(files, rate, part), "read", total=len(files))
    first = next(found, None)
    if first is None:
        raise InspectorError(f"no run in {', '.join(map(str, inputs))}, expected good ones")
    richest = profile or ("general" if {*MOTION.signals} <= {*_signals(first)} else "scalar")
    chosen = PROFILES[richest].at(first.rate)
    try:
        good = models.GoodMotion.read(chain([first], found), chosen)
    except models.RecordingError as error:
        hint = "; --profile scalar takes the noise alone" if "no signal" in str(error) else ""
        raise InspectorError(f"{error}{hint}") from error
    baseline = models.learn_baseline(good, chosen, alarms=alarms)
    baseline.classifier.save(output, overwrite=overwrite)
    return baseline


def _files(inputs: Sequence[Path]) -> Iterator[Path]:
    """Run files, samples, and folders of NoisyTest."""
    for path in inputs:
        if path.is_dir() and not any(path.glob("*.toml")):
            yield from sorted(path.rglob("*.npz"))
        else:
            yield path


def _recordings(
    files: Sequence[Path], rate: float | None, part: Part
) -> Iterator[models.Recording]:
    """Recordings, all of one rate and robot."""
    first: Source | None = None
    for path in files:
        for source, recording in _read(path, rate):
            if in_part(recording, part):
                first = first or source
                _check(source, first)
                yield replace(recording, signal=_signals(recording))


def _read(path: Path, rate: float | None) -> Iterator[tuple[Source, models.Recording]]:
    if path.is_dir():
        for each in models.noisytest.read_folder(path, rate=rate):
            yield Source(path / each.name, each.rate), each
    elif is_sample(path):
        own = Sample.load(path, only=WHOLE)
        wanted = rate or own.rate
        yield Source(path, wanted, own.robot), of_sample(path, wanted)
    else:
        run = nm.Run.load(path)
        wanted = rate or run.rate
        source = Source(path, wanted, run.robot or "", frozenset(run.joint_names))
        yield source, of_run(path, run, wanted)


def _check(source: Source, first: Source) -> None:
    """Refuse a recording of another rate or robot than the first."""
    if abs(source.rate / first.rate - 1) > models.profile.TOLERANCE:
        lower = min(source.rate, first.rate)
        raise InspectorError(
            f"{source.path}: recorded at {source.rate:g} Hz, {first.path} at {first.rate:g} Hz;"
            f" --rate {lower:g} decimates the faster ones"
        )
    if source.robot and first.robot and source.robot != first.robot:
        raise InspectorError(
            f"{source.path}: a run of {source.robot}, but {first.path} of {first.robot};"
            " a baseline is of one robot"
        )
    if source.joints and first.joints and source.joints != first.joints:
        differing = sorted(source.joints ^ first.joints)
        raise InspectorError(
            f"{source.path}: has other joints than {first.path} ({', '.join(differing[:3])});"
            " a baseline is of one robot"
        )


def _signals(recording: models.Recording) -> dict[str, models.types.Real]:
    """Signals by name, without the error if the desired motion is the measured one."""
    return models.signals.without_zero_error(models.signals.named(recording.signal))
