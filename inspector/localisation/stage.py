"""The first stage of the control flow in which a failure shows, told from the run alone.

There is no run without the failure to hold it against. What tells where it came in is what is new
in each stage, see `inspector.localisation.innovation`. Two kinds of failures are told apart:

- A *blow or jump* comes through one stage after the other, so these are ordered by time. It is
  looked for where the news of a stage, relative to its usual peak, first rise steeply. In a stage
  it sets in where the news first exceed a fifth of their peak and twice what they were in the
  50 ms before. A stage does not show it whose peak is less than four times what was before, or
  less than a fifth of all that changes there: it passes on what the stage before it did. Nothing
  foretells the first stage, hence its peak also has to exceed by half what is usual for it, or
  the stage next to it has to answer within 3 ms. The earliest onset wins; of simultaneous ones, the
  stage that a motion passes first.
- A *lasting vibration* has gone round the loop many times, and its onset, such as the touch that
  starts a limit cycle, is not its source. It lies in the first stage that adds to it: whose news
  have a quarter or more of the excess power that those of any stage have, and more than twice
  what is usual for it.

A failure lasts if its vibration is within 6 dB of its loudest 50 ms for 0.3 s in all, of the first
second. What shows no onset is treated as if it lasted.
"""

from dataclasses import dataclass

import numpy as np

from inspector.localisation import onset
from inspector.localisation.flow import Flow, flow
from inspector.localisation.innovation import WARM, News, Usual
from models import Event
from noisemodel import Block, Run
from noisemodel.types import Array

EARLY = 0.015
"""How long before its start a failure may have set in, in [s]."""
BEFORE, AFTER = 0.1 + WARM, 0.05
"""What is looked at around a failure, in [s]."""
LONGEST = 1.0
"""What is looked at of a failure, in [s]."""
BIN = 0.05
"""Time over which a vibration's power is taken, in [s]."""
LOUD = 0.25
"""Share of the loudest bin's power from which a bin counts: 6 dB less."""
LASTING = 0.3
"""Loud time of a lasting vibration, in [s]."""
PASSED_ON = 0.2
"""Share of a stage's change that has to be new."""
UNHEARD = 1.5
"""How far the first stage has to exceed its usual peak."""
ANSWERED = 0.003
"""Time within which the second stage else has to answer the first, in [s]."""
ADDS = 0.25
"""Share of the largest addition from which a stage counts as adding."""
MORE = 2.0
"""How far the power of a stage that adds exceeds the usual."""
JOINTS = 3
"""Joints that are named, at most."""
FRESH = 0.005
"""Time after its onset in which a blow or jump has not spread over the robot, in [s]."""
SLOWEST = 0.02
"""Longest lag between two stages that vibrate together, in [s]."""


@dataclass(frozen=True)
class First:
    """The stage in which a failure shows first.

    Attributes:
        stage: Its name.
        following: The next stage in which the failure shows; empty if it is in no other.
        lag: By how much that one is later, in [s].
        lasting: Whether the failure is a vibration that lasts, and not a blow or jump.
        joints: Up to three joints in which it is new there, and their shares of the power of
            what is, the largest first.
        onset: When a blow or jump sets in, in [s]; None of a vibration that lasts.
    """

    stage: str
    following: str
    lag: float
    lasting: bool
    joints: tuple[tuple[str, float], ...] = ()
    onset: float | None = None


def first_stage(run: Run, usual: Usual, failure: Event | Block, *, reach: float) -> First | None:
    """Find the stage in which a failure shows first.

    Args:
        run: The run.
        usual: What its stages do when nothing fails.
        failure: A finding, or an annotated block.
        reach: How long after its start it may have set in, in [s].

    Returns:
        The stage, and its lag to the next; None if no stage shows the failure.
    """
    stop = min(failure.stop, failure.start + LONGEST)
    edges = (failure.start - BEFORE, max(stop, failure.start + reach) + AFTER)
    first, last = (int(index) for index in np.searchsorted(run.time, edges))
    stages = flow(run, slice(first, last))
    start, end = (int(index) for index in np.searchsorted(stages.time, (failure.start, stop)))
    if end <= start or not stages.valid[start:end].any():
        return None
    news, during = usual.news(stages), slice(start, end)
    found = None
    if not _lasts(news.new[-1, during], float(usual.power[-1]), stages):
        edges = (failure.start - EARLY, failure.start + reach)
        found = _earliest(stages, news, usual, *np.searchsorted(stages.time, edges).tolist())
    return found or _adding(stages, news, usual, during)


