"""Linear models of FMUs and systems at a point: equilibrium, matrices, margins, largest step."""
