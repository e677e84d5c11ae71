"""A whole run from Python: tables, figures, pictures, and what a notebook shows of them."""

import copy
import pickle
from functools import partial

import av
import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import servo
from servo import Mistake, notebook
from servo.cli import run_command

SHORT = ["run.duration=0.5", "measure.after=0.46", "start.x=12", "camera.noise=2"]


@pytest.fixture(scope="module")
def result():
    return servo.simulate("still", SHORT, seed=4, gain=1.5)


def test_its_tables_are_those_of_the_command(result, tmp_path):
    run_command.run(
        "still", [*SHORT, "controller.gain=1.5"], 4, tmp_path, quiet=True, no_rerun=True
    )
    written = pq.read_table(tmp_path / "steps.parquet").to_pandas()
    timed = [name for name in written if name.startswith("seconds_")]
    assert result.steps.drop(columns=timed).equals(written.drop(columns=timed))
    rms = written.servo_error_px.iloc[-1]
    assert (
        result.measures.loc["servo_rms_px", "value"]
        == rms
        == result.record.measures["servo_rms_px"]
    )
    assert result.measures.loc["servo_rms_px", "unit"] == "px"


def test_without_pandas_tables_are_of_arrow(result, monkeypatch):
    monkeypatch.setattr(notebook, "find_spec", lambda name: None)
    monkeypatch.delitem(vars(result), "measures", raising=False)
    monkeypatch.delitem(vars(result), "steps", raising=False)
    assert isinstance(result.steps, pa.Table)
    assert result.measures.column("measure")[0].as_py() == "servo_rms_px"
    for again in (copy.copy, copy.deepcopy, lambda table: pickle.loads(pickle.dumps(table))):
        assert again(result.measures) == result.measures
    head, first, *_ = str(result.measures).splitlines()
    assert head.split() == ["measure", "value", "unit", "bound", "meaning"]
    name, value, unit = first.split()[:3]
    assert (name, unit) == ("servo_rms_px", "px")
    assert float(value) == pytest.approx(result.record.measures["servo_rms_px"], rel=0.01)
    assert head.index("value") == first.index(value)
    assert result.measures._repr_html_().count("<tr>") == 1 + result.measures.num_rows
    del result.__dict__["steps"], result.__dict__["measures"]


def test_it_is_the_sequence_of_its_steps(result):
    assert len(result) == 15
    assert [s.frame.index for s in result[3:6]] == [3, 4, 5]
    last = result[-1]
    seen = list(servo.run(result.scenario))[-1].frame.image
    assert np.abs(last.frame.image.astype(int) - seen).mean() < 3  # JPEG
    assert repr(last) == (
        f"Step(frame 14, 0.467 s: servo error {last.servo_error:.2f} px, tracking error "
        f"{last.tracking_error:.2f} px, LOCKED, SERVOING)"
    )
    assert repr(result).startswith("Run(still, seed 4: TIMED_OUT, ")


def test_a_picture_shows_where_the_target_shall_be(result):
    picture = np.asarray(result.frame(0.2))
    assert picture.shape == (480, 640, 3)
    corners = 2 * result[6].goal.corners
    across = (corners + np.roll(corners, -1, axis=0)) / 2  # the middle of each side
    near = [
        picture[int(y) - 3 : int(y) + 3, int(x) - 3 : int(x) + 3].astype(int) for x, y in across
    ]
    red = [bool((p[..., 0] > np.maximum(90, 2 * p[..., 1])).any()) for p in near]
    assert sum(red) >= 2  # truth and estimate are drawn over the others
    with pytest.raises(
        Mistake, match=r"^frame\(9\): this time is not in the run, from 0 to 0.466667 s$"
    ):
        result.frame(9)


def test_a_notebook_shows_summary_and_plots(result):
    page = result._repr_html_()
    assert "<b>still, seed 4</b>: TIMED_OUT. " in page
    assert "(missed: outcome is TIMED_OUT, expected CONVERGED; " in page
    assert page.count("<img") == 1
    assert "<td>servo_rms_px</td>" in page
    assert "<td>servo_angle_peak_deg</td>" not in page
    figure = result.figure()
    assert [ax.get_ylabel()[:8] for ax in figure.axes] == [
        "feature ",
        "distance",
        "dxn/dt o",
        "dyn/dt o",
    ]
    drawn = cv2.imdecode(np.frombuffer(figure._repr_png_(), np.uint8), cv2.IMREAD_COLOR)
    assert drawn.shape[1] == 640


def test_a_film_is_of_all_steps(result, monkeypatch):
    given = {}

    def write_film(steps, path, title):
        given[title] = [s.frame.index for s in steps]
        path.write_bytes(b"mp4")

    monkeypatch.setattr("servo.output.film.write_film", write_film)
    clip = result.film()
    assert given == {"still, seed 4": list(range(15))}
    assert clip._repr_html_().endswith('src="data:video/mp4;base64,bXA0"></video>')


