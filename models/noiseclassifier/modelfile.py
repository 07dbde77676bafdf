"""The model file, version 7: one uncompressed `.npz` of plain arrays and a JSON manifest.

Members: ``manifest`` (one text), ``mean`` and ``scale`` (features,), and those of the estimator, as
its ``DIMENSIONS`` list them. Nothing in it is ever unpickled; sizes are checked before an array is
made. The same model is the same bytes. A general model has ``recipe`` in the manifest, and its
profile is for its highest rate. Versions 4 to 6 are read too; 4 and 5 know no missing features
and no reference.
"""

import io
import json
import os
import stat
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from math import prod
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from noiseclassifier.errors import FileError, OutputError, ProfileError
from noiseclassifier.estimators import ESTIMATORS, Trees
from noiseclassifier.features import feature_count
from noiseclassifier.jsontext import from_json
from noiseclassifier.profile import HIGHEST, INPUTS, LogBands, Profile
from noiseclassifier.signals import Array

FORMAT = "noise-model/7"
OLD_FORMATS = ("noise-model/4", "noise-model/5", "noise-model/6")
# Settings of profiles in older formats that labels do not depend on.
DROPPED = {
    *("name", "networks", "units", "decay", "epochs", "learning_rate", "penalty"),
    *("pad_short", "spread_failures", "open_end", "cut_by_time", "widen_extra", "pad_widened"),
}
# Settings in older formats, and the bands that have them now.
BY_BANDS = {"single_precision": "comb", "drop_first_sample": "comb", "flush_end": "log"}
# Bytes that a model file may have: a thousand times as many as the shipped ones.
LARGEST = 512 * 1024**2
_KINDS = [
    {"manifest": 0, "mean": 1, "scale": 1} | {name: len(axes) for name, axes in each.SHAPES.items()}
    for each in ESTIMATORS.values()
]
_KINDS += [
    {name: count for name, count in kind.items() if name != "missing"}
    for kind in _KINDS
    if "missing" in kind
]


def versions() -> dict[str, str]:
    """Versions of the software that trains models, by name."""
    from importlib import metadata

    import sklearn

    try:
        own = metadata.version("noise-inspector")
    except metadata.PackageNotFoundError:
        own = "not installed"
    return {"noise-inspector": own, "numpy": np.__version__, "scikit-learn": sklearn.__version__}


def write(path: str | Path, model: Any, settings: Mapping[str, Any], *, overwrite: bool) -> None:
    """Write a model file, whole or not at all; settings are profile, rate, and recipe if any."""
    known = {name: dict(getattr(model, name)) for name in ("runs", "metrics", "versions")}
    manifest = {"format": FORMAT, **settings, "classes": list(model.classes), **known}
    arrays = {name: getattr(model.estimator, name) for name in model.estimator.SHAPES}
    arrays |= {"mean": model.mean, "scale": model.scale}
    text = json.dumps(manifest, sort_keys=True, allow_nan=False)
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, manifest=np.array(text), **arrays)  # dated 1980 always
    _replace(Path(path), content.getvalue(), overwrite=overwrite)


EXISTS = "exists already; choose another name, or overwrite it (--overwrite)"


def _replace(path: Path, content: bytes, *, overwrite: bool) -> None:
    """Write a file beside its place, and move it there when it is safely on the disk.

    `noisemodel.files` offers a path for other writers; this package must not import it.
    """
    if path.exists() and not path.is_file():
        raise OutputError(path, "is no regular file; name one")
    if path.exists() and not overwrite:
        raise OutputError(path, EXISTS)
    if path.is_symlink():  # the link stays
        path = Path(os.path.realpath(path))
    temporary = path.with_name(f".noise-inspector-{uuid4().hex[:8]}")
    try:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if not overwrite:
            path.touch(exist_ok=False)  # unless another process has taken the name meanwhile
        temporary.replace(path)
    except FileExistsError:
        raise OutputError(path, EXISTS) from None
    except OSError as error:
        raise OutputError(path, f"cannot be written ({error.strerror or error})") from error
    finally:
        with suppress(OSError):  # its folder may not be one
            temporary.unlink(missing_ok=True)


