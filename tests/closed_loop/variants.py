"""Variants of the closed loop, in their order."""

VARIANTS = ("nominal", "heavy_payload", "heavy_payload_integral")
VARIANTS += ("horizontal_plane", "limited_effort")
