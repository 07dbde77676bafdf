"""The demo run and the models: those that ship, the one for a run, and what it labels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import noiseclassifier as nc
import noisemodel as nm
from inspector.errors import InspectorError
from inspector.logs.clocks import without_hold
from noiseclassifier.profile import NOMINAL
from noisemodel.files import also_reading
from noisemodel.noise import in_both
from noisemodel.run import pieces_of
from noisemodel.types import Real

Library = Mapping[str, nc.Model]  # models by name
Events = tuple[nc.Event, ...]
HERE = Path(__file__).parent
# In an installed wheel, and in a checkout.
FOLDERS = (HERE / "assets", HERE.parent / "assets", HERE.parent)


class CannotTellError(InspectorError):
    """A run that no model can label."""


@dataclass(frozen=True)
class Labelled:
    """Labels of a run, and the model that gave them."""

    labels: nc.Labels  # one per frame
    model: str  # its name
    remark: str = ""  # what was done to the run before, a sentence; empty if nothing was
    alarm: float | None = None  # threshold, a probability of any failure; None without one
    lasting: Events = ()  # lines that stand out of any robot's motion
    bursts: Events = ()  # lines that the rest of the run lacks


def folder(kind: str) -> Path:
    """Find the folder of shipped "runs" or "models"."""
    for place in FOLDERS:
        if any((place / kind).glob("*.npz")):
            return place / kind
    raise InspectorError(f"this installation lacks its {kind}; install noise-inspector again")


def demo_run() -> Path:
    """The run file that ships: a simulated Panda that touches a table unexpectedly."""
    return folder("runs") / "demo.npz"


def model_files(chosen: Sequence[str | Path] | None = None) -> tuple[Path, ...]:
    """Name model files: those chosen, which may be names of models that ship, or all of these."""
    shipped = {path.stem: path for path in sorted(folder("models").glob("*.npz"))}
    given = map(Path, chosen or shipped.values())
    found = [path if path.exists() else shipped.get(str(path), path) for path in given]
    if missing := next((path for path in found if not path.exists()), None):
        raise InspectorError(
            f"{missing}: no such model; name a file, or one that ships: {', '.join(shipped)}"
        )
    also_reading(found)
    return tuple(found)


def load_library(chosen: Sequence[str | Path] | None = None) -> Library:
    """Read models, by the stems of their files.

    Args:
        chosen: Model files, or names of models that ship; all of these unless given.

    Raises:
        FileError: If a file is no model.
    """
    return {path.stem: nc.load(path) for path in model_files(chosen)}


def label_run(run: nm.Run, library: Library, *, slower: nm.Run | None = None) -> Labelled:
    """Label a run by the model of the nearest rate at or below its own whose signals it has.

    Where each value of a slower log is there several times (`clocks.without_hold`), it is labelled
    as that slower log.
    """
    slower = without_hold(run) if slower is None else slower
    try:
        name, classifier = nc.nearest(library, slower.rate, signal_names(slower), logged=run.rate)
    except nc.ModelsError as error:
        held = "" if slower is run else "measured values are held: "
        raise CannotTellError(f"{held}{error}") from error
    rate, remark = classifier.rate, ""
    if slower is not run and rate <= slower.rate * (1 + NOMINAL):
        run, remark = slower, f"Labelled at {slower.rate:g} Hz, the rate of its values."
    if abs(run.rate / rate - 1) >= NOMINAL:
        run = nm.decimated(run, rate)
        left = f"nothing above {rate / 2:g} Hz is left"
        remark = f"Labelled at {rate:g} Hz, the rate of model {name}: {left}."
    pieces = ((_signals(piece), piece.mask) for piece in pieces_of(run))
    labels = classifier.classify_pieces(pieces, run.rate, start=float(run.time[0]), whole=True)
    lasting, bursts = lines(run)
    if not (lasting.examined or len(labels.events())) and nc.lasting.MEASURED in signal_names(run):
        raise CannotTellError(
            f"no stretch of {nc.lasting.SHORTEST:g} s without a gap, as it takes to tell what lasts"
        )
    if not len(labels):
        raise CannotTellError(
            f"no stretch of {classifier.profile.duration:g} s without a gap, which model {name}"
            " requires"
        )
    novel = 0 if labels.novel is None else int(labels.novel.sum())
    if novel:
        line = f"{novel} of {len(labels)} frames are out of distribution for model {name}."
        remark = f"{remark} {line}".lstrip()
    alarm = None if labels.above_threshold is None else classifier.profile.alarm
    return Labelled(labels, name, remark, alarm, lasting.events, bursts.events)


def lines(run: nm.Run) -> tuple[nc.Lasting, nc.Bursts]:
    """What lasts in a run, and its bursts."""
    start = float(run.time[0])
    lasting = nc.Lasting(run.rate, start=start)
    bursts = nc.Bursts(run.rate, start=start, whole=True)
    for piece in pieces_of(run):
        signals = nm.by_joint(piece)
        for each in (lasting, bursts):
            each.push(signals, piece.mask)
    lasting.finish()
    return lasting, bursts


def signals_of(run: nm.Run) -> dict[str, Real]:
    """Signals that models take, without the error where the desired motion is the measured one.

    Norms have shape (samples,), velocities joint by joint (joints, samples), in [rad/s].
    """
    return nc.signals.without_zero_error(_signals(run))


def signal_names(run: nm.Run) -> tuple[str, ...]:
    """Names of the signals of a run, as `signals_of` has them."""
    errors = False  # whether the desired motion is not the measured one
    for piece in pieces_of(run, samples=4096):  # most often, the first ones differ
        if (desired := piece.velocity_desired) is None or errors:
            break
        measured, wanted = in_both(piece)
        errors = bool(np.any(desired[:, wanted] != piece.velocity[:, measured]))
    one = next(pieces_of(run, samples=1))
    return tuple(name for name in _signals(one) if errors or not name.startswith("error"))


def _signals(run: nm.Run) -> dict[str, Real]:
    return {**nm.norms(run), **nm.by_joint(run)}
