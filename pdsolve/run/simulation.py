"""A run from a model to its results: prepare, march, write."""

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
from pdsolve.results import Behind, Results, ResultsError, Writer, behind, is_empty, put_away, writing_to
from pdsolve.run import resuming, zone_restarts
from pdsolve.run.after_path import (
    needs_motion_after_path,
    prepare_motion_after_equilibrium_path,
    results_file_of_motion_after_equilibrium_path,
)
from pdsolve.run.coarse_breaks import warn_of_broken_bonds_outside_finest_zone
from pdsolve.run.initial_displacements import apply_initial_displacements
from pdsolve.run.narrow_contact import warn_of_unresolved_contact_width
from pdsolve.run.node_changes import Regridder, create_system_if_zone_changed
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import HistoryUntilCheckpoint, Recorder
from pdsolve.run.static_start import start_in_static_equilibrium
from pdsolve.run.system import System
from pdsolve.run.zone_restarts import RefinementThresholdFromStep
from pdsolve.state import State
from pdsolve.stepper import LoadStepProgress
from pdsolve.steppers.equilibrium import NotConvergedError
from pdsolve.zone.cells import EVERY
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


class RunRequest(NamedTuple):
    """What is asked of a run, besides its model; see `simulate`. What it is continued on; see `resume`."""

    output: Path | None
    watcher: Watcher | None
    provenance: str = ""
    adaptation: Regridder | None = None
    thread_count: int | None = None
    team: Team | None = None
    device: str | None = None
    refinement_thresholds: tuple[RefinementThresholdFromStep, ...] = ()  # after fine cells have come too late
    previous_compile_seconds: float = 0.0  # s that kernels were compiled for before


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
    output = None if output is None else Path(output)
    with _lock_output(output):
        results = _solve_with_restarts(
            model, options, RunRequest(output, watch, provenance, adapt, previous_compile_seconds=compile_seconds())
        )
    return _solve_motion_after_equilibrium_path_if_asked(results, output, options.threads, watch)


def _lock_output(output: Path | None) -> AbstractContextManager[None]:
    """Keeps other runs from writing to the results, which are in memory if None."""
    return nullcontext() if output is None else writing_to(output)


def _solve_with_restarts(model: Model, options: Options, request: RunRequest) -> Results:
    if model.settings.run.adapt == "auto":
        model = choose_adaptivity(model, options)
    try:
        return _solve_new_run(*_prepare_new_recorder(model, options, request))
    except FineZoneTooLateError as late:
        return _restart_with_earlier_refinement(model, options, request, late)


def _restart_with_earlier_refinement(
    model: Model, options: Options, request: RunRequest, fine_zone_too_late: FineZoneTooLateError
) -> Results:
    """Results of a run whose fine cells came too late: it goes back as often as they do."""
    while True:
        wider, refinement_thresholds = zone_restarts.plan_zone_restart(
            model, request.refinement_thresholds, fine_zone_too_late
        )
        step = zone_restarts.find_restart_checkpoint_step(request.output, refinement_thresholds)
        zone_restarts.warn_of_zone_restart(model, fine_zone_too_late, wider, refinement_thresholds, step)
        model, request = (
            wider,
            request._replace(refinement_thresholds=refinement_thresholds, thread_count=options.threads),
        )
        try:
            if step and request.output is not None:
                return _resume_from_checkpoint(request.output, request)
            return _solve_new_run(*_prepare_new_recorder(model, options, request))
        except FineZoneTooLateError as again:
            fine_zone_too_late = again


def _prepare_new_recorder(model: Model, options: Options, request: RunRequest) -> tuple[Recorder, RunRequest]:
    """The records of a run that begins, which alone keep its system and its state."""
    # A run that goes back was saved before: to stop loses nothing
    with stopping.patience(stopping.AT_ONCE) if request.refinement_thresholds else nullcontext():
        prepared = prepare(model, options)
    if has_initial_displacement(model):
        prepared = apply_initial_displacements(prepared)
    system, state = start_in_static_equilibrium(prepared) if model.settings.run.start == "static" else prepared
    warn_of_unused(model)
    warn_of_doubtful_conditions(system.model, system.time_step)
    if system.transport is None:
        warn_of_model(system.model, system.unbonded_node_rows, system.scheme.partial_cells, system.scheme.symmetric)
    return _make_new_recorder(system, state, request)


