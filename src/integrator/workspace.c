#include "workspace.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Threads that have entered a workspace: SUNDIALS passes nothing to malloc that would identify the
 * instance. Thread-local storage would be the usual place, but in a shared object that is loaded
 * later it either allocates at a thread's first access, and ends the process where that fails, or
 * takes from room that the loader does not always get back: after a hundred cycles of loading and
 * unloading three FMUs they could not be loaded any more. No lock: a thread of high priority would
 * wait for one of low priority. */
struct slot {
    const void *_Atomic thread; /* NULL if the slot is free */
    struct workspace
        *workspace; /* workspace that the thread entered last; of no concern to others */
};

/* Number of slots. More threads at once, each in the few microseconds of making or freeing a
 * solver, have to wait. */
enum { SLOTS = 256 };

static struct slot slots[SLOTS];
static atomic_size_t used_slots; /* number of the first slots that were ever used */

/* Returns the address of errno, which differs between threads. */
static const void *this_thread(void) {
    return &errno;
}

/* Returns the slot of this thread; NULL if it has entered no workspace. */
static struct slot *own_slot(void) {
    const size_t count = atomic_load_explicit(&used_slots, memory_order_relaxed);
    for (size_t i = 0; i < count; i++) {
        if (atomic_load_explicit(&slots[i].thread, memory_order_relaxed) == this_thread()) {
            return &slots[i];
        }
    }
    return NULL;
}

static struct slot *claim_slot(void) {
    size_t i = 0;
    const void *nobody = NULL;
    while (!atomic_compare_exchange_strong(&slots[i].thread, &nobody, this_thread())) {
        nobody = NULL;
        i = (i + 1) % SLOTS;
        if (i == 0) {
            YIELD_THREAD();
        }
    }
    size_t count = atomic_load(&used_slots);
    while (count <= i && !atomic_compare_exchange_weak(&used_slots, &count, i + 1)) {
    }
    return &slots[i];
}

bool workspace_create(struct workspace *workspace, size_t size) {
    *workspace = (struct workspace){.block = malloc(size)};
    workspace->size = workspace->block != NULL ? size : 0;
    return workspace->block != NULL;
}

void workspace_destroy(struct workspace *workspace) {
    free(workspace->block);
    *workspace = (struct workspace){0};
}

void workspace_enter(struct workspace *workspace) {
    struct slot *slot = own_slot();
    if (slot == NULL) {
        slot = claim_slot();
    }
    workspace->slot = (size_t)(slot - slots);
    workspace->outer = slot->workspace;
    slot->workspace = workspace;
}

void workspace_leave(struct workspace *workspace) {
    struct slot *slot = &slots[workspace->slot];
    slot->workspace = workspace->outer;
    if (slot->workspace == NULL) {
        atomic_store_explicit(&slot->thread, NULL, memory_order_release);
    }
}

void workspace_cut(struct workspace *workspace, size_t used) {
    workspace->used = used;
}

/* ---- Allocator ------------------------------------------------------------------------------ */

void *workspace_malloc(size_t size) {
    const size_t alignment = _Alignof(max_align_t);
    const struct slot *slot = own_slot();
    if (slot == NULL) {
        return NULL;
    }
    struct workspace *workspace = slot->workspace;
    const size_t left = workspace->size - workspace->used;
    if (size >= left) { // even a block of no bytes must lie inside
        return NULL;
    }
    void *taken = workspace->block + workspace->used;
    const size_t with_padding = (size + alignment - 1) / alignment * alignment;
    workspace->used += with_padding < left ? with_padding : left;
    return memset(taken, 0, size);
}

void *workspace_calloc(size_t items, size_t size) {
    return size == 0 || items <= SIZE_MAX / size ? workspace_malloc(items * size) : NULL;
}

void *workspace_realloc(void *memory, size_t size) {
    char *taken = workspace_malloc(size);
    if (taken != NULL && memory != NULL) {
        // the old block was not longer than the bytes between
        const size_t between = (size_t)(taken - (char *)memory);
        memcpy(taken, memory, size < between ? size : between);
    }
    return taken;
}

void workspace_free(void *memory) {}
