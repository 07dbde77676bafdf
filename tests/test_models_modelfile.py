import io
import json
import os
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from generalmodel import relative, rewrite

import noiseclassifier as nc
from noiseclassifier.estimators import Networks, Trees, calibrated
from noiseclassifier.features import feature_count

PROFILE = nc.LogBands(classes=("ok", "rattle", "squeal")).at(500.0)
RANDOM = np.random.default_rng(5)


def trained(profile=PROFILE):
    time = np.arange(2000) / profile.rate
    hums = {"ok": 30.0, "rattle": 90.0, "squeal": 180.0}
    recordings = [
        nc.Recording(
            label,
            1.0 + 0.1 * np.sin(2 * np.pi * hum * time) + 0.01 * np.cos(np.arange(2000) ** 2),
            profile.rate,
            (nc.Block(0.0, float("inf"), label),),
        )
        for label, hum in hums.items()
    ]
    return nc.Classifier.train(nc.Dataset.of(recordings, profile), profile)


CLASSIFIER = trained()
FEATURES = nc.features(1.0 + 0.1 * RANDOM.random((20, PROFILE.length)), PROFILE)


@pytest.fixture
def path(tmp_path):
    """A model file in a folder of its own."""
    CLASSIFIER.save(tmp_path / "model.npz")
    return tmp_path / "model.npz"


def refused(path, reason):
    with pytest.raises(nc.FileError, match=rf"model.npz: .*{reason}"):
        nc.load(path)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"kernel": "linear"},
        {"multiclass": "one-vs-rest"},
        {"least_deviation": 0.0},
        {"estimator": "detector", "rounds": 3, "leaves": 4},
    ],
)
def test_a_model_that_was_saved_decides_as_before(tmp_path, changes):
    classifier = trained(replace(PROFILE, **changes))
    classifier.save(tmp_path / "model.npz")
    loaded = nc.load(tmp_path / "model.npz")
    assert np.array_equal(loaded.decide(FEATURES), classifier.decide(FEATURES))
    assert np.array_equal(loaded.predict(FEATURES), classifier.predict(FEATURES))
    assert loaded.profile == classifier.profile
    assert loaded.classes == ("ok", "rattle", "squeal")
    assert (loaded.runs, loaded.metrics) == (classifier.runs, classifier.metrics)
    assert set(loaded.versions) == {"noise-inspector", "numpy", "scikit-learn"}


def test_numpy_alone_reads_it_too(path):
    with np.load(path, allow_pickle=False) as members:
        manifest = json.loads(str(members["manifest"]))
    assert manifest["format"] == "noise-model/7"
    assert manifest["rate"] == 500.0
    assert manifest["metrics"]["training"]["subset_accuracy"] == 1.0
    assert set(manifest["runs"]) == {"ok", "rattle", "squeal"}


def test_a_model_is_not_overwritten_unless_requested(path):
    before = path.read_bytes()
    with pytest.raises(nc.OutputError, match=r"model.npz: exists already; choose another name"):
        CLASSIFIER.save(path)
    assert path.read_bytes() == before
    path.write_bytes(b"old")
    CLASSIFIER.save(path, overwrite=True)
    assert path.read_bytes() == before


def test_a_model_has_the_permissions_of_any_new_file(tmp_path):
    before = os.umask(0o027)
    try:
        CLASSIFIER.save(tmp_path / "model.npz")
        (tmp_path / "other").touch()
    finally:
        os.umask(before)
    found, expected = ((tmp_path / name).stat().st_mode for name in ("model.npz", "other"))
    assert found == expected


