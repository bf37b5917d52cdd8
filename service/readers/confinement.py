"""What the reading process may reach: the code that reads, the one file that is read, a folder of its own, and no network.

Two means of Linux that need no privilege. Landlock: only files below the named paths can be opened, and no TCP port reached.
Seccomp: no sockets, no further processes or programs, no looking into other processes, no signal or limit for them, and no
modes, owners or times of files, which Landlock leaves open. Where a system has neither, limits on memory, time and files are
all that holds; `missing` says so.

Source: https://docs.kernel.org/userspace-api/landlock.html, https://docs.kernel.org/userspace-api/seccomp_filter.html.
"""

import ctypes
import errno
import os
import platform
import site
import struct
import sys
from collections.abc import Sequence
from pathlib import Path

_libc = ctypes.CDLL(None, use_errno=True)

_SET_NO_NEW_PRIVS, _SET_SECCOMP, _FILTER = 38, 22, 2
#: The numbers of Landlock's calls are the same on every architecture.
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION_FLAG, _PATH_BENEATH = 1, 1
_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR = 1, 2, 4, 8
#: Rights over files that each version of Landlock knows, as one past the highest bit; by version from 1.
_FILE_RIGHTS = (13, 14, 15, 15, 16)
_OF_FILES_ALONE = _EXECUTE | _WRITE_FILE | _READ_FILE | 1 << 14  # those that a rule for a file may hold, truncation too
_TCP, _TCP_FROM, _SCOPES, _SCOPES_FROM = 0b11, 4, 0b11, 6

_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000
_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_NUMBER_AT, _ARCHITECTURE_AT, _FIRST_ARGUMENT_AT = 0, 4, 16
_CLONE_THREAD = 0x10000
_OTHER_ABI = 0x40000000
#: By architecture: its number, those of seccomp, clone and clone3; of the calls that a process may make for itself alone: a
#: signal to a thread, limits, processors; and of the calls that are refused.
_ARCHITECTURES = {
    "x86_64": (
        0xC000003E, 317, 56, 435, (234, 302, 203),
        (
            41, 42, 43, 44, 49, 50, 53, 288, 57, 58, 59, 322,  # sockets; processes and programs
            62, 200, 129, 297, 424, 101, 310, 311, 434, 438, 312, 440, 448, 256, 279,  # other processes: signals, memory
            141, 142, 144, 314, 251,  # and how they are scheduled
            90, 91, 268, 452, 92, 93, 94, 260, 132, 235, 261, 280, 188, 189, 190, 197, 198, 199, 463, 466,  # modes, owners
            29, 64, 68, 240,  # memory and queues that outlive it
            272, 308, 165, 166, 155, 161, 304,  # namespaces and mounts
            321, 298, 323, 425, 248, 249, 250,  # kernel facilities that pass by these rules
        ),
    ),
    "aarch64": (
        0xC00000B7, 277, 220, 435, (131, 261, 122),
        (
            198, 203, 202, 206, 200, 201, 199, 242, 221, 281,
            129, 130, 138, 240, 424, 117, 270, 271, 434, 438, 272, 440, 448, 238, 239,
            140, 118, 119, 274, 30,
            52, 53, 452, 54, 55, 88, 5, 6, 7, 14, 15, 16, 463, 466,
            194, 190, 186, 180,
            97, 268, 40, 39, 41, 51, 265,
            280, 241, 282, 425, 217, 218, 219,
        ),
    ),
}  # fmt: skip
#: What the libraries look at of the system.
_SYSTEM = (
    "/usr", "/lib", "/lib64", "/bin", "/etc/ld.so.cache", "/etc/localtime", "/proc/self", "/proc/cpuinfo", "/proc/meminfo",
    "/sys/devices/system/cpu", "/dev/urandom",
)  # fmt: skip


def missing() -> list[str]:
    """Phrases on the protections that this system lacks for a process reading a file; empty if it has all."""
    phrases = []
    if _landlock_version() < 1:
        phrases.append("other files (Landlock is missing)")
    if not _has_seccomp():
        phrases.append("network and further processes (seccomp is missing)")
    return phrases


