"""A job's process that says how far it has come and does not end by itself; `python -m tests.service.jobs.sleeping`."""

import sys

from service.jobs import own_process

if __name__ == "__main__":
    own_process.say({"step": "sleeps"})
    sys.stdin.buffer.read()  # until the service ends
