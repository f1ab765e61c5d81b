"""Raises the walls it is told and tries to do harm; prints what it could do. Run as ``python deeds.py WALLS...``.

All of it is done in the current folder, to this process, or to nobody (signal 0).
"""

from __future__ import annotations

import ctypes
import json
import mmap
import os
import resource
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from pdmesh.drawing.sandbox import walls


def forked() -> None:
    child = os.fork()
    if child == 0:
        os._exit(0)
    os.waitpid(child, 0)


def wrote() -> None:
    with open("kept", "w") as file:
        file.write("lost")


def large() -> None:
    with open("large", "wb") as file:
        file.truncate(int(walls.OUTPUT * walls.MEMORY) + 1)


def threaded() -> None:
    thread = threading.Thread(target=int)
    thread.start()
    thread.join()


def traced() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.ptrace(0, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "ptrace")


def let_start_processes() -> None:
    """The limit does not hold for root, which has other walls: that it is set is looked at."""
    if resource.getrlimit(resource.RLIMIT_NPROC)[0] == 0:
        raise PermissionError


DEEDS: dict[str, Callable[[], object]] = {
    "read here": lambda: Path("kept").read_text(),
    "read elsewhere": lambda: Path("/etc/passwd").read_text(),
    "list elsewhere": lambda: os.listdir("/"),
    "write": wrote,
    "create": lambda: Path("new").touch(),
    "create and read": lambda: os.close(os.open("created", os.O_RDONLY | os.O_CREAT)),
    "append": lambda: open("kept", "a").close(),
    "remove": lambda: os.remove("old"),
    "rename": lambda: os.rename("kept", "moved") or os.rename("moved", "kept"),
    "make a folder": lambda: os.mkdir("folder"),
    "make a link": lambda: os.symlink("/", "link"),
    "make a pipe": lambda: os.mkfifo("pipe"),
    "change a mode": lambda: os.chmod("kept", 0o777),
    "run a program": lambda: subprocess.run(["/bin/true"], check=True),
    "become a program": lambda: os.execv("/nowhere/at/all", ["x"]),
    "fork": forked,
    "be let start processes": let_start_processes,
    "start a thread": threaded,
    "signal another": lambda: os.kill(os.getppid(), 0),
    "open a socket": lambda: socket.socket().close(),
    "be a server": lambda: socket.create_server(("127.0.0.1", 0)).close(),
    "take memory": lambda: mmap.mmap(-1, walls.MEMORY).close(),
    "fill a disk": large,
    "compute": lambda: sum(range(1000)),
    "be traced": traced,  # stops at its next signal
}


def main(wanted: list[str]) -> None:
    """Do it all."""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl.argtypes = [ctypes.c_int, *[ctypes.c_ulong] * 4]
    libc.prctl(walls.PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
    stands = {
        "limits": lambda: walls._limit(60.0),
        "landlock": lambda: walls._landlock(libc, Path.cwd()),
        "seccomp": lambda: walls._seccomp(libc),
    }
    raised = [name for name in wanted if stands[name]()]
    done = []
    for name, deed in DEEDS.items():
        try:
            deed()
            done.append(name)
        except FileNotFoundError:
            done.append(name)  # what is not there could have been
        except (OSError, MemoryError, RuntimeError):
            pass
    print(json.dumps({"raised": raised, "done": done}))


if __name__ == "__main__":
    main(sys.argv[1:])
