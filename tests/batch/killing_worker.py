"""Stands for a scan that makes a library crash: the worker that fits it dies. Imported by real worker processes."""

import os
import signal

from kpred.batch.worker import fit_tasks


def killing_fit(tasks, settings, out):
    if any("few" in task.name for task in tasks):
        os.kill(os.getpid(), signal.SIGKILL)
    return fit_tasks(tasks, settings, out)