def _make_new_recorder(system: System, state: State, request: RunRequest) -> tuple[Recorder, RunRequest]:
    """The records of a run that begins, of all ranks if there are many."""
    system = dataclasses.replace(system, regridder=request.adaptation or system.regridder)
    return Recorder(system, state, None), request


def run(
    system: System,
    state: State,
    output: Path | None = None,
    watch: Watcher | None = None,
    provenance: str = "",
    adapt: Regridder | None = None,
) -> Results:
    """Solve a prepared model; arguments are those of `simulate`. Raises UnstableError, ResultsError."""
    with _lock_output(output):
        return _solve_new_run(
            *_make_new_recorder(
                system, state, RunRequest(output, watch, provenance, adapt, previous_compile_seconds=compile_seconds())
            )
        )


def _solve_new_run(recorder: Recorder, request: RunRequest) -> Results:
    """Solve a new run from the state of its records."""
    recorder.open_rank_databases(request.output)

    def make_new_writer() -> Writer:
        metadata = recorder.metadata(request.provenance)
        if request.refinement_thresholds:
            metadata |= zone_restarts.refinement_threshold_metadata(request.refinement_thresholds)
        return recorder.make_database_writer(request.output, metadata)

    return _advance_to_end_and_close_results(recorder, make_new_writer, request)


def _solve_motion_after_equilibrium_path_if_asked(
    path_results: Results, output: Path | None, threads: int | None, watch: Watcher | None
) -> Results:
    """The results of the motion that follows a run; those of the run if none does."""
    if not needs_motion_after_path(path_results):
        return path_results
    with stopping.patience(stopping.AT_ONCE):
        (system, state), step = prepare_motion_after_equilibrium_path(path_results, threads)
    provenance = path_results.meta()["provenance"]
    path_results.close()
    target = None if output is None else results_file_of_motion_after_equilibrium_path(output)
    with _lock_output(target):
        past = HistoryUntilCheckpoint(step, 0.0, 0, 0, None, len(system.model.grid))
        return _solve_new_run(
            Recorder(system, state, past),
            RunRequest(target, watch, provenance, previous_compile_seconds=compile_seconds()),
        )


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
    request = RunRequest(output, watch, "", adapt, threads, team, device, previous_compile_seconds=compile_seconds())
    results, motion = _resume_unless_finished(output, request), results_file_of_motion_after_equilibrium_path(output)
    if needs_motion_after_path(results) and (motion.is_symlink() or (motion.exists() and not is_empty(motion))):
        results.close()
        if motion.is_symlink():
            raise ResultsError(f"{motion} is a link, and the motion of a run is written there; move it away")
        return _resume_unless_finished(motion, request)
    return _solve_motion_after_equilibrium_path_if_asked(results, output, threads, watch)


def _resume_unless_finished(output: Path, request: RunRequest) -> Results:
    """The results of a run that is continued if it is not finished."""
    if not _run_is_finished(output):
        with writing_to(output):
            if not _run_is_finished(output):
                try:
                    return _resume_from_checkpoint(output, request)
                except FineZoneTooLateError as late:
                    return _resume_with_earlier_refinement(output, request, late)
    put_away(output)
    return Results.open(output)


def _run_is_finished(output: Path) -> bool:
    with Results.open(output) as results:
        return results.meta().get("status") == "finished"


def options_from_metadata(model: Model, metadata: Mapping[str, Any], thread_count: int | None) -> Options:
    """The options of a run of `model`, from its metadata; the number of threads may differ."""
    kernel = metadata.get("kernel")
    return Options(
        metadata["mode"], metadata["precision"], thread_count, None if model.diffuses and kernel != "listed" else kernel
    )


