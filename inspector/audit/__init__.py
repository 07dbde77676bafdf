"""Audit of a log: gaps, bandwidth, warnings, and which failure classes it can show.

A class is observable if all of its band is. It is partly if two of the model's bands are, as fewer
are no spectrum, or if some are at the quantisation floor, which a failure must exceed. The limits:

- *Its band.* The paper puts oscillations at 20 to 1000 Hz. Impacts and high accelerations are short
  and broad: they take the model's band, from its first band to its last.
- *The model.* A run is labelled by the general model at the rate of its values, or by the model of
  the nearest rate at or below. Below all models, and outside of its bands, nothing is observable.
- *The log.* Its bandwidth: the Nyquist frequency, or less with a zero-order hold, differentiation
  or a filter. It needs a frame (the paper's 0.4 s) that touches no gap.
"""

import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np

import noiseclassifier as nc
from inspector.audit.signals import Bandwidth, bandwidth, copies, placeholder, unit_warnings
from inspector.errors import InspectorError, without_path
from inspector.library import Library, signal_names
from inspector.logs.clocks import without_hold
from inspector.logs.mapping import check_joints
from inspector.logs.motion import limit_warnings
from inspector.logs.read import Reading, Source, open_source
from inspector.text import counted, plain
from noiseclassifier import Profile
from noiseclassifier.lasting import SHORTEST
from noiseclassifier.profile import FEWEST, HIGHEST, LOWEST
from noisemodel import NoiseModelError, Run
from noisemodel.hold import hold_length
from noisemodel.run import part
from noisemodel.runfile import pieces
from noisemodel.types import Array, Mask

LONGEST = 60_000  # samples of an excerpt: a minute at 1 kHz
OSCILLATIONS = (20.0, 1000.0)  # the paper's band of them (scenarios 11 to 19), in [Hz]
# What the reason begins with where a class is observable in all of its band, if it is loud.
MASKED = "quantisation masks amplitudes"


class Observability(StrEnum):
    """Degrees to which a class is observable."""

    OBSERVABLE = "observable"
    PARTLY = "partly"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True)
class ClassObservability:
    """Observability of one failure class."""

    label: str
    observability: Observability
    low: float = 0.0  # lowest frequency at which it is observable, in [Hz]; 0 if there is none
    high: float = 0.0  # highest frequency at which it is observable, in [Hz]; 0 if there is none
    needed: float | None = None  # rate that shows all of it, or any, in [Hz]; None if none would
    reason: str = ""  # cause of the limit, a clause; empty for what is observable

    def __str__(self) -> str:
        """Format as a line."""
        band = f", {plain(self.low)} to {plain(self.high, 4)} Hz" if self.high else ""
        reason = f": {self.reason}" if self.reason else ""
        needed = f"; needs {self.needed:g} Hz" if self.needed else ""
        return f"{self.label}: {self.observability}{band}{reason}{needed}"


def observable_classes(
    bandwidth: Bandwidth, valid: Mask, library: Library, signals: Collection[str], *, rate: float
) -> tuple[ClassObservability, ...]:
    """Determine the observability of each failure class."""
    logged, lowest = 2 * bandwidth.nyquist, None
    try:
        name, chosen = nc.nearest(library, rate, signals, logged=logged)
    except nc.ModelsError as error:
        models = library.values()
        known = [each.recipe if isinstance(each, nc.General) else each.profile for each in models]
        labels = dict.fromkeys(name for each in known for name in each.classes if name != "ok")
        reason = str(error)
        if not isinstance(error, nc.MissingSignalError):
            rates = [LOWEST if isinstance(each, nc.LogBands) else each.rate for each in known]
            lowest = min(rates, default=None)
            reason = f"{rate:g} Hz is below the rate of every model"
    else:
        labels = dict.fromkeys(name for name in chosen.classes if name != "ok")
        profile = chosen.profile
        gaps = np.flatnonzero(np.concatenate(([True], ~valid, [True])))
        needed = max(profile.duration, SHORTEST)
        reason = f"no stretch of {needed:g} s without a gap"
        if np.diff(gaps).max() - 1 >= needed * logged * (1 - 1e-3):
            general = isinstance(library[name], nc.General)
            return tuple(
                _observability(label, bandwidth, profile, library, general=general)
                for label in labels
            )
    unseen = Observability.CANNOT_TELL
    return tuple(ClassObservability(each, unseen, needed=lowest, reason=reason) for each in labels)