def read(
    path: str | Path,
) -> tuple[dict[str, Any], dict[str, Array], Profile, LogBands | None]:
    """Manifest and finite arrays of a model file, with its profile and recipe, that they fit.

    The recipe is None in a model of one rate.
    """
    try:
        if not stat.S_ISREG(Path(path).stat().st_mode) and not Path(path).is_dir():
            raise FileError(path, "is no regular file")
        with zipfile.ZipFile(path) as archive:
            dimensions = _check_members(path, archive)
            members = {name: _member(path, archive, name, n) for name, n in dimensions.items()}
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror or error})") from error
    except (zipfile.BadZipFile, EOFError, RuntimeError, UnicodeDecodeError) as error:
        problem = f"is no model file, or a damaged one ({_one_line(error)})"
        raise FileError(path, problem) from error
    manifest = _manifest(path, str(members.pop("manifest")))
    if "threshold" in members:
        members.setdefault("missing", np.zeros_like(members["threshold"]))
    for name, array in members.items():
        if not np.isfinite(array).all():
            raise FileError(path, f"array {name!r} holds values that are not finite")
    return manifest, members, *check(path, manifest, members)


def _check_members(path: str | Path, archive: zipfile.ZipFile) -> dict[str, int]:
    """Check the table of contents; dimensions of each array, by name."""
    there = sorted(archive.namelist())
    kinds = [kind for kind in _KINDS if there == sorted(f"{name}.npy" for name in kind)]
    if not kinds:
        wanted = " or ".join(", ".join(sorted(kind)) for kind in _KINDS[: len(ESTIMATORS)])
        raise FileError(
            path, f"is no model file: holds {_escaped(', '.join(there))}, expected {wanted}"
        )
    for info in archive.infolist():
        # Stored as they are, members cannot be larger than the file that holds them.
        if info.compress_type != zipfile.ZIP_STORED or info.file_size != info.compress_size:
            raise FileError(path, f"member {info.filename!r} is compressed, expected stored")
    if sum(info.file_size for info in archive.infolist()) > LARGEST:
        raise FileError(path, f"is larger than {LARGEST} bytes, the most that is read")
    return kinds[0]


def _member(path: str | Path, archive: zipfile.ZipFile, name: str, dimensions: int) -> NDArray[Any]:
    """One array, once its header is checked."""
    content = archive.read(f"{name}.npy")
    header = io.BytesIO(content)
    try:
        if npy.read_magic(header) != (1, 0):
            raise ValueError("another version of .npy")
        shape, _, dtype = npy.read_array_header_1_0(header)
        size = prod(shape) * dtype.itemsize
    except Exception as error:  # NumPy lets those of its parser through: any, by the bytes
        raise FileError(path, f"array {name!r} is damaged ({_one_line(error)})") from error
    fits = dtype.kind == "U" if name == "manifest" else dtype == np.dtype("<f8")
    if not fits or len(shape) != dimensions:
        wanted = f"{'text' if name == 'manifest' else 'float64'}, {dimensions}-D"
        problem = f"array {name!r} is of type {dtype} and shape {shape}, expected {wanted}"
        raise FileError(path, problem)
    if size != len(content) - header.tell() or min(shape, default=0) < 0 or not dtype.itemsize:
        raise FileError(path, f"array {name!r} is damaged: its size is not what it declares")
    array: NDArray[Any] = np.load(io.BytesIO(content), allow_pickle=False)
    return array


def _escaped(text: str) -> str:
    return text[:200].encode("unicode_escape").decode()


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _manifest(path: str | Path, text: str) -> dict[str, Any]:
    try:
        manifest = from_json(text)
    except ValueError as error:
        raise FileError(path, f"manifest is no JSON ({error})") from error
    given = manifest.get("format") if isinstance(manifest, dict) else manifest
    known = (FORMAT, *OLD_FORMATS)
    if given not in known:
        raise FileError(
            path,
            f"is of format {given!r}, this version reads {', '.join(map(repr, known))}:"
            " train it again, or read it by the version that wrote it",
        )
    profile = manifest.get("profile")
    if given != FORMAT and isinstance(profile, dict):
        manifest["profile"] = _of_this_version(path, profile)
    if given != FORMAT and isinstance(manifest.get("recipe"), dict):
        manifest["recipe"].pop("relative", None)
    return dict(manifest)


