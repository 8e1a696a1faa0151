"""The experiment that the references are made for; loop.toml has to agree."""

START, STOP = 0.0, 6.0  # s
STEPS_PER_SECOND = 1000