def _observability(
    label: str, bandwidth: Bandwidth, profile: Profile, library: Library, *, general: bool
) -> ClassObservability:
    edges, whole = band_edges(profile), bandwidth.usable >= bandwidth.nyquist
    wanted = OSCILLATIONS if label == "oscillations" else (edges[0], edges[-1])
    low, high = max(wanted[0], edges[0]), min(wanted[1], edges[-1], bandwidth.usable)
    degree, needed, reason = Observability.PARTLY, None, bandwidth.limit
    if np.sum((edges[:-1] < high) & (edges[1:] <= high) & (edges[1:] > low)) < FEWEST:
        degree = Observability.CANNOT_TELL
        needed = _rate_for(low, library) if whole else None
        low = high = 0.0
    elif high < wanted[1]:
        # A general model has the bands that the log has.
        if edges[-1] <= bandwidth.usable and not general:
            reason = f"the model of {profile.rate:g} Hz ends there"
        rate = _rate_for(wanted[1], library)
        needed = rate if whole and rate > 2 * bandwidth.nyquist else None
    elif bandwidth.floor_from is not None and bandwidth.floor_from < high:
        floor, above = bandwidth.floor_amplitude, plain(bandwidth.floor_from)
        reason = f"{MASKED} below {floor:.2g} rad/s above {above} Hz"
    else:
        degree, reason = Observability.OBSERVABLE, ""
    return ClassObservability(label, degree, low, high, needed, reason)


def band_edges(profile: Profile) -> Array:
    """Edges of the frequency bands of a profile, shape (edges,), in [Hz]."""
    if profile.bands == "log":
        return np.array(profile.edges)
    # Bin 0 is the mean; the first after it is the paper's f_min (Sec. III-A).
    bin_width = profile.rate / profile.window
    return np.arange(1.0, profile.bins, 3.0) * bin_width


def _rate_for(frequency: float, library: Library) -> float:
    """Lowest rate at which a model has a band up to a frequency; without one, twice the latter."""
    reaching = []
    for model in library.values():
        if isinstance(model, nc.General):
            edges = band_edges(model.recipe.at(HIGHEST))
            # A band is there from twice its upper edge on.
            above = edges[edges >= frequency]
            reaching += [max(LOWEST, float(np.ceil(2 * each))) for each in above[:1]]
        elif band_edges(model.profile)[-1] >= frequency:
            reaching.append(model.rate)
    return min(reaching, default=2 * frequency)


@dataclass(frozen=True)
class Gaps:
    """Gaps of a run."""

    count: int = 0
    total: float = 0.0  # their total duration, in [s]
    longest: float = 0.0  # duration of the longest, in [s]

    def __str__(self) -> str:
        """Format as a clause."""
        if not self.count:
            return "no gaps"
        lasts = f"{self.total:.3g} s in all, {self.longest:.3g} s the longest"
        return f"{counted(self.count, 'gap')}, {lasts}"


@dataclass(frozen=True)
class Audit:
    """Rate, gaps, bandwidth and observable classes of a run."""

    rate: float  # sample rate, in [Hz]
    duration: float  # in [s]
    joints: int
    # Deviation of the logged stamps' steps, RMS and largest, in [s]; None if ``meta`` has none.
    jitter: tuple[float, float] | None
    gaps: Gaps
    bandwidth: Bandwidth
    warnings: tuple[str, ...]  # signs of wrong units, copies, holds or filters; a clause each
    notes: tuple[str, ...]  # differentiation, quantisation, missing signals; a clause each
    classes: tuple[ClassObservability, ...]

    @property
    def observable(self) -> bool:
        """Whether a failure class is observable, at least partly."""
        return any(each.observability is not Observability.CANNOT_TELL for each in self.classes)


