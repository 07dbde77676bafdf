"""The command line: read arguments, call one function, print its result."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    help="Inspect the noise that a robot's joints would make.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)

RunFile = Annotated[Path, typer.Argument(help="A run file (run.npz).", show_default=False)]
Output = Annotated[Path, typer.Option("--output", "-o", help="The file to write.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")]
ModelFiles = Annotated[
    list[Path] | None,
    typer.Option("--model", help="A model to use instead of those that ship; may be repeated."),
]
Kind = Annotated[
    str, typer.Option("--kind", help="Extended noise: normal, rms, mean, paper, A, B or C.")
]
Inputs = Annotated[
    list[Path], typer.Argument(help="Run files with annotated blocks, or NoisyTest folders.")
]


class Format(StrEnum):
    """How verdicts are written."""

    TEXT = "text"
    JSON = "json"
    JUNIT = "junit"
    GITHUB = "github"


@app.command()
def view(
    run: Annotated[
        Path | None, typer.Argument(help="A run file; without one, the demo that ships.")
    ] = None,
    save: Annotated[
        Path | None, typer.Option("--save", help="Write the recording here, open nothing.")
    ] = None,
    model: ModelFiles = None,
    robot: Annotated[
        bool, typer.Option("--robot/--no-robot", help="Draw the robot, and hear its links.")
    ] = True,
    kind: Kind = "normal",
    terms: Annotated[
        bool, typer.Option("--terms", help="Show the paper's terms A, B and C one by one.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Show a run in rerun: joints, noise, spectrogram, classes, the moving robot."""
    from inspector import assets, viewer
    from inspector.inspection import inspect
    from inspector.labelling import load_library
    from inspector.recording import write
    from inspector.report import sentence, verdict
    from noisemodel.atomic import refuse_existing

    path = run or assets.demo_run()
    target = save or viewer.scratch_path(path)
    overwrite = overwrite or save is None
    refuse_existing(target, overwrite=overwrite)
    library = load_library(model or assets.model_files())
    found = inspect(path, library, robot=robot, kind=kind, terms=terms)
    write(found, target, overwrite=overwrite)
    typer.echo(f"{path}: {verdict(found)}")
    for event in found.events:
        typer.echo(f"  {sentence(found, event)}")
    for remark in found.remarks:
        typer.echo(f"  {remark}")
    if save is None and viewer.has_display():
        problem = viewer.open_window(target)
        if not problem:
            return
        typer.echo(problem, err=True)
    typer.echo(f"recording: {target} ({target.stat().st_size / 1e6:.1f} MB)")
    typer.echo(viewer.how_to_open(target))


@app.command()
def classify(
    runs: Annotated[
        list[Path], typer.Argument(help="Run files, or NoisyTest's logs.", show_default=False)
    ],
    format: Annotated[Format, typer.Option("--format", help="How to print.")] = Format.TEXT,  # noqa: A002
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Runs at once.")] = 1,
    model: ModelFiles = None,
) -> None:
    """Label runs; exit 0 if all are quiet, 1 findings, 3 bad input, 4 cannot tell."""
    from inspector import assets
    from inspector.formats import FORMATS
    from inspector.labelling import load_library
    from inspector.progress import progress
    from inspector.verdict import exit_status, judge_all

    library = load_library(model or assets.model_files())
    verdicts = list(progress(judge_all(runs, library, jobs=jobs), "classify", total=len(runs)))
    typer.echo(FORMATS[format](verdicts))
    for bad in verdicts:
        if bad.status == "bad-input":
            typer.echo(f"inspector: {bad.path}: {bad.message}", err=True)
    raise typer.Exit(exit_status(verdicts))


