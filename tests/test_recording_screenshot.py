import pytest
from commandline import call

from inspector.library import demo_run
from inspector.recording import viewer
from inspector.recording.viewer import ViewerError


def test_system_packages_that_pictures_take_are_named(monkeypatch, tmp_path):
    monkeypatch.setattr(viewer, "DRIVER_FOLDERS", (tmp_path,))
    monkeypatch.setattr(viewer.sys, "platform", "linux")
    for library, driver, there in (("", "", False), ("so", "", False), ("so", "icd.json", True)):
        monkeypatch.setattr(viewer, "find_library", lambda _, found=library: found or None)
        if driver:
            (tmp_path / driver).touch()
        assert viewer.has_driver() == there
        if not there:
            wanted = "`apt-get install libvulkan1 mesa-vulkan-drivers`"
            with pytest.raises(ViewerError, match=wanted):
                viewer.shoot(tmp_path / "run.rrd", tmp_path / "out.png", 0.0)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["view", "gone.npz", "-o", "out.png"], "gone.npz: cannot be read"),
        (["view", demo_run(), "-o", "s.jpg"], "s.jpg: name a .rrd, .png or .html file"),
        (["view", demo_run(), demo_run(), "-o", "v.png"], ".png takes one run"),
        (["view", demo_run(), "-o", "v.rrd", "--at", "1"], "--at takes -o FILE.png"),
        (["view", demo_run(), "-o", "s.png", "--at", "100"], "--at 100: the samples are from 0 s"),
        (["view", demo_run(), "-o", "s.png", "--at", "-1"], "--at -1: the samples are from 0 s"),
    ],
)
def test_what_cannot_be_shot_leaves_nothing(arguments, text, tmp_path, monkeypatch):
    monkeypatch.setattr(viewer, "require_driver", lambda: None)
    monkeypatch.chdir(tmp_path)
    status, _, err = call(*arguments)
    assert status == (3 if "gone.npz" in arguments else 2)
    assert status == 2 or err.count("\n") == 1
    assert text in " ".join(err.split())
    assert not list(tmp_path.iterdir())
