"""Steps are taken so many at once that somebody who wants a run to stop is heard within a second."""

from __future__ import annotations

from pdsolve.run.simulation import BATCH_TIME, LEAST_STEPS, LONGEST_BATCH, StepBatchTimer


def test_a_piece_takes_no_longer_than_it_should() -> None:
    pace = StepBatchTimer(10**9)  # of which a step is supposed to take 100 s
    assert pace.choose_batch_step_count(1, 1000) == 1
    for each in (1e-3, 0.04, 2.0, 0.1, 0.4, 1e-6, 0.01):
        steps = pace.choose_batch_step_count(1, 1000)
        pace.record_duration(steps, steps * each)
        assert 1 <= pace.choose_batch_step_count(1, 1000) <= 1000
        longest = max(BATCH_TIME, min(LEAST_STEPS * each, LONGEST_BATCH), each)
        assert pace.choose_batch_step_count(1, 1000) * each <= longest * (1 + 1e-9)
        assert pace.choose_batch_step_count(1, 1000) >= min(LEAST_STEPS, int(LONGEST_BATCH / each))
        assert pace.choose_batch_step_count(8, 1000) >= 8
    assert pace.will_finish_soon(70)
    assert not pace.will_finish_soon(80)
