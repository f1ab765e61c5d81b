"""A run from a model to its results: prepare or restore, advance from event to event, record, finish."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from pdmesh import stopping
from pdmesh.files import FilePath
from pdsolve.adaptivity.hybrid.adaptivity_choice import choose_adaptivity, error_of_too_late_fine_zone
from pdsolve.checks import warn_of_doubtful_conditions, warn_of_model, warn_of_unused
from pdsolve.codegen.compile_time import compile_seconds, processor_kind, running_time
from pdsolve.conditions import has_initial_displacement
from pdsolve.errors import FineZoneTooLateError, UnstableError
from pdsolve.model import Model, model_of, on_device
from pdsolve.numerics.memory import give_back
from pdsolve.numerics.team import Team
from pdsolve.options import Options
from pdsolve.rest.equilibrium import NotConvergedError
from pdsolve.results import Behind, Results, ResultsError, Writer, behind, is_empty, put_away, writing_to
from pdsolve.run import resuming, zone_restarts
from pdsolve.run.after_path import (
    needs_motion_after_path,
    prepare_motion_after_equilibrium_path,
    results_file_of_motion_after_equilibrium_path,
)
from pdsolve.run.initial_states import apply_initial_displacements, start_in_static_equilibrium
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import HistoryUntilCheckpoint, Recorder
from pdsolve.run.result_warnings import warn_of_broken_bonds_outside_finest_zone, warn_of_unresolved_contact_width
from pdsolve.run.system import RefinementThresholdFromStep, Regridder, System, next_multiple
from pdsolve.state import State
from pdsolve.stepper import LoadStepProgress
from pdsolve.zone.summary import ZoneSummary

PATIENCE = 4e8  # bond updates between two looks at the watcher, some 0.2 s; fewer where they take longer
DEFAULT = Options()
BATCH_TIME, SLOW = 0.25, 1e7  # s that a batch is to take; bonds or links a second, as is supposed until it is measured
# Steps that a batch has at least, as what begins one costs a part of a step, where it takes no longer than so many s
LEAST_STEPS, LONGEST_BATCH = 4, 1.0


class Progress(NamedTuple):
    """Data for a progress display."""

    step: int
    last_step: int
    broken_directed_bond_count: int  # directed bonds, as of the last ledger row
    balance_error: float  # likewise
    message: str = ""  # energy balance
    zone_summary: ZoneSummary | None = None  # of a fine zone that moves
    load_step_progress: LoadStepProgress | None = None  # of a load step that is being solved


Watcher = Callable[[Progress], bool]  # returns whether to stop


class Job(NamedTuple):
    """What is asked of a run besides its model and its options; see `simulate`."""

    output: Path | None
    watcher: Watcher | None
    provenance: str
    regridder: Regridder | None
    previous_compile_seconds: float  # s that kernels were compiled for before


OpenRun = tuple[Recorder, Callable[[], Writer]]  # its records, and what creates the writer, of a new file for a new run


class Stage(NamedTuple):
    """A run from its start, or from the last checkpoint of its database, to its end."""

    open_run: Callable[[Stage, Job], OpenRun]
    model: Model
    options: Options
    refinement_thresholds: tuple[RefinementThresholdFromStep, ...] = ()  # after fine cells have come too late


def simulate(
    model: Model,
    output: FilePath | None = None,
    options: Options = DEFAULT,
    watch: Watcher | None = None,
    provenance: str = "",
    adapt: Regridder | None = None,
) -> Results:
    """Solve a model; the results are in the file `output`, or in memory if None.

    `watch` is called at least about once a second, unless one step takes longer, and stops the run by returning True;
    `provenance` describes the origin of the run; `adapt` may change the nodes during the run. No other run may be
    writing to that file. Raises ModelError, UnstableError (frames so far are kept), ResultsError.
    """
    job = Job(None if output is None else Path(output), watch, provenance, adapt, compile_seconds())
    with _lock_output(job.output):
        results = _solve(Stage(_begin, _with_chosen_adaptivity(model, options), options), job)
    return _solve_motion_after_equilibrium_path_if_asked(results, job, options.threads)


def resume(
    output: FilePath,
    threads: int | None = None,
    watch: Watcher | None = None,
    adapt: Regridder | None = None,
    team: Team | None = None,
    device: str | None = None,
) -> Results:
    """Continue the run in the file `output` from its last checkpoint, bit by bit as without the stop.

    On another kind of processor than it began on, the last bits differ, and a ResultsWarning says so. A run stopped
    before its first checkpoint starts again. `adapt` is the one it began with. A finished run is left unchanged, but a
    motion that is to follow it begins or continues. The whole file is checked before. `team` are the ranks to go on
    with, as many as before or not; `device` may be another one, None: the same. Raises ResultsError, ModelError,
    UnstableError.
    """
    output = Path(output)
    job, options = Job(output, watch, "", adapt, compile_seconds()), Options(threads=threads, team=team)
    results = _resume_unless_finished(job, options, device)
    motion = results_file_of_motion_after_equilibrium_path(output)
    if needs_motion_after_path(results) and (motion.is_symlink() or (motion.exists() and not is_empty(motion))):
        results.close()
        if motion.is_symlink():
            raise ResultsError(f"{motion} is a link, and the motion of a run is written there; move it away")
        return _resume_unless_finished(job._replace(output=motion), options, device)
    return _solve_motion_after_equilibrium_path_if_asked(results, job, threads)


def run(
    system: System,
    state: State,
    output: Path | None = None,
    watch: Watcher | None = None,
    provenance: str = "",
    adapt: Regridder | None = None,
) -> Results:
    """Solve a prepared model; arguments are those of `simulate`. Raises UnstableError, ResultsError."""
    job = Job(output, watch, provenance, adapt, compile_seconds())
    with _lock_output(output):
        return _advance_to_end_and_close_results(*_open_new_run(system, state, None, (), job), job)


def _lock_output(output: Path | None) -> AbstractContextManager[None]:
    """Keeps other runs from writing to the results, which are in memory if None."""
    return nullcontext() if output is None else writing_to(output)


def _with_chosen_adaptivity(model: Model, options: Options) -> Model:
    return choose_adaptivity(model, options) if model.settings.run.adapt == "auto" else model


def _solve(stage: Stage, job: Job) -> Results:
    """Results of a run; where fine cells come too late, it goes back, and makes them fine earlier."""
    while True:
        try:
            recorder, make_writer = stage.open_run(stage, job)
            recorder.system.regridder.refine_earlier(stage.refinement_thresholds)
            return _advance_to_end_and_close_results(recorder, make_writer, job)
        except FineZoneTooLateError as late:
            wider, thresholds = zone_restarts.plan_zone_restart(stage.model, stage.refinement_thresholds, late)
            step = zone_restarts.find_restart_checkpoint_step(job.output, thresholds)
            zone_restarts.warn_of_zone_restart(stage.model, late, wider, thresholds, step)
            stage = Stage(_restore if step else _begin, wider, stage.options, thresholds)


def _begin(stage: Stage, job: Job) -> OpenRun:
    """Begin a run."""
    # A run that goes back was saved before: to stop loses nothing
    with stopping.patience(stopping.AT_ONCE) if stage.refinement_thresholds else nullcontext():
        prepared = prepare(stage.model, stage.options)
    if has_initial_displacement(stage.model):
        prepared = apply_initial_displacements(prepared)
    system, state = start_in_static_equilibrium(prepared) if stage.model.settings.run.start == "static" else prepared
    warn_of_unused(stage.model)
    warn_of_doubtful_conditions(system.model, system.time_step)
    if system.transport is None:
        warn_of_model(system.model, system.unbonded_node_rows, system.scheme.partial_cells, system.scheme.symmetric)
    return _open_new_run(system, state, None, stage.refinement_thresholds, job)


def _restore(stage: Stage, job: Job) -> OpenRun:
    """Go on from the last checkpoint of the run in the output."""
    assert job.output is not None
    with Results.open(job.output) as results:
        recorder = resuming.make_resumed_recorder(results, stage.model, stage.options, job.regridder)
        files = recorder.open_further_rank_databases(job.output, results.pieces)
    metadata = zone_restarts.refinement_threshold_metadata(stage.refinement_thresholds)
    metadata |= {"processor": processor_kind()}
    return recorder, partial(_reopen_writer_at_checkpoint, job.output, files, metadata)


def _reopen_writer_at_checkpoint(output: Path, files: tuple[str, ...], metadata: Mapping[str, Any]) -> Writer:
    """The writer of a run that is continued, whose ranks go on with these `files`."""
    writer = Writer.reopen(output, files)
    writer.write_meta(metadata)
    return writer


def _open_new_run(
    system: System,
    state: State,
    past: HistoryUntilCheckpoint | None,
    refinement_thresholds: tuple[RefinementThresholdFromStep, ...],
    job: Job,
) -> OpenRun:
    """Open the records of a run that is not in the output yet; `past` is the path that a motion follows."""
    recorder = Recorder(dataclasses.replace(system, regridder=job.regridder or system.regridder), state, past)
    recorder.open_rank_databases(job.output)

    def make_new_writer() -> Writer:
        metadata = recorder.metadata(job.provenance)
        if refinement_thresholds:
            metadata |= zone_restarts.refinement_threshold_metadata(refinement_thresholds)
        return recorder.make_database_writer(job.output, metadata)

    return recorder, make_new_writer


def _resume_unless_finished(job: Job, options: Options, device: str | None) -> Results:
    """The results of a run that is continued if it is not finished."""
    output = job.output
    assert output is not None
    if not _run_is_finished(output):
        with writing_to(output):
            if not _run_is_finished(output):
                return _solve(*_read_stage(output, job, options, device))
    put_away(output)
    return Results.open(output)


def _run_is_finished(output: Path) -> bool:
    with Results.open(output) as results:
        return results.meta().get("status") == "finished"


def _read_stage(output: Path, job: Job, options: Options, device: str | None) -> tuple[Stage, Job]:
    """What is to be done to go on with the run in a file, which is checked."""
    with Results.open(output) as results:
        results.verify()
        model, meta, has_checkpoint = model_of(results.model(), str(output)), results.meta(), results.has_checkpoint()
    resuming.warn_of_other_processor(output, meta)
    model = model if device is None else on_device(model, device)
    options = options_from_metadata(model, meta, options.threads)._replace(team=options.team)
    thresholds = zone_restarts.read_refinement_thresholds(meta, output)
    model = _with_chosen_adaptivity(model, options)
    stage = Stage(_restore if has_checkpoint else _begin, model, options, thresholds)
    return stage, job._replace(provenance=meta["provenance"])


def options_from_metadata(model: Model, metadata: Mapping[str, Any], thread_count: int | None) -> Options:
    """The options of a run of `model`, from its metadata; the number of threads may differ."""
    kernel = metadata.get("kernel")
    return Options(
        metadata["mode"], metadata["precision"], thread_count, None if model.diffuses and kernel != "listed" else kernel
    )


def _solve_motion_after_equilibrium_path_if_asked(path_results: Results, job: Job, threads: int | None) -> Results:
    """The results of the motion that follows a run; those of the run if none does."""
    if not needs_motion_after_path(path_results):
        return path_results
    with stopping.patience(stopping.AT_ONCE):
        (system, state), step = prepare_motion_after_equilibrium_path(path_results, threads)
    provenance = path_results.meta()["provenance"]
    path_results.close()
    target = None if job.output is None else results_file_of_motion_after_equilibrium_path(job.output)
    job = Job(target, job.watcher, provenance, None, compile_seconds())
    past = HistoryUntilCheckpoint(step, 0.0, 0, 0, None, len(system.model.grid))
    with _lock_output(target):
        return _advance_to_end_and_close_results(*_open_new_run(system, state, past, (), job), job)


def _advance_to_end_and_close_results(recorder: Recorder, make_writer: Callable[[], Writer], job: Job) -> Results:
    """March to the end from the state of the records; `make_writer` creates the writer, of a new file for a new run."""
    give_back()
    with behind(make_writer, recorder.is_new, job.output) as writer:
        try:
            if recorder.is_new:
                recorder.record_step(recorder.step)
                writer.write(partial(recorder.make_frame, recorder.step, with_fields=True, with_checkpoint=True))
            status = _advance_to_end(recorder, writer, job)
        except BaseException as reason:
            error = error_of_too_late_fine_zone(reason, recorder.system.time_step, recorder.system.stable_time_step)
            ends = {UnstableError: "unstable", NotConvergedError: "unsettled", KeyboardInterrupt: "interrupted"}
            writer.abandon(ends.get(type(error), "failed"))
            raise error from error.__cause__
        finally:
            recorder.system.stepper.report_to(None)  # else the stepper keeps the recorder, and with it this run
        last = writer.done()
        last.close(status)
    results = Results(last.connection, "results in memory") if job.output is None else Results.open(job.output)
    if not recorder.system.model.diffuses:
        warn_of_broken_bonds_outside_finest_zone(recorder.system.requested_model, results)
        warn_of_unresolved_contact_width(recorder.system, recorder.state)
    return results


def _advance_to_end(recorder: Recorder, writer: Behind, job: Job) -> str:
    """Step to the end, from event to event; returns "finished" or "interrupted"."""
    watch, run, step = job.watcher, recorder.system.model.settings.run, recorder.frame_step
    interrupted, done, collected, pace = False, False, step, StepBatchTimer(recorder.system.directed_bond_count)

    def watcher_requests_stop() -> bool:
        """Whether the watcher wants the run to stop."""
        return watch is not None and watch(_make_progress(recorder, step))

    def show_load_step_progress(load_step_progress: LoadStepProgress) -> None:
        """Show the progress of a load step, which is discarded if the run is to stop meanwhile."""
        if watch is not None and watch(_make_progress(recorder, step, load_step_progress)):
            raise KeyboardInterrupt("within a load step, which is lost")

    recorder.system.stepper.report_to(show_load_step_progress)
    writer.stop = watcher_requests_stop
    while step < run.steps and not (interrupted or done):
        next_check = recorder.change_nodes_if_due(step)
        regridder, most = recorder.system.regridder, int(PATIENCE / max(recorder.system.directed_bond_count, 1))
        chunk = pace.choose_batch_step_count(regridder.least_steps, most)
        records = next_multiple(step, run.every), next_multiple(step, run.ledger or run.every), run.steps
        end = min(step + chunk, next_check, *records)
        began = running_time()
        last = recorder.advance(step + 1, end + 1)
        pace.record_duration(end - step, running_time() - began)
        step = last
        writer.look()
        is_record = step in records
        interrupted = watcher_requests_stop() and (
            is_record or _can_stop_before_next_balance_row(regridder, step, pace.will_finish_soon(min(records) - step))
        )
        if is_record:
            recorder.collect_node_changes(collected)
            collected = step
            recorder.record_step(step)
        done = _stop_criterion_is_met(recorder, step) if is_record else step < end
        with_fields = is_record and (step % run.every == 0 or step == run.steps or done)
        if with_fields or done or interrupted or (is_record and recorder.checkpoint_is_old):
            with_checkpoint = step == run.steps or done or interrupted
            writer.write(partial(recorder.make_frame, step, with_fields, with_checkpoint))
    recorder.evaluate_balance(step)
    compiled = {"compile_time": compile_seconds() - job.previous_compile_seconds}
    writer.done().write_meta({"summary": json.dumps(recorder.summary(step, done) | compiled)})
    recorder.accounts.warn_at_end()
    recorder.close_rank_databases()
    return "finished" if done or step == run.steps else "interrupted"


def _make_progress(recorder: Recorder, step: int, load_step_progress: LoadStepProgress | None = None) -> Progress:
    """Data for a progress display after `step`, or within a load step `load_step_progress`."""
    accounts, system = recorder.accounts, recorder.system
    broken = (load_step_progress or accounts).broken_directed_bond_count
    words = ", ".join(filter(None, [system.stepper.progress_text(), accounts.progress_text(broken)]))
    steps = system.model.settings.run.steps
    return Progress(step, steps, broken, accounts.balance_error, words, system.zone_summary, load_step_progress)


def _can_stop_before_next_balance_row(regridder: Regridder, step: int, balance_row_is_soon: bool) -> bool:
    """Whether a run can stop after a step without a record.

    Where it can stop at records alone, raises KeyboardInterrupt unless the next one comes `balance_row_is_soon`.
    """
    if regridder.stops_at_records_only and not balance_row_is_soon:
        raise KeyboardInterrupt(f"at step {step}; steps since the last checkpoint are lost")
    return not regridder.stops_at_records_only


def _stop_criterion_is_met(recorder: Recorder, step: int) -> bool:
    """Whether the model's stop criterion is met."""
    system, latest = recorder.system, recorder.last_break_step
    run = system.model.settings.run
    if system.stepper.finished:
        return True
    if run.until == "split":
        return recorder.has_more_fragments_than_bodies()
    if run.until == "quiet":
        return latest > 0 and run.quiet is not None and (step - latest) * system.time_step >= run.quiet
    return False


class StepBatchTimer:
    """Measures the duration of steps; results do not depend on it."""

    def __init__(self, updates_per_step: int) -> None:
        """`updates_per_step` is the number of bond or link updates of a step."""
        self._each = updates_per_step / SLOW  # s of a step

    def choose_batch_step_count(self, min_steps: int, max_steps: int) -> int:
        """Number of steps to take at once, from `min_steps` to `max_steps`."""
        each = max(self._each, 1e-9)
        return max(min_steps, min(max_steps, max(int(BATCH_TIME / each), min(LEAST_STEPS, int(LONGEST_BATCH / each)))))

    def record_duration(self, step_count: int, seconds: float) -> None:
        """Record the duration of some steps."""
        self._each = seconds / max(step_count, 1)

    def will_finish_soon(self, step_count: int) -> bool:
        """Whether so many steps take less than three times `BATCH_TIME`."""
        return step_count * self._each < 3 * BATCH_TIME


__all__ = ["NotConvergedError", "Options", "Progress", "UnstableError", "prepare", "resume", "simulate"]
