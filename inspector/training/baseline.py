"""Baselines trained on good runs only, from files."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import noiseclassifier as nc
from inspector.errors import InspectorError, OptionError
from inspector.logs.opening import Reading
from inspector.training.goodruns import good_runs, without_remarks
from inspector.training.part import Part
from inspector.training.recordings import Simulators
from noiseclassifier.estimators.baseline import MOTION, NOISE_ALONE
from noisemodel.atomic import refuse_existing

PROFILES: dict[str, nc.LogBands] = {"general": MOTION, "scalar": NOISE_ALONE}
"""Profiles of baselines, by the names of the classifier profiles with the same signals."""


def train(
    inputs: Sequence[Path],
    output: Path,
    *,
    alarms: float = 1.0,
    profile: str = "",
    rate: float | None = None,
    part: Part = Part.ALL,
    overwrite: bool = False,
    reading: Reading | None = None,
    remark: Callable[[str], None] = without_remarks,
) -> nc.Learnt:
    """Train a baseline and write it.

    Args:
        inputs: Run files or logs of good motion, samples, folders of them, or NoisyTest folders; of
            annotated runs, only the blocks `ok` count.
        output: The model file to write.
        alarms: False-alarm budget, per hour of good motion.
        profile: One of ``PROFILES``; by default the richest that the first run has the signals for.
        rate: Rate of the model, in [Hz], to which faster runs are decimated; by default that of
            the runs, which must be equal.
        part: The part of the recordings to train on.
        overwrite: Whether a file that exists may be replaced.
        reading: How logs are read.
        remark: Called with a line for what was assumed of a log, or hints at another robot.

    Returns:
        The baseline, and its measures on the good runs.

    Raises:
        InspectorError: If runs are of different rates or robots, or there is no such profile.
        OutputError: If the file exists or cannot be written.
        ModelsError: If there is too little good motion.
    """
    if profile and profile not in PROFILES:
        raise OptionError(f"a baseline has no profile {profile!r}; expected general or scalar")
    refuse_existing(output, overwrite=overwrite)
    found = good_runs(inputs, "a baseline", rate=rate, part=part, reading=reading, remark=remark)
    first, simulators = next(found), Simulators()
    there = nc.signals.named(first.signal)
    richest = profile or ("general" if {*MOTION.signals} <= {*there} else "scalar")
    chosen = PROFILES[richest].at(first.rate)
    try:
        good = nc.GoodMotion.read(simulators.noting(chain([first], found)), chosen)
    except nc.RecordingError as error:
        hint = "; --profile scalar takes the noise alone" if "no signal" in str(error) else ""
        raise InspectorError(f"{error}{hint}") from error
    learnt = nc.learn_baseline(good, chosen, alarms=alarms)
    baseline = replace(learnt, classifier=simulators.signed(learnt.classifier))
    baseline.classifier.save(output, overwrite=overwrite)
    return baseline
