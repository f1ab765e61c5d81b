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
from pdsolve.run.measures import count_initially_separate_bodies
from pdsolve.run.on_ranks import frames, split
from pdsolve.run.on_ranks.mechanics_records import MechanicsRecordsOnRanks
from pdsolve.run.on_ranks.rank_file import wait_until_all_ranks_wrote_frame
from pdsolve.run.on_ranks.start import SystemOnRanks
from pdsolve.run.recorder import KEPT, HistoryUntilCheckpoint, Recorder
from pdsolve.run.system import System
from pdsolve.state import State

BATCH = 64 * CHUNK  # nodes that are asked for together


class RecorderOnRanks(Recorder):
    """The records of all ranks; see `Recorder`."""

    def __init__(self, system: SystemOnRanks, state: State, history: HistoryUntilCheckpoint | None) -> None:
        """`history` is that of a resumed run."""
        assert system.team is not None
        self._team, self._slabs = system.team, system.slabs
        self._files: tuple[str, ...] = ()  # of all ranks, if each has one
        super().__init__(system, state, history, False)

    def _create_physics_records(self, history: HistoryUntilCheckpoint) -> None:
        """Open the records of the state that the run begins with."""
        assert isinstance(self.system, SystemOnRanks)
        self.physics_records: MechanicsRecordsOnRanks = MechanicsRecordsOnRanks(
            self.system, history.checkpoint_step, history.past_results
        )

    @property
    def last_break_step(self) -> int:
        """Step of the last broken bond known at the last record; 0 without any."""
        return max(self._latest, self.physics_records.known.last_break_step)

    def evaluate_balance(self, step: int) -> None:
        """Evaluate the balance at this step."""
        self.physics_records.evaluate_balance(self.state, step, None)

    def record_step(self, step: int) -> None:
        """Record this step. Raises UnstableError."""
        self.physics_records.record_step(self.state, step, None)

    def has_more_fragments_than_bodies(self) -> bool:
        """Whether there are more pieces than bodies."""
        return split.count_fragments_over_ranks(
            self._team, len(self.system.model.grid)
        ) > count_initially_separate_bodies(self.system)

    def make_frame(self, step: int, with_fields: bool, with_checkpoint: bool) -> FrameRecord:
        """All records since the last frame, for writing; see `Recorder`."""
        with_checkpoint |= clock.perf_counter() - self._kept > KEPT
        if with_checkpoint:
            self._kept = clock.perf_counter()
        names = self.system.requested_model.settings.run.fields if with_fields else None
        after = max(self.frame_step, self._since)
        said: list[frames.FrameHeaderAndBreaks] = self._team.everywhere(
            frames.send_frame_to_rank_0, step, after, names, with_checkpoint
        )
        breaks = np.concatenate([rank_rows.new_breaks for rank_rows in said], axis=1)
        order = np.lexsort((breaks[2], breaks[1], breaks[0]))
        local_arrays = iter(self._team.part.sending.sent_arrays)
        fields, checkpoint = (
            frames.receive_columns_from_ranks(
                self._team, local_arrays, [getattr(rank_rows, name) for rank_rows in said]
            )
            for name in ("fields", "checkpoint_arrays")
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
                ready=partial(wait_until_all_ranks_wrote_frame, self._team) if self._files else None,
            )
        )

    def make_database_writer(self, initial_system: System, output: Path | None, meta: Mapping[str, Any]) -> Writer:
        """The writer of a new database, of a run that begins with this system."""
        team = self._team
        assert isinstance(initial_system, SystemOnRanks)
        grid = initial_system.model.grid

        @lru_cache(1)
        def gather_batch(batch_number: int) -> tuple[Nodes, Families]:
            return frames.gather_nodes_and_families(
                team, batch_number * BATCH, min((batch_number + 1) * BATCH, len(grid))
            )

        def read_nodes(first_row: int, end_row: int) -> Nodes:
            begin = first_row // BATCH * BATCH
            return taken(gather_batch(first_row // BATCH)[0], np.arange(first_row - begin, end_row - begin))

        def read_families(first_row: int, end_row: int) -> Families:
            begin, (start, target) = first_row // BATCH * BATCH, gather_batch(first_row // BATCH)[1]
            start = start[first_row - begin : end_row - begin + 1]
            return Families(start - start[0], target[start[0] : start[-1]])

        births = Births(len(grid), grid.dimension, initial_system.directed_bond_count, read_nodes, read_families)
        if self._files:
            meta = {**meta, pieces.KEY: json.dumps([pieces.Pieces(0, self._files)])}
        return Writer.begin(output, births, grid.cracks, meta)

    def open_rank_databases(self, output: Path | None) -> None:
        """Let each rank write a file of its own beside the index `output`, if there are so many nodes.

        Databases of an earlier run are removed after all names are checked. Raises WriteError.
        """
        if self.system.writes_rank_databases and output is not None:
            self._open_rank_database_set(output, 0)

    def open_further_rank_databases(
        self, output: Path, earlier_rank_databases: tuple[pieces.Pieces, ...]
    ) -> tuple[str, ...]:
        """Let each rank write another file beside the index `output` if it has earlier ones; returns their names."""
        if earlier_rank_databases:
            self._open_rank_database_set(output, len(earlier_rank_databases))
        return self._files

    def _open_rank_database_set(self, output: Path, set_number: int) -> None:
        real = Path(os.path.realpath(output))
        self._files = pieces.files_of(real, set_number, self._team.size)
        for name in self._files:
            expect_piece(real.parent / name, real.name)
        if set_number == 0:
            remove(output)
        self._team.everywhere(frames.open_rank_database, items=[str(real.parent / name) for name in self._files])

    def close_rank_databases(self) -> None:
        """Close the files of all ranks. Raises WriteError."""
        if self._files:
            self._team.everywhere(frames.close_rank_database)
