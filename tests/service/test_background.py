"""Work in the background yields, and what it has done at once does not."""

import os
import subprocess
import sys

import pytest

from service.background import AtOnce, directly, in_background

pytestmark = pytest.mark.skipif(not hasattr(os, "SCHED_IDLE"), reason="this system has no such policy")


def policy() -> int:
    """The scheduling policy of the calling thread."""
    return os.sched_getscheduler(0)


def test_work_yields_and_what_it_has_done_at_once_does_not() -> None:
    usual = policy()
    assert usual != os.SCHED_IDLE

    def work(at_once: AtOnce) -> tuple[int, int]:
        return policy(), at_once(policy)

    assert in_background(work) == (os.SCHED_IDLE, usual)
    assert policy() == usual
    assert directly(policy) == usual


def test_what_either_raises_is_raised() -> None:
    def fail() -> None:
        raise LookupError("not there")

    with pytest.raises(LookupError, match="not there"):
        in_background(lambda at_once: at_once(fail))
    with pytest.raises(LookupError, match="not there"):
        in_background(lambda _: fail())


def test_a_module_is_run_in_the_background_from_its_first_import_on() -> None:
    source = "import os, sys; print(os.sched_getscheduler(0), sys.argv[1:])"
    command = [sys.executable, "-m", "service.background", "timeit", "-n1", "-r1", source]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.startswith(f"{os.SCHED_IDLE} ['-n1', '-r1', ")
