"""The records of a run on many ranks, of which rank 0 has no more than its own rows and what it writes just now."""

from __future__ import annotations

import json
import os
import time as clock
from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from pdsolve.results import Breaks, Families, FrameRecord, Nodes, Writer, pieces, remove
from pdsolve.results.removal import expect_piece
from pdsolve.results.schema import CHUNK, Births, taken
from pdsolve.run.measures import count_bodies
from pdsolve.run.on_ranks import frames, split
from pdsolve.run.on_ranks.mechanics_records import MechanicsRecordsOnRanks
from pdsolve.run.on_ranks.rank_file import wait_for_rank_files
from pdsolve.run.on_ranks.start import SystemOnRanks
from pdsolve.run.recorder import KEPT, Recorder, RunHistory
from pdsolve.run.system import System
from pdsolve.state import State

BATCH = 64 * CHUNK  # nodes that are asked for together


class RecorderOnRanks(Recorder):
    """The records of all ranks; see `Recorder`."""

    def __init__(self, system: SystemOnRanks, state: State, history: RunHistory | None) -> None:
        """`history` is that of a resumed run."""
        assert system.team is not None
        self._team, self._slabs = system.team, system.slabs
        self._files: tuple[str, ...] = ()  # of all ranks, if each has one
        super().__init__(system, state, history, False)

    def _open_records(self, history: RunHistory) -> None:
        """Open the records of the state that the run begins with."""
        assert isinstance(self.system, SystemOnRanks)
        self.physics_records: MechanicsRecordsOnRanks = MechanicsRecordsOnRanks(
            self.system, history.step, history.results
        )

    @property
    def last_break_step(self) -> int:
        """Step of the last broken bond known at the last record; 0 without any."""
        return max(self._latest, self.physics_records.known.last_break_step)

    def update_last_row(self, step: int) -> None:
        """Bring the last ledger row to this step."""
        self.physics_records.update_last_row(self.state, step, None)

    def record_step(self, step: int) -> None:
        """Record this step. Raises UnstableError."""
        self.physics_records.record_step(self.state, step, None)

    def bodies_are_split(self) -> bool:
        """Whether there are more pieces than bodies."""
        return split.count_pieces(self._team, len(self.system.model.grid)) > count_bodies(self.system)

    def make_frame(self, step: int, with_fields: bool, with_checkpoint: bool) -> FrameRecord:
        """All records since the last frame, for writing; see `Recorder`."""
        with_checkpoint |= clock.perf_counter() - self._kept > KEPT
        if with_checkpoint:
            self._kept = clock.perf_counter()
        names = self.system.requested_model.settings.run.fields if with_fields else None
        after = max(self.frame_step, self._since)
        said: list[frames.FrameDescription] = self._team.everywhere(
            frames.send_frame, step, after, names, with_checkpoint
        )
        breaks = np.concatenate([rank_rows.breaks for rank_rows in said], axis=1)
        order = np.lexsort((breaks[2], breaks[1], breaks[0]))
        local_arrays = iter(self._team.part.sending.buffers)
        fields, checkpoint = (
            frames.receive_columns(self._team, local_arrays, [getattr(rank_rows, name) for rank_rows in said])
            for name in ("fields", "checkpoint")
        )
        self.frame_step = step
        return self.physics_records.move_records_into(
            FrameRecord(
                step=step,
                time=step * self.system.time_step,
                fields=fields if with_fields else None,  # none of them where each rank has a file
                breaks=Breaks(*breaks[[0, 3, 4]][:, order]),
                ledger=(),
                probes=(),
                checkpoint=checkpoint if with_checkpoint else None,
                wall_time=self.wall_time(),
                ready=partial(wait_for_rank_files, self._team) if self._files else None,
            )
        )

    def make_writer(self, system: System, output: Path | None, meta: Mapping[str, Any]) -> Writer:
        """The writer of a new database, of a run that begins with this system."""
        team = self._team
        assert isinstance(system, SystemOnRanks)
        grid = system.model.grid

        @lru_cache(1)
        def batch(number: int) -> tuple[Nodes, Families]:
            return frames.gather_nodes(team, number * BATCH, min((number + 1) * BATCH, len(grid)))

        def nodes(first: int, last: int) -> Nodes:
            begin = first // BATCH * BATCH
            return taken(batch(first // BATCH)[0], np.arange(first - begin, last - begin))

        def families(first: int, last: int) -> Families:
            begin, (start, target) = first // BATCH * BATCH, batch(first // BATCH)[1]
            start = start[first - begin : last - begin + 1]
            return Families(start - start[0], target[start[0] : start[-1]])

        births = Births(len(grid), grid.dimension, system.directed_bond_count, nodes, families)
        if self._files:
            meta = {**meta, pieces.KEY: json.dumps([pieces.Pieces(0, self._files)])}
        return Writer.begin(output, births, grid.cracks, meta)

    def open_rank_databases(self, output: Path | None) -> None:
        """Let each rank write a file of its own beside the index `output`, if there are so many nodes.

        Databases of an earlier run are removed after all names are checked. Raises WriteError.
        """
        if self.system.has_rank_databases and output is not None:
            self._open_rank_database(output, 0)

    def reopen_rank_databases(self, output: Path, piece_sets: tuple[pieces.Pieces, ...]) -> tuple[str, ...]:
        """Let each rank write another file beside the index `output`, if it has `piece_sets` of them; returns their
        names."""
        if piece_sets:
            self._open_rank_database(output, len(piece_sets))
        return self._files

    def _open_rank_database(self, output: Path, number: int) -> None:
        real = Path(os.path.realpath(output))
        self._files = pieces.files_of(real, number, self._team.size)
        for name in self._files:
            expect_piece(real.parent / name, real.name)
        if number == 0:
            remove(output)
        self._team.everywhere(frames.open_rank_file, items=[str(real.parent / name) for name in self._files])

    def close_rank_databases(self) -> None:
        """Close the files of all ranks. Raises WriteError."""
        if self._files:
            self._team.everywhere(frames.close_rank_file)
