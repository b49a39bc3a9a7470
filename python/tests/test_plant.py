"""The diagnosis of plants whose model is in Python."""

import copy
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from plants import Carriage, Oscillator, ParallelCarriage, friction
from sfers_rs import Diagnosis, diagnose_plant
from sfers_rs.plant import Candidate, Constant, Curve, Diverged, Model, Parameter, Plant, PredictionError, Run


def dry(x, v):
    return 1.5 * friction(v)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_hidden_is_silence(seed):
    found = diagnose_plant(Carriage(seed=seed))
    assert (found.verdict, found.causes) == ("none", []), found.summary


@pytest.mark.parametrize(
    ("hidden", "cause", "parameter", "value"),
    [
        (dry, "dry-friction", "force", 1.5),
        (lambda x, v: 1.2 * v * abs(v), "drag", "coefficient", 1.2),
        (lambda x, v: 90.0 * x**3, "hardening", "stiffness", 90.0),
    ],
)
def test_a_hidden_force_is_named_with_its_value(hidden, cause, parameter, value):
    found = diagnose_plant(Carriage(hidden))
    assert (found.verdict, found.causes) == ("named", [cause]), found.summary
    estimate = found.effects[0].parameters[parameter]
    assert abs(estimate.value - value) < 0.05 * value and estimate.low < value < estimate.high, estimate
    errors = found.heldout_errors
    assert errors["extended"] < 0.06 < errors["retuned"] <= errors["nominal"], errors


def test_constants_that_are_off_are_re_tuned_and_named():
    plant = Carriage(lambda x, v: 0.8 * v)
    found = diagnose_plant(plant)
    assert found.causes == ["viscous-friction"], found.summary
    assert found.effects[0].parameters["value"].value == pytest.approx(3.8, abs=0.02)


def test_dry_friction_of_an_oscillator_in_time_is_named_from_another_integrators_data():
    found = diagnose_plant(Oscillator(dry=0.6))
    assert (found.verdict, found.causes) == ("named", ["dry-friction"]), found.summary
    assert found.effects[0].parameters["deceleration"].value == pytest.approx(0.6, rel=0.1)
    assert diagnose_plant(Oscillator()).causes == []


def test_two_causes_that_do_the_same_are_tied():
    plant = Carriage(dry)
    twin = replace(plant.candidates[0], id="brush-friction", place="brushes")
    plant.candidates = [*plant.candidates, twin]
    predict = plant.predict

    def both(model, run):
        effects = dict(model.effects)
        force = effects.pop("brush-friction", {"force": 0.0})["force"]
        return predict(replace(model, effects=effects), run) + force * friction(plant.motion(*run.data, run.times_s)[1])

    plant.predict = both
    found = diagnose_plant(plant)
    assert found.verdict == "tied", found.summary
    assert {found.effects[0].id, *found.effects[0].tied_with} == {"dry-friction", "brush-friction"}


class Stuck(Carriage):
    """Dry friction beside one that is rounded within 8 mm/s in place of 5: fast motion does not tell them apart."""

    motions = [(0.3, 1.0), (0.2, 1.6), (0.25, 1.3), (0.35, 0.9), (0.3, 1.2), (0.2, 1.9)]
    candidates = [
        Candidate("dry-friction", [Parameter("force", bounds=(0.0, 10.0), unit="N")], place="speed"),
        Candidate("soft-friction", [Parameter("force", bounds=(0.0, 10.0), unit="N")], place="film"),
    ]
    slow = Run("slow", np.arange(0.0, 20.0, 0.05), None, 0.05, inputs=np.zeros(400), data=(0.004, 0.2))
    fast = Run("fast", np.arange(0.0, 4.0, 0.05), None, 0.05, inputs=np.zeros(80), data=(0.3, 2.0))
    proposals = [fast, slow]

    def predict(self, model, run):
        v = self.motion(*run.data, np.asarray(run.times_s))[1]
        return super().predict(model, run) + model.effect("soft-friction", "force") * np.tanh(v / 0.008)


