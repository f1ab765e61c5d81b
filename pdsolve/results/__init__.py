"""The database of a run: schema, writer, reader. Programs that read results need only this package.

A plain SQLite file. Nodal fields are float32, in chunks of `CHUNK` nodes. The view ``node_state`` decodes them in SQL,
so ``SELECT time, uy FROM node_state WHERE node = 7`` works in any client. One transaction writes a frame with its
broken bonds and its ledger: a killed run loses at most the last frame. About once a second, a transaction also writes a
checkpoint in full precision, from which a run can continue.
"""

from pdsolve.results.background_writer import Behind, behind
from pdsolve.results.errors import (
    BusyError,
    DamagedError,
    EmptyError,
    GoneError,
    ResultsError,
    ResultsWarning,
    TakenError,
    WriteError,
    gone_back,
)
from pdsolve.results.lock import holder, writing_to
from pdsolve.results.reader import Results
from pdsolve.results.recovery import State, StateKind, is_empty, remove, state_of
from pdsolve.results.schema import Breaks, Epoch, Families, FrameRecord, Lives, Nodes
from pdsolve.results.writer import Writer, put_away

__all__ = [
    "Behind",
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
    "behind",
    "gone_back",
    "holder",
    "is_empty",
    "put_away",
    "remove",
    "state_of",
    "writing_to",
]
