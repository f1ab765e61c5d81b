"""The database of a run: schema, writer, reader. Programs that read results need only this package.

A plain SQLite file. Nodal fields are float32, in chunks of `CHUNK` nodes. The view ``node_state`` decodes them in SQL,
so ``SELECT time, uy FROM node_state WHERE node = 7`` works in any client. One transaction writes a frame with its
broken bonds and its ledger: a killed run loses at most the last frame. About once a second, a transaction also writes a
checkpoint in full precision, from which a run can continue.
"""

from pdsolve.results.background_writer import BackgroundWriter, open_background_writer
from pdsolve.results.errors import (
    BusyError,
    DamagedError,
    EmptyError,
    GoneError,
    ResultsError,
    ResultsWarning,
    TakenError,
    WriteError,
    name_damaged_checkpoint,
)
from pdsolve.results.lock import holder, writing_to
from pdsolve.results.reader import Results
from pdsolve.results.recovery import State, StateKind, is_empty, remove, state_of
from pdsolve.results.schema import Breaks, Epoch, Families, FrameRecord, Lives, Nodes
from pdsolve.results.writer import Writer, merge_leftover_files

__all__ = [
    "BackgroundWriter",
    "Breaks",
    "BusyError",
    "DamagedError",
    "EmptyError",
    "Epoch",
    "Families",
    "FrameRecord",
    "GoneError",
    "Lives",
    "Nodes",
    "Results",
    "ResultsError",
    "ResultsWarning",
    "State",
    "StateKind",
    "TakenError",
    "WriteError",
    "Writer",
    "holder",
    "is_empty",
    "merge_leftover_files",
    "name_damaged_checkpoint",
    "open_background_writer",
    "remove",
    "state_of",
    "writing_to",
]