def test_the_proposal_that_tells_tied_causes_apart_is_next():
    plant = Stuck(lambda x, v: 0.15 * friction(v))
    found = diagnose_plant(plant)
    assert found.verdict == "tied", found.summary
    assert found.next_experiment.startswith("measure the proposed run slow: the models then differ by "), found.next_experiment
    assert found.next_experiment in found.report
    plant.proposals = [plant.fast]
    assert diagnose_plant(plant, jobs=2).next_experiment == "none of the proposed runs tells them apart"
    plant.proposals = []
    assert diagnose_plant(plant).next_experiment is None


def test_zeros_that_differ_from_run_to_run_are_the_benchs_and_no_cause():
    found = diagnose_plant(Carriage(dry, zeros=0.5))
    assert found.causes == ["dry-friction"], found.summary
    assert [fault["id"] for fault in found.json["bench"]["faults"]] == ["zero"]
    assert found.json["bench"]["zero_mm"] == pytest.approx(0.5, rel=0.6)


def test_a_clock_that_differs_from_run_to_run_is_found_where_predict_asks_for_it():
    plant = Carriage(dry)
    random = np.random.default_rng(4)
    for index, run in enumerate(plant.runs):
        x, v, a = plant.motion(*run.data, run.times_s + 0.01 * random.standard_normal())
        plant.runs[index] = replace(run, measured=2.0 * a + 3.0 * v + dry(x, v) + 0.05 * random.standard_normal(len(v)))
    predict = plant.predict
    plant.predict = lambda model, run: predict(model, replace(run, times_s=model.times(run)))
    plant.bench = {"clock_s": None}
    found = diagnose_plant(plant)
    assert found.causes == ["dry-friction"], found.summary
    assert found.json["bench"]["clock_ms"] == pytest.approx(10.0, rel=0.7)


def test_a_law_that_nobody_wrote_down_is_located_with_its_curve():
    knots = [0.25, 0.5, 1.0, 1.5, 2.0]
    parameters = [Parameter(f"at-{k}", bounds=(-5.0, 5.0), unit="N", scale=0.1) for k in range(len(knots))]
    plant = Carriage(lambda x, v: 1.5 * np.sign(v) * np.exp(-(((abs(v) - 0.5) / 0.25) ** 2)))
    plant.candidates = [*plant.candidates, Candidate("free-friction", parameters, place="speed", curve=Curve(knots, "speed", "force", "m/s", "N"))]
    predict = plant.predict

    def free(model, run):
        weights = list(model.effects.get("free-friction", {}).values())
        v = plant.motion(*run.data, run.times_s)[1]
        extra = np.interp(abs(v), [0.0, *knots], [0.0, *weights]) * np.sign(v) if weights else 0.0
        return predict(model, run) + extra

    plant.predict = free
    found = diagnose_plant(plant)
    assert found.verdict in ("located", "unexplained") and "free-friction" in found.causes, found.summary
    curve = found.effects[found.causes.index("free-friction")].curve
    assert curve["x"] == knots and curve["x_unit"] == "m/s" and max(curve["y"]) > 0.8


def test_results_do_not_depend_on_jobs_or_on_how_predictions_are_made_parallel():
    alone = diagnose_plant(ParallelCarriage(dry), jobs=1).json
    for jobs in (2, 3):
        assert diagnose_plant(ParallelCarriage(dry), jobs=jobs).json == alone
    threads = Carriage(dry)
    threads.parallel = "threads"
    assert diagnose_plant(threads, jobs=3).json == alone


def test_other_processes_are_started_anew_where_the_caller_has_threads():
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    thread.start()
    try:
        assert diagnose_plant(ParallelCarriage(dry), jobs=2).causes == ["dry-friction"]
    finally:
        done.set()
        thread.join()


