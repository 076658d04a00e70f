"""Work for other processes; apart, so that they need not import what tests do."""

import os
import signal
from pathlib import Path


def square(number):
    return number * number


def mortal(job):
    """Kills its process where the file is missing, having made it."""
    number, path = job
    if path is not None and not Path(path).exists():
        Path(path).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def doomed(job):
    """Always kills its process."""
    os.kill(os.getpid(), signal.SIGKILL)