def close_files(*, readable: Sequence[Path], writable: Sequence[Path]) -> None:
    """Restrict this thread, and threads it starts, to opening the system's libraries, our code and these paths.

    Does nothing where the system has no Landlock.
    """
    version = _landlock_version()
    if version < 1:
        return
    handled = (1 << _FILE_RIGHTS[min(version, len(_FILE_RIGHTS)) - 1]) - 1
    attributes = struct.pack(
        "=QQQ", handled, _TCP if version >= _TCP_FROM else 0, _SCOPES if version >= _SCOPES_FROM else 0
    )
    size = len(attributes) if version >= _SCOPES_FROM else 16 if version >= _TCP_FROM else 8
    ruleset = _call(_CREATE_RULESET, attributes, size, 0)
    code = [
        Path(sys.prefix),
        Path(sys.base_prefix),
        *map(Path, site.getsitepackages()),
        Path(site.getusersitepackages()),
        *(Path(path) for path in sys.path if path.endswith(("site-packages", "dist-packages", ".zip"))),
    ]
    ours = [Path(__file__).parents[1], *(Path(__file__).parents[2] / name for name in ("models", "storage"))]
    for path in (*map(Path, _SYSTEM), *code, *ours):
        _allow(ruleset, path, (_EXECUTE | _READ_FILE | _READ_DIR) & handled)
    for path in readable:
        _allow(ruleset, path, _READ_FILE & handled)
    for path in (*writable, Path(os.devnull)):
        _allow(ruleset, path, handled)
    _no_new_privileges()
    _call(_RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)


def close_network_and_processes() -> None:
    """Forbid all threads of this process to open sockets, start, inspect or end processes, or change a file's
    permissions.

    Does nothing where the system has no seccomp.
    """
    if not _has_seccomp():
        return
    architecture, seccomp, clone, clone3, native, refused = _ARCHITECTURES[platform.machine()]

    def refuse(number: int, code: int = errno.EPERM) -> list[bytes]:
        return [_line(_EQUAL, number, 0, 1), _line(_RETURN, _REFUSE | code)]

    lines = [_line(_LOAD, _ARCHITECTURE_AT), _line(_EQUAL, architecture, 1, 0), _line(_RETURN, _REFUSE | errno.EPERM)]
    lines += [_line(_LOAD, _NUMBER_AT), _line(_AT_LEAST, _OTHER_ABI, 0, 1), _line(_RETURN, _REFUSE | errno.EPERM)]
    lines += refuse(clone3, errno.ENOSYS)  # the C library then takes clone, whose flags can be seen here
    for number in refused:
        lines += refuse(number)
    # a signal names the own process by its number, the others call it 0
    for number, itself in zip(native, (os.getpid(), 0, 0), strict=True):
        lines += [_line(_EQUAL, number, 0, 4), _line(_LOAD, _FIRST_ARGUMENT_AT), _line(_EQUAL, itself, 0, 1)]
        lines += [_line(_RETURN, _ALLOW), _line(_RETURN, _REFUSE | errno.EPERM)]
    lines += [_line(_EQUAL, clone, 0, 3), _line(_LOAD, _FIRST_ARGUMENT_AT), _line(_ANY_BIT, _CLONE_THREAD, 1, 0)]
    lines += [_line(_RETURN, _REFUSE | errno.EPERM), _line(_RETURN, _ALLOW)]
    text = ctypes.create_string_buffer(b"".join(lines))
    program = struct.pack("@HP", len(lines), ctypes.addressof(text))
    _no_new_privileges()
    _call(seccomp, 1, 1, program)  # a filter, of all threads


def _line(code: int, value: int, if_true: int = 0, if_false: int = 0) -> bytes:
    """An instruction of the filter: `code`, the numbers of lines to skip if it is true and if it is false, and its
    value."""
    return struct.pack("=HBBI", code, if_true, if_false, value)


def _allow(ruleset: int, path: Path, rights: int) -> None:
    """Allow these rights on a file, or on everything below a folder; a missing path needs no rule."""
    try:
        opened = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        return
    try:
        allowed = rights if path.is_dir() else rights & _OF_FILES_ALONE
        _call(_ADD_RULE, ruleset, _PATH_BENEATH, struct.pack("=Qi", allowed, opened), 0)
    finally:
        os.close(opened)


def _landlock_version() -> int:
    """The kernel's version of Landlock, below 1 without it."""
    if not sys.platform.startswith("linux"):
        return 0
    return int(_libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION_FLAG))


def _has_seccomp() -> bool:
    """Whether the kernel supports seccomp filters; it is tested with a null address, which gives a fault if they are
    supported."""
    if not sys.platform.startswith("linux") or platform.machine() not in _ARCHITECTURES:
        return False
    return bool(_libc.prctl(_SET_SECCOMP, _FILTER, None, 0, 0) == -1 and ctypes.get_errno() == errno.EFAULT)


def _no_new_privileges() -> None:
    if _libc.prctl(_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "a process cannot give up new privileges")


def _call(number: int, *arguments: object) -> int:
    """A system call without a function of its own. Raises OSError."""
    result = int(_libc.syscall(number, *arguments))
    if result < 0:
        code = ctypes.get_errno()
        raise OSError(code, f"system call {number}: {os.strerror(code)}")
    return result