def test_many_diagnoses_at_a_time_do_not_wait_for_each_other():
    found = [None] * 3

    def work(index):
        found[index] = diagnose_plant(Carriage(dry), jobs=1).causes

    threads = [threading.Thread(target=work, args=(index,)) for index in range(3)]
    [thread.start() for thread in threads]
    [thread.join(60.0) for thread in threads]
    assert found == [["dry-friction"]] * 3


def test_predict_is_called_on_the_callers_thread_unless_it_is_parallel():
    plant, seen = Carriage(), set()
    predict = plant.predict
    plant.predict = lambda model, run: (seen.add(threading.get_ident()), predict(model, run))[1]
    diagnose_plant(plant)
    assert seen == {threading.get_ident()}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_process_forks_and_diagnoses_after_a_diagnosis():
    diagnose_plant(Carriage(dry))
    child = os.fork()
    if child == 0:
        os._exit(0 if diagnose_plant(Carriage(dry)).causes == ["dry-friction"] else 1)
    assert os.waitpid(child, 0)[1] == 0


def test_a_diagnosis_is_saved_pickled_and_shown(tmp_path):
    tasks = []
    found = diagnose_plant(Carriage(dry), name="carriage & rail", out=tmp_path / "a", progress=tasks.append)
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == ["diagnosis.json", "report.html", "residuals.csv"]
    assert "the nominal model" in tasks and any("dry-friction" in task for task in tasks)
    again = pickle.loads(pickle.dumps(found))
    assert again == found and copy.deepcopy(found).effects == found.effects
    shown = found._repr_html_()
    assert shown.startswith("<iframe srcdoc=") and "&lt;h1&gt;Diagnosis of carriage &amp;amp; rail" in shown
    assert "\u2060" not in found.report + str(found.json)
    table = found.to_pandas()
    assert list(table.effect) == ["dry-friction"] and table.unit[0] == "N"
    rows = (tmp_path / "a" / "residuals.csv").read_text().splitlines()
    assert rows[0] == "run,role,channel,t_s,measured,nominal,calibrated,extended,used" and len(rows) == 1 + 8 * 400


def test_ids_of_robots_causes_have_no_other_name_in_a_plants_report():
    plant = Carriage(lambda x, v: 1.2 * v * abs(v))
    plant.candidates = [replace(candidate, id="damping") if candidate.id == "drag" else candidate for candidate in plant.candidates]
    predict = plant.predict

    def renamed(model, run):
        return predict(replace(model, effects={"drag" if k == "damping" else k: v for k, v in model.effects.items()}), run)

    plant.predict = renamed
    found = diagnose_plant(plant)
    assert found.causes == ["damping"] and "damping time" not in found.summary + found.report, found.summary


def test_missing_values_are_left_out_and_channels_come_as_a_dict():
    plant = Carriage(dry)
    plant.channels = ["force", "twice"]
    for index, run in enumerate(plant.runs):
        force = np.where(np.arange(400) % 7 == 0, np.nan, run.measured)
        measured = {"force": force, "twice": 2.0 * run.measured}
        plant.runs[index] = replace(run, measured=measured, sigma={"force": 0.05, "twice": np.full(400, 0.1)})
    predict = plant.predict
    plant.predict = lambda model, run: {"force": predict(model, run), "twice": 2.0 * predict(model, run)}
    assert diagnose_plant(plant).causes == ["dry-friction"]


