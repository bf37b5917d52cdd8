"""A job's process that ends in the way that its task says; `python -m tests.service.jobs.job_process`."""

import json
import os
import signal
import sys

from service.jobs import process

if __name__ == "__main__":
    how = json.loads(sys.argv[1])["how"]
    if how == "sleeps":
        process.say({"step": how})
        sys.stdin.buffer.read()  # until the service ends
    elif how == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    elif how == "raises":
        raise RuntimeError(how)
    elif how == "writes garbage":
        sys.stdout.write("garbage\n")
    elif how == "writes a list":
        sys.stdout.write("[1]\n")
    elif how != "says nothing":
        process.answer({"result": how})