@app.command()
def noise(
    run: RunFile,
    kind: Annotated[
        list[str] | None,
        typer.Option("--kind", help="simplified, paper, A, B, C, mean, rms, normal; repeatable."),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option("--csv", help="Write the noises over time here.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Print how loud a run is, when, and which joints and links make it so."""
    from inspector.loudness import default_kinds, estimate, loudness, write_csv
    from noisemodel import Run

    recorded = Run.load(run)
    estimates = tuple(estimate(recorded, each) for each in kind or default_kinds(recorded))
    if csv:
        write_csv(recorded, estimates, csv, overwrite=overwrite)
    typer.echo(f"{run}: {recorded.duration:.2f} s at {recorded.rate:g} Hz")
    for each in estimates:
        typer.echo(str(loudness(recorded, each)))


@app.command("import")
def import_(
    log: Annotated[Path, typer.Argument(help="A wide CSV log.", show_default=False)],
    output: Output,
    desired: Annotated[
        Path | None, typer.Option(help="Another CSV, with the desired motion on its own clock.")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="A listed robot, or a URDF.")] = None,
    rate: Annotated[
        float | None, typer.Option(min=1.0, help="The log's rate in [Hz], if it is known.")
    ] = None,
    map_: Annotated[
        list[str] | None,
        typer.Option("--map", help="velocity.JOINT=COLUMN; may be repeated."),
    ] = None,
    degrees: Annotated[bool, typer.Option(help="Angles in the log are in degrees.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Turn a CSV log into a run file."""
    from inspector.importing import read_csv

    imported = read_csv(
        log, desired=desired, robot=robot, rate=rate, mapping=map_ or (), degrees=degrees
    )
    imported.run.save(output, overwrite=overwrite)
    for remark in imported.remarks:
        typer.echo(f"  {remark}")
    typer.echo(f"{output}: {imported.run.duration:.2f} s at {imported.run.rate:g} Hz")


@app.command()
def simulate(
    robot: Annotated[str, typer.Argument(help="The robot: panda.")] = "panda",
    scenario: Annotated[str, typer.Option(help="What happens to it.")] = "ok",
    seed: Annotated[int, typer.Option(min=0, help="Makes each run another one.")] = 0,
    duration: Annotated[
        float | None, typer.Option(min=0.5, help="In seconds; 7 unless given.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path(
        "run.npz"
    ),
    list_: Annotated[bool, typer.Option("--list", help="Print the scenarios, do nothing.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Simulate a robot with a defect, labelled by construction (needs the extra `sim`)."""
    import scenarios
    from noisemodel.atomic import refuse_existing

    if list_:
        for name, entry in scenarios.SCENARIOS.items():
            typer.echo(f"{name:12} {entry.description}")
        return
    refuse_existing(output, overwrite=overwrite)
    run = scenarios.simulate(robot, scenario, seed, duration=duration)
    run.save(output, overwrite=overwrite)
    typer.echo(f"{output}: {run.duration:.2f} s at {run.rate:g} Hz")
    for block in run.blocks:
        typer.echo(f"  {block.label} from {block.start:.2f} s to {block.stop:.2f} s")


@app.command()
def train(
    inputs: Inputs,
    output: Output,
    profile: Annotated[
        str, typer.Option(help="logbands, noisytest-rbf, noisytest-linear, paper-rbf, paper-linear")
    ] = "logbands",
    rate: Annotated[
        float, typer.Option(min=1.0, help="Rate of the model in [Hz]; faster runs are lowered.")
    ] = 10000.0,
    overwrite: Overwrite = False,
) -> None:
    """Train a model on annotated runs."""
    from inspector.training import train as train_model

    typer.echo(str(train_model(inputs, profile, rate, output, overwrite=overwrite)))
    typer.echo(f"{output}: written; measured above on the frames that it was trained on")


@app.command()
def evaluate(
    model: Annotated[Path, typer.Argument(help="A model file.", show_default=False)],
    inputs: Inputs,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure a model on annotated runs that it was not trained on."""
    from json import dumps

    from inspector.training import evaluate as evaluate_model

    report = evaluate_model(model, inputs)
    typer.echo(dumps(report.as_dict(), indent=2) if as_json else str(report))


@app.command()
def compare(
    runs: Annotated[
        list[Path] | None, typer.Argument(help="Run files with robot and positions.")
    ] = None,
    robots: Annotated[
        str, typer.Option(help="Robots to move by a motion of our own: talos,go2 or all.")
    ] = "",
    kinds: Annotated[
        str, typer.Option(help="Of simplified, paper, A, B, C, mean, rms, normal.")
    ] = "simplified,C,paper,mean,rms,normal",
    geometry: Annotated[str, typer.Option(help="visual, collision, hull or auto.")] = "auto",
    seed: Annotated[int, typer.Option(min=0, help="Makes our own motion another one.")] = 0,
    csv: Annotated[Path | None, typer.Option(help="Write all numbers here.")] = None,
    save: Annotated[Path | None, typer.Option(help="Write a recording (.rrd) here.")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Write a PNG here (needs the extra `report`).")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Robots at once.")] = 1,
    overwrite: Overwrite = False,
) -> None:
    """Compare the noise models; exit 3 if nothing could be compared."""
    from inspector import comparing, comparisonoutput
    from inspector.comparisontable import table
    from inspector.progress import progress

    sources = comparing.sources_of(runs or (), robots)
    if not sources:
        raise typer.BadParameter("name run files, or robots with --robots")
    settings = comparing.Settings(tuple(kinds.split(",")), geometry, seed)
    outputs = comparisonoutput.Outputs(csv, save, picture, overwrite=overwrite)
    outputs.check(len(sources))
    results = comparing.compare_all(sources, settings, jobs=jobs)
    found, failed = comparing.sorted_out(progress(results, "compare", total=len(sources)))
    for bad in failed:
        typer.echo(f"inspector: {bad.name}: {bad.message}", err=True)
    if not found:
        raise typer.Exit(3)
    outputs.write(found)
    typer.echo(table(found))


@app.command()
def robots() -> None:
    """List the robots that can be had by name."""
    from noisemodel import ROBOTS

    for name, robot in ROBOTS.items():
        base = "floating" if robot.floating_base else "fixed"
        typer.echo(f"{name:28} {base:10} {robot.urdf}")


def main() -> None:
    """Run the command line; expected errors become one line and exit status 3."""
    try:
        app()
    except ValueError as error:
        from inspector.verdict import EXPECTED
        from scenarios import ScenarioError

        if not isinstance(error, (*EXPECTED, ScenarioError)):
            raise
        typer.echo(f"inspector: {error}", err=True)
        sys.exit(3)
