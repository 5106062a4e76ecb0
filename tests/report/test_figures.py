"""Pictures: the same bytes for the same numbers, units on every axis, no dependence on settings."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import toy
from matplotlib.figure import Figure

from mcsettle.analysis.stress_under_train import DepthCurve, StressAlong, layer_weights
from mcsettle.analysis.table4 import DEFINITIONS, Increase
from mcsettle.railway.track import CASE_STUDY_TRACK
from mcsettle.report.figures.passage import axle_passage, passage_figure
from mcsettle.report.figures.receptance import ReceptanceMap, receptance_figure
from mcsettle.report.figures.results import Fan, fan_figure
from mcsettle.report.figures.section import section_figure, section_view, softening_figure
from mcsettle.report.figures.slice import DeflectionSlice, slice_figure
from mcsettle.report.figures.stress import along_figure, depth_figure, table4_figure
from mcsettle.report.figures.style import FORMATS, files_of, log_labels
from mcsettle.report.figures.vehicles import VehiclePeaks, vehicles_figure

X = np.linspace(0.0, 200.0, 41)


def depth() -> Figure:
    grid = toy.transfer().grid
    decay = 1e4 * np.exp(grid.z / 3.0)
    curves = [DepthCurve(f"{v} km/h", grid.z, grid.layer, decay, decay / v) for v in (201, 225)]
    return depth_figure(curves, [("ballast", 0.8), ("subgrade", 0.0)], "SD 1 mm", "title")


def along() -> Figure:
    x = np.linspace(-15.0, 15.0, 31)
    rows = np.abs(np.array([np.cos(x), np.sin(x)])) * 1e4
    view = StressAlong("train", x, np.array([0.7, 0.0]), rows, np.array([-9.0, 9.0]))
    return along_figure(view, ["z = 0.7 m", "z = 0.0 m"], "title")


def table4() -> Figure:
    rows = [
        Increase(name, speed, d, 1e3, p, 0.7 * p, 1.2 * p, p + 1.0 if p else None, "Table 4")
        for d in DEFINITIONS
        for name, speed, p in (("a", 55.0, 0.0), ("b", 60.0, 5.0))
    ]
    return table4_figure(rows, "SD 1 mm")


def receptance() -> Figure:
    k, omega = np.linspace(0.01, 2.0, 20), np.linspace(0.0, 160.0, 17)
    values = 1e-9 / (1.0 + k[:, None] + omega[None, :])
    view = ReceptanceMap(k, omega, values, (("train", 55.0),), 109.0, "Rayleigh wave")
    return receptance_figure(view, "title")


def vehicles() -> Figure:
    peak = 1e-5 * (1.1 + np.sin(X))
    peaks = {"complete": peak, "bogies": 0.5 * peak}
    views = [VehiclePeaks(name, 50.0, 3, X, 1e-3 * np.sin(X), peaks) for name in ("one", "two")]
    return vehicles_figure(views, "Profile: seed 1.", "title")


def passage() -> Figure:
    transfer = toy.transfer()
    weights = layer_weights(transfer.grid, 0, 0.7)
    profile = toy.profiles([1])[0]
    view = axle_passage(transfer, 2, profile, weights, toy.model(), 200.0, "a train")
    return passage_figure(view, "0.1 m below the sleeper", "sub_ballast", "seed 1")


def section() -> Figure:
    return section_figure(section_view(CASE_STUDY_TRACK, 2.0), "title")


def softening() -> Figure:
    view = section_view(CASE_STUDY_TRACK, 2.0)
    scale = np.where(view.material > 0, 0.7, np.nan)
    return softening_figure(view, scale, "title")


def deflection() -> Figure:
    x, z = np.linspace(-30.0, 30.0, 61), np.linspace(1.0, -5.0, 13)
    field = 1e-3 * np.exp(-((x / 10.0) ** 2))[:, None] * np.exp(z / 8.0)
    wave = 0.1 * np.cos(x / 2.0)
    return slice_figure(
        DeflectionSlice(
            "train", x, z, field, wave[:, None] * field, 1.2 * field[:, 0], wave * field[:, 0],
            1e-3 * wave, np.array([-2.0, 2.0]), np.array([4e3, -2e3]),
        ),
        "Profile: seed 1.",
    )  # fmt: skip


DRAWN = [depth, along, table4, receptance, vehicles, passage, section, softening, deflection]


@pytest.mark.parametrize("draw", DRAWN, ids=lambda draw: draw.__name__)
def test_every_axis_has_a_unit_and_no_label_is_cut(draw) -> None:
    figure = draw()
    figure.canvas.draw()
    edge = figure.bbox
    for axes in figure.axes:
        labels = [axes.get_ylabel(), *([axes.get_xlabel()] if axes.get_xlabel() else [])]
        for label in labels:
            assert not label or ("[" in label and "]" in label), label
    for text in figure.findobj(matplotlib.text.Text):
        if text.get_text() and text.get_visible() and text.get_in_layout():
            box = text.get_window_extent()
            if not text.get_clip_on():
                assert box.x0 >= edge.x0 - 1.0, text
                assert box.x1 <= edge.x1 + 1.0, text


@pytest.mark.parametrize("draw", DRAWN, ids=lambda draw: draw.__name__)
def test_same_numbers_same_bytes(draw, tmp_path: Path) -> None:
    """As SVG, which has all that is drawn and ids besides; one of them as PNG too."""
    formats = FORMATS if draw is depth else ("svg",)
    first = list(files_of(draw(), tmp_path, "picture", formats).values())
    with matplotlib.rc_context({"font.size": 17, "svg.hashsalt": "other", "axes.grid": False}):
        second = list(files_of(draw(), tmp_path, "picture", formats).values())
    assert first == second
    assert first[0].startswith(b"\x89PNG") or draw is not depth
    assert ElementTree.fromstring(first[-1]).tag.endswith("svg")
    assert b"dc:date" not in first[-1]
    assert matplotlib.rcParams["svg.hashsalt"] != "mcsettle"


@pytest.mark.parametrize(("last", "drawn"), [(1.75, False), (9.9, True)])
def test_a_limit_that_no_track_comes_near_does_not_press_the_curves(last, drawn):
    days = np.array([0.0, 500.0])
    quantiles = np.array([[1.7, last - 0.1 * (4 - i)] for i in range(5)])
    axes = fan_figure([Fan("line", days, quantiles, 0.05)], 10.0).axes[0]
    assert bool(axes.get_ylim()[1] > 10.0) is drawn
    assert [t.get_text() for t in axes.texts] == ["limit" if drawn else "limit: 10 mm, above"]


@pytest.mark.parametrize("ends", [(0.9, 1.1), (3.0, 4.5), (2.2, 4.8), (3.0, 70.0), (1e-9, 1e-3)])
def test_a_log_axis_has_two_labels_at_least(ends: tuple[float, float]) -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.set(yscale="log", ylim=ends)
    log_labels(axes.yaxis)
    figure.draw_without_rendering()
    shown = [
        label.get_text()
        for place, label in zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)
        if ends[0] <= place <= ends[1] and label.get_text()
    ]
    assert len(set(shown)) >= 2
    assert len(shown) <= 8
