"""Every kind of chart on a page with all that it can show: logarithms, bands, gaps, columns."""

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_hex, to_rgb

from servo.report import charts
from servo.report.charts import Curve, Scale, colour


@pytest.fixture
def chart(monkeypatch, drawn, approved):
    """Compares a chart with the one that was approved."""
    monkeypatch.setattr(charts, "svg", lambda figure, title: [title, drawn(figure)])
    return lambda name, figure: approved(f"charts/{name}", figure)


X = np.array([0.0, 0.5, 1.0, 1.5, 2.0])


def test_curves_with_bands_points_dashes_and_shade(chart):
    y = np.array([1.0, 3.0, 2.0, 5.0, 4.0])
    drawn = [
        Curve("plain", X, y),
        Curve("band", X, y + 1, y, y + 3, colour=colour(1)),
        Curve("points", X, y / 2, y / 2 - 0.2, y, colour=colour(2), points=True),
        Curve("dashed", X, -y, colour=colour(3), dashed=True),
    ]
    shade = X, np.array([False, True, True, False, False])
    chart(
        "curves",
        charts.curves("t", Scale("x"), Scale("y", low=-9.0), drawn, shaded=shade, note="n"),
    )


@pytest.mark.parametrize(("low", "ends"), [(0, (0, 3.5)), (None, (2.5, 3.5))])
def test_rounding_has_no_range_of_its_own(low, ends):
    y = 3 + 1e-14 * np.array([0.0, 5.0, 1.0, 300.0, 7.0])
    figure = charts.curves("t", Scale("x"), Scale("y", low=low, log_from=5.0), [Curve("c", X, y)])
    assert figure.drawing.axes[0].get_ylim() == pytest.approx(ends)
    figure = charts.curves("t", Scale("x"), Scale("y", 0, log_from=5.0), [Curve("c", X, y - 3)])
    axes = figure.drawing.axes[0]
    assert (axes.get_yscale(), axes.get_ylim()) == ("linear", pytest.approx((-0.5, 0.5)))


@pytest.mark.parametrize("deep", [30.0, 1e3, 1e9])
@pytest.mark.newest
def test_a_curve_over_decades_has_a_logarithmic_axis(chart, deep):
    y = np.array([0.0, 1.0, 2.0, np.nan, deep])
    x, axis = Scale("x", 0.0, 2.0), Scale("y", low=0, log_from=10.0)
    chart(f"decades-{deep:g}", charts.curves("t", x, axis, [Curve("one", X, y, dashed=True)]))


def test_a_long_interval_cuts_no_mean_off():
    drawn = [Curve("mean", X, np.full(5, 2.0), np.full(5, 1.0), np.full(5, 1e6))]
    (axes,) = charts.curves("t", Scale("x"), Scale("y", log_from=50.0), drawn).drawing.axes
    assert axes.get_yscale() == "log"
    # The axis covers three decades below the largest mean, not below the end of the interval.
    assert axes.get_ylim() == pytest.approx((1.0 / 1.15, 1e6 * 1.15))


def test_a_curve_below_the_factor_keeps_its_axis(chart):
    axis = Scale("y", low=0, high=50, log_from=100.0)
    chart("linear", charts.curves("t", Scale("x"), axis, [Curve("one", X, 10 + 10 * X)]))


@pytest.mark.parametrize(
    "options", [{}, {"limits": (0.0, 1.0)}, {"log_from": 5.0}], ids=["plain", "limits", "log"]
)
def test_a_heat_map_has_its_numbers(chart, options, request):
    values = np.array([[0.1, 0.5, np.nan], [0.9, 0.2, 8.0]])
    figure = charts.heat("t", "x", "y", ["p", "q", "r"], ["u", "v"], values, **options, note="n")
    chart(f"heat-{request.node.callspec.id}", figure)


def test_numbers_in_a_heat_map_can_be_read():
    values = np.linspace(0, 1, 12)[None]
    (axes,) = charts.heat("t", "x", "y", list("abcdefghijkl"), ["u"], values).drawing.axes

    def luminance(colour):
        coded = np.array(to_rgb(colour))
        linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
        return linear @ (0.2126, 0.7152, 0.0722)

    for text, value in zip(axes.texts, values[0], strict=True):
        pair = luminance(text.get_color()), luminance(colormaps["viridis"](value))
        contrast = (max(pair) + 0.05) / (min(pair) + 0.05)
        assert contrast > 4.5, value  # what WCAG 2.2 asks for (AA)


@pytest.mark.parametrize("options", [{}, {"limits": (0.0, 1.0)}, {"log_from": 5.0}])
def test_a_heat_map_of_nothing_but_nan_is_empty(options):
    figure = charts.heat("t", "x", "y", ["p"], ["u", "v"], np.full((2, 1), np.nan), **options)
    (axes,) = figure.drawing.axes
    assert [text.get_text() for text in axes.texts] == []
    assert [label.get_text() for label in axes.get_yticklabels()] == ["u", "v"]


def test_a_heat_map_of_many_columns_has_none(chart):
    columns = [f"column {i}" for i in range(14)]
    values = np.arange(28.0).reshape(2, 14)
    chart("heat-wide", charts.heat("t", "x", "y", columns, ["u", "v"], values))


def test_no_colour_of_a_heat_map_is_one_that_follows_the_page():
    shades = {to_hex(shade) for shade in colormaps["viridis"](np.arange(256))}
    assert not shades & set(charts.INKS)


def test_a_figure_that_is_saved_twice_has_one_legend():
    figure = charts.stacked("t", ["b"], ["p", "q"], np.array([[0.4], [0.6]]))
    first, second = (charts.saved(figure, "svg") for _ in range(2))
    assert first == second
    assert first.count(b">p</text>") == 1
