"""Confines a process that reads foreign files: it may compute, read one folder, and write files already open.

This is a second wall behind the list of `scan`: Gmsh is a large C++ program, and a list may have a gap. On Linux it
needs neither rights nor libraries. A filter of system calls (seccomp, x86-64) admits a few harmless ones: none starts a
program or a process, opens a file for writing or a socket, or reaches another process. Landlock leaves one folder
readable and none writable. Other systems have only resource limits, as far as they support them.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import platform
import signal
import struct
import warnings
from collections.abc import Collection
from pathlib import Path

from pdmesh.plain_text import print_to_stderr
from pdmesh.trust import TrustWarning

MEMORY = 2**31  # bytes, where nothing else is said
OUTPUT = 1 / 8  # of that, in any file that is written
OPEN_FILES = 256
LAST_SECONDS = 5  # of computing, from the signal to the end in any case
STAGE = "stage: "  # before what a process says that it does
PR_SET_SECCOMP, PR_SET_NO_NEW_PRIVS, SECCOMP_MODE_FILTER = 22, 38, 2
NAMES = {"landlock": "Landlock", "seccomp": "seccomp"}  # beside limits, which are no walls
WITHOUT_WORDS = "nothing; it stopped, probably for lack of memory"  # what a library says whose error has no message


def warn_of_missing(path: Path, stand: Collection[str]) -> None:
    """Warn that a file of unknown origin was read without a wall that Linux on x86-64 has."""
    missing = [name for wall, name in NAMES.items() if wall not in stand]
    if missing:
        warnings.warn(
            f"{path} is read without {' and '.join(missing)}, which this system lacks; read files of others in a"
            " sandbox elsewhere",
            TrustWarning,
            stacklevel=2,
        )


def raise_walls(folder: Path, seconds: float, memory: int = MEMORY) -> tuple[str, ...]:
    """Confine this process to reading `folder` and to `seconds` of computing; returns the names of the walls in force.

    Open files stay open. Confinement cannot be undone. Walls that a system lacks are skipped.
    """
    raised = [("limits", _limit(seconds, memory))]
    if platform.system() == "Linux":
        libc = ctypes.CDLL(None, use_errno=True)
        libc.prctl.argtypes = [ctypes.c_int, *[ctypes.c_ulong] * 4]
        if libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0:
            raised += [("landlock", _landlock(libc, folder)), ("seccomp", _seccomp(libc))]
    return tuple(name for name, stands in raised if stands)


def limit_time(seconds: float) -> None:
    """End this process by SIGXCPU after `seconds` of computing, where the system can."""
    with contextlib.suppress(ImportError, ValueError, OSError):  # Windows; macOS refuses some
        import resource

        most = resource.getrlimit(resource.RLIMIT_CPU)[1]
        hard = max(int(seconds) + 1 + LAST_SECONDS, 0)
        hard = hard if most == resource.RLIM_INFINITY else min(hard, most)
        resource.setrlimit(resource.RLIMIT_CPU, (min(int(seconds) + 1, hard), hard))


def say_stage(doing: str) -> None:
    """Say on stderr what this process does from now on, for a message if it never ends."""
    print_to_stderr(f"{STAGE}{doing}")


def _limit(seconds: float, memory: int = MEMORY) -> bool:
    limit_time(seconds)
    try:
        import resource
    except ImportError:  # Windows
        return False
    limits = {
        "AS": memory,
        "CORE": 0,
        "FSIZE": int(OUTPUT * memory),
        "NOFILE": OPEN_FILES,
        "NPROC": 0,
    }
    for name, value in limits.items():
        kind = getattr(resource, f"RLIMIT_{name}", None)
        if kind is not None:
            most = resource.getrlimit(kind)[1]
            value = value if most == resource.RLIM_INFINITY else min(value, most)
            with contextlib.suppress(ValueError, OSError):  # macOS refuses some
                resource.setrlimit(kind, (value, value))
    return True


# ---- Landlock (linux/landlock.h)

CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446  # system calls, the same on all processors but Alpha


RIGHTS = {1: 13, 2: 14, 3: 15, 4: 15, 5: 16}  # of files, by the version of the interface


READ_FILE, READ_DIR = 1 << 2, 1 << 3


NET = 0b11  # bind and connect TCP


SCOPES = 0b11  # abstract sockets and signals


def _landlock(libc: ctypes.CDLL, folder: Path) -> bool:
    call = libc.syscall
    call.restype = ctypes.c_long
    version = call(ctypes.c_long(CREATE_RULESET), None, ctypes.c_size_t(0), ctypes.c_uint32(1))
    if version < 1:
        return False
    handled = [
        (1 << RIGHTS[min(version, 5)]) - 1,
        *([NET] if version >= 4 else []),
        *([SCOPES] if version >= 6 else []),
    ]
    attributes = struct.pack(f"={len(handled)}Q", *handled)
    size = ctypes.c_size_t(len(attributes))
    rules = call(ctypes.c_long(CREATE_RULESET), ctypes.c_char_p(attributes), size, ctypes.c_uint32(0))
    if rules < 0:
        return False
    place = os.open(folder, os.O_PATH | os.O_CLOEXEC)
    try:
        beneath = struct.pack("=Qi", READ_FILE | READ_DIR, place)
        kind, none = ctypes.c_int(1), ctypes.c_uint32(0)
        added = call(ctypes.c_long(ADD_RULE), ctypes.c_int(rules), kind, ctypes.c_char_p(beneath), none)
        return bool(added == 0 and call(ctypes.c_long(RESTRICT_SELF), ctypes.c_int(rules), none) == 0)
    finally:
        os.close(place)
        os.close(rules)


# ---- seccomp (linux/seccomp.h, linux/bpf_common.h): numbers of system calls are those of x86-64

X86_64 = 0xC000003E


HARMLESS = {
    "read": 0, "write": 1, "close": 3, "stat": 4, "fstat": 5, "lstat": 6, "poll": 7, "lseek": 8, "mmap": 9,
    "mprotect": 10, "munmap": 11, "brk": 12, "rt_sigaction": 13, "rt_sigprocmask": 14, "rt_sigreturn": 15,
    "pread64": 17, "readv": 19, "writev": 20, "access": 21, "sched_yield": 24, "mremap": 25, "madvise": 28,
    "dup": 32, "nanosleep": 35, "getpid": 39, "exit": 60, "uname": 63, "getcwd": 79, "readlink": 89, "gettimeofday": 96,
    "getrlimit": 97, "getrusage": 98, "sysinfo": 99, "times": 100, "getuid": 102, "getgid": 104, "geteuid": 107,
    "getegid": 108, "sigaltstack": 131, "gettid": 186, "time": 201, "futex": 202, "sched_getaffinity": 204,
    "getdents64": 217, "restart_syscall": 219, "clock_gettime": 228, "clock_getres": 229, "clock_nanosleep": 230,
    "exit_group": 231, "newfstatat": 262, "readlinkat": 267, "faccessat": 269, "getrandom": 318, "statx": 332,
    "rseq": 334, "faccessat2": 439,
}  # fmt: skip


OPEN, OPENAT, TGKILL, FCNTL = 2, 257, 234, 72


ASKING = (0, 1, 2, 3, 1030)  # of fcntl: to double a file, and about its flags; others could have signals sent


FOR_WRITING = 0o1 | 0o2 | 0o100 | 0o1000 | 0o2000 | 0o20000000  # only, and too, creating, emptying, adding, unnamed


LOAD, EQUAL, SET, RETURN = 0x20, 0x15, 0x45, 0x06  # BPF: load a word, jump if equal, jump if a bit is set, return


ALLOW, DENY = 0x7FFF0000, 0x00050000 | errno.EPERM


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("code", ctypes.c_char_p))


def _seccomp(libc: ctypes.CDLL) -> bool:
    if platform.machine() != "x86_64" or struct.calcsize("P") != 8:
        return False

    def step(code: int, value: int, if_so: int = 0, if_not: int = 0) -> bytes:
        return struct.pack("=HBBI", code, if_so, if_not, value)

    def argument(number: int) -> bytes:
        return step(LOAD, 16 + 8 * number)

    foreign = step(LOAD, 4) + step(EQUAL, X86_64, 1, 0) + step(RETURN, DENY)
    plain = [step(EQUAL, number, 0, 1) + step(RETURN, ALLOW) for number in HARMLESS.values()]
    reading = [
        step(EQUAL, call, 0, 4) + argument(flags) + step(SET, FOR_WRITING, 0, 1) + step(RETURN, DENY)
        + step(RETURN, ALLOW)
        for call, flags in ((OPEN, 1), (OPENAT, 2))
    ]  # fmt: skip
    asking = step(EQUAL, FCNTL, 0, 2 + 2 * len(ASKING)) + argument(1)
    asking += b"".join(step(EQUAL, what, 0, 1) + step(RETURN, ALLOW) for what in ASKING) + step(RETURN, DENY)
    aborting = step(EQUAL, TGKILL, 0, 3) + argument(0) + step(EQUAL, os.getpid(), 0, 1) + step(RETURN, ALLOW)
    code = foreign + step(LOAD, 0) + b"".join([*plain, *reading]) + asking + aborting + step(RETURN, DENY)
    program = _Program(len(code) // 8, code)
    return bool(libc.prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, ctypes.addressof(program), 0, 0) == 0)


def how_it_ended(code: int) -> str:
    """Words for a process's exit code."""
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"ended with exit code {code}"
