"""The processes of a job that a run has started."""

import pathlib


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
