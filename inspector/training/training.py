"""Classifiers trained on annotated runs, from files."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import noiseclassifier as nc
from inspector.errors import InspectorError, OptionError
from inspector.progress import progress
from inspector.training.part import Part
from inspector.training.recordings import Simulators, classified, count
from noiseclassifier.logbands import LOWEST
from noisemodel.atomic import refuse_existing

ANY_RATE = "general"
"""The profile of a model for any rate."""
RATE = 10_000.0
"""Rate of a model of one rate unless another is given, in [Hz]."""
THIN = 8
"""A general model learns from every so many `ok` frames of a log."""

PROFILES: dict[str, Callable[[float], nc.Profile]] = {
    "joints": lambda rate: nc.EACH.at(rate),
    "norms": lambda rate: nc.GENERAL.at(rate),
    "scalar": lambda rate: nc.SCALAR.at(rate),
    "logbands": lambda rate: nc.LogBands().at(rate),
    "noisytest-rbf": lambda _: nc.Profile.noisytest("rbf"),
    "noisytest-linear": lambda _: nc.Profile.noisytest("linear"),
    "paper-rbf": lambda _: nc.Profile.paper("rbf"),
    "paper-linear": lambda _: nc.Profile.paper("linear"),
}
"""Profiles by name, at a rate in [Hz]."""

LACKING = {
    "measured": "without measured velocities",
    "desired": "without desired velocities",
    "error": "without tracking errors",
}
"""Why a run is left out, by the first signal that it lacks."""


@dataclass(frozen=True)
class LeftOut:
    """Runs that a profile cannot be trained on.

    Attributes:
        runs: Their names, by reason.
    """

    runs: dict[str, list[str]] = field(default_factory=dict)

    def without(
        self, found: Iterable[nc.Recording | nc.Unanswered], profile: nc.Profile
    ) -> Iterator[nc.Recording]:
        """Recordings that have all signals of a profile, at its rate; notes the others.

        Args:
            found: Recordings at the profile's rate, and runs below it.
            profile: What is to be trained.
        """
        for each in found:
            if reason := lacking(each, profile):
                self.runs.setdefault(reason, []).append(each.name)
            elif isinstance(each, nc.Recording):
                yield each

    def __str__(self) -> str:
        if not self.runs:
            return "no run was left out"
        counts = [f"{len(names)} {reason}" for reason, names in self.runs.items()]
        first = next(iter(self.runs.values()))
        counts[0] = counts[0].replace(" ", " run " if len(first) == 1 else " runs ", 1)
        return f"left out: {', '.join(counts)}, e.g. {first[0]}"


@dataclass(frozen=True)
class Trained:
    """What training has to say.

    Attributes:
        evaluation: Measures of the model on its own training frames.
        left_out: Runs that it was not trained on.
    """

    evaluation: nc.Evaluation
    left_out: LeftOut

    def __str__(self) -> str:
        return f"{self.evaluation}\n{self.left_out}"


def train(
    inputs: Sequence[Path],
    profile: str,
    rate: float | None,
    output: Path,
    *,
    part: Part = Part.ALL,
    overwrite: bool = False,
) -> Trained:
    """Train a model and write it.

    Runs below the rate, those that lack a signal of the profile, and those without an annotation
    are left out; a desired velocity that is a placeholder is none, as in `inspector classify`.

    Args:
        inputs: Annotated run files, folders of them, or NoisyTest folders.
        profile: ``ANY_RATE``, or one of ``PROFILES``.
        rate: Rate of a model of one rate, in [Hz], to which faster runs are decimated; None for
            ``RATE``. A general model takes each run at its own.
        output: The model file to write.
        part: The part of the recordings to train on.
        overwrite: Whether a file that exists may be replaced.

    Returns:
        The measures of the model on its own training frames, and the runs that were left out.

    Raises:
        InspectorError: If there is no such profile, it does not exist at this rate, or all runs
            are left out.
        OutputError: If the file exists or cannot be written.
    """
    if profile == ANY_RATE:
        if rate is not None:
            raise OptionError(f"profile {profile} is for any rate; leave out --rate {rate:g}")
        return _train_general(inputs, output, part=part, overwrite=overwrite)
    rate = RATE if rate is None else rate
    chosen = profile_at(profile, rate)
    refuse_existing(output, overwrite=overwrite)
    left_out, simulators = LeftOut(), Simulators()
    read = progress(classified(inputs, rate, part, bare_too=True), "read", total=count(inputs))
    try:
        usable = left_out.without((recording for recording, _ in read), chosen)
        examples = nc.Examples.read(simulators.noting(usable), chosen)
    except nc.NoFrameError as error:
        if error.count or not left_out.runs:
            raise
        scalar = set(LACKING.values()) & left_out.runs.keys()
        hint = "; --profile scalar takes the noise alone" if scalar else ""
        raise InspectorError(f"no run to train {profile} on; {left_out}{hint}") from error
    classifier = simulators.signed(nc.Classifier.train(examples, chosen))
    classifier.save(output, overwrite=overwrite)
    predicted = classifier.predict_features(examples.features)
    evaluation = nc.Evaluation.of(examples.labels, predicted, classifier.classes)
    return Trained(evaluation, left_out)


def _train_general(inputs: Sequence[Path], output: Path, *, part: Part, overwrite: bool) -> Trained:
    """Train a general model and write it, see `train`."""
    refuse_existing(output, overwrite=overwrite)
    left_out, simulators = LeftOut(), Simulators()
    slowest = nc.ANY.bound(LOWEST, (nc.NOISE,))
    read = progress(classified(inputs, None, part, bare_too=True), "read", total=count(inputs))
    usable = left_out.without((recording for recording, _ in read), slowest)
    parts = list(nc.frames_of(simulators.noting(usable), nc.ANY, thin=THIN))
    if not parts:
        raise InspectorError(f"no run to train {ANY_RATE} on; {left_out}")
    frames = nc.Frames.joined(parts)
    model = simulators.signed(nc.General.train(frames, nc.ANY, thin=THIN))
    model.save(output, overwrite=overwrite)
    return Trained(model.evaluate(frames), left_out)


def profile_at(name: str, rate: float) -> nc.Profile:
    """A profile by its name.

    Args:
        name: One of ``PROFILES``.
        rate: The rate that it is to have, in [Hz].

    Raises:
        OptionError: If there is no such profile, or it does not exist at this rate.
    """
    if name not in PROFILES:
        raise OptionError(
            f"no profile {name!r} of one rate; there are {', '.join(PROFILES)}, and {ANY_RATE} for"
            " any rate"
        )
    found = PROFILES[name](rate)
    if found.rate != rate:
        raise OptionError(f"profile {name} exists at {found.rate:g} Hz only, not {rate:g}")
    return found


def lacking(each: nc.Recording | nc.Unanswered, profile: nc.Profile) -> str:
    """Why a profile cannot be trained on a run, in a few words; empty if it can."""
    if isinstance(each, nc.Unanswered):
        return f"below {profile.rate:g} Hz"
    if not each.blocks:
        return "without annotated blocks"
    there = nc.signals.named(each.signal)
    if nc.signals.feeds(there, profile.signals):
        return ""
    gone = [name for name in profile.signals if name not in there]
    return next((LACKING[name] for name in gone if name in LACKING), "without joints")
