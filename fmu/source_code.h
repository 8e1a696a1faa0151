/* Stands in front of every file of a source-code FMU (source_code.py), in place of options of the
 * compiler in the project's build. The headers of the system come first: they keep their own
 * symbols. */
#pragma once

#include <errno.h>
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "platform.h"

HIDE_SYMBOLS
NO_FUSED_OPERATIONS
