"""What a test of the program looked for in vain: it goes on, and leaves with 1 in the end where `failures` holds any."""

failures = []


def check(holds, message):
    if not holds:
        failures.append(message)
        print(message)