class Point(Plant):
    """A plant that is wrong in one way."""

    candidates = [Candidate("offset", [Parameter("y", bounds=(-1.0, 1.0))])]

    def __init__(self, **changes):
        base = Run("run 1", np.arange(5.0), np.arange(5.0), 1.0)
        self.runs = [replace(base, **changes)]

    def predict(self, model, run):
        return np.asarray(run.times_s) + model.effect("offset", "y")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"measured": np.zeros(4)}, ["run 'run 1'", "measured has the shape (4,)", "(5, 1) or (5,)"]),
        ({"measured": np.zeros((5, 2))}, ["measured has the shape (5, 2)"]),
        ({"measured": {"z": np.zeros(5)}}, ["channels ['z']", "['y']"]),
        ({"measured": None}, ["measured has the shape ()", "(5, 1) or (5,)"]),
        ({"measured": np.full(5, np.nan)}, ["no finite value"]),
        ({"measured": ["a"] * 5}, ["no array of numbers"]),
        ({"times_s": np.zeros(5)}, ["times_s must rise"]),
        ({"times_s": np.zeros((5, 1))}, ["times_s has the shape (5, 1)"]),
        ({"sigma": 0.0}, ["sigma", "above 0"]),
        ({"sigma": np.ones(3)}, ["sigma has the shape (3,)"]),
        ({"sigma": np.nan}, ["sigma must be a finite number"]),
        ({"inputs": np.zeros(4)}, ["inputs has the shape (4,)"]),
        ({"role": "test"}, ["role", "'test'"]),
        ({"id": ""}, ["id of a run"]),
        ({"nuisances": -1}, ["nuisances"]),
    ],
)
def test_a_wrong_run_is_refused_with_its_argument_and_shape(changes, words):
    with pytest.raises(ValueError) as caught:
        diagnose_plant(Point(**changes))
    assert all(word in str(caught.value) for word in words), caught.value


@pytest.mark.parametrize(
    ("candidate", "words"),
    [
        (Candidate("a b", [Parameter("y", (-1.0, 1.0))]), ["spaces"]),
        (Candidate("a", []), ["one or more parameters"]),
        (Candidate("a", [Parameter("y", (1.0, -1.0))]), ["'a'", "'y'", "bounds", "rising"]),
        (Candidate("a", [Parameter("y", (0.0, np.inf))]), ["bounds must be two finite numbers"]),
        (Candidate("a", [Parameter("y", (1.0, 2.0))]), ["off=0.0", "outside the bounds"]),
        (Candidate("a", [Parameter("y", (-1.0, 1.0), start=2.0)]), ["start", "outside its bounds"]),
        (Candidate("a", [Parameter("y", (-1.0, 1.0), scale=0.0)]), ["scale must be above 0"]),
        (Candidate("a", [Parameter("y", (-1.0, 1.0))], starts=[[0.1, 0.2]]), ["starts must hold 1 values"]),
        (Candidate("a", [Parameter("y", (-1.0, 1.0))], curve=Curve([1.0, 2.0], "u", "c")), ["2 abscissas and 1 parameters"]),
    ],
)
def test_a_wrong_candidate_is_refused_with_its_name(candidate, words):
    plant = Point()
    plant.candidates = [candidate]
    with pytest.raises(ValueError) as caught:
        diagnose_plant(plant)
    assert all(word in str(caught.value) for word in words), caught.value


def test_what_is_no_plant_is_refused():
    with pytest.raises(TypeError, match="this int has no runs"):
        diagnose_plant(3)
    plant = Point()
    plant.constants = [Constant("offset", 1.0, (0.0, 2.0))]
    with pytest.raises(ValueError, match="must differ from each other and from those of candidates"):
        diagnose_plant(plant)
    plant = Point()
    plant.bench = {"clock": None}
    with pytest.raises(ValueError, match="clock_s, clock_rate.*not 'clock'"):
        diagnose_plant(plant)
    with pytest.raises(ValueError, match="jobs must be 1 to 1024, not 0"):
        diagnose_plant(Point(), jobs=0)


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("shape", ["run 'run 2'", "effects {}", "shape (3,)", "(400, 1)"]),
        ("nan", ["run 'run 2'", "not finite, first in row 7", "Diverged"]),
        ("text", ["no array of numbers"]),
        ("raise", ["run 'run 2'", "ZeroDivisionError: by zero"]),
    ],
)
def test_a_wrong_prediction_ends_the_diagnosis_with_the_run_and_its_shape(wrong, words, jobs):
    plant = ParallelCarriage(dry)
    predict = plant.predict

    def spoilt(model, run):
        predicted = predict(model, run)
        if run.id != "run 2":
            return predicted
        if wrong == "raise":
            raise ZeroDivisionError("by zero")
        predicted[7] = np.nan
        return {"shape": np.zeros(3), "nan": predicted, "text": "none"}[wrong]

    plant.predict = spoilt
    with pytest.raises(PredictionError) as caught:
        diagnose_plant(plant, jobs=jobs)
    assert all(word in str(caught.value) for word in words), caught.value
    assert wrong != "raise" or jobs > 1 or isinstance(caught.value.__cause__, ZeroDivisionError)


