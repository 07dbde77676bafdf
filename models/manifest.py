"""The manifest of a model file: that it is whole, and that the arrays are of the model it names."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from models.errors import ModelFileError, ProfileError
from models.features import feature_count
from models.machine import DIMENSIONS, shapes
from models.profile import Profile
from models.types import Array

_KINDS = {
    "format": str,
    "profile": dict,
    "classes": list,
    "rate": float,
    "runs": dict,
    "metrics": dict,
    "versions": dict,
}


def check(path: str | Path, manifest: Mapping[str, Any], arrays: Mapping[str, Array]) -> None:
    """Check a manifest, and the arrays against it.

    Args:
        path: The file that they are from.
        manifest: The manifest of a known format.
        arrays: Its arrays, each of the right dimensions.

    Raises:
        ModelFileError: If an entry is missing or wrong, or an array has not the shape that
            profile and classes ask for.
    """
    for name, kind in _KINDS.items():
        if not isinstance(manifest.get(name), kind):
            raise ModelFileError(
                path,
                f"manifest has {name} = {str(manifest.get(name))[:80]}, expected a {kind.__name__}",
            )
    try:
        profile = Profile.of(manifest["profile"])
    except ProfileError as error:
        raise ModelFileError(path, f"manifest has a wrong profile: {error}") from error
    classes = manifest["classes"]
    if len(classes) < 2 or classes != [name for name in profile.classes if name in classes]:
        raise ModelFileError(
            path, f"classes {classes} are not two or more of {', '.join(profile.classes)}, in order"
        )
    if manifest["rate"] != profile.rate:
        raise ModelFileError(
            path, f"rate is {manifest['rate']} Hz, but {profile.rate} Hz in its profile"
        )
    _check_arrays(path, profile, len(classes), arrays)


def _check_arrays(
    path: str | Path, profile: Profile, classes: int, arrays: Mapping[str, Array]
) -> None:
    if lacking := sorted(DIMENSIONS[profile.machine].keys() - arrays.keys()):
        raise ModelFileError(
            path, f"its profile asks for {profile.machine}, but it has no {', '.join(lacking)}"
        )
    count = feature_count(profile)
    wanted = shapes(arrays, profile, features=count, classes=classes)
    for name, shape in {**wanted, "mean": (count,), "scale": (count,)}.items():
        if arrays[name].shape != shape:
            raise ModelFileError(
                path, f"array {name!r} has shape {arrays[name].shape}, its profile asks for {shape}"
            )
    if not (arrays["scale"] > 0).all():
        raise ModelFileError(path, "array 'scale' holds values that are not above 0")
    if profile.machine == "trees":
        for name, most in (("feature", count - 1), ("left", profile.leaves)):
            if arrays[name].min() < 0 or arrays[name].max() > most:
                raise ModelFileError(path, f"array {name!r} holds values beyond 0 to {most}")
