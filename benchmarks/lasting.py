"""Figures of what `classify` finds in runs, and of what it finds in good ones.

    python -m benchmarks.lasting [--logs LOG ...] RUN ...

RUN are simulated runs with blocks (`inspector simulate domains`): those without a failure are good.
LOG are logs of good motion of real robots. Robots are told by the runs; each is weighed alike.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import noisemodel as nm
from inspector.analysis import analyse
from inspector.library import Library, load_library
from noiseclassifier import Event
from noiseclassifier.scenarios.faults import octave
from noisemodel.types import Array

TONES = (0.3, 1.0, 3.0)  # root mean squares of tones over whole runs, in [rad/s]
# Levels of short tones above the log's own level in their octave, in [dB].
ABOVE = (0.0, 5.0, 10.0, 20.0, 40.0, 60.0)
LOUDEST, SHORT = 100.0, 0.5  # loudest tone, in [rad/s], and how long short ones last, in [s]
# Time left on either side of what is cut out, in [s]: of oscillations, and of others.
MARGIN, BLOW = 0.1, 0.5
# Edges of how far oscillations stand out from the background, in [dB].
BINS = (-20.0, -10.0, 0.0, 10.0, 20.0, 30.0, 80.0)


def is_good(run: nm.Run) -> bool:
    """Whether a run has no fault, felt or not."""
    return run.meta.get("scenario") in ("good", "straight", "curve", "directions", "spot")


def findings(run: nm.Run, library: Library) -> tuple[Event, ...]:
    """What `classify` finds."""
    return analyse(run, library).findings


def overlaps(event: Event, start: float, stop: float) -> bool:
    """Whether a finding and a stretch overlap."""
    return event.start < stop and event.stop > start


def toned(
    run: nm.Run, joint: int, frequency: float, rms: float, start: float, stop: float
) -> nm.Run:
    """A run with a tone in a measured joint."""
    time, velocity = run.time, run.velocity.astype(np.float64)
    during = (time >= start) & (time < stop)
    velocity[:, joint] += during * rms * np.sqrt(2.0) * np.sin(2.0 * np.pi * frequency * time)
    return replace(run, velocity=velocity)


def octave_level(signal: Array, rate: float, frequency: float) -> float:
    """Root mean square of a signal in the octave around a frequency."""
    return float(np.sqrt(np.mean(octave(signal, frequency, 1.0 / rate) ** 2)))


def standing_out(run: nm.Run, start: float, stop: float) -> float:
    """How far a failure stands out: its loudest octave and joint against the rest of the run."""
    inside = (run.time >= start) & (run.time < stop)
    if inside.all() or np.count_nonzero(inside) < 16:
        return np.nan
    loudest = -np.inf
    for joint in run.velocity.astype(np.float64).T:
        for frequency in 15.0 * 2.0 ** np.arange(0, np.log2(0.45 * run.rate / 15.0)):
            during = octave_level(joint[inside], run.rate, frequency)
            before = octave_level(joint[~inside], run.rate, frequency)
            if during > 0.003:
                loudest = max(loudest, 20.0 * np.log10(during / max(before, 1e-6)))
    return loudest


def whole_tones(good: Sequence[nm.Run], library: Library) -> Iterator[str]:
    """Tones from the first sample of good runs to the last."""
    generator = np.random.default_rng(33)
    for rms in TONES:
        found = 0
        for run in good:
            joint = int(generator.integers(run.velocity.shape[1]))
            frequency = generator.uniform(18.0, min(110.0, 0.45 * run.rate))
            shaken = toned(run, joint, frequency, rms, -np.inf, np.inf)
            found += bool(findings(shaken, library))
        yield f"tone of {rms:g} rad/s over the whole run: found in {found} of {len(good)}"


def cuts(runs: Sequence[nm.Run], library: Library) -> Iterator[str]:
    """What is found in runs, cut out of them."""
    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0])
    for run in runs:
        for event in findings(run, library):
            margin = MARGIN if event.label == "oscillations" else BLOW
            piece = run.cut(event.start - margin, event.stop + margin)
            found = findings(piece, library) if piece.duration >= 0.6 else ()
            count = counts[event.label]
            count[0] += 1
            count[1] += bool(found)
            count[2] += any(each.label == event.label for each in found)
    for label, (all_of, found, named) in sorted(counts.items()):
        yield f"{label} cut out of their runs: found {found}, as such {named} of {all_of}"


def good_cuts(good: Sequence[nm.Run], library: Library) -> Iterator[str]:
    """Pieces of runs in which nothing is found."""
    generator, flagged, count = np.random.default_rng(34), 0, 0
    for run in good:
        if findings(run, library):
            continue
        length = generator.uniform(0.8, 3.0)
        start = generator.uniform(0.0, run.duration - length)
        flagged += bool(findings(run.cut(start, start + length), library))
        count += 1
    yield f"pieces of good runs that are ok: flagged {flagged} of {count}"


def alarms(runs: Sequence[nm.Run], library: Library) -> Iterator[str]:
    """False alarms, faults found, and recall by how far oscillations stand out."""
    rows: dict[str, list[float]] = defaultdict(lambda: [0.0] * 7)
    recall: dict[int, list[int]] = defaultdict(lambda: [0, 0])
    for run in runs:
        found = findings(run, library)
        faults = [block for block in run.blocks if block.label != "ok"]
        row = rows[str(run.robot)]
        false = [e for e in found if not any(overlaps(e, b.start, b.stop) for b in faults)]
        hits = [any(overlaps(e, b.start, b.stop) for e in found) for b in faults]
        named = [
            any(overlaps(e, b.start, b.stop) and e.label == b.label for e in found) for b in faults
        ]
        values = (
            is_good(run),
            is_good(run) and bool(found),
            len(false),
            len(faults),
            sum(hits),
            sum(named),
        )
        for place, value in enumerate((*values, run.duration / 3600.0)):
            row[place] += value
        for block, hit in zip(faults, hits, strict=True):
            level = standing_out(run, block.start, block.stop)
            if block.label == "oscillations" and np.isfinite(level):
                place = int(np.digitize(level, BINS))
                recall[place][0] += 1
                recall[place][1] += hit
    if not rows:
        return
    table = np.array(list(rows.values()))
    flagged, good = table[:, 1].sum(), table[:, 0].sum()
    yield f"robots: {len(rows)}, good runs flagged: {flagged:.0f} of {good:.0f}"
    hourly = np.mean(table[:, 2] / table[:, 6])
    yield f"false alarms per hour, robots weighed alike: {hourly:.0f} in {table[:, 6].sum():.2f} h"
    yield "faults found: {:.0f}, named {:.0f} of {:.0f}".format(*table[:, [4, 5, 3]].sum(axis=0))
    for place, (count, hits) in sorted(recall.items()):
        low = BINS[place - 1] if place else -np.inf
        yield f"oscillations from {low:g} dB above the rest of the run on: found {hits} of {count}"


def on_logs(logs: Sequence[nm.Run], library: Library, *, each: int = 6) -> Iterator[str]:
    """Findings in logs of good motion, and short tones put into them."""
    generator = np.random.default_rng(35)
    for run in logs:
        name = run.meta.get("name", f"{run.robot} (real)")
        yield f"{name}: {len(findings(run, library))} findings"
        counts = []
        for above in (*ABOVE, np.inf):
            found = 0
            for _ in range(each):
                joint = int(generator.integers(run.velocity.shape[1]))
                top = np.log(0.45 * run.rate)
                frequency = float(np.exp(generator.uniform(np.log(15.0), top)))
                own = octave_level(run.velocity[:, joint].astype(float), run.rate, frequency)
                rms = min(own * 10.0 ** (above / 20.0), LOUDEST)
                start = float(run.time[0]) + generator.uniform(0.2, run.duration - SHORT - 0.2)
                shaken = toned(run, joint, frequency, rms, start, start + SHORT)
                found += any(overlaps(e, start, start + SHORT) for e in findings(shaken, library))
            counts.append(f"{above:g} dB {found}")
        yield f"  tones of {SHORT:g} s above their octave, of {each}: {', '.join(counts)}"


def variants(run: nm.Run) -> Iterator[nm.Run]:
    """A simulated run as a coarse sensor, a slow driver and a slow logger give it."""
    velocity = run.velocity.astype(np.float64)
    step = 0.02
    for name, changed in (
        ("quantised", np.round(velocity / step) * step),
        ("held", np.repeat(velocity[::5], 5, axis=0)[: len(velocity)]),
    ):
        yield replace(run, velocity=changed, meta={**run.meta, "name": f"{run.robot}, {name}"})
    slow = nm.decimated(run, 200.0)
    yield replace(slow, meta={**run.meta, "name": f"{run.robot}, 200 Hz"})


def main() -> None:
    """Print all figures, a line each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="*", type=Path)
    parser.add_argument("--logs", nargs="*", type=Path, default=[])
    given = parser.parse_args()
    library = load_library()
    runs = [nm.Run.load(path) for path in given.runs]
    good = [run for run in runs if is_good(run)]
    logs = [nm.Run.load(path) for path in given.logs]
    logs += [variant for run in good[:2] for variant in variants(run)]
    for lines in (
        alarms(runs, library),
        whole_tones(good, library),
        cuts([run for run in runs if not is_good(run)], library),
        good_cuts(good, library),
        on_logs(logs, library),
    ):
        for line in lines:
            print(line, flush=True)


if __name__ == "__main__":
    main()
