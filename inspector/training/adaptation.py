"""General models adapted to a robot by good runs of it, from files."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import noiseclassifier as nc
from inspector.errors import InspectorError
from inspector.library import load_library
from inspector.logs.opening import Reading
from inspector.training.goodruns import good_runs, without_remarks
from inspector.training.part import Part
from inspector.training.recordings import Simulators
from noiseclassifier.logbands import HIGHEST
from noiseclassifier.novelty.faults import Recall, recall
from noisemodel.atomic import refuse_existing

ITSELF = (
    "features stay relative to the run itself: the good runs differ too much to be each other's"
    " reference"
)


@dataclass(frozen=True, eq=False)
class Adapted:
    """An adapted model, and what it is worth.

    Attributes:
        learnt: The model, and its limits.
        recall: Faults put into the good runs that the general model and the adapted one find; None
            if the runs have no joints.
    """

    learnt: nc.Learnt
    recall: Recall | None

    def __str__(self) -> str:
        itself = "" if self.learnt.classifier.reference else f"{ITSELF}\n"
        without = "the runs have no joints to put faults into: recall was not measured"
        return f"{self.learnt}\n{itself}{self.recall or without}"


def adapt(
    inputs: Sequence[Path],
    output: Path,
    *,
    alarms: float = 1.0,
    model: Path | None = None,
    rate: float | None = None,
    part: Part = Part.ALL,
    overwrite: bool = False,
    reading: Reading | None = None,
    remark: Callable[[str], None] = without_remarks,
) -> Adapted:
    """Adapt a general model to a robot and write it.

    Args:
        inputs: Run files or logs of good motion, samples, folders of them, or NoisyTest folders; of
            annotated runs, only the blocks `ok` count.
        output: The model file to write.
        alarms: False-alarm budget, per hour of good motion.
        model: The general model, a file or the name of a shipped one; by default the shipped one.
        rate: Rate of the model, in [Hz], to which faster runs are decimated; by default that of
            the runs, which must be equal.
        part: The part of the recordings to learn from.
        overwrite: Whether a file that exists may be replaced.
        reading: How logs are read.
        remark: Called with a line for what was assumed of a log, or hints at another robot.

    Returns:
        The adapted model, and its measures on the good runs.

    Raises:
        InspectorError: If runs are of different rates or robots, or there is no general model.
        OutputError: If the file exists or cannot be written.
        ModelsError: If there is too little good motion.
    """
    refuse_existing(output, overwrite=overwrite)
    name, general = _general(model)

    def read(task: str, remark: Callable[[str], None] = without_remarks) -> Iterator[nc.Recording]:
        what, highest = "an adapted model", HIGHEST
        return good_runs(
            inputs,
            what,
            rate=rate,
            highest=highest,
            part=part,
            task=task,
            reading=reading,
            remark=remark,
        )

    found = read("read", remark)
    first, simulators = next(found), Simulators()
    bound = general.at(first.rate, nc.signals.named(first.signal))
    try:
        good = nc.GoodMotion.read(simulators.noting(chain([first], found)), bound.profile)
    except nc.RecordingError as error:
        hint = f"; {first.name} has it: give runs of the same signals"
        raise InspectorError(f"{error}{hint if 'no signal' in str(error) else ''}") from error
    learnt = nc.adapt(bound, good, alarms=alarms)
    learnt = replace(learnt, classifier=simulators.signed(learnt.classifier))
    measured = recall({name: bound, "adapted": learnt.classifier}, read("put faults into"), good)
    learnt.classifier.save(output, overwrite=overwrite)
    return Adapted(learnt, measured)


def _general(chosen: Path | None) -> tuple[str, nc.General]:
    """The general model of a file, or that which ships, with its name."""
    library = load_library([chosen] if chosen else [])
    for name, model in library.items():
        if isinstance(model, nc.General):
            return name, model
    raise InspectorError(
        f"{', '.join(library)}: of one rate, but only a general model can be adapted"
        " (inspector train --profile general)"
    )