def audit(run: Run, library: Mapping[str, nc.Model], *, slower: Run | None = None) -> Audit:
    """Audit a run: gaps are counted in all of it, signals are examined in an excerpt."""
    check_joints(run.joint_names, run.robot)
    check_joints(run.desired_joint_names, run.robot)
    part, rate = excerpt(run), (slower or without_hold(run)).rate
    reach = bandwidth(part)
    edges = np.flatnonzero(np.diff(np.concatenate(([True], run.mask, [True]))))
    lengths = np.diff(edges)[::2] / run.rate  # of its gaps
    jitter = None
    match run.meta.get("jitter"):
        case {"rms": float(rms), "max": float(largest)}:
            jitter = rms, largest
    return Audit(
        rate=run.rate,
        duration=run.duration,
        joints=len(run.joint_names),
        jitter=jitter,
        gaps=Gaps(len(lengths), float(lengths.sum()), float(lengths.max(initial=0.0))),
        bandwidth=reach,
        warnings=(*_warnings(part, reach), *limit_warnings(run)),
        notes=tuple(_notes(part, reach)),
        classes=observable_classes(reach, run.mask, library, signal_names(part), rate=rate),
    )


def _warnings(run: Run, reach: Bandwidth) -> Iterator[str]:
    yield from unit_warnings(run)
    if clause := placeholder(run):
        yield f"{clause}: it is left out"
    for copy in copies(run):
        whose = "all joints" if len(copy.joints) == len(run.joint_names) else ", ".join(copy.joints)
        samples = counted(abs(copy.lag), "sample")
        when = f", {samples} {'later' if copy.lag > 0 else 'earlier'}" if copy.lag else ""
        yield f"measured {copy.signal} of {whose} is the desired one{when}: one is a copy"
    if reach.hold > 1:
        held = f"measured values have a zero-order hold of {reach.hold:.3g} samples"
        yield f"{held}: they come at {plain(run.rate / reach.hold, 4)} Hz"
    if reach.corner:
        yield f"velocities look filtered from {plain(reach.corner)} Hz on"


def _notes(run: Run, reach: Bandwidth) -> Iterator[str]:
    if reach.differentiator:
        corner = plain(reach.limits["velocities were differentiated"])
        method = f"differentiated positions ({reach.differentiator.name})"
        yield f"velocities are {method}, attenuated above {corner} Hz"
    if run.velocity_desired is None:
        yield "there is no desired motion"
    elif (hold := hold_length(run.velocity_desired, run.mask)) > 1:
        rate = plain(run.rate / hold, 4)
        yield f"desired velocities have a zero-order hold of {hold:.3g} samples ({rate} Hz)"
    if reach.floor_from is not None:
        step = f"step {reach.step:.2g} {'rad' if reach.differentiator else 'rad/s'}"
        masked = f"masks oscillations up to {reach.floor_amplitude:.2g} rad/s"
        yield f"above {plain(reach.floor_from)} Hz the quantisation ({step}) {masked}"
    elif reach.quiet_from is not None:
        quiet = "the level is below any encoder's noise: filtered or simulated"
        yield f"above {plain(reach.quiet_from)} Hz {quiet}"