def test_a_model_that_diverges_is_passed_over():
    plant = Carriage(dry)
    predict = plant.predict

    def edge(model, run):
        if "spring" in model.effects:
            raise Diverged("no equilibrium")
        return predict(model, run)

    plant.predict = edge
    assert diagnose_plant(plant).causes == ["dry-friction"]


def test_a_nominal_model_that_diverges_is_an_error_with_its_reason():
    plant = Carriage()

    def never(model, run):
        raise Diverged("no equilibrium")

    plant.predict = never
    with pytest.raises(RuntimeError, match="no equilibrium"):
        diagnose_plant(plant)


def test_a_process_that_dies_is_an_error_and_no_hang():
    plant = ParallelCarriage(dry)
    plant.predict = lambda model, run: os._exit(3)
    with pytest.raises(PredictionError, match="ended with code 3"):
        diagnose_plant(plant, jobs=2)


def test_an_exception_of_progress_ends_the_diagnosis():
    def stop(task):
        raise LookupError(task)

    with pytest.raises(LookupError, match="the nominal model"):
        diagnose_plant(Carriage(dry), progress=stop)


@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_ends_it_within_seconds_and_leaves_no_process(jobs):
    code = f"""
        import sys
        from plants import Slow
        from sfers_rs import diagnose_plant
        diagnose_plant(Slow(), jobs={jobs}, progress=lambda task: print(task, flush=True))
    """
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout.readline().strip() == "the nominal model"
    time.sleep(1.0)
    start = time.monotonic()
    # As a terminal does: to all processes of the group.
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=20.0)
    assert time.monotonic() - start < 5.0
    assert process.returncode != 0 and errors.strip().endswith("KeyboardInterrupt"), errors
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


def test_a_time_constant_is_off_where_it_is_infinite():
    parameter = Parameter("time", bounds=(0.1, np.inf), unit="s", off=np.inf, scale=0.2)
    times = np.arange(0.0, 3.0, 0.02)
    random = np.random.default_rng(1)
    levels = [0.5, 1.0, 1.5, 2.0, 3.0, 4.0]
    runs = [Run(f"{k}", times, u * np.exp(-times / 2.0) + 0.01 * random.standard_normal(150), 0.01, data=u) for k, u in enumerate(levels)]

    class Leak(Plant):
        candidates = [Candidate("leak", [parameter])]

        def predict(self, model, run):
            return run.data * np.exp(-times / model.effect("leak", "time", np.inf))

    plant = Leak()
    plant.runs = runs
    found = diagnose_plant(plant)
    assert found.causes == ["leak"] and found.effects[0].parameters["time"].value == pytest.approx(2.0, rel=0.02), found.summary


def test_a_model_applies_the_benchs_clock_and_gain():
    run = Run("a", [1.0, 2.0, 3.0], np.zeros(3), 1.0, inputs=[1.0, 0.0, -1.0])
    model = Model({}, {}, clock_s=0.5, clock_rate=0.01, input_gain=0.1)
    assert np.allclose(model.times(run), [1.5, 2.51, 3.52]) and np.allclose(model.inputs(run), [1.1, 0.0, -1.1])
