"""What tests of the program share: how they run it, and how they tell what is wrong."""

import pathlib
import subprocess
import sys

HPR = str(pathlib.Path(sys.argv[1]).resolve())
failures = []


def plain(*arguments):
    """Arguments that draw one sample, level by level, but for what they say themselves: for tests that look at values, or
    at what a sample takes."""
    options = {"--tone": "none", "--exposure": "0", "--environment": "none", "--spp": "1"}
    stated = {argument.split("=")[0] for argument in map(str, arguments)}
    return [*arguments, *(word for option in options.items() if option[0] not in stated for word in option)]


def expect(condition, message):
    """For tests that go on: leave with 1 where there are failures at the end."""
    if not condition:
        failures.append(message)
        print(f"failed: {message}")
    return condition


class Failure(Exception):
    pass


def check(good, what):
    """For tests whose case ends here."""
    if not good:
        raise Failure(what)


def run(folder, *arguments, timeout=120, **options):
    return subprocess.run([HPR, *arguments], cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=timeout, check=False, **options)


def run_to(folder, arguments, expected=0, timeout=300):
    """Fails unless it leaves with that code."""
    result = run(folder, *arguments, timeout=timeout)
    check(result.returncode == expected, f"hpr {' '.join(arguments)} left with {result.returncode}:\n{result.stderr[-2000:]}")
    return result
