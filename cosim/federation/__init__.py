"""One co-simulation as several processes, on one machine or on many, coupled by HELICS."""
