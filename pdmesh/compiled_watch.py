"""Watches for signals in compiled code, also while a library call holds the interpreter's lock.

The code reads a table of numbers, which Python keeps up to date. It reads the numbers of signals from a pipe and, when
the time after them is over, writes the last words, removes unfinished files, says the line and ends the process.
"""

from __future__ import annotations

import ctypes
import math
import os
import sys
import time
from collections import deque
from collections.abc import Callable, MutableSequence

FILES = 256  # unfinished files that are removed; there are few at a time
LATER = 3  # patience after the first, the second and each later signal
SIGNALS = 65  # numbers of signals are less
NEVER = -1
# Places in the table, in words of 8 bytes; the first one is what `poll` waits for
POLLED, EAR, UNTIL, COUNT, LAST, CLOCK, BYTE = 0, 1, 2, 3, 4, 5, 7
WORDS, PATIENCE, EXIT = 8, 11, 14
CODES, LINES, LENGTHS = 15, 15 + SIGNALS, 15 + 2 * SIGNALS
PATHS = 15 + 3 * SIGNALS
POLLIN = 1

CODE = f"""
declare i32 @poll(i64, i64, i32)
declare i64 @read(i32, i64, i64)
declare i64 @write(i32, i64, i64)
declare i32 @unlink(i64)
declare i32 @clock_gettime(i32, i64)

define internal i64 @place(i64 %t, i64 %k) alwaysinline {{
  %o = shl i64 %k, 3
  %a = add i64 %t, %o
  ret i64 %a
}}

define internal i64 @get(i64 %t, i64 %k) alwaysinline {{
  %a = call i64 @place(i64 %t, i64 %k)
  %p = inttoptr i64 %a to POINTER
  %v = load volatile i64, POINTER %p
  ret i64 %v
}}

define internal void @set(i64 %t, i64 %k, i64 %v) alwaysinline {{
  %a = call i64 @place(i64 %t, i64 %k)
  %p = inttoptr i64 %a to POINTER
  store volatile i64 %v, POINTER %p
  ret void
}}

define internal i64 @now(i64 %t) {{
  %a = call i64 @place(i64 %t, i64 {CLOCK})
  %r = call i32 @clock_gettime(i32 MONOTONIC, i64 %a)
  %s = call i64 @get(i64 %t, i64 {CLOCK})
  %n = call i64 @get(i64 %t, i64 {CLOCK + 1})
  %ms = mul i64 %s, 1000
  %part = sdiv i64 %n, 1000000
  %all = add i64 %ms, %part
  ret i64 %all
}}

define internal void @write_words(i64 %t, i32 %handle, i64 %text, i64 %length) {{
  %address = call i64 @get(i64 %t, i64 %text)
  %n = call i64 @get(i64 %t, i64 %length)
  %r = call i64 @write(i32 %handle, i64 %address, i64 %n)
  ret void
}}

define void @watch(i64 %t) {{
entry:
  br label %wait
wait:
  %until = call i64 @get(i64 %t, i64 {UNTIL})
  %endless = icmp slt i64 %until, 0
  %now = call i64 @now(i64 %t)
  %left = sub i64 %until, %now
  %over = icmp slt i64 %left, 0
  %rest = select i1 %over, i64 0, i64 %left
  %long = select i1 %endless, i64 {NEVER}, i64 %rest
  %timeout = trunc i64 %long to i32
  %ready = call i32 @poll(i64 %t, i64 1, i32 %timeout)
  %interrupted = icmp slt i32 %ready, 0
  br i1 %interrupted, label %wait, label %waited
waited:
  %silent = icmp eq i32 %ready, 0
  br i1 %silent, label %act, label %hear
hear:
  call void @set(i64 %t, i64 {BYTE}, i64 0)
  %ear = call i64 @get(i64 %t, i64 {EAR})
  %handle = trunc i64 %ear to i32
  %byte = call i64 @place(i64 %t, i64 {BYTE})
  %n = call i64 @read(i32 %handle, i64 %byte, i64 1)
  %number = call i64 @get(i64 %t, i64 {BYTE})
  %unread = icmp ne i64 %n, 1
  %zero = icmp eq i64 %number, 0
  %stop = or i1 %unread, %zero
  br i1 %stop, label %leave, label %heard
heard:
  %other = icmp uge i64 %number, {SIGNALS}
  br i1 %other, label %wait, label %known
known:
  %code_at = add i64 %number, {CODES}
  %code = call i64 @get(i64 %t, i64 %code_at)
  %ignored = icmp eq i64 %code, 0
  br i1 %ignored, label %wait, label %count
count:
  %last = call i64 @get(i64 %t, i64 {LAST})
  %first = icmp eq i64 %last, 0
  %kept = select i1 %first, i64 %number, i64 %last
  call void @set(i64 %t, i64 {LAST}, i64 %kept)
  %before = call i64 @get(i64 %t, i64 {COUNT})
  %after = add i64 %before, 1
  call void @set(i64 %t, i64 {COUNT}, i64 %after)
  %many = icmp ugt i64 %before, {LATER - 1}
  %row = select i1 %many, i64 {LATER - 1}, i64 %before
  %patience_at = add i64 %row, {PATIENCE}
  %patience = call i64 @get(i64 %t, i64 %patience_at)
  %forever = icmp slt i64 %patience, 0
  br i1 %forever, label %wait, label %shorten
shorten:
  %then = call i64 @now(i64 %t)
  %due = add i64 %then, %patience
  %sooner = icmp slt i64 %due, %until
  %shorter = or i1 %endless, %sooner
  %new = select i1 %shorter, i64 %due, i64 %until
  call void @set(i64 %t, i64 {UNTIL}, i64 %new)
  br label %wait
act:
  %told = call i64 @get(i64 %t, i64 {WORDS})
  %quiet = icmp slt i64 %told, 0
  br i1 %quiet, label %files, label %tell
tell:
  %to = trunc i64 %told to i32
  call void @write_words(i64 %t, i32 %to, i64 {WORDS + 1}, i64 {WORDS + 2})
  br label %files
files:
  %i = phi i64 [ {FILES}, %act ], [ {FILES}, %tell ], [ %j, %file ], [ %j, %remove ]
  %j = sub i64 %i, 1
  %done = icmp eq i64 %i, 0
  br i1 %done, label %end, label %file
file:
  %path_at = add i64 %j, {PATHS}
  %path = call i64 @get(i64 %t, i64 %path_at)
  %no_path = icmp eq i64 %path, 0
  br i1 %no_path, label %files, label %remove
remove:
  %r = call i32 @unlink(i64 %path)
  br label %files
end:
  %number_of_line = call i64 @get(i64 %t, i64 {LAST})
  %line = add i64 %number_of_line, {LINES}
  %length = add i64 %number_of_line, {LENGTHS}
  call void @write_words(i64 %t, i32 2, i64 %line, i64 %length)
  %exit_code_at = add i64 %number_of_line, {CODES}
  %exit_code = call i64 @get(i64 %t, i64 %exit_code_at)
  %status = trunc i64 %exit_code to i32
  %exit_address = call i64 @get(i64 %t, i64 {EXIT})
  %exit = inttoptr i64 %exit_address to FUNCTION
  call void %exit(i32 %status)
  ret void
leave:
  ret void
}}
"""