def excerpt(run: Run) -> Run:
    """Cut out the part of a run around its fastest motion, which limits the cost of long runs."""
    if len(run.time) <= LONGEST:
        return run
    velocities = (run.velocity[rows] for rows in pieces(run.velocity))
    squares = np.concatenate([np.einsum("sj,sj->s", each, each) for each in velocities])
    fastest = int(np.where(run.mask, squares, -1.0).argmax())
    start = min(max(0, fastest - LONGEST // 2), len(run.time) - LONGEST)
    nothing: dict[str, Any] = dict.fromkeys(("effort", "base_pose", "base_velocity"))
    return part(run, start, start + LONGEST, **nothing, stages={})


# As text and JSON

ROUNDING = 1e-9  # deviation of a stamp that is rounding, in [s]: stamps have nanoseconds at best


def text(name: str, audit: Audit, assumed: str = "") -> str:
    """An audit as text."""
    off = "stamps are uniform"
    if audit.jitter and audit.jitter[1] >= ROUNDING:
        rms, largest = (1e3 * value for value in audit.jitter)
        off = f"stamps were off by {rms:.3g} ms rms, {largest:.3g} ms at most"
    lines = [
        *([assumed] if assumed else []),
        f"rate: {audit.rate:g} Hz, {off}",
        f"missing: {audit.gaps}",
        f"bandwidth: up to {plain(audit.bandwidth.usable, 4)} Hz ({audit.bandwidth.limit})",
        *(f"warning: {warning}" for warning in audit.warnings),
        *(f"note: {note}" for note in audit.notes),
        *map(str, audit.classes),
    ]
    head = f"{name}: {audit.duration:.2f} s, {counted(audit.joints, 'joint')}"
    return "\n  ".join([head, *lines])


def summary(audit: Audit, *, classes: bool = True) -> tuple[str, ...]:
    """Write the one or two lines that a report has for an audit: classes, then warnings."""
    lines, limited = [], dict[tuple[str, str], list[str]]()
    for each in audit.classes if classes else ():
        if each.observability is not Observability.OBSERVABLE:
            limited.setdefault(_limit(each, audit.bandwidth), []).append(each.label)
    clauses = [f"{lead}{_and(labels)} {rest}" for (lead, rest), labels in limited.items()]
    if classes and audit.classes:
        shown = _and([each.label for each in audit.classes])
        sentence = "; ".join(clauses) or f"the log can show {shown}"
        lines.append(f"{sentence[0].upper()}{sentence[1:]}.")
    if warnings := "; ".join(audit.warnings):
        lines.append(f"Warnings: {warnings}{'' if warnings.endswith('?') else '.'}")
    return tuple(lines)


def shortcomings(audit: Audit) -> tuple[str, ...]:
    """Write the summary of an audit, and nothing without warnings or limits."""
    limited = any(each.observability is not Observability.OBSERVABLE for each in audit.classes)
    return summary(audit) if audit.warnings or limited else ()


def as_json(found: Mapping[str, tuple[Audit, str]], failed: Mapping[str, str]) -> str:
    """Write audits as ``noise-audit/2``."""
    runs: list[dict[str, Any]] = []
    for name, (audit, assumed) in found.items():
        reach, jitter = audit.bandwidth, audit.jitter
        bandwidth = {
            "usable": reach.usable,
            "limit": reach.limit,
            "zero_order_hold": reach.hold,
            "differentiated": reach.differentiator.name if reach.differentiator else None,
            "filtered_from": reach.corner,
            "quantisation_step": reach.step,
            "quantisation_floor_from": reach.floor_from,
            "quiet_from": reach.quiet_from,
        }
        off = jitter and dict(zip(("rms", "max"), jitter, strict=True))
        told = asdict(audit) | {"jitter": off, "bandwidth": bandwidth}
        runs.append({"run": name, **told, "assumed": assumed})
    runs += [{"run": name, "message": message} for name, message in failed.items()]
    return json.dumps({"format": "noise-audit/2", "runs": runs}, indent=2)


def _limit(each: ClassObservability, reach: Bandwidth) -> tuple[str, str]:
    """What cannot be seen of a class: the words before and after its name."""
    needed = f"requires {each.needed:g} Hz" if each.needed else ""
    if each.observability is Observability.CANNOT_TELL:
        return "", f"cannot be observed ({each.reason}{needed and f'; {needed}'})"
    if each.reason.startswith(MASKED):
        return "", f"only from {plain(each.low)} to {plain(each.high, 4)} Hz ({each.reason})"
    above = f"above {plain(each.high, 4)} Hz cannot be seen"
    if each.reason == reach.limit and reach.usable == reach.nyquist / reach.hold:
        return f"at {plain(2 * reach.usable, 4)} Hz, ", above
    return "", f"{above} ({each.reason}{needed and f'; all of it {needed}'})"


def _and(words: list[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if words[1:] else words)


# Of files


def audit_all(
    runs: Iterable[Source], library: Library, reading: Reading
) -> tuple[dict[str, tuple[Audit, str]], dict[str, str]]:
    """Audit all runs of many files; one bad file never stops the rest.

    Audits come with what was assumed when the log was read; other files with why they cannot be.
    """
    found, failed = dict[str, tuple[Audit, str]](), dict[str, str]()
    for source in runs:
        name = str(source.shown)
        try:
            opened = open_source(source, reading)
            found[name] = audit(opened.run, library), opened.assumed
        except (InspectorError, NoiseModelError) as error:
            failed[name] = without_path(error, source.path)
    return found, failed
