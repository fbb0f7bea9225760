/*
 * A host whose allocator fails. Arguments: the backend ("cpu" or "gpu"), and how many failures a step has at most (0 = any
 * number).
 */

#include "platform.h"

#include "allocate_rounds.h"

/* Blocks and bytes that the library has. */
static atomic_long blocks, bytes;

static void *host_alloc(void *user, size_t size, size_t alignment)
{
    void *block;
    if (user != &blocks || size < 4096 || alignment < 16 || (alignment & (alignment - 1)) != 0) {
        abort();
    }
    if (is_to_fail() || (block = platform_allocate(alignment, size)) == NULL) {
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
    platform_free(block);
}

static void misuse(int backend)
{
    vrtm_allocator allocator = vrtm_allocator_init();
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device device;
    desc.backend = backend;
    desc.allocator = &allocator;
    fails("an allocator needs alloc", vrtm_device_create(&desc, &device), BAD, "desc.allocator.alloc is null");
    allocator.alloc = host_alloc;
    fails("an allocator needs free", vrtm_device_create(&desc, &device), BAD, "desc.allocator.free is null");
    allocator.free = host_free;
    allocator.struct_size = 4;
    fails("an allocator has a size", vrtm_device_create(&desc, &device), BAD, "desc.allocator.struct_size");
}

/* Counts and sizes whose product is beyond all memory are refused before anything is computed from them. */
static void extremes(int backend)
{
    static const size_t huge[] = {SIZE_MAX, SIZE_MAX / 2, (size_t)1 << 62, ((size_t)1 << 61) + 1};
    static work w;
    char line[100];
    work_begin(&w, backend, NULL);
    w.step.quality = VRTM_QUALITY_DRAFT;
    if (!check_that(make_device(&w) == VRTM_OK && make_asset(&w) == VRTM_OK && find_tiles(&w) == VRTM_OK &&
                        paint(&w) == VRTM_OK && solve(&w) == VRTM_OK,
                    "a model is solved", vrtm_last_error())) {
        return;
    }
    for (size_t k = 0; k < sizeof huge / sizeof huge[0]; ++k) {
        const size_t n = huge[k];
        vrtm_array points = array_of(rest, n), good = array_of(rest, POSITIONS), pairs = array_of(uvs[0], POSITIONS);
        vrtm_mesh_desc desc = vrtm_mesh_desc_init();
        vrtm_solve_options options = vrtm_solve_options_init();
        vrtm_image image = map_of(painted);
        vrtm_image_out out = image_of(w.out[0], VRTM_PIXEL_F32);
        vrtm_asset asset;
        size_t *const counts[] = {&desc.index_count, &desc.face_count, &desc.face_offset_count, &desc.uv_index_count,
                                  &desc.uv_set_count, &desc.seam_count, &desc.textured_face_count};
        vrtm_uv_set set;
        int refused = 1;
        memset(&set, 0, sizeof set);
        set.uvs = &pairs;
        for (size_t field = 0; field < sizeof counts / sizeof counts[0]; ++field) {
            desc.positions = &good;
            desc.uvs = &pairs;
            desc.indices = desc.uv_indices = quad_indices;
            desc.index_count = desc.uv_index_count = QUAD_CORNERS;
            desc.face_counts = field == 2 ? NULL : quad_counts;
            desc.face_count = QUADS * QUADS;
            desc.face_offsets = field == 2 ? quad_indices : NULL;
            desc.uv_sets = field == 4 ? &set : NULL;
            desc.seams = field == 5 ? cut : NULL;
            desc.textured_faces = field == 6 ? quad_counts : NULL;
            *counts[field] = n;
            refused &= vrtm_asset_create(w.device, &desc, &asset) == VRTM_ERROR_INVALID_ARGUMENT;
        }
        desc.index_count = desc.uv_index_count = QUAD_CORNERS;
        desc.textured_faces = NULL;
        desc.positions = &points;
        refused &= vrtm_asset_create(w.device, &desc, &asset) == VRTM_ERROR_INVALID_ARGUMENT;
        refused &= vrtm_asset_solve(w.asset, &points, NULL) == VRTM_ERROR_INVALID_ARGUMENT;
        good.stride = n;
        refused &= vrtm_asset_solve(w.asset, &good, NULL) == VRTM_ERROR_INVALID_ARGUMENT;
        good.stride = 0;
        options.dirty_vertices = quad_indices;
        options.dirty_vertex_count = n;
        refused &= vrtm_asset_solve(w.asset, &good, &options) == VRTM_ERROR_INVALID_ARGUMENT;
        options.dirty_vertices = NULL;
        options.tiles = w.tiles;
        options.tile_count = n;
        refused &= vrtm_asset_solve(w.asset, &good, &options) == VRTM_ERROR_INVALID_ARGUMENT;
        refused &= vrtm_asset_fetch_corner_uvs(w.asset, 0, w.corners[0], n) == VRTM_ERROR_INVALID_ARGUMENT;
        refused &= vrtm_tile_load(w.tiles[0], w.saved, n) == VRTM_ERROR_INVALID_ARGUMENT;
        for (int which = 0; which < 3; ++which) {
            image.pixel_stride = which == 0 ? n : 0;
            image.row_stride = which == 1 ? n : 0;
            image.width = image.height = which == 2 ? UINT32_MAX : TEXELS;
            out.pixel_stride = image.pixel_stride;
            out.row_stride = image.row_stride;
            out.width = out.height = which == 2 ? UINT32_MAX : 16;
            refused &= vrtm_tile_set_rigidity(w.tiles[0], &image) == VRTM_ERROR_INVALID_ARGUMENT;
            refused &= vrtm_tile_set_mask(w.tiles[0], &image) == VRTM_ERROR_INVALID_ARGUMENT;
            refused &= fetch_image(w.tiles[0], VRTM_FETCH_WARP, &out) == VRTM_ERROR_INVALID_ARGUMENT;
        }
        snprintf(line, sizeof line, "%zu of anything is refused", n);
        check_that(refused, line, vrtm_last_error());
    }
    for (uint32_t n = UINT32_MAX; n > 1u << 30; n = n / 2 + 1) {
        vrtm_image image = map_of(painted);
        vrtm_image_out out = image_of(w.out[0], VRTM_PIXEL_F32);
        vrtm_tile_settings settings = vrtm_tile_settings_init();
        int refused = vrtm_tile_update_rigidity(w.tiles[0], &image, n, 0, n, 1) == VRTM_ERROR_INVALID_ARGUMENT;
        refused &= vrtm_tile_update_rigidity(w.tiles[0], &image, 1, 1, n, n) == VRTM_ERROR_INVALID_ARGUMENT;
        refused &= fetch_rectangle(w.tiles[0], VRTM_FETCH_WARP, &out, n, n, n, n) == VRTM_ERROR_INVALID_ARGUMENT;
        settings.grid_width = settings.grid_height = n;
        refused &= vrtm_tile_set_settings(w.tiles[0], &settings) == VRTM_ERROR_INVALID_ARGUMENT;
        /* A part of an image that is larger than any memory is as good as any other. */
        refused &= fetch_rectangle(w.tiles[0], VRTM_FETCH_REDIRECTION, &out, n / 2, n / 2, n, n) == VRTM_OK;
        refused &= fetch_rectangle(w.tiles[0], VRTM_FETCH_WARP, &out, n - OUT_WIDTH, n - OUT_HEIGHT, n, n) == VRTM_OK;
        snprintf(line, sizeof line, "%u texels are refused, or taken for what they are", n);
        check_that(refused, line, vrtm_last_error());
    }
    work_end(&w);
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
    extremes(backend);
    reference(backend, &allocator);
    check_that(atomic_load(&blocks) == 0 && atomic_load(&bytes) == 0, "everything was freed", "blocks are left");
    all = rounds(backend, &allocator, 0, most);
    check_that(atomic_load(&blocks) == 0 && atomic_load(&bytes) == 0, "everything was freed after failures", "blocks are left");
    all += rounds(backend, &allocator, 1, most);
    check_that(atomic_load(&blocks) == 0 && atomic_load(&bytes) == 0, "everything was freed after more failures", "blocks are left");
    snprintf(line, sizeof line, "%ld failures in all", all);
    /* Some steps have fewer allocations that can fail than are to be tried. */
    check_that(all > (most == 0 ? 1000 : 30 * most), line, "too few");
    return finish();
}
