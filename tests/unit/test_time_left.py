"""The station time that is left of a run, as it is told, against what the plant's clock then says."""

import itertools
import re

import pytest
from small_station import MemorySink, lot_of, short_recipe, station_of

from pipelines.capture.capture import capture
from pipelines.capture.time_left import Remaining, duration_text
from pipelines.schedule.steps import steps
from schemas.poses import Pose
from stations.opening import open_station

LEFT = re.compile(r"(?:(\d+) h )?(?:(\d+) min|(\d+) s) of station time left(?:, about [^,]+ here)?$")


def told_and_true(recipe, config, lot=None):
    """Pairs (station time, seconds left as told), and when the run was over."""
    told, lot = [], lot or lot_of(8)
    with open_station(config, lot) as station:

        def progress(_done, _total, note):
            match = LEFT.search(note)
            if match:
                hours, minutes, seconds = (int(part or 0) for part in match.groups())
                told.append((station.clock.now(), 3600.0 * hours + 60.0 * minutes + seconds, note))

        capture(station, recipe, lot, MemorySink(), progress=progress)
        return told, station.clock.now()


def after_first_soak(told):
    first = next(k for k, (_, _, note) in enumerate(told) if "soak" not in note)
    return told[first:]


@pytest.mark.parametrize(
    ("temperatures", "changes"),
    [
        ((50.0, 10.0), {}),
        pytest.param((25.0, 60.0, -10.0), {}, marks=pytest.mark.slow),
        pytest.param((60.0, -20.0, 10.0, 40.0), {}, marks=pytest.mark.slow),
        pytest.param((40.0, 0.0, 60.0), {"slot_lag_s": [250.0, 400.0]}, marks=pytest.mark.slow),
    ],
)
def test_the_time_that_is_left_is_right_within_a_tenth_after_the_first_soak(temperatures, changes):
    recipe = short_recipe(poses=6, static_s=300.0).model_copy(update={"temperatures_C": list(temperatures)})
    told, end = told_and_true(recipe, station_of(**changes))
    judged = [(now, left, end - now) for now, left, _ in after_first_soak(told) if end - now > 600.0]
    assert len(judged) > 50
    worst = max(abs(left - true) / true for _, left, true in judged)
    assert worst < 0.10


def test_a_station_that_is_slower_than_its_file_says_teaches_by_its_first_soak_and_records():
    config = station_of()
    wrong = config.model_copy(update={"pace": config.pace.model_copy(update={"ramp_K_per_min": 6.0})})
    recipe = short_recipe(poses=6).model_copy(update={"temperatures_C": [60.0, -10.0, 40.0], "soak_min_s": 900.0})
    told, end = told_and_true(recipe, wrong)
    judged = [(left, end - now) for now, left, _ in after_first_soak(told) if end - now > 600.0]
    first_error = abs(told[0][1] - end) / end
    assert first_error > 0.12  # before the first soak nobody can know
    assert max(abs(left - true) / true for left, true in judged) < 0.10


def test_the_time_left_never_runs_up_within_a_soak():
    recipe = short_recipe(poses=2, temperatures=(25.0, 60.0))
    told, _ = told_and_true(recipe, station_of())
    soaking = [left for _, left, note in told if "soak at 60" in note]
    assert len(soaking) > 50
    assert all(b <= a for a, b in itertools.pairwise(soaking))


def test_a_resumed_run_counts_only_what_is_left():
    recipe = short_recipe(poses=4)
    plan = steps(recipe)
    remaining = Remaining(plan, station_of(), recipe)
    first, last = remaining.seconds(plan[0], 0.0), Remaining(plan, station_of(), recipe).seconds(plan[-1], 0.0)
    assert first > 900.0
    assert last < 30.0


def test_far_moves_count_for_more():
    near, far = short_recipe(poses=1), short_recipe(poses=1)
    far = far.model_copy(update={"poses": [Pose(name="far", outer_deg=180.0, inner_deg=0.0)]})
    seconds = [Remaining(steps(r), station_of(), r).seconds(steps(r)[0], 0.0) for r in (near, far)]
    assert seconds[1] > seconds[0]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(59.6, "60 s"), (119.0, "119 s"), (121.0, "2 min"), (3599.0, "1 h 00 min"), (7380.0, "2 h 03 min")],
)
def test_durations_are_told_in_words(seconds, text):
    assert duration_text(seconds) == text


def test_only_a_simulated_station_has_a_time_of_its_own():
    recipe = short_recipe()
    plan = steps(recipe)
    real = station_of().model_copy(update={"kind": "modbus", "simulation": None})
    assert Remaining(plan, station_of(), recipe).text(plan[0], 0.0).endswith(" of station time left")
    assert re.fullmatch(r"\d+ min left", Remaining(plan, real, recipe).text(plan[0], 0.0))


def test_the_time_by_the_wall_clock_is_in_proportion_to_the_records_that_are_left(monkeypatch: pytest.MonkeyPatch):
    clock = [100.0]
    monkeypatch.setattr("pipelines.capture.time_left.time.monotonic", lambda: clock[0])
    recipe = short_recipe(poses=4)
    plan = steps(recipe)
    left = Remaining(plan, station_of(), recipe)
    assert left.wall_seconds(plan[0]) is None
    clock[0] += 6.0
    for step in plan[:2]:
        left.add_record(step, 12.0)
    done, rest = (sum(left._record[step.record] for step in part) for part in (plan[:2], plan[2:]))
    assert left.wall_seconds(plan[2]) == pytest.approx(6.0 * rest / done)
    assert left.text(plan[2], 0.0).endswith(" here")
