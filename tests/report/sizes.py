"""What the parts of a report may take, in bytes, so that the whole stays small."""

WHOLE = 12_000_000
OF_SCENARIOS = 8_000_000  # all scenarios, studies, the overview, scripts and styles
OF_NUMBER = 15  # in a file of values of a variant
OF_VARIANT_PAGE = 120_000
