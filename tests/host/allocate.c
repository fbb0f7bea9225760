/*
 * A host whose allocator fails. Arguments: the backend ("cpu" or "gpu"), and how many failures a step has at most (0 = any
 * number).
 */

#define _POSIX_C_SOURCE 200809L

#include "allocate_rounds.h"

/* Blocks and bytes that the library has. */
static atomic_long blocks, bytes;

static void *host_alloc(void *user, size_t size, size_t alignment)
{
    void *block = NULL;
    if (user != &blocks || size < 4096 || alignment < 16 || (alignment & (alignment - 1)) != 0) {
        abort();
    }
    if (is_to_fail() || posix_memalign(&block, alignment, size) != 0) {
        return NULL;
    }
    /* Zeros are not promised. */
    memset(block, 0xa5, size);
    atomic_fetch_add(&blocks, 1);
    atomic_fetch_add(&bytes, (long)size);
    return block;
}

static void host_free(void *user, void *block, size_t size, size_t alignment)
{
    if (user != &blocks || block == NULL || alignment < 16) {
        abort();
    }
    atomic_fetch_sub(&blocks, 1);
    atomic_fetch_sub(&bytes, (long)size);
    memset(block, 0x5a, size);
    free(block);
}

static void misuse(int backend)
{
    vrtm_allocator allocator = vrtm_allocator_init();
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device device;
    desc.backend = backend;
    desc.allocator = &allocator;
    fails("an allocator needs alloc", vrtm_device_create(&desc, &device), VRTM_ERROR_INVALID_ARGUMENT, "desc.allocator.alloc is null");
    allocator.alloc = host_alloc;
    fails("an allocator needs free", vrtm_device_create(&desc, &device), VRTM_ERROR_INVALID_ARGUMENT, "desc.allocator.free is null");
    allocator.free = host_free;
    allocator.reserved = 1;
    fails("reserved fields are zero", vrtm_device_create(&desc, &device), VRTM_ERROR_INVALID_ARGUMENT, "desc.allocator.reserved");
    allocator.reserved = 0;
    allocator.struct_size = 4;
    fails("an allocator has a size", vrtm_device_create(&desc, &device), VRTM_ERROR_INVALID_ARGUMENT, "desc.allocator.struct_size");
}

int main(int count, char **arguments)
{
    const int backend = count > 1 && strcmp(arguments[1], "gpu") == 0 ? VRTM_BACKEND_GPU : VRTM_BACKEND_CPU;
    const long most = count > 2 ? atol(arguments[2]) : 0;
    char line[100];
    long all;
    vrtm_allocator allocator = vrtm_allocator_init();
    allocator.alloc = host_alloc;
    allocator.free = host_free;
    allocator.user = &blocks;
    prepare_inputs();
    misuse(backend);
    reference(backend, &allocator);
    check_that(atomic_load(&blocks) == 0 && atomic_load(&bytes) == 0, "everything was freed", "blocks are left");
    all = rounds(backend, &allocator, 0, most);
    check_that(atomic_load(&blocks) == 0 && atomic_load(&bytes) == 0, "everything was freed after failures", "blocks are left");
    all += rounds(backend, &allocator, 1, most);
    check_that(atomic_load(&blocks) == 0 && atomic_load(&bytes) == 0, "everything was freed after more failures", "blocks are left");
    snprintf(line, sizeof line, "%ld failures in all", all);
    check_that(all > 100, line, "too few");
    return finish();
}
