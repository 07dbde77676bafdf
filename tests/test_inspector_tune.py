import json
import shutil

import numpy as np
import pytest
import workers
from commandline import call

import inspector.training
import noiseclassifier as nc
from noisemodel import parallel

GRID = ("--grid", "stride=25,50", "--grid", "gamma=0.001,0.01", "--grid", "C=0.1,1,10")
OPTIONS = ("--profile", "logbands", "--rate", "1000")


def write_log(folder, number, classes=("ok", "impact", "oscillations")):
    """Six seconds of noise at 1 kHz with a stretch of each class, as NoisyTest keeps them."""
    folder.mkdir(exist_ok=True)
    random = np.random.default_rng(number)
    time = np.arange(6000) / 1000.0
    noise = random.standard_normal(len(time))
    noise += 0.6 * np.sin(300.0 * time) * (time > 4.0)
    noise += 2.0 * random.standard_normal(len(time)) * (time > 2.3) * (time < 2.4)
    spans = dict(
        zip(("ok", "impact", "oscillations"), ([0, 1.5], [2.2, 2.5], [4, 5.9]), strict=True)
    )
    path = folder / f"walk{number}.log"
    np.savetxt(path, np.column_stack((time, noise)), fmt="%.6f")
    path.with_suffix(".toml").write_text(
        f"[data]\nchunk_ranges = {[spans[each] for each in classes]}\n"
        f"chunk_labels = {json.dumps(list(classes))}\n"
    )


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A training and a validation folder."""
    folder = tmp_path_factory.mktemp("data")
    for number in range(4):
        write_log(folder / "training", number)
    for number in range(4, 7):
        write_log(folder / "validation", number)
    for kind in ("log", "toml"):  # NoisyTest's own sets share names, too
        (folder / "validation" / f"walk6.{kind}").rename(folder / "validation" / f"walk3.{kind}")
    return folder


def tune(data, output, *more, grid=GRID):
    against = ("--validation", data / "validation")
    return call("tune", data / "training", *against, *OPTIONS, *grid, "-o", output, *more)


@pytest.fixture(scope="module")
def whole(data, tmp_path_factory):
    """Results of a search without interruption, and its output."""
    output = tmp_path_factory.mktemp("whole") / "tuned.jsonl"
    status, out, err = tune(data, output)
    assert (status, err) == (0, "")
    return output, out


def lines(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def rank(point):
    return -point["balanced_accuracy"], -point["subset_accuracy"]


@pytest.fixture
def counted(monkeypatch):
    """The points that are measured."""
    points = []

    def measure(profiles, trial):
        points.extend(profiles)
        return nc.tuning.measure(profiles, trial)

    monkeypatch.setattr(inspector.training, "measure", measure)
    return points


def test_each_point_has_a_line_after_the_header(whole):
    question, *points = lines(whole[0])
    axes = {"stride": [25, 50], "gamma": [0.001, 0.01], "regularization": [0.1, 1.0, 10.0]}
    assert (question["format"], question["grid"]) == ("noise-tuning/1", axes)
    assert sorted(question["training_set"]) == ["walk0", "walk1", "walk2", "walk3"]
    assert len(points) == 12
    assert [points[1][name] for name in axes] == [25, 0.001, 1.0]
    assert all(0.0 <= point["balanced_accuracy"] <= 1.0 for point in points)


def test_the_best_points_are_printed_as_a_table(whole):
    output, out = whole
    points = lines(output)[1:]
    best = min(points, key=rank)
    heading, _, _, names, first, *_ = out.splitlines()
    assert heading.startswith("12 points of logbands, trained on ")
    assert "4 recordings, measured on" in heading
    assert heading.endswith("3 others")
    assert names.split()[:3] == ["stride", "gamma", "regularization"]
    assert first.split()[:4] == ["1", *(f"{best[name]:g}" for name in names.split()[:3])]
    assert f"{best['balanced_accuracy']:.1%}" in first
    assert "untuned        25" in out
    ends = [line for line in out.splitlines() if line.endswith("a wider one may hold better.")]
    at_end = {"stride": best["stride"], "gamma": best["gamma"]}
    at_end |= {"C": best["regularization"]} if best["regularization"] != 1.0 else {}
    assert [line.split()[1] for line in ends] == [f"{value:.6g}" for value in at_end.values()]


def test_json_is_printed_for_programs(data, whole):
    status, out, _ = tune(data, whole[0], "--json")
    report = json.loads(out)
    assert (status, report["points"], len(report["best"])) == (0, 12, 10)
    assert report["best"][0] in lines(whole[0])
    assert report["profile"]["gamma"] == report["best"][0]["gamma"]


def test_the_best_point_is_the_one_that_is_trained(data, whole, tmp_path):
    model = tmp_path / "model.npz"
    status, out, _ = tune(data, whole[0], "--train", model)
    assert status == 0
    assert out.endswith(f"{model}: written, the best point trained on all training runs\n")
    points = lines(whole[0])[1:]
    best = min(points, key=rank)
    classifier = nc.load(model)
    for name in ("stride", "gamma", "regularization"):
        assert getattr(classifier.profile, name) == best[name]
    metrics = classifier.metrics["validation"]
    for name in ("balanced_accuracy", "failure_recall", "false_alarm_rate", "subset_accuracy"):
        assert metrics[name] == pytest.approx(best[name], abs=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.65, 0.999, 1.0])
def test_an_interrupted_search_resumes_to_the_same_bytes(data, whole, tmp_path, counted, share):
    output, content = tmp_path / "tuned.jsonl", whole[0].read_bytes()
    output.write_bytes(content[: int(share * len(content))])
    there = max(output.read_bytes().count(b"\n") - 1, 0)
    assert tune(data, output)[:2] == (0, whole[1])
    assert len(counted) == 12 - there
    assert output.read_bytes() == content


@pytest.mark.slow
def test_two_jobs_give_the_same_results(data, whole, tmp_path):
    output = tmp_path / "tuned.jsonl"
    assert tune(data, output, "-j", 2)[0] == 0
    assert lines(output) == lines(whole[0])


def test_a_point_that_kills_its_worker_is_named_and_the_search_resumes(
    data, whole, tmp_path, monkeypatch
):
    output, measure = tmp_path / "tuned.jsonl", inspector.training.measure

    def die(profiles, trial):
        if profiles[0].stride == 50:
            workers.die()
        return measure(profiles, trial)

    with monkeypatch.context() as patch:
        patch.setattr(inspector.training, "measure", die)
        workers.simulate(patch)
        status, _, err = tune(data, output, "-j", 2)
    assert status == 3
    point = "stride=50, gamma=0.001, regularization=0.1"
    resumes = "the same command resumes there\n"
    assert err.splitlines(keepends=True)[-1] in (
        f"inspector: {point} and 2 more: {parallel.DIED}; {resumes}",
        f"inspector: {point.replace('0.001', '0.01')} and 2 more: {parallel.DIED}; {resumes}",
        f"inspector: {point}: {parallel.DIED}; {resumes}",
    )
    assert tune(data, output)[0] == 0
    assert lines(output) == lines(whole[0])


def test_without_a_validation_set_a_part_of_the_recordings_is_folded(data, tmp_path):
    held_out = [f"walk{n}" for n in range(4) if nc.held_out(f"walk{n}")]
    options = (*OPTIONS, *GRID, "--folds", 2, "--part", "training", "-o", tmp_path / "a.jsonl")
    status, out, err = call("tune", data / "training", *options)
    assert (status, err) == (0, "")
    assert "frames of the same, in 2 folds" in out
    header = lines(tmp_path / "a.jsonl")[0]
    assert header["number_of_folds"] == 2
    assert held_out
    assert sorted([*header["training_set"], *held_out]) == ["walk0", "walk1", "walk2", "walk3"]


def refused(data, output, *more, grid=GRID, code=3):
    """Call in vain; the complaint, which is one line."""
    status, out, err = tune(data, output, *more, grid=grid)
    assert (status, out) == (code, "")
    assert err.startswith("inspector: ")
    assert err.count("\n") == 1
    return err


def test_results_of_another_grid_or_other_annotations_are_refused(data, whole, tmp_path):
    output = tmp_path / "tuned.jsonl"
    output.write_bytes(whole[0].read_bytes())
    others = tmp_path / "others"
    shutil.copytree(data / "validation", others)
    toml = others / "walk5.toml"
    toml.write_text(toml.read_text().replace("1.5", "1.4"))
    for more, name in ((("--grid", "C=1"), "grid"), (("--validation", others), "validation_set")):
        assert f"is of another batch (its {name} differs);" in refused(data, output, *more)
        assert output.read_bytes() == whole[0].read_bytes()
    assert tune(data, output, "--grid", "C=1", "--overwrite")[0] == 0


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda text: "time,noise\n" + text, "holds no results of tuning"),
        (lambda text: "[]\n" + text, "holds no results of tuning"),
        (lambda text: "an unfinished letter", "holds no results of tuning"),
        (lambda text: text.replace('{"stride": 25', '{"stride"', 1), "is damaged in line 2"),
        (lambda text: text.replace('"stride": 50', '"stride": 51', 1), "is damaged in line 8"),
        (lambda text: text.replace('"failure_recall"', '"recall"', 1), "is damaged in line 2"),
        (lambda text: text + text.splitlines()[-1] + "\n", "is damaged: 13 points of 12"),
        (lambda text: text.replace("noise-tuning/1", "noise-tuning/0"), "its format differs"),
    ],
)
def test_a_damaged_file_is_named_and_left_alone(data, whole, tmp_path, damage, reason):
    output = tmp_path / "tuned.jsonl"
    output.write_text(damage(whole[0].read_text()))
    before = output.read_bytes()
    complaint = refused(data, output)
    assert f"{output}: {reason}" in complaint or reason in complaint
    assert complaint.endswith("name another file, or overwrite it (--overwrite)\n")
    assert output.read_bytes() == before


def test_sets_that_do_not_validate_are_refused(data, tmp_path):
    output, empty = tmp_path / "a.jsonl", tmp_path / "empty"
    empty.mkdir()
    arguments = ("--validation", empty, *OPTIONS, *GRID, "-o", output)
    status, _, err = call("tune", data / "training", *arguments)
    assert (status, err) == (3, f"inspector: {empty}: no recording (of part 'all')\n")
    seen = refused(data, output, "--validation", data / "training")
    assert "trained on the same recording as 'walk0'" in seen
    status, _, err = tune(data, output, "--folds", 3)
    assert (status, "not both" in err) == (2, True)


def test_an_output_that_cannot_be_written_is_named_before_the_work(data, tmp_path, counted):
    reason = f"{tmp_path / 'none' / 'tuned.jsonl'}: cannot be written (No such file or directory)"
    assert reason in refused(data, tmp_path / "none" / "tuned.jsonl", code=5)
    assert f"{tmp_path}: is no regular file; name another file, or" in refused(data, tmp_path)
    model = tmp_path / "model.npz"
    model.write_bytes(b"")
    complaint = refused(data, tmp_path / "tuned.jsonl", "--train", model)
    assert f"{model}: exists already" in complaint
    assert not counted
    assert not (tmp_path / "tuned.jsonl").exists()