def _of_this_version(path: str | Path, profile: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a profile that an earlier version wrote, as this one has them."""
    for name, bands in BY_BANDS.items():
        if profile.get(name) not in (None, profile.get("bands") == bands):
            problem = f"{name} {profile[name]} with bands {profile.get('bands')!r}"
            raise FileError(path, f"has a profile that this version cannot follow: {problem}")
    names = {"machine": "estimator"}  # in version 4; versions 4 and 5 know no reference
    kept = {name: each for name, each in profile.items() if name not in {*DROPPED, *BY_BANDS}}
    return {"reference": False, **{names.get(name, name): each for name, each in kept.items()}}


_JSON_TYPES = {
    "format": str,
    "profile": dict,
    "classes": list,
    "rate": float,
    "runs": dict,
    "metrics": dict,
    "versions": dict,
}


def check(
    path: str | Path, manifest: Mapping[str, Any], arrays: Mapping[str, Array]
) -> tuple[Profile, LogBands | None]:
    """Profile and recipe of a manifest, once it and the arrays are checked."""
    for name, kind in _JSON_TYPES.items():
        if not isinstance(manifest.get(name), kind):
            value = str(manifest.get(name))[:80]
            raise FileError(path, f"manifest has {name} = {value}, expected a {kind.__name__}")
    recipe = None
    try:
        profile = Profile.of(manifest["profile"])
        count = feature_count(profile)
        if "recipe" in manifest:
            recipe = LogBands.of(manifest["recipe"])
            if not (issubclass(ESTIMATORS[recipe.estimator], Trees) and recipe.reference):
                raise ProfileError(
                    f"a recipe for any rate has trees and a reference, not {recipe.estimator} and"
                    f" reference {recipe.reference}"
                )
            count, profile = len(recipe.columns), recipe.at(HIGHEST, INPUTS[0])
    except ProfileError as error:
        raise FileError(path, f"manifest has a wrong profile: {error}") from error
    classes = manifest["classes"]
    if len(classes) < 2 or classes != [name for name in profile.classes if name in classes]:
        raise FileError(
            path, f"classes {classes} are not two or more of {', '.join(profile.classes)}, in order"
        )
    if manifest["rate"] != profile.rate:
        raise FileError(
            path, f"rate is {manifest['rate']} Hz, but {profile.rate} Hz in its profile"
        )
    _check_arrays(path, profile, count, len(classes), arrays)
    return profile, recipe


def _check_arrays(
    path: str | Path, profile: Profile, count: int, classes: int, arrays: Mapping[str, Array]
) -> None:
    estimator = ESTIMATORS[profile.estimator]
    if lacking := sorted(estimator.SHAPES.keys() - arrays.keys()):
        raise FileError(
            path, f"its profile asks for {profile.estimator}, but it has no {', '.join(lacking)}"
        )
    one_vs_one = profile.multiclass == "one-vs-one"
    sizes = {
        "features": count,
        "classes": classes,
        "1 + classes": 1 + classes,
        "svms": classes * (classes - 1) // 2 if one_vs_one else classes,
        "trees": profile.rounds * classes,
        "leaves": profile.leaves,
        "splits": profile.leaves - 1,
    }
    for name, axes in {**estimator.SHAPES, "mean": ("features",), "scale": ("features",)}.items():
        shape = arrays[name].shape
        # There may be any number of vectors, networks and units, but of each array the same.
        wanted = tuple(
            sizes.setdefault(axis, size) if isinstance(axis, str) else axis
            for axis, size in zip(axes, shape, strict=True)
        )
        if shape != wanted:
            raise FileError(
                path, f"array {name!r} has shape {shape}, its profile asks for {wanted}"
            )
    if not (arrays["scale"] > 0).all():
        raise FileError(path, "array 'scale' holds values that are not above 0")
    indices = {"feature": count - 1, "left": profile.leaves, "missing": 1}
    for name, most in indices.items() if issubclass(estimator, Trees) else ():
        if arrays[name].min() < 0 or arrays[name].max() > most:
            raise FileError(path, f"array {name!r} holds values beyond 0 to {most}")
