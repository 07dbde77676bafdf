"""Several runs side by side: names, the worst, rows on one time axis, runs that cannot be read."""

import numpy as np
import pytest
from commandline import call, complaint
from recordings import entities, read

from inspector.compare.many import Several, lay, report, write
from inspector.logs.read import open_run
from inspector.recording.views import TOP
from noiseclassifier import Event
from noisemodel import Block, Run


def run_file(folder, name, *, loud=0.0, seconds=3.0, start=0.0, blocks=()):
    time = start + np.arange(round(seconds * 1000)) / 1000
    hum = loud * np.sin(2 * np.pi * 90 * time) * (time - start >= 1.0)
    path = folder / f"{name}.npz"
    path.parent.mkdir(exist_ok=True)
    velocity = (np.cos(time) + hum)[:, None]
    Run(time=time, velocity=velocity, joint_names=("a",), blocks=blocks).save(path)
    return path


def laid(*paths, findings=(), **options):
    """Runs side by side, with findings for each in place of a model's."""
    several = lay([open_run(path) for path in paths], {}, **options)
    sides = list(several.sides)
    for index, events in enumerate(findings):
        sides[index] = type(sides[index])(
            **{**vars(sides[index]), "findings": events, "spans": events}
        )
    return Several(several.names, tuple(sides))


def test_the_worst_has_findings_for_the_longest_time_and_then_is_the_loudest(tmp_path):
    paths = [
        run_file(tmp_path, name, loud=loud) for name, loud in (("a", 0.5), ("b", 0.1), ("c", 0))
    ]
    short, long = Event("impact", 1.0, 1.1, 0.9), Event("oscillations", 1.0, 2.0, 0.6)
    assert laid(*paths, findings=[(short,), (long,), ()]).order == (1, 0, 2)
    assert laid(*paths, findings=[(short,), (short,), (short,)]).worst == 0
    assert laid(*paths).worst is None
    assert laid(*paths).order == (0, 1, 2)


def test_every_run_starts_at_0_unless_clocks_count_and_its_blocks_with_it(tmp_path):
    block = Block(11.0, 12.0, "impact")
    paths = [run_file(tmp_path, "a"), run_file(tmp_path, "b", start=10.0, blocks=(block,))]
    together = laid(*paths)
    assert [float(side.run.time[0]) for side in together.sides] == [0.0, 0.0]
    assert together.sides[1].run.blocks == (Block(1.0, 2.0, "impact"),)
    apart = laid(*paths, from_start=False)
    assert [float(side.run.time[0]) for side in apart.sides] == [0.0, 10.0]


def test_runs_of_one_file_name_are_told_apart(tmp_path):
    paths = [run_file(tmp_path / folder, "run") for folder in "xy"]
    assert laid(*paths).names == tuple(map(str, paths))


def rows(path, below):
    """Height on the axis of each line of rows that is not empty."""
    found = []
    for entity in sorted(e for e in entities(path) if e.startswith(below)):
        time, place = read(path, entity, "Scalars:scalars")
        _, shades = read(path, entity, "SeriesLines:colors")
        found.append((time, place[0], [shade[0] for shade in shades]))
    return found


@pytest.mark.parametrize("count", [3, 40])
def test_each_run_has_its_row_of_classes_and_of_levels_in_the_order_given(tmp_path, count):
    event = Event("impact", 1.0, 2.0, 0.9)
    paths = [run_file(tmp_path, f"run{n:02d}", loud=0.4 * (n == 1)) for n in range(count)]
    several = laid(*paths, findings=[(), (event,)])
    write(several, tmp_path / "out.rrd")
    out = tmp_path / "out.rrd"
    slots = np.linspace(TOP, 0.0, count + 1)
    levels = rows(out, "/levels/")
    quiet = set(levels[0][2])
    loud = [place for _, place, shades in levels if set(shades) - quiet]
    assert loud
    assert all(
        slots[2] < line < slots[1] for place in loud for line in place
    )  # in the second row, no other
    assert {time[0] for time, _, _ in levels} == {0.0}
    time, place = read(out, "/class/mark/impact", "Scalars:scalars")
    assert time.tolist() == [1.0]
    assert slots[2] < place[0][0] < slots[1]
    _, (labels,) = read(out, "/axis/class/left", "Points2D:labels")
    assert [label for label in labels if "worst" in label] == ["run01\nworst"][: count < 35]
    curves = [entity for entity in entities(out) if entity.startswith("/curves/")]
    assert len(curves) == min(count, 8)
    assert "/curves/001" in curves


def test_runs_that_cannot_be_judged_do_not_pass(tmp_path):
    paths = [run_file(tmp_path, name) for name in "abc"]
    impact = (Event("impact", 1.0, 1.1, 0.9),)
    for findings, told in (((), "CANNOT TELL   3 of 3 runs"), ([impact], "FAIL   1 of 3 runs")):
        write(laid(*paths, findings=findings), tmp_path / "out.rrd", overwrite=True)
        assert read(tmp_path / "out.rrd", "/verdict/words", "Points2D:labels")[1] == [[told]]


def test_the_table_has_a_row_for_each_run_and_marks_the_worst(tmp_path):
    paths = [run_file(tmp_path, name) for name in "abc"]
    events = (Event("highaccelerations", 1.0, 1.2, 0.9), Event("impact", 2.0, 2.1, 0.8))
    text = report(laid(*paths, findings=[(), events]))
    assert text.startswith("### 3 runs, 1 with findings\n")
    assert "Worst: **b**, high accelerations from 1.00 s to 1.20 s" in text
    assert "| **b** (worst) | 1 high accelerations, 1 impact |" in text
    assert "| a | cannot-tell |" in text
    assert text.count("(3 runs)") == text.count("- ")  # what holds for all is said once


def test_runs_that_cannot_be_read_are_named_and_the_others_are_shown(tmp_path):
    good = [run_file(tmp_path, name) for name in "ab"]
    (tmp_path / "torn.npz").write_bytes(good[0].read_bytes()[:500])
    saved = tmp_path / "out.rrd"
    status, out, err = call("view", *good, tmp_path / "torn.npz", "gone.npz", "-o", saved)
    assert status == 3
    assert err.count("\n") == 2
    assert f"inspector: {tmp_path / 'torn.npz'}: " in err
    assert "inspector: gone.npz: cannot be read" in err
    assert "a: " in out
    assert "b: " in out
    assert "/curves/001" in entities(saved)
    alone = tmp_path / "alone.rrd"
    status, out, err = call("view", good[0], tmp_path / "torn.npz", "-o", alone)
    assert status == 3
    assert err.startswith(f"inspector: {tmp_path / 'torn.npz'}: ")
    assert f"{good[0]}: " in out
    assert "→" not in out
    assert alone.exists()
    for runs in (["x.npz", "y.npz"], ["x.npz", "y.npz", "z.npz"]):
        told = complaint("view", *runs, "-o", tmp_path / "none.rrd")
        assert f"none of {len(runs)} runs can be read" in told
    assert not (tmp_path / "none.rrd").exists()


@pytest.mark.parametrize(
    ("runs", "options", "text"),
    [
        (3, ["--align", "auto"], "--align takes two runs or more, --align auto two"),
        (1, ["--align", "start"], "--align takes two runs or more, --align auto two"),
    ],
)
def test_options_that_do_not_fit_the_number_of_runs_are_wrong_usage(tmp_path, runs, options, text):
    path = run_file(tmp_path, "a")
    err = complaint("view", *[path] * runs, *options, "-o", tmp_path / "out.rrd", status=2)
    assert text in " ".join(err.split())
