"""Expressions that users write: the derived values of campaigns, the equations of own models."""
