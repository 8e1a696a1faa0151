"""What the commands do: a module each, whose `run` takes the options and gives the exit code."""
