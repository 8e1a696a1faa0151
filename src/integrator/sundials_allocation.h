/* Stands in front of every file of SUNDIALS, by an option of the compiler (cmake/Sundials.cmake):
 * SUNDIALS allocates from the workspace of the instance. Macros without arguments, because SUNDIALS
 * has members named free. The headers of the system come first: they declare the true functions. */
#pragma once

#include "workspace.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define malloc  workspace_malloc
#define calloc  workspace_calloc
#define realloc workspace_realloc
#define free    workspace_free
