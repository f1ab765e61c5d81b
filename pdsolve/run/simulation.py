"""A run from a model to its results: prepare or restore, advance from event to event, record, finish."""

from __future__ import annotations

import dataclasses
import json
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh import stopping
from pdmesh.files import FilePath
from pdmesh.model.document import InitialDisplacement
from pdsolve.adaptivity.hybrid.adaptivity_choice import error_of_too_late_fine_zone
from pdsolve.checks import warn_of_doubtful_conditions, warn_of_model, warn_of_unused
from pdsolve.codegen.compile_time import compile_seconds, processor_kind, running_time
from pdsolve.conditions import has_conditions
from pdsolve.errors import CheckpointError, FineZoneTooLateError, UnstableError
from pdsolve.model import Model, ModelError, model_of, on_device
from pdsolve.numerics.memory import give_back
from pdsolve.numerics.team import Team
from pdsolve.options import Options
from pdsolve.rest.equilibrium import NotConvergedError
from pdsolve.results import (
    BackgroundWriter,
    Results,
    ResultsError,
    ResultsWarning,
    Writer,
    is_empty,
    merge_leftover_files,
    name_damaged_checkpoint,
    open_background_writer,
    writing_to,
)
from pdsolve.run import zone_restarts
from pdsolve.run.initial_states import (
    apply_initial_displacements,
    needs_motion_after_path,
    prepare_motion_after_equilibrium_path,
    results_file_of_motion_after_equilibrium_path,
    start_in_static_equilibrium,
)
from pdsolve.run.motion_checks import warn_of_unresolved_contact_width
from pdsolve.run.prepare import prepare, with_chosen_adaptivity
from pdsolve.run.recorder import BATCH, HistoryUntilCheckpoint, Recorder, warn_of_broken_bonds_outside_finest_zone
from pdsolve.run.subdomain import Subdomain, restore_all_ranks, team_of
from pdsolve.run.system import NODES_STAY, RefinementThresholdFromStep, Regridder, System, next_multiple
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
        results = _solve(Stage(_begin, with_chosen_adaptivity(model, options), options), job)
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
    if has_conditions(stage.model.settings, InitialDisplacement):
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
        recorder = make_resumed_recorder(results, stage.model, stage.options, job.regridder)
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
    recorder = Recorder(_with_regridder(system, job.regridder), state, past)
    recorder.open_rank_databases(job.output)

    def make_new_writer() -> Writer:
        metadata = recorder.metadata(job.provenance)
        if refinement_thresholds:
            metadata |= zone_restarts.refinement_threshold_metadata(refinement_thresholds)
        return recorder.make_database_writer(job.output, metadata)

    return recorder, make_new_writer


def _with_regridder(system: System, regridder: Regridder | None) -> System:
    """The system whose nodes a caller's regridder changes. Raises ModelError where the model has changes of its own."""
    if regridder is None:
        return system
    if system.regridder is not NODES_STAY:
        setting = "run.cracks" if system.model.settings.run.cracks == "particles" else "run.adapt"
        raise ModelError(f"{system.model.name}: adapt changes nodes, and $.{setting} bonds or nodes; use one of both")
    return dataclasses.replace(system, regridder=regridder)


def _resume_unless_finished(job: Job, options: Options, device: str | None) -> Results:
    """The results of a run that is continued if it is not finished."""
    output = job.output
    assert output is not None
    if not _run_is_finished(output):
        with writing_to(output):
            if not _run_is_finished(output):
                return _solve(*_read_stage(output, job, options, device))
    merge_leftover_files(output)
    return Results.open(output)


def _run_is_finished(output: Path) -> bool:
    with Results.open(output) as results:
        return results.meta().get("status") == "finished"


def _read_stage(output: Path, job: Job, options: Options, device: str | None) -> tuple[Stage, Job]:
    """What is to be done to go on with the run in a file, which is checked."""
    with Results.open(output) as results:
        results.verify()
        model, meta, has_checkpoint = model_of(results.model(), str(output)), results.meta(), results.has_checkpoint()
    warn_of_other_processor(output, meta)
    run = model.settings.run
    if run.every is None and run.solver != "static":  # of a version that did not choose
        run = msgspec.structs.replace(run, every=run.frame_interval)
        model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
    model = model if device is None else on_device(model, device)
    options = options_from_metadata(model, meta, options.threads)._replace(team=options.team)
    thresholds = zone_restarts.read_refinement_thresholds(meta, output)
    model = with_chosen_adaptivity(model, options)
    stage = Stage(_restore if has_checkpoint else _begin, model, options, thresholds)
    return stage, job._replace(provenance=meta["provenance"])


