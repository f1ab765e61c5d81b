"""A run from a model to its results: prepare, march, write."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pdmesh import stopping
from pdmesh.files import FilePath
from pdsolve.adaptivity.hybrid.arrays import EVERY
from pdsolve.adaptivity.hybrid.engine import ZoneSummary
from pdsolve.adaptivity.hybrid.outlook import decided, of_long_steps
from pdsolve.adaptivity.hybrid.space.operator import SpaceHybrid
from pdsolve.adaptivity.quadtree.operator import Leaves
from pdsolve.checks import advise, advise_unused
from pdsolve.codegen.compile_time import compile_seconds, running_time
from pdsolve.codegen.processor import processor_kind
from pdsolve.conditions import has_initial_displacement
from pdsolve.errors import LateZoneError, UnstableError
from pdsolve.model import Model, model_of, on_device
from pdsolve.numerics.memory import give_back
from pdsolve.numerics.team import Team
from pdsolve.options import Options
from pdsolve.results import Behind, Results, ResultsError, Writer, behind, gone_back, is_empty, put_away, writing_to
from pdsolve.run import late_zones
from pdsolve.run.after_path import motion_after, motion_follows, name_of
from pdsolve.run.body_zones import Refining
from pdsolve.run.cell_splitting import Splitting
from pdsolve.run.coarse_breaks import warn_of_coarse_breaks
from pdsolve.run.doubtful_conditions import advise_conditions
from pdsolve.run.initial_displacements import displaced
from pdsolve.run.late_zones import Sooner
from pdsolve.run.narrow_contact import warn_of_narrow_contact
from pdsolve.run.node_changes import Adapt, zone_back
from pdsolve.run.on_ranks import resuming
from pdsolve.run.on_ranks import start as on_ranks
from pdsolve.run.on_ranks.recorder import RecorderOnRanks
from pdsolve.run.pace import Pace, adapted, follow_zone, grown, next_multiple
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import Past, Recorder, restore
from pdsolve.run.static_start import started
from pdsolve.run.summary import meta, summary
from pdsolve.run.system import System
from pdsolve.state import State
from pdsolve.steppers.equilibrium import UnsettledError
from pdsolve.steppers.load_steps import Going
from pdsolve.steppers.stepped_rest import SteppedRest

PATIENCE = 5e7  # bond updates between two looks at the watcher, some 20 ms; fewer where they take longer
DEFAULT = Options()


class Progress(NamedTuple):
    """Data for a progress display."""

    step: int
    steps: int
    broken: int  # directed bonds, as of the last entry in the books
    balance: float  # likewise
    words: str = ""  # how the books stand
    fine: ZoneSummary | None = None  # of a fine zone that moves
    going: Going | None = None  # of a load step that is being solved


Watcher = Callable[[Progress], bool]  # returns whether to stop


class Request(NamedTuple):
    """What is asked of a run, besides its model; see `simulate`. What it is continued on; see `resume`."""

    output: Path | None
    watch: Watcher | None
    provenance: str = ""
    adapt: Adapt | None = None
    threads: int | None = None
    team: Team | None = None
    device: str | None = None
    sooner: tuple[Sooner, ...] = ()  # after fine cells have come too late
    compiled: float = 0.0  # s that kernels were compiled for before


def simulate(
    model: Model,
    output: FilePath | None = None,
    options: Options = DEFAULT,
    watch: Watcher | None = None,
    provenance: str = "",
    adapt: Adapt | None = None,
) -> Results:
    """Solve a model; the results are in the file `output`, or in memory if None.

    `watch` is called many times a second and stops the run by returning True; `provenance` describes the origin of the
    run; `adapt` may change the nodes during the run. No other run may be writing to that file. Raises ModelError,
    UnstableError (frames so far are kept), ResultsError.
    """
    output = None if output is None else Path(output)
    with _alone(output):
        results = _simulate(model, options, Request(output, watch, provenance, adapt, compiled=compile_seconds()))
    return _moved_on(results, output, options.threads, watch)


def _alone(output: Path | None) -> AbstractContextManager[None]:
    """Keeps other runs from writing to the results, which are in memory if None."""
    return nullcontext() if output is None else writing_to(output)


def _simulate(model: Model, options: Options, request: Request) -> Results:
    if model.settings.run.adapt == "auto":
        model = decided(model, options)
    try:
        return _solve(model, options, request)
    except LateZoneError as late:
        return _sooner(model, options, request, late)


def _sooner(model: Model, options: Options, request: Request, late: LateZoneError) -> Results:
    """Results of a run whose fine cells came too late: it goes back as often as they do."""
    while True:
        wider, earlier_refinements = late_zones.after(model, request.sooner, late)
        step = late_zones.back_to(request.output, earlier_refinements)
        late_zones.say(model, late, wider, earlier_refinements, step)
        model, request = wider, request._replace(sooner=earlier_refinements, threads=options.threads)
        try:
            if step and request.output is not None:
                return _resume(request.output, request)
            return _solve(model, options, request)
        except LateZoneError as again:
            late = again


def _solve(model: Model, options: Options, request: Request) -> Results:
    """Solve a model from its start. Raises LateZoneError besides."""
    return _begin(*_noted(model, options, request))


def _noted(model: Model, options: Options, request: Request) -> tuple[Recorder, Request]:
    """The records of a run that begins, which alone keep its system and its state."""
    with stopping.patience(stopping.AT_ONCE) if request.sooner else nullcontext():  # where a run before was saved
        if options.team is None or model.diffuses:
            prepared = prepare(model, options)
        else:
            prepared = on_ranks.prepare(model, options, options.team)
    if has_initial_displacement(model):
        prepared = displaced(prepared)
    system, state = started(prepared) if model.settings.run.start == "static" else prepared
    advise_unused(model)
    advise_conditions(system.model, system.time_step)
    if system.transport is None:
        advise(system.model, system.unbonded, system.scheme.partial_cells, system.scheme.symmetric)
    return _records(system, state, request)


def _records(system: System, state: State, request: Request) -> tuple[Recorder, Request]:
    """The records of a run that begins, of all ranks if there are many."""
    request = request._replace(adapt=request.adapt or changing(system))
    if isinstance(system, on_ranks.OnRanks):
        return RecorderOnRanks(system, state, None), request
    return Recorder(system, state, None, _changes(system, request.adapt)), request


def run(
    system: System,
    state: State,
    output: Path | None = None,
    watch: Watcher | None = None,
    provenance: str = "",
    adapt: Adapt | None = None,
) -> Results:
    """Solve a prepared model; arguments are those of `simulate`. Raises UnstableError, ResultsError."""
    with _alone(output):
        return _begin(*_records(system, state, Request(output, watch, provenance, adapt, compiled=compile_seconds())))


def _begin(notes: Recorder, request: Request) -> Results:
    """Solve a new run from the state of its records."""
    notes.divide(request.output)
    start = [notes.system]  # whose nodes may have changed when the writer is made

    def new() -> Writer:
        refinement_meta = late_zones.kept(request.sooner) if request.sooner else {}
        writer = notes.writer(start[0], request.output, meta(notes, request.provenance) | refinement_meta)
        start.clear()
        return writer

    return _finish(notes, new, request)


def _moved_on(path: Results, output: Path | None, threads: int | None, watch: Watcher | None) -> Results:
    """The results of the motion that follows a run; those of the run if none does."""
    if not motion_follows(path):
        return path
    with stopping.patience(stopping.AT_ONCE):
        (system, state), step = motion_after(path, threads)
    provenance = path.meta()["provenance"]
    path.close()
    target = None if output is None else name_of(output)
    with _alone(target):
        past = Past(step, 0.0, 0, 0, None, len(system.model.grid))
        return _begin(
            Recorder(system, state, past, False), Request(target, watch, provenance, compiled=compile_seconds())
        )


def changing(system: System) -> Adapt | None:
    """What changes the nodes of a run as its model requires; None if nothing does, or the operator itself does."""
    if isinstance(system.operator, SpaceHybrid):
        return Refining()
    return Splitting(system) if isinstance(system.operator, Leaves) else None


def _changes(system: System, adapt: Adapt | None) -> bool:
    """Whether nodes may be born and die."""
    return adapt is not None or system.hybrid is not None


def resume(
    output: FilePath,
    threads: int | None = None,
    watch: Watcher | None = None,
    adapt: Adapt | None = None,
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
    request = Request(output, watch, "", adapt, threads, team, device, compiled=compile_seconds())
    results, motion = _resumed(output, request), name_of(output)
    if motion_follows(results) and (motion.is_symlink() or (motion.exists() and not is_empty(motion))):
        results.close()
        if motion.is_symlink():
            raise ResultsError(f"{motion} is a link, and the motion of a run is written there; move it away")
        return _resumed(motion, request)
    return _moved_on(results, output, threads, watch)


def _resumed(output: Path, request: Request) -> Results:
    """The results of a run that is continued if it is not finished."""
    if not _is_finished(output):
        with writing_to(output):
            if not _is_finished(output):
                try:
                    return _resume(output, request)
                except LateZoneError as late:
                    return _resume_sooner(output, request, late)
    put_away(output)
    return Results.open(output)


def _is_finished(output: Path) -> bool:
    with Results.open(output) as results:
        return results.meta().get("status") == "finished"


def options_of(model: Model, meta: Mapping[str, Any], threads: int | None) -> Options:
    """The options of a run of `model`, from its metadata; the number of threads may differ."""
    kernel = meta.get("kernel")
    return Options(meta["mode"], meta["precision"], threads, None if model.diffuses and kernel != "listed" else kernel)


def _resume_sooner(output: Path, request: Request, late: LateZoneError) -> Results:
    """Results of a continued run whose fine cells came too late, as they would have been without the stop."""
    with Results.open(output) as results:
        model, meta = model_of(results.model(), str(output)), results.meta()
    earlier_refinements = late_zones.back(meta, output)
    request = request._replace(output=output, provenance=meta["provenance"], sooner=earlier_refinements)
    return _sooner(model, options_of(model, meta, request.threads), request, late)


def _resume(output: Path, request: Request) -> Results:
    with Results.open(output) as results:
        results.verify()
        model, meta = model_of(results.model(), str(output)), results.meta()
        model = model if request.device is None else on_device(model, request.device)
        options = options_of(model, meta, request.threads)._replace(team=request.team)
        resuming.warn_of_processor(output, meta)
        earlier_refinements = request.sooner or late_zones.back(meta, output)
        request = request._replace(output=output, provenance=meta["provenance"], sooner=earlier_refinements)
        if not results.has_checkpoint():
            results.close()
            return _simulate(model, options, request)
        if request.team is not None and not model.diffuses:
            ranked = resuming.gone_on(results, model, options, meta)
            make = partial(Writer.reopen, output, ranked.go_on(output, results.pieces))
            results.close()
            return _finish(ranked, make, request)
        initial_nodes, (step, checkpoint) = results.nodes(0), results.checkpoint()
        with stopping.patience(stopping.AT_ONCE):
            system, state = prepare(model, options)
        if system.hybrid is None and not checkpoint.keys() >= set(State._fields):
            raise ResultsError(f"{output} has a checkpoint that only {meta['program']} reads; solve it anew")
        adapt = request.adapt or changing(system)
        same = float(meta["time_step"]) == system.time_step and np.array_equal(initial_nodes.family, system.family)
        if not same or not np.array_equal(initial_nodes.cut, system.family - system.count):
            raise resuming.of_other_bonds(output, meta, system)
        before = (breaks := results.breaks().step)[breaks <= step]
        wall, latest = float(meta.get("wall_time", 0.0)), int(before.max(initial=0))
        past = Past(step, wall, results.bond_updates(step), latest, None, len(initial_nodes.ids), results)
        if _changes(system, adapt) != ("ids" in checkpoint):
            words = ("stay", "may change") if adapt is not None else ("may change", "stay")
            raise ResultsError(f"{output}: its nodes {words[0]}, and here they {words[1]}; resume it as it began")
        if _changes(system, adapt):
            with gone_back(output):
                system, state = zone_back(system, checkpoint) if adapt is None else adapt.back(system, checkpoint)
            lives = results.lives()
            rows = lives.at(system.model.grid.ids, step)
            if not np.array_equal(lives.nodes.family[rows], system.family) or (rows < 0).any():
                raise ResultsError(f"{output} has other nodes than this version's at step {step}; solve it anew")
            past = past._replace(rows=rows, ever=int((lives.birth <= step).sum()))
        with gone_back(output):
            resuming.expect_within(step, model)
            restore(system, state, step, checkpoint, results.breaks())
        broken = len(before) - len(system.operator.broken().step)
        energy = float(meta.get("initial_energy", 0.0))  # results of diffusion have none
        system = dataclasses.replace(system, broken_before=broken, initial_energy=energy)
        with gone_back(output):
            notes = Recorder(system, state, past, _changes(system, adapt))
    return _finish(notes, partial(_reopened, output, request.sooner), request._replace(adapt=adapt))


def _reopened(output: Path, earlier_refinements: tuple[Sooner, ...]) -> Writer:
    """The writer of a run that is continued."""
    writer = Writer.reopen(output)
    writer.tell(late_zones.kept(earlier_refinements) | {"processor": processor_kind()})
    return writer


def _finish(notes: Recorder, make: Callable[[], Writer], request: Request) -> Results:
    """March to the end from the state of the records; `make` creates the writer, of a new file for a new run."""
    give_back()
    with behind(make, notes.new, request.output) as writer:
        try:
            if notes.new:
                notes.take(notes.step)
                writer.write(partial(notes.frame, notes.step, whole=True, state=True))
            status = _march(notes, writer, request)
        except BaseException as reason:
            error = of_long_steps(reason, notes.system.time_step, notes.system.bound)
            ends = {UnstableError: "unstable", UnsettledError: "unsettled", KeyboardInterrupt: "interrupted"}
            writer.abandon(ends.get(type(error), "failed"))
            raise error from error.__cause__
        last = writer.done()
        last.close(status)
    results = Results(last.connection, "results in memory") if request.output is None else Results.open(request.output)
    if not notes.system.model.diffuses:
        warn_of_coarse_breaks(notes.system.asked, results)
        warn_of_narrow_contact(notes.system, notes.state)
    return results


def _march(notes: Recorder, writer: Behind, request: Request) -> str:
    """Step to the end, from event to event; returns "finished" or "interrupted"."""
    watch, adapt = request.watch, request.adapt
    run, step = notes.system.model.settings.run, notes.written
    interrupted, done, looked, pace = False, False, step, Pace(notes.system.bonds)

    def asked() -> bool:
        """Whether the watcher wants the run to stop."""
        return watch is not None and watch(_progress(notes, step))

    def going(now: Going) -> None:
        """Show the progress of a load step, which is discarded if the run is to stop meanwhile."""
        if watch is not None and watch(_progress(notes, step, now)):
            raise KeyboardInterrupt("within a load step, which is lost")

    load_stepper = notes.system.stepper if isinstance(notes.system.stepper, SteppedRest) else notes.system.load_steps
    if load_stepper is not None:
        load_stepper.watch = going
    writer.stop = asked
    while step < run.steps and not (interrupted or done):
        looks = run.steps if adapt is None else adapted(notes, adapt, step)
        looks = min(looks, grown(notes, step, run.steps))
        looks = min(looks, late_zones.widen(notes.system, request.sooner, step, run.steps)) if request.sooner else looks
        chunk = pace.steps(EVERY if notes.system.hybrid else 1, int(PATIENCE / max(notes.system.bonds, 1)))
        records = next_multiple(step, run.every), next_multiple(step, run.ledger or run.every), run.steps
        ends = (step + chunk, looks, *records)
        began = running_time()
        last = notes.march(step + 1, min(ends) + 1)
        pace.took(min(ends) - step, running_time() - began)
        step = last
        writer.look()
        is_record = step in records
        interrupted = asked() and (is_record or _can_stop(notes.system, step, pace.is_soon(min(records) - step)))
        if is_record:
            follow_zone(notes, looked)
            looked = step
            notes.take(step)
        done = _is_enough(notes, step) if is_record else step < min(ends)
        with_fields = is_record and (step % run.every == 0 or step == run.steps or done)
        if with_fields or done or interrupted or (is_record and notes.is_old):
            writer.write(partial(notes.frame, step, with_fields, state=step == run.steps or done or interrupted))
    notes.settle(step)
    compiled = {"compile_time": compile_seconds() - request.compiled}
    writer.done().tell({"summary": json.dumps(summary(notes, step, done) | compiled)})
    notes.accounts.warn_at_end()
    notes.close()
    return "finished" if done or step == run.steps else "interrupted"


def _progress(notes: Recorder, step: int, load_step_progress: Going | None = None) -> Progress:
    """Data for a progress display after `step`, or within a load step `load_step_progress`."""
    books, steps = notes.accounts, notes.system.model.settings.run.steps
    broken = books.broken_bond_count if load_step_progress is None else load_step_progress.broken
    words, stepper = books.progress_text(broken), notes.system.stepper
    if isinstance(stepper, SteppedRest):
        words = f"{stepper.words()}, {words}"
    return Progress(step, steps, broken, books.balance_error, words, notes.system.zone_summary, load_step_progress)


def _can_stop(system: System, step: int, soon: bool) -> bool:
    """Whether a run can stop after a step without a record.

    A moving fine zone is followed from one ledger entry to the next: raises KeyboardInterrupt unless the next one comes
    `soon`.
    """
    if system.hybrid is not None and not soon:
        raise KeyboardInterrupt(f"at step {step}; steps since the last checkpoint are lost")
    return system.hybrid is None


def _is_enough(notes: Recorder, step: int) -> bool:
    """Whether the model's stop criterion is met."""
    system, latest = notes.system, notes.latest
    run = system.model.settings.run
    if isinstance(system.stepper, SteppedRest):
        return system.stepper.ended
    if run.until == "split":
        return notes.is_split()
    if run.until == "quiet":
        return latest > 0 and run.quiet is not None and (step - latest) * system.time_step >= run.quiet
    return False


__all__ = ["Options", "Progress", "UnsettledError", "UnstableError", "prepare", "resume", "simulate"]