def test_a_failed_write_leaves_nothing_behind(path, monkeypatch):
    def fail(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    before = path.read_bytes()
    with pytest.raises(nc.OutputError, match="cannot be written .No space left on device"):
        CLASSIFIER.save(path, overwrite=True)
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_a_model_that_is_not_there_is_named(tmp_path):
    refused(tmp_path / "model.npz", "cannot be read .No such file")


def test_a_file_of_another_kind_or_that_is_cut_off_is_refused(path):
    whole = path.read_bytes()
    parts = [whole[: int(share * len(whole))] for share in (0.1, 0.5, 0.9, 0.999)]
    for content in (b"", b"not a zip", b"PK\x03\x04 but no more", *parts):
        path.write_bytes(content)
        refused(path, r"is no model file, or a damaged one .File is not a zip file.$")


def test_a_flipped_bit_anywhere_is_refused_or_harmless(path):
    content = path.read_bytes()
    expected = CLASSIFIER.decide(FEATURES)
    refusals = 0
    for position in RANDOM.integers(0, len(content), 200):
        damaged = bytearray(content)
        damaged[position] ^= 1 << int(RANDOM.integers(8))
        path.write_bytes(damaged)
        try:
            loaded = nc.load(path)
        except nc.FileError:
            refusals += 1
        else:
            assert np.array_equal(loaded.decide(FEATURES), expected)
    assert refusals > 150


def test_a_missing_or_additional_array_is_refused(path):
    rewrite(path, intercept=None)
    refused(path, "is no model file: holds coefficients.npy, manifest.npy")
    CLASSIFIER.save(path, overwrite=True)
    rewrite(path, surprise=np.zeros(3))
    refused(path, "surprise.npy")


def test_pickled_objects_are_refused_unread(path):
    class Bomb:
        def __reduce__(self):
            return (os.abort, ())

    rewrite(path, mean=np.array([Bomb()], dtype=object))
    refused(path, "array 'mean' is of type object")


@pytest.mark.parametrize(("place", "value"), [(10, 8), (20, 7), (24, 7)])
def test_members_that_an_archive_says_are_packed_are_refused(path, place, value):
    content = bytearray(path.read_bytes())
    entry = content.index(b"PK\x01\x02")  # the first in the table of contents
    content[entry + place] ^= value  # its method, or one of its sizes
    path.write_bytes(content)
    refused(path, "is compressed, expected stored")


@pytest.mark.parametrize(
    ("name", "kind", "shape", "content"),
    [
        ("intercept", "<f8", (4,), 3 * b"12345678"),
        ("intercept", "<f8", (10**12,), b"12345678"),
        ("intercept", "<f8", (2,), 3 * b"12345678"),
        ("coefficients", "<f8", (-1, -3), 3 * b"12345678"),
        ("manifest", "<U0", (), b""),
    ],
)
def test_an_array_of_another_size_than_its_header_declares_is_refused(
    path, name, kind, shape, content
):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": kind, "fortran_order": False, "shape": shape}
    )
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members[f"{name}.npy"] = header.getvalue() + content
    with zipfile.ZipFile(path, "w") as archive:
        for each, there in members.items():
            archive.writestr(each, there)
    refused(path, f"array '{name}' is damaged: its size is not what it declares")


def test_a_version_that_is_not_installed_is_said(monkeypatch):
    from importlib import metadata

    from noiseclassifier import modelfile

    def lacking(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", lacking)
    assert modelfile.versions()["noise-inspector"] == "not installed"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"intercept": np.zeros(3, np.float32)}, "array 'intercept' is of type float32"),
        ({"intercept": np.zeros((3, 1))}, r"shape \(3, 1\), expected float64, 1-D"),
        ({"intercept": np.zeros(4)}, r"array 'intercept' has shape \(4,\), .* asks for \(3,\)"),
        ({"intercept": np.full(3, np.nan)}, "array 'intercept' holds values that are not finite"),
        ({"scale": np.zeros_like(CLASSIFIER.scale)}, "array 'scale' holds values that are not abo"),
        ({"mean": np.zeros(3)}, r"array 'mean' has shape \(3,\)"),
        ({"manifest": np.zeros(3)}, "array 'manifest' is of type float64"),
        ({"manifest": np.array("{")}, "manifest is no JSON"),
        (
            {"manifest": np.array("[]")},
            r"is of format \[\], this version reads 'noise-model/7', 'noise-model/4',"
            " 'noise-model/5', 'noise-model/6'",
        ),
    ],
)
def test_wrong_arrays_are_refused(path, changes, reason):
    rewrite(path, **changes)
    refused(path, reason)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"format": "noise-model/1"}, "is of format 'noise-model/1', this version reads"),
        ({"classes": None}, "manifest has classes = None, expected a list"),
        ({"rate": "fast"}, "manifest has rate = fast, expected a float"),
        ({"rate": 1000.0}, "rate is 1000.0 Hz, but 500.0 Hz in its profile"),
        ({"classes": ["ok"]}, "are not two or more of ok, rattle, squeal, in order"),
        ({"classes": ["ok", "ok", "rattle"]}, "are not two or more of"),
        ({"classes": ["rattle", "ok", "squeal"]}, "are not two or more of"),
        ({"classes": ["ok", "rattle"]}, r"array 'coefficients' has shape .* asks for \(1, "),
        ({"profile": {}}, "manifest has a wrong profile: setting 'alarm' is missing"),
    ],
)
def test_wrong_manifests_are_refused(path, changes, reason):
    rewrite(path, changes)
    refused(path, reason)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("feature", 1e9, "array 'feature' holds values beyond 0 to "),
        ("left", -1.0, "array 'left' holds values beyond 0 to 4"),
        ("leaf", np.inf, "array 'leaf' holds values that are not finite"),
    ],
)
def test_trees_with_children_or_features_out_of_range_are_refused(path, name, value, reason):
    classifier = trained(replace(PROFILE, estimator="detector", rounds=3, leaves=4))
    classifier.save(path, overwrite=True)
    array = getattr(classifier.estimator, name).copy()
    array.flat[5] = value
    rewrite(path, **{name: array})
    refused(path, reason)


