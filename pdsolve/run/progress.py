"""What a run shows: a bar in a terminal or a notebook, an occasional line elsewhere, its summary; and stopping it."""

from __future__ import annotations

import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from pdmesh import stopping
from pdmesh.commandline import STOPS
from pdmesh.plain_text import print_to_stderr

if TYPE_CHECKING:
    from pdsolve.run.simulation import Progress

LINE_EVERY = 10.0  # s between two lines of progress where there is no terminal


def is_in_notebook() -> bool:
    """Whether this process is a notebook's kernel."""
    kernels = sys.modules.get("ipykernel.kernelapp")  # others import it without being one
    return kernels is not None and bool(kernels.IPKernelApp.initialized())


def make_progress_bar(label: str, unit: str, **tqdm_options: Any) -> Any:
    """A progress bar (tqdm's), as a widget in notebooks that support it; None if nobody would see it."""
    if not (sys.stderr.isatty() or is_in_notebook()):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a notebook without widgets: the bar is one of letters
        from tqdm.auto import tqdm
    return tqdm(desc=label, unit=unit, dynamic_ncols=True, leave=False, **tqdm_options)


class Watch:
    """Shows progress and turns Ctrl-C, a notebook's stop, SIGTERM and SIGHUP into a stop with a checkpoint.

        with Watch() as watch:
            simulate(model, path, watch=watch)

    A run that was stopped goes on by `resume(path, watch=watch)`. A run that is still being prepared has nothing to
    save: the signal raises KeyboardInterrupt there, and so does a second one at any time.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet = quiet
        self.signal: int | None = None  # that the run is to stop for
        self._before: dict[int, Any] = {}
        self._bar: Any = None
        self._said = time.monotonic()
        self._runs = False  # or is being prepared
        self._compiled = 0.0  # s that kernels were compiled for when progress was last shown
        self._patience: tuple[float, ...] = stopping.AT_ONCE  # before

    def __enter__(self) -> Callable[[Progress], bool]:
        if threading.current_thread() is threading.main_thread():
            for number in STOPS:
                if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                    self._before[number] = signal.signal(number, self._request_stop)
        self._bar = None if self._quiet else make_progress_bar("preparing (the first run compiles)", " steps")
        return self._show_progress

    def __exit__(self, *_: object) -> None:
        if self._runs:
            stopping.set_patience(self._patience)
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if self._bar is not None:
            self._bar.close()

    def _request_stop(self, signal_number: int, frame: FrameType | None) -> None:
        again, self.signal = self.signal is not None, self.signal or signal_number
        if again or not self._runs or stopping.has_nothing_to_save():  # asked twice, or prepared anew
            before = self._before[signal_number]
            if callable(before):
                before(signal_number, frame)
            raise KeyboardInterrupt

    def _show_progress(self, progress: Progress) -> bool:
        from pdsolve.codegen.compile_time import compile_seconds  # numba, which --help does not need

        compiled = compile_seconds()
        if not self._runs:
            self._patience = stopping.set_patience(stopping.SAVING)
            self._runs = True
            if self._bar is not None:
                self._bar.reset(progress.last_step)  # the speed, and what is left, are those of steps alone
        elif self._bar is not None:
            self._bar.start_t += compiled - self._compiled
            self._bar.last_print_t += compiled - self._compiled
        self._compiled = compiled
        text = progress.message
        load_step = progress.load_step_progress
        if load_step is not None:
            text = f"{load_step.iterations} iterations, residual {load_step.residual:.1e}, {text}"
        if self._bar is not None:
            self._bar.total = progress.last_step
            self._bar.set_description_str("solving", refresh=False)
            self._bar.set_postfix_str(text, refresh=False)
            self._bar.update(progress.step - self._bar.n)
        elif not self._quiet and time.monotonic() - self._said > LINE_EVERY:
            self._said = time.monotonic()
            print_to_stderr(f"step {progress.step} of {progress.last_step}, {text}")
        return self.signal is not None


def _diffusion_summary_lines(results_path: Path, summary: dict[str, Any]) -> list[str]:
    masses, share = summary["masses"], summary["dissolved_share"]
    lines = [
        f"{results_path}: {summary['nodes']} nodes, {summary['bonds']} bonds, {summary['steps']} steps of"
        f" {summary['method']} to {summary['time']:.4g} s",
        wall_time_text(summary),
        _amount_balance_text(summary),
    ]
    if share is not None:
        lines.append(
            f"dissolved {share:.2%}, {masses['dissolved']:.6g} mol; solid left {masses['solid']:.6g},"
            f" its surface {masses['surface']:.6g}"
        )
    return lines


def _amount_balance_text(summary: dict[str, Any]) -> str:
    """Where a substance or heat is, and where it has gone."""
    from pdmesh.model.amounts import amounts_line  # here and below, as help does without what models need

    amounts = summary.get("amounts") or summary["masses"] | {"unit": "mol"}  # files of earlier releases
    return amounts_line(amounts["unit"], amounts["inside"], amounts["through"], amounts["supplied"], summary["balance"])


def _step_kind_and_end_text(summary: dict[str, Any]) -> tuple[str, str]:
    """The kind of a run's steps, and where they ended."""
    if "load_steps" in summary:
        return "load steps", f"{summary['time']:.4g} s"
    if "path_steps" in summary:
        last, most = summary["path_steps"][-1], max(abs(step["pull"]) for step in summary["path_steps"]) or 1.0
        load = f"{last['factor']:.4g} of the loads, {abs(last['pull']) / most:.1%} of their largest"
        return "path steps", f"{load}, {summary['ended']}" if summary.get("ended") else load
    if "fatigue_steps" in summary:
        ended = f", {summary['ended'] or 'its last step'}"
        return "steps of jumps", f"{summary['fatigue_steps'][-1]['cycles']:.6g} cycles{ended}"
    factor, unit = (1e6, "us") if summary["time"] < 1e-2 else (1e3, "ms") if summary["time"] < 0.1 else (1.0, "s")
    return "steps", f"{summary['time'] * factor:.4g} {unit}"