def _lasts(sharp: Array, usual: float, stages: Flow) -> bool:
    """Tell whether a vibration lasts."""
    size = stages.samples(BIN)
    power = np.add.reduceat(np.square(sharp), np.arange(0, len(sharp), size)) / size
    loud = power > max(LOUD * power.max(), MORE * usual)
    return bool(loud.sum() * BIN >= LASTING)


def _earliest(stages: Flow, news: News, usual: Usual, first: int, last: int) -> First | None:
    """Order the stages by when a blow or jump comes through."""
    rate, samples = stages.rate, len(stages.time)
    # Of a stage that adds nothing, anything would be unusual.
    scale = usual.peak + PASSED_ON * (float(usual.peak.max()) or 1.0)
    unusual = (news.new / scale[:, None]).max(axis=0)
    moment = onset.rise(unusual, first, last, rate=rate)
    around = onset.window(moment, samples, rate=rate)
    onsets = [
        (onset.onset(new, moment, rate=rate, least=PASSED_ON * float(peak)), place)
        for place, (new, peak) in enumerate(
            zip(news.new, news.whole[:, around].max(axis=1), strict=True)
        )
    ]
    found = sorted((at, place) for at, place in onsets if at is not None)
    if found and found[0][1] == 0 and len(news.new) > 1:
        common = float(news.new[0, around].max()) <= UNHEARD * usual.peak[0]
        answers = [at for at, place in found if place == 1]
        if common and not any(at - found[0][0] <= ANSWERED * rate for at in answers):
            found = found[1:]
    if not found:
        return None
    earliest, place = found[0]
    at, other = next((later for later in found if later[0] > earliest), (earliest, None))
    return First(
        stage=stages.names[place],
        following="" if other is None else stages.names[other],
        lag=(at - earliest) / rate,
        lasting=False,
        joints=_joints(stages, news.unforetold[place, earliest : earliest + stages.samples(FRESH)]),
        onset=float(stages.time[earliest]),
    )


def _adding(stages: Flow, news: News, usual: Usual, during: slice) -> First | None:
    """Find the first stage that adds to a vibration."""
    power = np.square(news.new[:, during]).mean(axis=1)
    least = np.maximum(
        MORE * usual.power, PASSED_ON**2 * np.square(news.whole[:, during]).mean(axis=1)
    )
    excess = np.where(power > least, power - usual.power, 0.0)
    if not excess.max() > 0.0:
        return None
    place = int(np.argmax(excess >= ADDS * excess.max()))
    joints = _joints(stages, news.unforetold[place, during])
    if place == len(excess) - 1:
        return First(stages.names[place], "", 0.0, lasting=True, joints=joints)
    lag = _lag(news.change[place, during], news.change[-1, during], stages.samples(SLOWEST))
    return First(stages.names[place], stages.names[-1], lag / stages.rate, True, joints)


def _joints(stages: Flow, unforetold: Array) -> tuple[tuple[str, float], ...]:
    """Name the joints in which something is new, shape (samples, joints), and their shares."""
    power = np.square(unforetold).sum(axis=0)
    shares = power / (power.sum() or 1.0)
    ranked = np.argsort(-shares, kind="stable")[:JOINTS].tolist()
    return tuple((stages.joints[i], float(shares[i])) for i in ranked if shares[i] > 0.0)


def _lag(cause: Array, effect: Array, most: int) -> int:
    """Samples, up to a number, by which one vibration follows another, all joints together."""
    size = len(cause) + most
    waves = [np.fft.rfft(signal, size, axis=0) for signal in (effect, cause)]
    together = np.fft.irfft((waves[0] * waves[1].conj()).sum(axis=1), size)
    return int(np.argmax(together[: most + 1]))
