/* The functions of workspace.h without a workspace: what SUNDIALS allocates comes from the
 * program's allocator, and goes back there. */
#include "workspace.h"

#include <stdlib.h>

bool workspace_create(struct workspace *workspace, size_t size) {
    *workspace = (struct workspace){0};
    return true;
}

void workspace_destroy(struct workspace *workspace) {}

void workspace_enter(struct workspace *workspace) {}

void workspace_leave(struct workspace *workspace) {}

void workspace_cut(struct workspace *workspace, size_t used) {}

void *workspace_malloc(size_t size) {
    return malloc(size);
}

void *workspace_calloc(size_t items, size_t size) {
    return calloc(items, size);
}

void *workspace_realloc(void *memory, size_t size) {
    return realloc(memory, size);
}

void workspace_free(void *memory) {
    free(memory);
}
