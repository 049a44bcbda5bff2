"""The processes of a job that a run has started."""

import os
import pathlib
import time


def children_of(pid):
    found = []
    for status in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found.append(int(status.parent.name))
    return found


def ranks_of(pid):
    """The ranks of the job of a run: children of its mpiexec, the youngest last."""
    return sorted(rank for mpiexec in children_of(pid) for rank in children_of(mpiexec))


def words_of(pid, file):
    """What /proc has about a process ("environ", "maps"); nothing once it has gone."""
    try:
        return pathlib.Path(f"/proc/{pid}/{file}").read_bytes()
    except OSError:
        return b""


def send(pid, number):
    """A signal; False where the process has gone."""
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return False
    return True


def wait_gone(pid, seconds=20.0):
    """Whether the process ends within that time; one that nobody waited for has ended."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            if pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.02)
    return False