def options_from_metadata(model: Model, metadata: Mapping[str, Any], thread_count: int | None) -> Options:
    """The options of a run of `model`, from its metadata; the number of threads may differ."""
    kernel = metadata.get("kernel")
    return Options(
        metadata["mode"],
        metadata["precision"],
        thread_count,
        None if model.has_diffusion_only and kernel != "listed" else kernel,
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
    with open_background_writer(make_writer, recorder.is_new, job.output) as writer:
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
    if not recorder.system.model.has_diffusion_only:
        warn_of_broken_bonds_outside_finest_zone(recorder.system.requested_model, results)
        warn_of_unresolved_contact_width(recorder.system, recorder.state)
    return results


def _advance_to_end(recorder: Recorder, writer: BackgroundWriter, job: Job) -> str:
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
        next_row = next_multiple(step, run.ledger or run.frame_interval)
        records = next_multiple(step, run.frame_interval), next_row, run.steps
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
        with_fields = is_record and (step % run.frame_interval == 0 or step == run.steps or done)
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
    zone_summary = system.regridder.zone_summary(system)
    return Progress(step, steps, broken, accounts.balance_error, words, zone_summary, load_step_progress)


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


def make_resumed_recorder(results: Results, model: Model, options: Options, adaptation: Regridder | None) -> Recorder:
    """The records of a run that goes on; `adaptation` changes its nodes, if not what its model asks for.

    Raises ResultsError for results of another version, or of a run with another adaptation, and ModelError.
    """
    output, meta, (step, checkpoint) = Path(results.name), results.meta(), results.checkpoint()
    with stopping.patience(stopping.AT_ONCE):
        one_file = 0 if results.pieces else len(model.grid)
        system, state = prepare(model, options._replace(one_file=one_file) if options.team else options)
    if system.moving_zone_operator is None and not checkpoint.keys() >= set(State._fields):
        raise ResultsError(f"{output} has a checkpoint that only {meta['program']} reads; solve it anew")
    if float(meta["time_step"]) != system.time_step or not has_same_bonds(system, state, results):
        raise ResultsError(
            f"{output} is of a run by {meta['program']} with a step of {meta['time_step']:.6g} s, and this version has"
            f" other bonds or a step of {system.time_step:.6g} s; solve it anew"
        )
    system = _with_regridder(system, adaptation)
    changes = system.regridder.nodes_may_change
    if changes != ("ids" in checkpoint):
        words = ("stay", "may change") if changes else ("may change", "stay")
        raise ResultsError(f"{output}: its nodes {words[0]}, and here they {words[1]}; resume it as it began")
    breaks, node_count, rows = results.breaks(), len(system.model.grid), None
    if changes:
        with name_damaged_checkpoint(output):
            regridder = system.regridder
            system, state = regridder.create_system_with_checkpoint_nodes(system, checkpoint)
            system = dataclasses.replace(system, regridder=regridder)
        lives = results.lives()
        rows, node_count = lives.at(system.model.grid.ids, step), int((lives.birth <= step).sum())
        if not np.array_equal(lives.nodes.family[rows], system.family_sizes) or (rows < 0).any():
            raise ResultsError(f"{output} has other nodes than this version's at step {step}; solve it anew")
    with name_damaged_checkpoint(output):
        if step > model.settings.run.steps:
            raise CheckpointError(f"step is {step}; the run has {model.settings.run.steps}")
        restore_all_ranks(team_of(system, state), system, step, checkpoint, breaks)
        until = breaks.step[breaks.step <= step]
        removed = len(until) - len(system.operator.broken().step) if changes else 0
        energy = float(meta.get("initial_energy", 0.0))  # results of diffusion have none
        system = dataclasses.replace(system, broken_bonds_of_removed_nodes=removed, initial_energy=energy)
        wall, updates = float(meta.get("wall_time", 0.0)), results.bond_updates(step)
        past = HistoryUntilCheckpoint(step, wall, updates, int(until.max(initial=0)), rows, node_count, results)
        return Recorder(system, state, past)


def warn_of_other_processor(output: Path, meta: Mapping[str, Any]) -> None:
    """Warn if a run goes on on another kind of processor, where sums round otherwise."""
    before, processor = meta.get("processor"), processor_kind()
    if before is not None and before != processor:
        words = (
            f"{output}: begun on a processor of kind {before}, goes on on {processor}: not bit-identical, sums round"
            " anew"
        )
        warnings.warn(words, ResultsWarning, stacklevel=2)


def has_same_bonds(system: System, state: State, results: Results) -> bool:
    """Whether the nodes of a database have the families of this system at its start."""
    team, nodes = team_of(system, state), len(system.model.grid)
    for first, family_sizes, cut_bond_counts in _initial_families(system, results):
        if first + len(family_sizes) > nodes:
            return False
        nodes_left = nodes - first - len(family_sizes)
        if not all(team.everywhere(_rank_has_same_bonds, first, family_sizes, cut_bond_counts)):
            return False
    return nodes_left == 0


def _initial_families(system: System, results: Results) -> Iterator[tuple[int, NDArray[np.int64], NDArray[np.int64]]]:
    """Row by row what a database says of nodes at the start: a first row, bonds that count, and those cut; of many
    ranks some at a time."""
    if system.ranks is None:
        initial = results.nodes(0)
        yield 0, initial.family, initial.cut
        return
    for first in range(0, max(results.count("node") or 0, 1), BATCH):
        yield first, *results.bonded(first, first + BATCH)


def _rank_has_same_bonds(
    team: Team, first_row: int, family_sizes: NDArray[np.int64], cut_bond_counts: NDArray[np.int64]
) -> bool:
    """Whether own nodes among the rows from the first on have these families."""
    subdomain: Subdomain = team.subdomain
    system, own_rows, offset = subdomain.system, subdomain.own_rows, first_row - subdomain.begin
    rows = slice(max(own_rows.start, offset), min(own_rows.stop, offset + len(family_sizes)))
    if rows.start >= rows.stop:
        return True
    entries = slice(rows.start - offset, rows.stop - offset)
    cut = system.family_sizes[rows] - system.initial_bond_counts[rows]
    return np.array_equal(system.family_sizes[rows], family_sizes[entries]) and np.array_equal(
        cut, cut_bond_counts[entries]
    )
