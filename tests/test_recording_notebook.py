import sys
import types
from pathlib import Path
from urllib.parse import quote

import browser
import numpy as np
import pytest

import inspector
from inspector.recording import viewer
from inspector.recording.viewer import ViewerError
from noisemodel import Run, RunFileError

ROOT = Path(__file__).parents[1]


@pytest.fixture
def run():
    time = np.arange(4000) / 1000
    return Run(time=time, velocity=np.sin(300 * time)[:, None], joint_names=("elbow",))


@pytest.fixture(autouse=True)
def plain(monkeypatch, tmp_path):
    """Plain Python with a display, and a cache of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(viewer, "has_display", lambda: True)
    monkeypatch.setattr(viewer, "in_notebook", lambda: False)


@pytest.fixture
def opened(monkeypatch):
    """The recordings that a window was opened for."""
    shown = []
    monkeypatch.setattr(viewer, "open_window", lambda path: shown.append(path) or "")
    return shown


def test_plain_python_opens_a_window_of_a_run_and_of_a_run_file(run, opened, tmp_path):
    inspector.show(run)
    run.save(tmp_path / "run.npz")
    inspector.show(tmp_path / "run.npz")
    inspector.show(str(tmp_path / "run.npz"))
    assert all(recording.read_bytes().startswith(b"RRF2") for recording in opened)
    assert len(opened) == 3
    assert len(set(opened)) == 2  # the same run replaces its own recording


@pytest.mark.parametrize(
    ("name", "result", "problem"),
    [
        ("has_display", False, "no display"),
        ("open_window", "the viewer ended with status 101", "status 101"),
    ],
)
def test_where_no_window_opens_the_recording_is_named(run, monkeypatch, name, result, problem):
    monkeypatch.setattr(viewer, name, lambda *_: result)
    with pytest.raises(ViewerError, match=rf"{problem}; the recording is in .*\.rrd"):
        inspector.show(run)


def test_what_is_no_run_is_named(tmp_path, opened):
    with pytest.raises(RunFileError, match="gone.npz: cannot be read"):
        inspector.show(tmp_path / "gone.npz")
    assert opened == []


def test_a_notebook_without_the_widget_is_an_error_with_what_to_install(run, monkeypatch):
    monkeypatch.setattr(viewer, "in_notebook", lambda: True)
    monkeypatch.setattr(viewer, "find_spec", lambda _: None)
    with pytest.raises(ViewerError, match=r'pip install "rerun-sdk\[notebook\]"'):
        inspector.show(run)


@pytest.fixture
def kernel(monkeypatch):
    """A kernel that has rerun's widget; what is displayed and sent, and how to set its code."""
    seen = types.SimpleNamespace(widgets=[], sent=[])

    class Viewer:
        def __init__(self, width, height):
            self.size = (width, height)

        def send_rrd(self, data):
            seen.sent.append(data)

    seen.rerun = types.SimpleNamespace(Viewer=Viewer, ESM_MOD="// 23 MB")
    trait = types.SimpleNamespace(tag=lambda sync: sync)
    modules = {
        "rerun_notebook": seen.rerun,
        "IPython.display": types.SimpleNamespace(display=seen.widgets.append),
        "traitlets": types.SimpleNamespace(
            Unicode=lambda code: setattr(seen, "code", code) or trait
        ),
    }
    monkeypatch.setattr(viewer, "in_notebook", lambda: True)
    monkeypatch.setattr(viewer, "find_spec", lambda _: object())
    monkeypatch.setattr(viewer, "import_module", modules.get)
    monkeypatch.delenv("RERUN_NOTEBOOK_ASSET", raising=False)
    return seen


def test_a_notebook_gets_the_recording_and_fetches_nothing_from_outside(run, kernel):
    inspector.show(run, size=(800, 500))
    (widget,) = kernel.widgets
    assert isinstance(widget, kernel.rerun.Viewer)
    assert widget.size == (800, 500)
    assert [data[:4] for data in kernel.sent] == [b"RRF2"]
    assert viewer.os.environ["RERUN_NOTEBOOK_ASSET"] == "inline"
    assert (widget._esm, kernel.code, widget._code) == (viewer.LOADER, "// 23 MB", True)


def test_a_notebook_whose_owner_names_an_address_has_the_viewer_fetched_there(run, kernel):
    kernel.rerun.ESM_MOD = "https://viewer.example/widget.js"
    inspector.show(run)
    assert [type(widget) for widget in kernel.widgets] == [kernel.rerun.Viewer]


@pytest.mark.slow
def test_a_widget_is_ready_before_its_code_and_then_draws():
    """Of a widget that takes two seconds to be ready, anywidget forgets what is sent to it."""
    code = """
        await new Promise((ready) => setTimeout(ready, 3000));
        const render = ({ model, el }) => { el.textContent = model.get("name"); return "ended"; };
        export default { render };
    """
    with browser.page() as page:
        page.set_content("<main></main>")
        assert page.evaluate(
            """async ([loader, code]) => {
                const begun = performance.now();
                const { default: widget } = await import(`data:text/javascript,${loader}`);
                const ready = performance.now() - begun;
                const el = document.querySelector("main");
                const model = { get: (name) => ({ _code: code, name: "drawn" })[name] };
                const end = await widget.render({ model, el });
                return [ready < 2000, el.textContent, end];
            }""",
            [quote(viewer.LOADER), code],
        ) == [True, "drawn", "ended"]


def test_plain_python_is_no_notebook_and_a_kernel_is(monkeypatch):
    monkeypatch.undo()
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    assert not viewer.in_notebook()
    shell = types.SimpleNamespace(kernel=object())
    ipython = types.SimpleNamespace(get_ipython=lambda: shell)
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    assert viewer.in_notebook()
    ipython.get_ipython = object  # a terminal's shell has no kernel
    assert not viewer.in_notebook()