def format_summary_lines(results_path: Path, summary: dict[str, Any]) -> list[str]:
    """What a run has computed, in lines: its size, time, energies and cracks."""
    from pdmesh.model.amounts import crack_energy

    if summary.get("physics") == "diffusion":
        return _diffusion_summary_lines(results_path, summary)
    energy = summary["energy"]
    rested = summary.get("load_steps") or summary.get("path_steps") or summary.get("fatigue_steps")
    what, until = _step_kind_and_end_text(summary)
    how = None
    if rested:
        iterations, residual = sum(step["iterations"] for step in rested), max(step["residual"] for step in rested)
        how = f" {iterations} iterations of {summary['method']}, residual {residual:.1e} at most"
    unit = summary.get("energy_unit", "J/m")
    damped = "".join(f" + {name} {energy[name]:.4g}" for name in ("damped", "friction") if energy[name])
    lines = [
        f"{results_path}: {summary['nodes']} nodes, {summary['bonds']} bonds, {summary['steps']} {what} to"
        f" {until}, {summary['mode']} mode, {summary['precision']}",
        wall_time_text(summary, how),
        f"broken bonds {summary['broken_bonds']}; energy, {unit}:"
        f" work {energy['work']:.4g} = kinetic {energy['kinetic']:.4g} + strain {energy['strain']:.4g}"
        f" + dissipated {energy['dissipated']:.4g}{damped} (balance error {summary['balance']:+.1e})",
    ]
    if summary.get("cracks"):
        lines.append(crack_energy(summary["cracks"], unit))
    heat = summary.get("diffusion")
    if heat is not None:
        lines.append(f"content, {_amount_balance_text(heat)}, {heat['method']}")
    fine = summary.get("hybrid")
    if fine is not None:
        coarse = "of coarse pairs" if summary["kernel"] == "collocation" else "at the zone border"
        lines.append(
            f"{summary['kernel']}: {fine['fine_share']:.1%} of the {'plate' if unit == 'J/m' else 'body'} is fine;"
            f" largest stretch {coarse}: {fine['clipped_stretch']:.2f} of critical; refining made"
            f" {fine['refinement']:+.3g} {unit}"
        )
    if "particles" in summary:
        lines.append(f"cracks have {summary['particles']} particles")
        lines += summary["remarks"]
    cells = summary.get("split")
    if cells is not None:
        lines.append(
            f"split: {cells['fine_share']:.1%} of the plate is fine; splitting and merging made"
            f" {cells['refinement']:+.3g} J/m"
        )
    return lines


SHOWN = 0.5  # s of compiling that are worth a word


def wall_time_text(summary: dict[str, Any], method_text: str | None = None) -> str:
    """The wall time in the summary of a run, what it ran on, and `method_text`, by default at what speed."""
    if method_text is None:
        millions = summary["bond_updates_per_second"] / 1e6
        layout, integrator = summary.get("layout", summary["kernel"]), summary.get("integrator")  # of earlier releases
        kernel = f"{layout}, {integrator}" if integrator else layout
        method_text = f" {millions:.0f} million directed bond updates a second ({kernel})"
    compiled = summary.get("compile_time", 0.0)  # files of earlier releases have none
    apart = f"; compiled kernels for {compiled:.0f} s" if compiled >= SHOWN else ""
    device = str(summary["device"])
    if device == "cpu":
        device = f"{summary['threads']} thread{'s' if summary['threads'] > 1 else ''}"
    return f"wall time {summary['wall_time']:.2f} s on {device},{method_text}{apart}"