class SignalTable:
    """What the compiled code knows: the pipe, the seconds after each signal, lines and exit codes, unfinished files.

    `end` is the address of the function in C that ends the process with an exit code, by default ``_exit``.
    """

    def __init__(self, end: int | None = None) -> None:
        self._words = (ctypes.c_int64 * (PATHS + FILES))()
        self._words[WORDS] = self._words[UNTIL] = NEVER
        self._lines: list[ctypes.Array[ctypes.c_char]] = []
        self._paths: deque[ctypes.Array[ctypes.c_char]] = deque(maxlen=4 * FILES)  # the code may still read old ones
        self._words[EXIT] = end or ctypes.cast(ctypes.CDLL(None)._exit, ctypes.c_void_p).value or 0
        self.address = ctypes.addressof(self._words)

    def listen(self, ear: int, lines: dict[int, tuple[int, str]]) -> None:
        """Read from `ear`; a signal's number goes with an exit code and a line."""
        polled = (ctypes.c_int32 * 2)(ear, POLLIN if sys.byteorder == "little" else POLLIN << 16)
        self._words[POLLED] = ctypes.cast(polled, ctypes.POINTER(ctypes.c_int64))[0]
        self._words[EAR] = ear
        for number, (code, line) in lines.items():
            text = f"{line}\n".encode(errors="backslashreplace")
            self._words[LINES + number], self._words[LENGTHS + number] = _address(text, self._lines), len(text)
            self._words[CODES + number] = code

    def begin(self, count: int, until: float, last: int) -> None:
        """So many signals came already, the first of this number; the end is due then, by the monotonic clock."""
        self._words[COUNT], self._words[LAST], self._words[UNTIL] = count, last, _milliseconds(until)

    def set_patience(self, seconds: tuple[float, ...]) -> None:
        """The time to the end after the first signal and after each later one."""
        for row in range(LATER):
            self._words[PATIENCE + row] = _milliseconds(seconds[min(row, len(seconds) - 1)])

    def set_words(self, words: tuple[int, bytes] | None) -> None:
        """What is written where before the end, if anything."""
        self._words[WORDS] = NEVER
        if words is not None:
            self._words[WORDS + 1], self._words[WORDS + 2] = _address(words[1], self._lines), len(words[1])
            self._words[WORDS] = words[0]

    def add_file(self, row: int, path: str) -> None:
        """Remove the file at the end; those of later rows go first. Rows beyond the last are left out."""
        if row < FILES:
            self._words[PATHS + row] = _address(os.fsencode(path), self._paths)

    def drop_file(self, row: int) -> None:
        """Leave the file of this row alone."""
        if row < FILES:
            self._words[PATHS + row] = 0


def compiled_watch() -> Callable[[int], None] | None:
    """The compiled code, a function of a table's address, which runs without the interpreter's lock.

    None where it cannot be compiled.
    """
    if ctypes.sizeof(ctypes.c_void_p) != 8 or sys.byteorder != "little":
        return None
    try:
        from llvmlite import binding
    except Exception:  # too little memory, or no such library on this system
        return None
    opaque = binding.llvm_version_info >= (15,)
    code = CODE.replace("POINTER", "ptr" if opaque else "i64*").replace("FUNCTION", "ptr" if opaque else "void (i32)*")
    try:
        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        module = binding.parse_assembly(code.replace("MONOTONIC", str(time.CLOCK_MONOTONIC)))
        machine = binding.Target.from_default_triple().create_target_machine()
        engine = binding.create_mcjit_compiler(module, machine)
        engine.finalize_object()
    except Exception:
        return None
    function = ctypes.CFUNCTYPE(None, ctypes.c_int64)(engine.get_function_address("watch"))
    function.engine = engine  # type: ignore[attr-defined]  # which owns the code
    return function


def _address(text: bytes, kept: MutableSequence[ctypes.Array[ctypes.c_char]]) -> int:
    """The address of a text in C that lives as long as it is in a list."""
    kept.append(ctypes.create_string_buffer(text))
    return ctypes.addressof(kept[-1])


def _milliseconds(seconds: float) -> int:
    return NEVER if math.isinf(seconds) else math.ceil(1000 * seconds)
