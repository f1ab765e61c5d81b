"""The records of a run on many ranks, of which rank 0 has no more than its own rows and what it writes just now."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from pdsolve.results import Breaks, Families, Frame, Nodes, Writer, pieces, remove
from pdsolve.results.removal import expect_piece
from pdsolve.results.schema import CHUNK, Births, taken
from pdsolve.run.measures import count_bodies
from pdsolve.run.on_ranks import frames, split
from pdsolve.run.on_ranks.accounts import MechanicsRecordsOnRanks
from pdsolve.run.on_ranks.rank_file import expect_written
from pdsolve.run.on_ranks.start import OnRanks
from pdsolve.run.recorder import KEPT, Past, Recorder
from pdsolve.run.system import System
from pdsolve.state import State

BATCH = 64 * CHUNK  # nodes that are asked for together


class RecorderOnRanks(Recorder):
    """The records of all ranks; see `Recorder`."""

    def __init__(self, system: OnRanks, state: State, past: Past | None) -> None:
        """`past` is that of a resumed run."""
        assert system.team is not None
        self._team, self._slabs = system.team, system.slabs
        self._files: tuple[str, ...] = ()  # of all ranks, if each has one
        super().__init__(system, state, past, False)

    def _begin(self, past: Past) -> None:
        """Open the accounts of the state that the run begins with."""
        assert isinstance(self.system, OnRanks)
        self.accounts: MechanicsRecordsOnRanks = MechanicsRecordsOnRanks(self.system, past.step, past.results)

    @property
    def latest(self) -> int:
        """Step of the last broken bond known at the last record; 0 without any."""
        return max(self._latest, self.accounts.known.last_break_step)

    def settle(self, step: int) -> None:
        """Bring the accounts to this step."""
        self.accounts.update_last_row(self.state, step, None)

    def take(self, step: int) -> None:
        """Record this step in the accounts. Raises UnstableError."""
        self.accounts.record_step(self.state, step, None)

    def is_split(self) -> bool:
        """Whether there are more pieces than bodies."""
        return split.pieces(self._team, len(self.system.model.grid)) > count_bodies(self.system)

    def frame(self, step: int, whole: bool, state: bool) -> Frame:
        """All records since the last frame, for writing; see `Recorder`."""
        state |= clock.perf_counter() - self._kept > KEPT
        if state:
            self._kept = clock.perf_counter()
        names = self.system.asked.settings.run.fields if whole else None
        after = max(self.written, self._since)
        said: list[frames.Rows] = self._team.everywhere(frames.frame, step, after, names, state)
        breaks = np.concatenate([rank_rows.breaks for rank_rows in said], axis=1)
        order = np.lexsort((breaks[2], breaks[1], breaks[0]))
        local_arrays = iter(self._team.part.sending.held)
        fields, checkpoint = (
            frames.received(self._team, local_arrays, [getattr(rank_rows, name) for rank_rows in said])
            for name in ("fields", "checkpoint")
        )
        self.written = step
        return self.accounts.move_records_into(
            Frame(
                step=step,
                time=step * self.system.time_step,
                fields=fields if whole else None,  # none of them where each rank has a file
                breaks=Breaks(*breaks[[0, 3, 4]][:, order]),
                ledger=(),
                probes=(),
                checkpoint=checkpoint if state else None,
                wall_time=self.wall(),
                ready=partial(expect_written, self._team) if self._files else None,
            )
        )

    def writer(self, system: System, output: Path | None, meta: Mapping[str, Any]) -> Writer:
        """The writer of a new database, of a run that begins with this system."""
        team = self._team
        assert isinstance(system, OnRanks)
        grid = system.model.grid

        @lru_cache(1)
        def batch(number: int) -> tuple[Nodes, Families]:
            return frames.births(team, number * BATCH, min((number + 1) * BATCH, len(grid)))

        def nodes(first: int, last: int) -> Nodes:
            begin = first // BATCH * BATCH
            return taken(batch(first // BATCH)[0], np.arange(first - begin, last - begin))

        def families(first: int, last: int) -> Families:
            begin, (start, target) = first // BATCH * BATCH, batch(first // BATCH)[1]
            start = start[first - begin : last - begin + 1]
            return Families(start - start[0], target[start[0] : start[-1]])

        births = Births(len(grid), grid.dimension, system.bonds, nodes, families)
        if self._files:
            meta = {**meta, pieces.KEY: pieces.written([pieces.Pieces(0, self._files)])}
        return Writer.begin(output, births, grid.cracks, meta)

    def divide(self, output: Path | None) -> None:
        """Let each rank write a file of its own beside the index `output`, if there are so many nodes.

        Databases of an earlier run are removed after all names are checked. Raises WriteError.
        """
        if self.system.is_in_pieces and output is not None:
            self._write_apart(output, 0)

    def go_on(self, output: Path, sets: tuple[pieces.Pieces, ...]) -> tuple[str, ...]:
        """Let each rank write another file beside the index `output`, if it has `sets` of them; returns their names."""
        if sets:
            self._write_apart(output, len(sets))
        return self._files

    def _write_apart(self, output: Path, number: int) -> None:
        real = Path(os.path.realpath(output))
        self._files = pieces.files_of(real, number, self._team.size)
        for name in self._files:
            expect_piece(real.parent / name, real.name)
        if number == 0:
            remove(output)
        self._team.everywhere(frames.begin_file, items=[str(real.parent / name) for name in self._files])

    def close(self) -> None:
        """Close the files of all ranks. Raises WriteError."""
        if self._files:
            self._team.everywhere(frames.end_file)
