#!/usr/bin/env python3
"""How often `auto` is right: on simulated clusters, the time of what it chose against the best strategy's.

usage: auto_choice.py HPR

Prints how many cells of the sweep are within 10 % of the best, and those that are not. Deterministic; about a minute.
"""
import json
import subprocess
import sys

HOSTS = (2, 4, 16)
RANKS_PER_HOST = (1, 4)
KINDS = ("dense", "half", "sparse", "scatter")
NETWORKS = (("1us", "12.5GB/s"), ("50us", "120MB/s"))


def simulate(hpr, kind, hosts, ranks, latency, bandwidth):
    cluster = f"hosts={hosts},ranks={ranks},latency={latency},bandwidth={bandwidth}"
    done = subprocess.run([hpr, "compare", "--synthetic", kind, "--size", "640x360", "--simulate", cluster, "--json"],
                          capture_output=True, text=True, check=True)
    return {run["strategy"]: run for run in json.loads(done.stdout)["runs"]}


def main():
    right = cells = 0
    for hosts in HOSTS:
        for per_host in RANKS_PER_HOST:
            for kind in KINDS:
                for latency, bandwidth in NETWORKS:
                    runs = simulate(sys.argv[1], kind, hosts, hosts * per_host, latency, bandwidth)
                    chosen = runs.pop("auto")
                    best, name = min((run["ms"]["median"], name) for name, run in runs.items())
                    ratio = chosen["ms"]["median"] / best
                    cells += 1
                    right += ratio <= 1.1
                    if ratio > 1.1:
                        print(f"{kind}, {hosts} hosts of {per_host}, {latency}, {bandwidth}: "
                              f"{chosen.get('chosen')} takes {ratio:.2f} x {name}")
    print(f"{right} of {cells} cells within 10 % of the best")


if __name__ == "__main__":
    main()
