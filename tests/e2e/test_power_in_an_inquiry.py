"""A follow-up that switches the devices off and on, from the order to the diagnosis of all that was measured."""

import math
from pathlib import Path

import inquiries
import numpy as np
import pytest

from inertial.planning.sequences import SequenceStep
from inertial.power import switched
from pipelines.archive import Archive
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.inquiry.followup import follow_up
from pipelines.inquiry.inquiry import FOLLOW_UP, FollowUp, begin
from schemas.progress import silent

UP, DOWN = (0.0, 0.0), (math.pi, 0.0)


@pytest.mark.slow
def test_warm_up_is_named_by_what_follows_a_power_on_whatever_the_bias_has_come_back_to(tmp_path: Path) -> None:
    archive = Archive(tmp_path / "archive")
    job = inquiries.job_of(tmp_path, kind="warm_up", size=400e-6, tau=900.0)
    runner = Runner(job, archive, silent)
    for name in ORDER:
        runner.stage(name)
    inquiry = begin(archive, job, runner.run, (), None)
    alternating = [SequenceStep(*(UP, DOWN)[k % 2], 25.0, wait=8.0) for k in range(24)]
    wanted = [SequenceStep(*UP, 25.0), SequenceStep(*DOWN, 25.0), SequenceStep(*UP, 25.0, off=1200.0), *alternating]
    move = FollowUp(follow_up(wanted, job, job, inquiry.lineage.ids, "why"), (), ("why",), 30.0)
    follower = inquiry.runner(move, silent)
    for name in FOLLOW_UP:
        follower.stage(name)
    inquiry.add_run(move, follower.run)
    finding = inquiry.diagnose()

    first = runner.run.table("dwells")["dwell"].nunique()
    assert switched(finding.state) == [first + 2]
    assert finding.state.power_off.max() == pytest.approx(1200.0, abs=2.0)
    assert [t.effect.id for t in finding.diagnosis.base.terms][-1] == "turn_on_bias"
    assert ["warm_up"] in [group["effects"] for group in finding.document["classes"]]
    assert inquiry.rounds[0]["minutes"] > 20.0

    dwells = follower.run.table("dwells")
    up = dwells[(dwells["unit"] == "A1") & (np.abs(dwells["force_z"] - 1.0) < 1e-3)].sort_values("dwell")
    after = up[up["since_power_s"] < 600.0]["out_z"].to_numpy() / 256000.0
    # the device lacks 1 − (1 − e^(−u/τ))·e^(−off/τ) of its warmth, and makes good for a part of it while it is looked at
    on = float(runner.run.table("dwells")["since_power_s"].max())
    cold = 1.0 - (1.0 - math.exp(-on / 900.0)) * math.exp(-1200.0 / 900.0)
    seen = np.exp(-up[up["since_power_s"] < 600.0]["since_power_s"].to_numpy() / 900.0)
    assert after[0] - after[-1] == pytest.approx(400e-6 * cold * (seen[0] - seen[-1]), abs=25e-6)
