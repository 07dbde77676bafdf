"""Read the data-set folders and the configuration of NoisyTest."""

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

from noiseclassifier.errors import AnnotationError, DataFileError, ProfileError, RateError
from noiseclassifier.jsontext import from_json, from_toml, text_of
from noiseclassifier.logfile import nominal_rate, read_log
from noiseclassifier.profile import CLASSES, TOLERANCE, Profile
from noiseclassifier.recording import Block, Recording

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
"""Settings of a profile by NoisyTest's names, by section of its configuration."""

END = -1.0
"""A stop that stands for the end of the recording."""
LATEST = 1e12
"""All times lie before, in [s]."""


def read_folder(folder: str | Path, *, rate: float | None = None) -> Iterator[Recording]:
    """Recordings of a folder, in sorted order.

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
    """Recording of a noise signal and the annotations beside it.

    Args:
        log: The ``.log``; the annotations are in the ``.toml`` of the same name.
        rate: Sample rate that it must have, in [Hz]; by default, that of its times.

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
    """Annotated blocks of a ``.toml``, in their order; see `parse_annotations`.

    Args:
        path: The file.

    Raises:
        DataFileError: If the file is missing, or cannot be understood.
    """
    try:
        return tuple(parse_annotations(text_of(path)))
    except OSError as error:
        raise DataFileError(
            path, f"cannot be read ({error.strerror}); each .log needs its .toml"
        ) from error
    except AnnotationError as error:
        raise DataFileError(path, str(error)) from error
    except ValueError as error:
        raise DataFileError(path, f"not TOML ({error})") from error


def parse_annotations(text: str) -> Iterator[Block]:
    """Annotated blocks: ``chunk_ranges`` and ``chunk_labels`` of the table ``data``.

    Args:
        text: TOML; a stop of -1 means the end of the recording.

    Yields:
        The blocks, in their order; those that last to the end stop at infinity.

    Raises:
        AnnotationError: If it is no TOML, lacks the lists, or they hold other things.
    """
    try:
        data = from_toml(text).get("data", {})
    except ValueError as error:
        raise AnnotationError(f"not TOML ({error})") from error
    table = data if isinstance(data, dict) else {}
    ranges, labels = table.get("chunk_ranges"), table.get("chunk_labels")
    if not (isinstance(ranges, list) and isinstance(labels, list)):
        raise AnnotationError("lacks the lists chunk_ranges and chunk_labels in a table [data]")
    if len(ranges) != len(labels):
        raise AnnotationError(f"{len(ranges)} chunk_ranges and {len(labels)} chunk_labels")
    for count, (span, label) in enumerate(zip(ranges, labels, strict=True), start=1):
        yield _block(span, label, f"chunk {count}")


def profile_from_config(path: str | Path) -> Profile:
    """Profile of NoisyTest's JSON configuration, with NoisyTest's defaults.

    Args:
        path: The file, say ``noisytest-config.json``.

    Returns:
        A profile with NoisyTest's quirks.

    Raises:
        DataFileError: If the file is no such configuration, or a name in it is unknown.
    """
    try:
        config = from_json(text_of(path))
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
    try:
        profile = Profile.of(settings)
    except ProfileError as error:
        raise DataFileError(path, str(error)) from error
    return replace(profile, open_end=round(0.1 * profile.rate))


def _block(span: Any, label: Any, where: str) -> Block:
    numbers = isinstance(span, list) and [
        type(each) in (int, float) and -LATEST < each < LATEST for each in span
    ]
    if numbers != [True, True] or not isinstance(label, str):
        raise AnnotationError(
            f"{span!r} with label {label!r}, expected [start, stop] in seconds and text", where
        )
    start, stop = float(span[0]), float(span[1])
    return Block(start, inf if stop == END else stop, label)


def _known(path: str | Path, table: Any, names: Any, where: str) -> dict[str, Any]:
    """A table without unknown names."""
    if not isinstance(table, dict):
        raise DataFileError(path, f"{where} is {table!r}, expected a JSON object")
    for key in table:
        if key not in names:
            raise DataFileError(
                path, f"unknown key {key!r} in {where}; it takes {', '.join(names)}"
            )
    return table


def _classes(path: str | Path, targets: Any) -> tuple[str, ...]:
    """Labels in the order of their numbers, which have to be 0, 1, 2 and so on."""
    if not targets:
        return CLASSES
    if not isinstance(targets, dict) or sorted(targets.values(), key=str) != [*range(len(targets))]:
        raise DataFileError(
            path,
            f"keywords_to_target_data is {targets!r}, expected labels with the numbers 0, 1, 2…",
        )
    return tuple(sorted(targets, key=lambda label: int(targets[label])))