def _resume_with_earlier_refinement(
    output: Path, request: RunRequest, fine_zone_too_late: FineZoneTooLateError
) -> Results:
    """Results of a continued run whose fine cells came too late, as they would have been without the stop."""
    with Results.open(output) as results:
        model, meta = model_of(results.model(), str(output)), results.meta()
    refinement_thresholds = zone_restarts.read_refinement_thresholds(meta, output)
    request = request._replace(
        output=output, provenance=meta["provenance"], refinement_thresholds=refinement_thresholds
    )
    return _restart_with_earlier_refinement(
        model, options_from_metadata(model, meta, request.thread_count), request, fine_zone_too_late
    )


def _resume_from_checkpoint(output: Path, request: RunRequest) -> Results:
    with Results.open(output) as results:
        results.verify()
        model, meta = model_of(results.model(), str(output)), results.meta()
        model = model if request.device is None else on_device(model, request.device)
        options = options_from_metadata(model, meta, request.thread_count)._replace(team=request.team)
        resuming.warn_of_other_processor(output, meta)
        refinement_thresholds = request.refinement_thresholds or zone_restarts.read_refinement_thresholds(meta, output)
        request = request._replace(
            output=output, provenance=meta["provenance"], refinement_thresholds=refinement_thresholds
        )
        if not results.has_checkpoint():
            results.close()
            return _solve_with_restarts(model, options, request)
        recorder = resuming.make_resumed_recorder(results, model, options, request.adaptation)
        files = recorder.open_further_rank_databases(output, results.pieces)
    reopen = partial(_reopen_writer_at_checkpoint, output, request.refinement_thresholds, files)
    return _advance_to_end_and_close_results(recorder, reopen, request)


def _reopen_writer_at_checkpoint(
    output: Path, refinement_thresholds: tuple[RefinementThresholdFromStep, ...], files: tuple[str, ...]
) -> Writer:
    """The writer of a run that is continued, whose ranks go on with these `files`."""
    writer = Writer.reopen(output, files)
    writer.write_meta(
        zone_restarts.refinement_threshold_metadata(refinement_thresholds) | {"processor": processor_kind()}
    )
    return writer


def _advance_to_end_and_close_results(
    recorder: Recorder, make_writer: Callable[[], Writer], request: RunRequest
) -> Results:
    """March to the end from the state of the records; `make_writer` creates the writer, of a new file for a new run."""
    give_back()
    with behind(make_writer, recorder.is_new, request.output) as writer:
        try:
            if recorder.is_new:
                recorder.record_step(recorder.step)
                writer.write(partial(recorder.make_frame, recorder.step, with_fields=True, with_checkpoint=True))
            status = _advance_to_end(recorder, writer, request)
        except BaseException as reason:
            error = error_of_too_late_fine_zone(reason, recorder.system.time_step, recorder.system.stable_time_step)
            ends = {UnstableError: "unstable", NotConvergedError: "unsettled", KeyboardInterrupt: "interrupted"}
            writer.abandon(ends.get(type(error), "failed"))
            raise error from error.__cause__
        finally:
            recorder.system.stepper.report_to(None)  # else the stepper keeps the recorder, and with it this run
        last = writer.done()
        last.close(status)
    results = Results(last.connection, "results in memory") if request.output is None else Results.open(request.output)
    if not recorder.system.model.diffuses:
        warn_of_broken_bonds_outside_finest_zone(recorder.system.requested_model, results)
        warn_of_unresolved_contact_width(recorder.system, recorder.state)
    return results


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


def change_nodes_if_due_and_find_next_step(recorder: Recorder, adaptation: Regridder, step: int) -> int:
    """Let nodes change that are due after `step`; returns the step of the next look."""
    change = (
        adaptation.change_nodes(recorder.system, recorder.state, step)
        if step % adaptation.steps_between_checks == 0
        else None
    )
    if change is not None:
        recorder.record_node_change(step, change)
    return next_multiple(step, adaptation.steps_between_checks)


def grow_cracks_if_due_and_find_next_step(recorder: Recorder, step: int, last_step: int) -> int:
    """Let cracks due after `step` grow; returns the step of the next check, `last_step` without growing cracks."""
    system = recorder.system
    if system.crack_growth is None or system.crack_growth.every is None:
        return last_step
    if step % system.crack_growth.every == 0:
        system.crack_growth.look(recorder.state, step + 1)
    return next_multiple(step, system.crack_growth.every)


