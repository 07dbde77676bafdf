"""Labels while samples arrive, and the findings that they make, as for a whole run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import inf

import numpy as np

import noiseclassifier as nc
import noisemodel as nm
from inspector.library import Library
from noiseclassifier import Event, Labels
from noiseclassifier.lasting import ERROR, MEASURED
from noiseclassifier.profile import NOMINAL
from noiseclassifier.signals import NOISE
from noisemodel.types import Array, Mask

# What makes noise, in the order of the columns of a motion: where one is unknown, no label is.
NOISY = ("base_velocity", "velocity", "velocity_desired")


def noise_signals(names: Sequence[str], motion: Array, base: int, joints: int) -> dict[str, Array]:
    """Norms of a motion, and joint by joint what they are of, as `noisemodel` makes them."""
    moved = base + joints
    of_joints = {"measured": motion[:, base:moved], "desired": motion[:, moved:]}
    if any(name.startswith("error") for name in names):
        of_joints["error"] = of_joints["desired"] - of_joints["measured"]
    norms_of = {**of_joints, "measured": motion[:, :moved], NOISE: motion}
    each = {f"{name}_joints": moved_of.T for name, moved_of in of_joints.items()}
    return {name: each[name] if name in each else nm.simplified(norms_of[name]) for name in names}


class Labeller:
    """Labels frames as they become complete, or remarks why it does not."""

    def __init__(self, library: Library, rate: float, widths: Mapping[str, int]) -> None:
        self.rate, self.remark, self.model = rate, "", ""
        # Without a model there are no classes; duration of frames, from one to the next, in [s].
        self.classes, self.length, self.hop = tuple[str, ...](), 0.0, 0.0
        self._stream: nc.Stream | None = None
        self._windows: tuple[()] | tuple[nc.Lasting, nc.Bursts] = ()  # beside it
        self._samples = 0
        self._shift = 0.0  # from samples at the nominal rate to the clock of the latest ones, [s]
        self._edges: dict[float, float] = {}  # times of what lasts, by those at the nominal rate
        self._base, self._joints, desired = (widths.get(name, 0) for name in NOISY)
        kinds = ("desired", "measured", "error") if desired else ("measured",)
        there = (NOISE, *kinds, *(f"{kind}_joints" for kind in kinds))
        try:
            model, chosen = nc.nearest(library, rate, there)
        except nc.ModelsError as error:
            self.remark = f"No labels: {error}."
            return
        if abs(rate / chosen.rate - 1.0) > NOMINAL:
            rates = f"samples come at {rate:g} Hz, the nearest model takes {chosen.rate:g} Hz"
            self.remark = f"No labels: {rates}; only files are decimated."
            return
        self.model, self.classes, self.length = model, chosen.classes, chosen.profile.duration
        self.hop = chosen.profile.hop / rate
        followed = [name for name in there if name in (MEASURED, ERROR)]
        self._names = tuple(dict.fromkeys((*followed, *chosen.profile.signals)))
        self._stream = nc.Stream(chosen, rate=rate, joints=self._joints)
        self._windows = nc.Lasting(rate), nc.Bursts(rate)

    def push(self, motion: Array, valid: Mask, end: float) -> Labels | None:
        """Take a motion, shape (samples, columns), that ends at a time; labels now complete."""
        self._samples += len(motion)
        self._shift = end - self._samples / self.rate
        if self._stream is None:
            return None
        signals = noise_signals(self._names, motion, self._base, self._joints)
        for each in self._windows:
            each.push(signals, valid)
        labels = self._stream.push(signals, valid)
        if not len(labels):
            return None
        return replace(labels, start=labels.start + self._shift, stop=labels.stop + self._shift)

    @property
    def lasting(self) -> tuple[Event, ...]:
        """What lasts, and bursts, so far."""
        found = [event for each in self._windows for event in each.events]
        edges = {time for event in found for time in (event.start, event.stop)}
        # An edge keeps the time that it had when it came, since true rates are seldom nominal.
        self._edges = {time: self._edges.get(time, time + self._shift) for time in edges}
        at = self._edges
        return tuple(replace(each, start=at[each.start], stop=at[each.stop]) for each in found)

    @property
    def decided(self) -> float:
        """Time before which nothing begins any more that lasts."""
        return self._windows[0].decided + self._shift if self._windows else inf

    def finish(self) -> None:
        """End the signal."""
        for each in self._windows:
            each.finish()

    def skip(self, samples: int) -> None:
        """Pass over samples that were lost."""
        self._samples += samples
        if self._stream is not None:
            for each in (self._stream, *self._windows):
                each.skip(samples)


SETTLED = 3  # hops after the start of an event until its class is known apart from its edge's


class Findings:
    """Collects labels, and keeps of them what may still become part of an event.

    A finding is decided when a frame begins after it. Memory grows with events and
    with the stretch that lasts, not with time.
    """

    def __init__(self) -> None:
        self._closed: list[Event] = []
        self._open: Labels | None = None
        self._quiet = True  # whether all frames that are kept are `ok`, as most often

    def add(self, labels: Labels) -> None:
        """Take the labels of the next frames."""
        waiting = labels if self._open is None else Labels.concatenated((self._open, labels))
        quiet = waiting.label == "ok"
        # How far the frames reach that are not `ok`; those that it touches join them.
        reached = np.maximum.accumulate(np.where(quiet, -inf, waiting.stop))
        apart = np.flatnonzero(quiet & (waiting.start > np.append(-inf, reached[:-1])))
        # The frame that is `ok` belongs to both parts: neither ends where the signal goes on.
        last = int(apart[-1]) if len(apart) else 0
        if not quiet[:last].all():  # most often all of it is `ok`, and a label must not wait
            self._closed += waiting.part(slice(last + 1)).events()
        self._open, self._quiet = waiting.part(slice(last, None)), bool(quiet[last:].all())

    @property
    def decided(self) -> float:
        """Time at which the earliest frame starts whose event may still change, in [s]."""
        return -inf if self._open is None else float(self._open.start[0])

    @property
    def confirmed(self) -> tuple[Event, ...]:
        """The events that will not vanish, whatever comes: as if an `ok` frame came next."""
        if self._open is None or self._quiet:
            return tuple(self._closed)
        last = self._open.part(slice(-1, None))
        quiet = replace(last, label=np.full_like(last.label, "ok"))
        return (*self._closed, *Labels.concatenated((self._open, quiet)).events())

    @property
    def events(self) -> tuple[Event, ...]:
        """The events so far, as if the signal ended here."""
        waiting = () if self._open is None or self._quiet else self._open.events()
        return (*self._closed, *waiting)


class News:
    """Tells of each event twice: when it is there, and when it is over.

    The frames at the edges of a failure often look like another one: an event is told of when
    frames stop a time ``wait`` after its start, in [s]. What it is called may still change:
    `unknown` frames take the class of a failure that follows. Such an event is told of again under
    its new name, and only that ends.
    """

    def __init__(self, tell: Callable[[Event, bool], None], wait: float = 0.0) -> None:
        self._tell, self._wait = tell, wait
        self._begun: dict[str, float] = {}  # stop of the latest event of each class
        self._ended: dict[str, float] = {}

    def update(self, events: Sequence[Event], decided: float, now: float = inf) -> None:
        """Tell of what is new when the latest frame stops.

        An event that stops before the time up to which all is ``decided`` is over, since what
        continues it would begin before its end.
        """
        for event in events:
            begun, over = self._begun.get(event.label, -inf), event.stop < decided
            early = event.start + self._wait > now and not over
            if early or event.stop <= self._ended.get(event.label, -inf):
                continue
            if begun < event.start:  # otherwise it continues one of its class
                self._tell(event, False)
            self._begun[event.label] = max(event.stop, begun)
            if over:
                self._ended[event.label] = event.stop
                self._tell(event, True)
