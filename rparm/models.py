"""The folder of the models: modules of their studies and references are `rparm.models.NAME`."""

from rparm import project

__path__ = [str(project.MODELS)]
