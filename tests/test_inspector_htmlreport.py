import base64
import dataclasses
import io
import re
import struct
import wave
from html.parser import HTMLParser

import numpy as np
import pytest
from commandline import refused

from inspector.analysis import analyse_file
from inspector.library import demo_run, load_library, model_files
from inspector.report import html
from noiseclassifier import Event
from noisemodel import Block, Run

VOID = {"meta", "img", "br", "hr", "link", "input"}


class Page(HTMLParser):
    """A page as a browser has to read it: every element closed in its turn."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.text, self.addresses = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == [], f"never closed: {self.open}"

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "data")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open[-1] == tag, f"</{tag}> within {self.open}"
        self.open.pop()

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.text.append(data)

    @property
    def words(self):
        return " ".join(" ".join(self.text).split())


def short_run(**changes):
    time = np.arange(6000) / 1000
    velocity = np.stack((np.sin(300 * time), 0.2 * np.sin(900 * time)), axis=1)
    fields = {"time": time, "velocity": velocity, "joint_names": ("elbow", "wrist")}
    return Run(**(fields | changes))


def inspected(run, tmp_path, **changes):
    run.save(tmp_path / "run.npz", overwrite=True)
    return dataclasses.replace(analyse_file(tmp_path / "run.npz", {}), **changes)


@pytest.fixture(scope="module")
def demo():
    return html.page(analyse_file(demo_run(), load_library(model_files())), audit="rate: 10 kHz")


def test_the_page_of_the_demo_is_valid_and_has_everything(demo):
    page = Page(demo)
    assert demo.startswith('<!DOCTYPE html>\n<html lang="en">')
    for tag in ("html", "head", "title", "body", "h1", "img", "audio"):
        assert page.tags.count(tag) == 1, tag
    titles = ("Findings", "Annotated", "Over time", "Sound")
    for title in (*titles, "What the log can show", "Remarks"):
        assert title in page.words
    assert "panda_link7" in page.words
    assert "panda_joint6" in page.words
    assert len(demo.encode()) <= 5_000_000


def test_the_page_fetches_nothing_from_anywhere(demo):
    page = Page(demo)
    assert [address.partition(",")[0] for address in page.addresses] == [
        "data:image/png;base64",
        "data:audio/wav;base64",
    ]
    rest = re.sub(r"base64,[A-Za-z0-9+/=]+", "", demo)
    assert not re.search(r"https?:|//|url\(|@import|<script|<link|<iframe", rest)
    assert "default-src 'none'" in demo


def test_the_picture_and_the_sound_are_whole(demo):
    picture, sound = (
        base64.b64decode(address.partition(",")[2]) for address in Page(demo).addresses
    )
    assert picture.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", picture[16:24])
    assert width > 1000
    assert height > 600
    with wave.open(io.BytesIO(sound)) as file:
        assert file.getnframes() / file.getframerate() == pytest.approx(4.0, abs=0.01)


def test_a_run_without_robot_labels_and_findings_has_a_page_too(tmp_path):
    page = Page(html.page(inspected(short_run(), tmp_path)))
    assert "cannot-tell: rate of 1000 Hz" in page.words
    assert "No 3D robot: the run names none." in page.words
    assert "Findings" not in page.words


def test_names_are_escaped_in_the_page(tmp_path):
    evil = "<script>alert(1)</script>\"'&$\\frac{$"
    run = short_run(joint_names=(evil, "wrist"), blocks=(Block(1.0, 2.0, f"<b>{evil}"),))
    found = inspected(run, tmp_path, name=evil)
    text = html.page(found, audit=f"{evil}\x00\x1b[31m")
    page = Page(text)
    assert "script" not in page.tags
    assert "b" not in page.tags
    assert "<script>alert(1)</script>" in page.words
    assert not re.search(r"[\x00-\x08\x0b-\x1f]", text)


def test_a_slow_log_has_no_sound_and_gaps_and_silence_are_drawn(tmp_path):
    time = np.arange(600) / 30
    run = short_run(time=time, velocity=np.sin(np.stack((time, 2 * time), axis=1)))
    page = Page(html.page(inspected(run, tmp_path)))
    assert "audio" not in page.tags
    assert "rate is too low for audible frequencies" in page.words
    valid = (np.arange(6000) < 2000) | (np.arange(6000) >= 4000)
    still = short_run(velocity=np.zeros((6000, 2)), valid=valid)
    page = Page(html.page(inspected(still, tmp_path)))
    assert "img" in page.tags
    assert "silent: nothing reaches 1e-06 rad/s" in page.words


def test_findings_are_listed_with_their_scores(tmp_path):
    events = (Event("impact", 1.0, 1.5, 0.9), Event("wobble", 3.0, 3.5, 0.7, novel=True))
    words = Page(html.page(inspected(short_run(), tmp_path, findings=events, spans=events))).words
    assert "impact, 1.00 s to 1.50 s, score 0.90" in words
    assert "wobble, 3.00 s to 3.50 s, score 0.70, out of distribution" in words


def test_without_matplotlib_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("inspector.report.picture.find_spec", lambda _: None)
    assert 'pip install "noise-inspector[report]"' in refused("view", "-o", tmp_path / "out.html")
