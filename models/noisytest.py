"""Read the data-set folders and the configuration of NoisyTest."""

import hashlib
import json
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

from models.errors import DataFileError, ProfileError, RateError
from models.logfile import nominal_rate, read_log
from models.profile import CLASSES, TOLERANCE, Profile
from models.recording import Block, Recording

_SETTINGS = {
    "import_preprocessor": {
        "keywords_to_target_data": "classes",
        "samples_per_frame": "length",
        "time_frame_stride": "hop",
        "input_data_sample_rate": "rate",
    },
    "feature_preprocessor": {"fft_sample_length": "window", "fft_stride_length": "stride"},
    "model": {"regularization": "regularization", "kernel": "kernel", "kernel_gamma": "gamma"},
}
"""NoisyTest's names of what a profile holds, by section of its configuration."""


def read_folder(folder: str | Path, *, rate: float | None = None) -> Iterator[Recording]:
    """Read all recordings of a folder, in sorted order.

    Args:
        folder: Folder that holds a ``.toml`` beside each ``.log``.
        rate: Sample rate that all must have, in [Hz]; by default, each has its own.

    Yields:
        Recordings with their annotations, named after their files.

    Raises:
        DataFileError: If there is no ``.log``, or a file cannot be understood.
        RateError: If a recording has another rate.
    """
    logs = sorted(Path(folder).glob("*.log"))
    if not logs:
        state = "has no .log file" if Path(folder).is_dir() else "is no folder"
        raise DataFileError(folder, f"{state}; name a folder of .log files with .toml beside them")
    for log in logs:
        yield read_recording(log, rate=rate)


def read_recording(log: str | Path, *, rate: float | None = None) -> Recording:
    """Read one noise signal and the annotations beside it.

    Args:
        log: The ``.log``; the annotations are in the ``.toml`` of the same name.
        rate: Sample rate that it must have, in [Hz]; by default, what its times say.

    Returns:
        The recording, named after the file, with the hash of the file.

    Raises:
        DataFileError: If a file is missing or cannot be understood.
        RateError: If the recording has another rate.
        RecordingError: If the annotations do not fit the signal.
    """
    log = Path(log)
    blocks = read_annotations(log.with_suffix(".toml"))
    time, noise = read_log(log)
    own = nominal_rate(time)
    if rate is not None and abs(own / rate - 1.0) > TOLERANCE:
        raise RateError(own, [rate], f"{log} does not fit; lower its rate, or take another profile")
    digest = hashlib.sha256(log.read_bytes()).hexdigest()
    return Recording(log.stem, noise, rate or own, blocks, start=float(time[0]), sha256=digest)


def read_annotations(path: str | Path) -> tuple[Block, ...]:
    """Read annotated blocks: ``chunk_ranges`` and ``chunk_labels`` of the table ``data``.

    Args:
        path: A ``.toml``; a stop of -1 means the end of the recording.

    Returns:
        The blocks, in their order.

    Raises:
        DataFileError: If the file is missing, is no TOML, or lacks a pair of numbers or a label.
    """
    try:
        data = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))["data"]
        ranges, labels = data["chunk_ranges"], data["chunk_labels"]
    except OSError as error:
        raise DataFileError(
            path, f"cannot be read ({error.strerror}); each .log needs its .toml"
        ) from error
    except ValueError as error:
        raise DataFileError(path, f"is no TOML ({error})") from error
    except (KeyError, TypeError) as error:
        raise DataFileError(path, "lacks chunk_ranges or chunk_labels in a table [data]") from error
    if not (isinstance(ranges, list) and isinstance(labels, list)) or len(ranges) != len(labels):
        raise DataFileError(path, "chunk_ranges and chunk_labels are not lists of one length")
    return tuple(_block(path, *each) for each in zip(ranges, labels, strict=True))


def profile_from_config(path: str | Path) -> Profile:
    """Read NoisyTest's JSON configuration, what it leaves open being NoisyTest's defaults.

    Args:
        path: The file, say ``noisytest-config.json``.

    Returns:
        A profile with NoisyTest's quirks.

    Raises:
        DataFileError: If the file is no such configuration, or a name in it is unknown.
    """
    try:
        config = json.loads(Path(path).read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise DataFileError(path, f"cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise DataFileError(path, f"is no JSON ({error})") from error
    settings = Profile.noisytest().as_dict()
    for section, content in _known(path, config, _SETTINGS, "the configuration").items():
        arguments = _known(path, content, ("arguments",), section).get("arguments", {})
        names = _SETTINGS[section]
        for key, value in _known(path, arguments, names, section).items():
            settings[names[key]] = _classes(path, value) if names[key] == "classes" else value
    settings["rate"] = (
        float(settings["rate"]) if type(settings["rate"]) is int else settings["rate"]
    )
    try:
        profile = Profile.of(settings)
    except ProfileError as error:
        raise DataFileError(path, str(error)) from error
    return replace(profile, open_end=round(0.1 * profile.rate))


def _block(path: str | Path, span: Any, label: Any) -> Block:
    numbers = isinstance(span, list) and [type(each) in (int, float) for each in span]
    if numbers != [True, True] or not isinstance(label, str):
        raise DataFileError(
            path, f"chunk {span!r} with label {label!r}, expected [start, stop] in seconds and text"
        )
    start, stop = float(span[0]), float(span[1])
    return Block(start, inf if stop == -1 else stop, label)


def _known(path: str | Path, table: Any, names: Any, where: str) -> dict[str, Any]:
    """Check that a table is one, and has no name that would be ignored in silence."""
    if not isinstance(table, dict):
        raise DataFileError(path, f"{where} is {table!r}, expected a JSON object")
    for key in table:
        if key not in names:
            raise DataFileError(
                path, f"unknown key {key!r} in {where}; it takes {', '.join(names)}"
            )
    return table


def _classes(path: str | Path, targets: Any) -> tuple[str, ...]:
    """Order labels by their numbers, which have to be 0, 1, 2 and so on."""
    if not targets:
        return CLASSES
    if not isinstance(targets, dict) or sorted(targets.values(), key=str) != [*range(len(targets))]:
        raise DataFileError(
            path,
            f"keywords_to_target_data is {targets!r}, expected labels with the numbers 0, 1, 2…",
        )
    return tuple(sorted(targets, key=lambda label: int(targets[label])))