# Some of the settings that profiles had up to version 6.
EARLIER = {
    "single_precision": False,
    "drop_first_sample": False,
    "flush_end": True,
    "name": "logbands",
    "networks": 5,
    "widen_extra": 0,
}


def earlier(path, version=6, **profile):
    """Write a model file anew as an earlier version did."""
    with np.load(path, allow_pickle=False) as members:
        settings = json.loads(str(members["manifest"]))["profile"] | EARLIER | profile
    if version < 6:
        del settings["reference"]
        rewrite(path, missing=None)
    if version < 5:
        settings["machine"] = settings.pop("estimator")
    rewrite(path, {"format": f"noise-model/{version}", "profile": settings})


@pytest.mark.parametrize("version", [4, 5, 6])
@pytest.mark.parametrize("estimator", ["svm", "detector", "trees"])
def test_models_of_earlier_versions_decide_as_before(path, version, estimator):
    profile = relative(rate=500.0)
    changes = {"classes": PROFILE.classes, "estimator": "svm" if estimator == "svm" else "detector"}
    before = trained(replace(profile, **changes))
    before.save(path, overwrite=True)
    earlier(path, version, estimator=estimator)
    loaded = nc.load(path)
    assert loaded.profile == replace(before.profile, estimator=estimator)
    features = RANDOM.normal(size=(20, len(before.mean)))
    expected = before.decide(features)
    if estimator == "trees":  # their logits are the sums of leaves
        ours = before.estimator
        sums = Trees.logits(ours, (features - before.mean) / before.scale)
        expected[:, :-1] = calibrated(sums, ours.calibration)
    np.testing.assert_array_equal(loaded.decide(features), expected)


def test_networks_of_earlier_versions_decide(path):
    profile = replace(relative(rate=500.0), classes=PROFILE.classes)
    count = feature_count(profile)
    arrays = {
        "hidden": RANDOM.normal(size=(2, count, 4)),
        "hidden_bias": RANDOM.normal(size=(2, 4)),
        "output": RANDOM.normal(size=(2, 4, 3)),
        "output_bias": RANDOM.normal(size=(2, 3)),
        "calibration": np.array([1.0, 0.0, 0.1, 0.2]),
        "frequency": np.full(3, 1 / 3),
        "known": np.array([[-1.0] * count, [2.0] * count]),
    }
    trained(replace(profile, estimator="svm")).save(path, overwrite=True)
    rewrite(path, vectors=None, coefficients=None, intercept=None, **arrays)
    earlier(path, estimator="networks", networks=2, units=4)
    loaded = nc.load(path)
    features = RANDOM.normal(size=(20, count))
    expected = Networks(**arrays, alarm=0.6).decision((features - loaded.mean) / loaded.scale)
    np.testing.assert_array_equal(loaded.decide(features), expected)
    with pytest.raises(nc.ProfileError, match="networks cannot be trained, only svm, det"):
        trained(loaded.profile)
    rewrite(path, output=arrays["output"][:, :3])
    refused(path, r"array 'output' has shape \(2, 3, 3\), its profile asks for \(2, 4, 3\)")


@pytest.mark.parametrize("setting", ["single_precision", "drop_first_sample", "flush_end"])
def test_a_mixture_of_profiles_that_earlier_versions_could_have_is_refused(path, setting):
    earlier(path, **{setting: not EARLIER[setting]})
    refused(path, f"that this version cannot follow: {setting} {not EARLIER[setting]} with bands")