def record_zone_motion(recorder: Recorder, since_step: int) -> None:
    """Record the motion of a fine zone since the step `since_step`."""
    change = (
        create_system_if_zone_changed(recorder.system, with_state=False)
        if recorder.system.moving_zone_operator is not None
        else None
    )
    if change is not None:
        recorder.record_node_change(since_step, change)


def next_multiple(step: int, interval: int) -> int:
    """The next step that is a multiple of an interval."""
    return (step // interval + 1) * interval


def _advance_to_end(recorder: Recorder, writer: Behind, request: RunRequest) -> str:
    """Step to the end, from event to event; returns "finished" or "interrupted"."""
    watch, adapt = request.watcher, recorder.system.regridder
    run, step = recorder.system.model.settings.run, recorder.frame_step
    interrupted, done, looked, pace = False, False, step, StepBatchTimer(recorder.system.directed_bond_count)

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
        looks = run.steps if adapt is None else change_nodes_if_due_and_find_next_step(recorder, adapt, step)
        looks = min(looks, grow_cracks_if_due_and_find_next_step(recorder, step, run.steps))
        if request.refinement_thresholds:
            next_kappa_step = zone_restarts.set_refinement_threshold_and_find_next_change(
                recorder.system, request.refinement_thresholds, step, run.steps
            )
            looks = min(looks, next_kappa_step)
        chunk = pace.choose_batch_step_count(
            EVERY if recorder.system.moving_zone_operator else 1,
            int(PATIENCE / max(recorder.system.directed_bond_count, 1)),
        )
        records = next_multiple(step, run.every), next_multiple(step, run.ledger or run.every), run.steps
        ends = (step + chunk, looks, *records)
        began = running_time()
        last = recorder.advance(step + 1, min(ends) + 1)
        pace.record_duration(min(ends) - step, running_time() - began)
        step = last
        writer.look()
        is_record = step in records
        interrupted = watcher_requests_stop() and (
            is_record
            or _can_stop_before_next_balance_row(recorder.system, step, pace.will_finish_soon(min(records) - step))
        )
        if is_record:
            record_zone_motion(recorder, looked)
            looked = step
            recorder.record_step(step)
        done = _stop_criterion_is_met(recorder, step) if is_record else step < min(ends)
        with_fields = is_record and (step % run.every == 0 or step == run.steps or done)
        if with_fields or done or interrupted or (is_record and recorder.checkpoint_is_old):
            with_checkpoint = step == run.steps or done or interrupted
            writer.write(partial(recorder.make_frame, step, with_fields, with_checkpoint))
    recorder.evaluate_balance(step)
    compiled = {"compile_time": compile_seconds() - request.previous_compile_seconds}
    writer.done().write_meta({"summary": json.dumps(recorder.summary(step, done) | compiled)})
    recorder.accounts.warn_at_end()
    recorder.close_rank_databases()
    return "finished" if done or step == run.steps else "interrupted"


def _make_progress(recorder: Recorder, step: int, load_step_progress: LoadStepProgress | None = None) -> Progress:
    """Data for a progress display after `step`, or within a load step `load_step_progress`."""
    accounts, steps = recorder.accounts, recorder.system.model.settings.run.steps
    broken = (load_step_progress or accounts).broken_directed_bond_count
    words = ", ".join(filter(None, [recorder.system.stepper.progress_text(), accounts.progress_text(broken)]))
    return Progress(
        step, steps, broken, accounts.balance_error, words, recorder.system.zone_summary, load_step_progress
    )


def _can_stop_before_next_balance_row(system: System, step: int, balance_row_is_soon: bool) -> bool:
    """Whether a run can stop after a step without a record.

    A moving fine zone is followed from one ledger entry to the next: raises KeyboardInterrupt unless the next one comes
    `balance_row_is_soon`.
    """
    if system.moving_zone_operator is not None and not balance_row_is_soon:
        raise KeyboardInterrupt(f"at step {step}; steps since the last checkpoint are lost")
    return system.moving_zone_operator is None


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


__all__ = ["NotConvergedError", "Options", "Progress", "UnstableError", "prepare", "resume", "simulate"]
