"""A job's process that says how far it has come and does not end by itself; `python -m tests.service.work.sleeping`."""

import sys

from service.work import process

if __name__ == "__main__":
    process.say({"step": "sleeps"})
    sys.stdin.buffer.read()  # until the service ends