def test_the_viewer_needs_an_extra_and_a_notebook(result, monkeypatch):
    monkeypatch.setattr("servo.result.find_spec", lambda name: name)
    with pytest.raises(Mistake, match=r"^Run.view: this is no notebook; record with"):
        result.view()
    monkeypatch.setattr("servo.result.find_spec", lambda name: None)
    with pytest.raises(Mistake, match=r"^view: .*pip install 'servobench\[notebook\]'$"):
        result.view()


def test_a_notebook_shows_a_mistake_as_one_sentence():
    with pytest.raises(Mistake) as found:
        servo.simulate("still", gian=2)
    sentence = "Mistake: there is no setting 'gian'; did you mean 'gain'?"
    assert found.value._render_traceback_() == [sentence]


def test_a_loaded_scenario_takes_no_changes():
    with pytest.raises(Mistake, match=r"^a loaded scenario cannot be changed: "):
        servo.simulate(servo.load("still"), gain=2.0)


def test_a_bar_is_shown_in_notebooks_only(monkeypatch):
    shown = []

    class Display:
        HTML = staticmethod(str)

        def display(self, page, display_id):
            self.update(page)
            return self

        update = staticmethod(shown.append)

    display = Display()
    monkeypatch.setattr(notebook, "import_module", lambda name: display)
    monkeypatch.setattr(notebook, "INTERVAL", 0.0)
    for there in (False, True):
        monkeypatch.setattr(notebook, "in_notebook", partial(bool, there))
        with notebook.progress("<run>", 3) as bar:
            bar(2, "error 1 px")
    first, second, last = shown
    assert 'value="0" max="3"' in first
    assert second.startswith("<div>&lt;run&gt; <progress ")
    assert second.endswith("2 / 3 error 1 px</div>")
    assert last == ""


@pytest.mark.processes
def test_a_study_gives_its_tables(tmp_path):
    study = tmp_path / "mine.toml"
    study.write_text('scenario = "line"\nseeds = 2\n[axes]\ncontroller.gain = [1.0, 2.0]\n')
    swept = servo.sweep(
        str(study), ["run.duration=0.3", "measure.after=0"], workers=1, out=tmp_path / "out"
    )
    assert swept.runs.columns[:4].tolist() == ["run", "scenario", "seed", "controller.gain"]
    assert swept.cells["controller.gain"].tolist() == [1.0, 2.0]
    assert swept.cells["runs"].tolist() == [2, 2]
    assert repr(swept) == "Sweep(mine: 4 runs, 2 cells, 0 failed)"
    assert swept._repr_html_().count("<tr>") == 3
    rms = [record.measures["servo_rms_px"] for record in swept.records]
    assert rms == swept.runs["servo_rms_px"].tolist()
    again = servo.sweep(
        str(study), ["run.duration=0.3", "measure.after=0"], workers=1, out=tmp_path / "out"
    )
    assert again.runs.equals(swept.runs)  # times too: nothing was done again


def test_a_film_has_a_picture_for_each_step(result, tmp_path):
    result.film().save(tmp_path / "film.mp4")
    with av.open(str(tmp_path / "film.mp4")) as film:
        times = [float(picture.time) for picture in film.decode(video=0)]
    assert times == pytest.approx([s.frame.time for s in result], abs=1e-4)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: servo.simulate(3), "a scenario is given by its name or path, not by int"),
        (
            lambda: servo.simulate("still", [3]),
            "[3]: expected a list of changes, such as ['run.duration=5']",
        ),
        (
            lambda: servo.simulate("still", {"run.duration": 1}),
            "{'run.duration': 1}: expected a list of changes, such as ['run.duration=5']",
        ),
        (lambda: servo.sweep(None), "a study is given by its name or path, not by NoneType"),
        (
            lambda: servo.sweep("particles", seeds="x"),
            "seeds = 'x': expected a whole number from 1 on",
        ),
        (
            lambda: servo.sweep("particles", workers=0),
            "workers = 0: expected a whole number from 1 on",
        ),
        (
            lambda: servo.sweep("particles", out=3),
            "a folder is given by its name or path, not by int",
        ),
    ],
)
def test_an_argument_of_a_wrong_type_is_a_sentence(call, sentence):
    with pytest.raises(Mistake) as found:
        call()
    assert str(found.value) == sentence


def test_a_path_and_a_seed_of_numpy_are_taken(tmp_path):
    (tmp_path / "mine.toml").write_text("[run]\nduration = 0.1\n")
    loaded = servo.load(tmp_path / "mine.toml", seed=np.int64(3))
    assert (loaded.name, loaded.run.seed) == ("mine", 3)


def test_it_can_be_copied_and_says_why_it_is_not_pickled(result):
    for again in (copy.deepcopy(result), copy.copy(result)):
        assert again.measures.equals(result.measures)
        assert len(again) == len(result)
    with pytest.raises(Mistake, match=r"^a run cannot be pickled, as it holds the simulated world"):
        pickle.dumps(result)
