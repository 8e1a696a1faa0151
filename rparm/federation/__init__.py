"""One co-simulation as several processes, on one machine or on many, coupled by HELICS."""

SILENCE = 60.0  # s, that a process of a federation may be silent
