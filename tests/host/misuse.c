/*
 * Misuse: every wrong call returns its status and a message that names the argument, and writes nothing.
 *
 * Each step below sets one field of a valid call to a wrong value, makes the call, and restores the field.
 */

#include "check.h"

/* Sets `field` during the step. */
#define WITH(type, field, value, step)   \
    do {                                 \
        const type kept_ = (field);      \
        (field) = (value);               \
        step;                            \
        (field) = kept_;                 \
    } while (0)

static sheet s;
static sheet_desc d;
static vrtm_device device;
static vrtm_asset asset;
static vrtm_tile tile;

static void versions_of_structs(void)
{
    vrtm_device other = {77};
    vrtm_device_desc desc = vrtm_device_desc_init();
    WITH(uint32_t, desc.struct_size, 0,
         fails("struct_size 0", vrtm_device_create(&desc, &other), BAD, "desc.struct_size is 0"));
    WITH(uint32_t, desc.struct_size, 4,
         fails("struct_size 4", vrtm_device_create(&desc, &other), BAD, "desc.struct_size is 4"));
    WITH(uint32_t, desc.struct_size, UINT32_MAX,
         fails("struct_size of garbage", vrtm_device_create(&desc, &other), BAD, "desc.struct_size"));
    struct {
        vrtm_device_desc known;
        uint64_t later;
    } newer = {vrtm_device_desc_init(), 0};
    newer.known.struct_size = sizeof newer;
    newer.later = 1;
    fails("a newer struct with an unknown field", vrtm_device_create(&newer.known, &other), VRTM_ERROR_UNSUPPORTED,
          "desc: a field after");
    check_that(other.id == 77, "no device was written", "");
    newer.later = 0;
    succeeds("a newer struct without", vrtm_device_create(&newer.known, &other));
    succeeds("its end", vrtm_device_destroy(other));
    vrtm_device_info info = vrtm_device_info_init();
    info.struct_size = 12;
    fails("an output's struct_size", vrtm_device_get_info(device, &info), BAD, "info.struct_size is 12");
    check_that(info.threads == 0, "no info was written", "");
    struct {
        vrtm_device_info known;
        uint64_t later;
    } longer = {vrtm_device_info_init(), 9};
    longer.known.struct_size = sizeof longer;
    succeeds("a newer output struct", vrtm_device_get_info(device, &longer.known));
    check_that(longer.known.threads > 0 && longer.later == 0 && longer.known.struct_size == sizeof longer,
               "what the library does not know is zero", "");
}

static void devices(void)
{
    vrtm_device other = {77};
    vrtm_device_desc desc = vrtm_device_desc_init();
    fails("no place for the device", vrtm_device_create(NULL, NULL), BAD, "vrtm_device_create: device is null");
    uint32_t count = 77;
    succeeds("the number of adapters", vrtm_adapter_count(&count));
    desc.adapter = count;
    WITH(vrtm_backend, desc.backend, VRTM_BACKEND_GPU,
         fails("a gpu that is not there", vrtm_device_create(&desc, &other), count > 0 ? BAD : VRTM_ERROR_UNSUPPORTED,
               count > 0 ? "adapter: " : "backend: gpu was asked for, but there is no GPU"));
    desc.adapter = 0;
    WITH(vrtm_backend, desc.backend, 9,
         fails("backend 9", vrtm_device_create(&desc, &other), BAD, "desc.backend is 9"));
    WITH(uint32_t, desc.threads, 5000, fails("5000 threads", vrtm_device_create(&desc, &other), BAD, "threads"));
    const vrtm_executor executor = vrtm_executor_init();
    typedef const vrtm_executor *loops;
    WITH(loops, desc.executor, &executor,
         fails("no loop", vrtm_device_create(&desc, &other), BAD, "desc.executor.parallel_for is null"));
    check_that(other.id == 77, "no device was written", "");
    fails("no place for the count", vrtm_adapter_count(NULL), BAD, "count is null");
    vrtm_adapter_info adapter = vrtm_adapter_info_init();
    fails("an adapter that is not there", vrtm_adapter_get_info(count, &adapter), BAD, "index is ");
    check_that(adapter.name[0] == 0, "no adapter was written", "");
    fails("no place for the info", vrtm_device_get_info(device, NULL), BAD, "info is null");
    vrtm_device_info info = vrtm_device_info_init();
    fails("device zero", vrtm_device_get_info((vrtm_device){0}, &info), GONE, "device: the handle is zero");
    fails("a device from nowhere", vrtm_device_get_info((vrtm_device){12345}, &info), GONE, "device");
    fails("an asset as a device", vrtm_device_get_info((vrtm_device){asset.id}, &info), GONE, "device");
    fails("destroy device zero", vrtm_device_destroy((vrtm_device){0}), GONE, "device");
    succeeds("a second device", vrtm_device_create(&desc, &other));
    succeeds("its end", vrtm_device_destroy(other));
    fails("destroyed twice", vrtm_device_destroy(other), GONE, "device");
    fails("a stale device", vrtm_device_get_info(other, &info), GONE, "device");
    fails("an asset on a stale device", vrtm_asset_create(other, &d.mesh, &asset), GONE, "device");
}

static void bad_settings(const char *name, const vrtm_tile_settings *settings, const char *text)
{
    fails(name, vrtm_tile_set_settings(tile, settings), BAD, text);
}

static void bad_solve(const char *name, const vrtm_array *positions, const vrtm_solve_options *options,
                      const char *text)
{
    fails(name, vrtm_asset_solve(asset, positions, options), BAD, text);
}

static void bad_mesh(const char *name, const char *text)
{
    vrtm_asset other = {77};
    fails(name, vrtm_asset_create(device, &d.mesh, &other), BAD, text);
    if (other.id != 77) {
        check_that(0, name, "a handle was written");
    }
}

static void meshes(void)
{
    const double nan = NAN, inf = INFINITY;
    fails("no place for the asset", vrtm_asset_create(device, &d.mesh, NULL), BAD, "asset is null");
    vrtm_asset other = {77};
    fails("no desc", vrtm_asset_create(device, NULL, &other), BAD, "desc is null");
    WITH(uint32_t, d.mesh.struct_size, 8, bad_mesh("a mesh's struct_size", "desc.struct_size is 8"));
    typedef const vrtm_array *array;
    typedef const uint32_t *numbers;
    WITH(array, d.mesh.positions, NULL, bad_mesh("no positions", "desc.positions is null"));
    typedef const void *data;
    WITH(data, d.positions.data, NULL, bad_mesh("no position data", "desc.positions.data is null"));
    WITH(size_t, d.positions.count, 0, bad_mesh("no vertices", "desc.positions.count is 0"));
    WITH(size_t, d.positions.count, SIZE_MAX / 2, bad_mesh("vertices beyond memory", "desc.positions.count"));
    WITH(size_t, d.positions.stride, 23, bad_mesh("a short stride", "desc.positions.stride is 23"));
    WITH(vrtm_scalar, d.positions.format, 7, bad_mesh("scalar 7", "desc.positions.format is 7"));
    WITH(uint32_t, d.positions.struct_size, 1, bad_mesh("an array's struct_size", "desc.positions.struct_size"));
    WITH(double, s.points[5][1], nan, bad_mesh("a NaN position", "desc.positions[5]"));
    WITH(double, s.points[6][2], inf, bad_mesh("an infinite position", "desc.positions[6]"));
    WITH(numbers, d.mesh.indices, NULL, bad_mesh("no indices", "desc.indices is null"));
    WITH(size_t, d.mesh.index_count, 0, bad_mesh("zero indices", "indices"));
    WITH(size_t, d.mesh.index_count, SIZE_MAX, bad_mesh("indices beyond memory", "desc.indices"));
    WITH(numbers, d.mesh.indices, (numbers)((const char *)s.indices + 1),
         bad_mesh("indices off their alignment", "desc.indices is not aligned"));
    WITH(uint32_t, s.indices[9], VERTICES, bad_mesh("a vertex out of range", "desc.indices[9]"));
    WITH(uint32_t, s.counts[3], 2, bad_mesh("a corner too many for the faces", "desc.face_counts"));
    WITH(uint32_t, s.counts[3], 5, bad_mesh("counts that do not add up", "desc.face_counts"));
    WITH(size_t, d.mesh.face_count, FACES - 1, bad_mesh("a face too few", "desc.face_counts"));
    {
        uint32_t offsets[FACES + 1], pair[2] = {0, VERTICES}, none[CORNERS], faces[2] = {0, FACES};
        vrtm_uv_set set;
        for (int k = 0; k <= FACES; ++k) {
            offsets[k] = (uint32_t)(4 * k);
        }
        d.mesh.face_offset_count = FACES + 1;
        WITH(numbers, d.mesh.face_offsets, offsets, bad_mesh("counts and offsets", "desc.face_offsets: face_counts"));
        d.mesh.face_counts = NULL;
        d.mesh.face_offsets = offsets;
        WITH(uint32_t, offsets[0], 1, bad_mesh("offsets from 1", "desc.face_offsets[0]"));
        WITH(uint32_t, offsets[7], 3, bad_mesh("offsets that fall", "desc.face_offsets[7]"));
        WITH(size_t, d.mesh.face_offset_count, FACES, bad_mesh("an offset too few", "desc.face_offsets[143]"));
        d.mesh.face_counts = s.counts;
        d.mesh.face_offsets = NULL;

        d.mesh.seam_count = 1;
        WITH(numbers, d.mesh.seams, pair, bad_mesh("a seam of no vertex", "desc.seams[0]: vertex 169"));
        pair[1] = 0;
        WITH(numbers, d.mesh.seams, pair, bad_mesh("a seam of one vertex", "desc.seams[0]: both"));
        d.mesh.textured_face_count = 2;
        WITH(numbers, d.mesh.textured_faces, faces, bad_mesh("a face out of range", "desc.textured_faces[1]: face 144"));

        memcpy(none, s.indices, sizeof none);
        none[17] = UINT32_MAX;
        WITH(numbers, d.mesh.uv_indices, none, bad_mesh("a corner without a UV", "desc.uv_indices[17]"));
        memset(&set, 0, sizeof set);
        d.mesh.uv_sets = &set;
        d.mesh.uv_set_count = 1;
        bad_mesh("a uv set without uvs", "desc.uv_sets[0].uvs is null");
        set.uvs = &d.uvs;
        bad_mesh("a uv set without indices", "desc.uv_sets[0].uvs");
        set.uv_indices = s.indices;
        set.uv_index_count = 3;
        bad_mesh("a uv set with few indices", "desc.uv_sets[0].uv_indices: 3");
        set.uv_indices = none;
        set.uv_index_count = CORNERS;
        bad_mesh("a uv set's corner without a UV", "desc.uv_sets[0].uv_indices[17]");
        d.mesh.uv_sets = NULL;

        WITH(vrtm_weld, d.mesh.weld, 3, bad_mesh("weld 3", "desc.weld is 3"));
        WITH(double, d.mesh.weld_uv_tolerance, -1, bad_mesh("a negative tolerance", "desc.weld_uv_tolerance: -1"));
        WITH(double, d.mesh.weld_uv_tolerance, 1.5, bad_mesh("a large tolerance", "desc.weld_uv_tolerance: 1.5"));
        WITH(double, d.mesh.weld_position_tolerance, NAN, bad_mesh("a NaN", "desc.weld_position_tolerance: NaN"));
    }
    WITH(array, d.mesh.uvs, NULL, bad_mesh("no uvs", "desc.uvs is null"));
    WITH(array, d.mesh.u, &d.uvs, bad_mesh("uvs twice", "desc.uvs is given"));
    WITH(float, s.uvs[7][1], NAN, bad_mesh("a NaN uv", "desc.uvs[7]"));
    WITH(size_t, d.uvs.stride, 4, bad_mesh("a short uv stride", "desc.uvs.stride is 4"));
    WITH(size_t, d.mesh.uv_index_count, 3, bad_mesh("uv indices too few", "desc.uv_indices"));
    WITH(numbers, d.mesh.uv_indices, NULL, bad_mesh("a uv per corner, but too few", "desc.uvs"));
    {
        uint32_t spoilt[CORNERS];
        memcpy(spoilt, s.indices, sizeof spoilt);
        spoilt[11] = 1000000;
        WITH(numbers, d.mesh.uv_indices, spoilt, bad_mesh("a uv out of range", "desc.uv_indices[11]"));
    }
    vrtm_array u = d.uvs, v = d.uvs;
    u.stride = v.stride = 8;
    v.data = &s.uvs[0][1];
    v.count -= 1;
    d.mesh.uvs = NULL;
    d.mesh.u = &u;
    bad_mesh("u without v", "desc.v is null");
    d.mesh.v = &v;
    bad_mesh("u longer than v", "desc.v");
    v.count += 1;
    WITH(float, s.uvs[8][1], INFINITY, bad_mesh("an infinite v", "desc.v[8]"));
    succeeds("u and v apart", vrtm_asset_create(device, &d.mesh, &other));
    succeeds("its end", vrtm_asset_destroy(other));
    d.mesh.u = d.mesh.v = NULL;
    d.mesh.uvs = &d.uvs;
}

static void handles(void)
{
    vrtm_asset_info info = vrtm_asset_info_init();
    vrtm_tile other = {77};
    vrtm_tile_key key = {77, 77, 77, 77};
    vrtm_tile_grid grid = {77, 77};
    fails("asset zero", vrtm_asset_get_info((vrtm_asset){0}, &info), GONE, "asset: the handle is zero");
    fails("a device as an asset", vrtm_asset_get_info((vrtm_asset){device.id}, &info), GONE, "asset");
    fails("a tile as an asset", vrtm_asset_get_info((vrtm_asset){tile.id}, &info), GONE, "asset");
    fails("an asset as a tile", vrtm_tile_set_mask((vrtm_tile){asset.id}, NULL), GONE, "tile");
    fails("a tile from nowhere", vrtm_tile_set_mask((vrtm_tile){tile.id + (1ull << 40)}, NULL), GONE, "tile");
    fails("tile zero", vrtm_tile_set_mask((vrtm_tile){0}, NULL), GONE, "tile: the handle is zero");
    fails("no place for the info", vrtm_asset_get_info(asset, NULL), BAD, "info is null");
    fails("no place for the tile", vrtm_asset_get_tile(asset, 0, NULL), BAD, "tile is null");
    fails("tile 1 of one", vrtm_asset_get_tile(asset, 1, &other), BAD, "index is 1");
    fails("tile UINT32_MAX", vrtm_asset_get_tile(asset, UINT32_MAX, &other), BAD, "index");
    fails("tile 1002", find_udim(asset, 1002, &other), BAD, "udim");
    fails("no key", vrtm_asset_find_tile(asset, NULL, &other), BAD, "key is null");
    key = (vrtm_tile_key){1001, 1, 0, 0};
    fails("uv set 1", vrtm_asset_find_tile(asset, &key, &other), BAD, "key.uv_set is 1");
    fails("no place for the cells", vrtm_tile_get_grid(tile, NULL), BAD, "grid is null");
    fails("the grid of tile zero", vrtm_tile_get_grid((vrtm_tile){0}, &grid), GONE, "tile: the handle is zero");
    key.udim = 77;
    fails("no place for the key", vrtm_tile_get_key(tile, NULL), BAD, "key is null");
    fails("the key of tile zero", vrtm_tile_get_key((vrtm_tile){0}, &key), GONE, "tile: the handle is zero");
    check_that(other.id == 77 && grid.width == 77 && key.udim == 77 && info.faces == 0, "nothing was written", "");

    vrtm_asset second;
    vrtm_image rigidity = sheet_rigidity(&s);
    succeeds("a second asset", vrtm_asset_create(device, &d.mesh, &second));
    succeeds("its tile", vrtm_asset_get_tile(second, 0, &other));
    succeeds("its end", vrtm_asset_destroy(second));
    fails("destroyed twice", vrtm_asset_destroy(second), GONE, "asset");
    fails("a stale asset", vrtm_asset_get_info(second, &info), GONE, "asset");
    fails("a tile whose asset is gone", vrtm_tile_set_rigidity(other, &rigidity), GONE, "tile");
    vrtm_asset third;
    succeeds("a third asset", vrtm_asset_create(device, &d.mesh, &third));
    fails("the old tile is not the third's", vrtm_tile_set_rigidity(other, &rigidity), GONE, "tile");
    succeeds("its end", vrtm_asset_destroy(third));
}

static void bad_map(const char *name, const vrtm_image *image, const char *text)
{
    char message[64];
    fails(name, vrtm_tile_set_rigidity(tile, image), BAD, text);
    snprintf(message, sizeof message, "%s (mask)", name);
    fails(message, vrtm_tile_set_mask(tile, image), BAD, strchr(text, '.') != NULL ? strchr(text, '.') : "mask");
}

static void maps(void)
{
    typedef const void *data;
    vrtm_image image = sheet_rigidity(&s);
    WITH(uint32_t, image.struct_size, 3, bad_map("an image's struct_size", &image, "rigidity.struct_size is 3"));
    WITH(data, image.data, NULL, bad_map("no image data", &image, "rigidity.data is null"));
    WITH(uint32_t, image.width, 0, bad_map("no width", &image, "rigidity"));
    WITH(uint32_t, image.height, 0, bad_map("no height", &image, "rigidity"));
    WITH(vrtm_pixel_format, image.format, 4, bad_map("pixel format 4", &image, "rigidity.format is 4"));
    WITH(vrtm_pixel_format, image.format, -1, bad_map("pixel format -1", &image, "rigidity.format is -1"));
    WITH(vrtm_origin, image.origin, 2, bad_map("origin 2", &image, "rigidity.origin is 2"));
    WITH(size_t, image.row_stride, MAP - 1, bad_map("a short row stride", &image, "rigidity: row_stride"));
    WITH(size_t, image.row_stride, SIZE_MAX, bad_map("a row stride beyond memory", &image, "rigidity: row_stride is 1"));
    WITH(size_t, image.pixel_stride, SIZE_MAX / 2,
         bad_map("a pixel stride beyond memory", &image, "rigidity: pixel_stride is 92"));
    static float values[4][4];
    values[2][1] = NAN;
    image.data = values;
    image.format = VRTM_PIXEL_F32;
    image.width = image.height = 4;
    bad_map("a NaN texel", &image, "rigidity: texel (1, 2)");
    WITH(size_t, image.pixel_stride, 3, bad_map("a short pixel stride", &image, "rigidity: pixel_stride"));

    static float rigid[VERTICES];
    vrtm_array array = vrtm_array_init();
    array.data = rigid;
    array.count = VERTICES - 1;
    fails("a value per vertex, but one", vrtm_asset_set_vertex_rigidity(asset, &array), BAD, "rigidity");
    fails("a mask per vertex, but one", vrtm_asset_set_vertex_mask(asset, &array), BAD, "mask");
    array.count = VERTICES;
    rigid[VERTICES - 1] = NAN;
    fails("a NaN mask", vrtm_asset_set_vertex_mask(asset, &array), BAD, "mask[168]");
    fails("a NaN value", vrtm_asset_set_vertex_rigidity(asset, &array), BAD, "rigidity[168]");
    WITH(data, array.data, NULL,
         fails("no values", vrtm_asset_set_vertex_rigidity(asset, &array), BAD, "rigidity.data is null"));

    vrtm_tile_settings settings = vrtm_tile_settings_init();
    WITH(float, settings.room, -2, bad_settings("room -2", &settings, "settings.room: -2 is not between"));
    WITH(float, settings.smoothness, NAN, bad_settings("smoothness NaN", &settings, "settings.smoothness"));
    WITH(float, settings.smoothness_floor, 0, bad_settings("no floor", &settings, "settings.smoothness_floor"));
    WITH(float, settings.room_threshold, 2, bad_settings("threshold 2", &settings, "settings.room_threshold"));
    WITH(float, settings.harm, 17, bad_settings("harm 17", &settings, "settings.harm: 17 is not between"));
    WITH(float, settings.harm, NAN, bad_settings("harm NaN", &settings, "settings.harm"));
    WITH(vrtm_seams, settings.seams, 3, bad_settings("seams 3", &settings, "settings.seams is 3"));
    WITH(float, settings.seam_reach, -1, bad_settings("no reach", &settings, "settings.seam_reach: -1 is not"));
    settings.seams = VRTM_SEAMS_CONTINUE;
    WITH(float, settings.orientation_density, 1, bad_settings("seams and density", &settings, "orientation_density"));
    settings.seams = VRTM_SEAMS_SHUT;
    WITH(vrtm_open_borders, settings.open_borders, -1,
         bad_settings("borders -1", &settings, "settings.open_borders is -1"));
    settings.open_borders = VRTM_OPEN_BORDERS_SLIDE;
    WITH(float, settings.orientation_density, 1,
         bad_settings("borders and density", &settings, "settings.open_borders: "));
    settings.open_borders = VRTM_OPEN_BORDERS_FIXED;
    WITH(uint32_t, settings.grid_width, 20000, bad_settings("a grid too large", &settings, "settings.grid"));
    WITH(vrtm_overlap, settings.overlap, 5, bad_settings("overlap 5", &settings, "settings.overlap is 5"));
    fails("no place for settings", vrtm_tile_get_settings(tile, NULL), BAD, "settings is null");
}

static float map[2 * MAP * MAP], before[2 * MAP * MAP], uvs[2 * CORNERS];

static void before_a_solve(void)
{
    vrtm_image_out image = sheet_map(map);
    memset(map, 0x5A, sizeof map);
    memset(uvs, 0x5A, sizeof uvs);
    memcpy(before, map, sizeof before);
    vrtm_tile_report report = vrtm_tile_report_init();
    vrtm_asset_report whole = vrtm_asset_report_init();
    fails("fetch before solve", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image), VRTM_ERROR_NOT_SOLVED, "");
    fails("corner uvs before solve", vrtm_asset_fetch_corner_uvs(asset, 0, uvs, CORNERS), VRTM_ERROR_NOT_SOLVED, "");
    fails("tile report before solve", vrtm_tile_get_report(tile, &report), VRTM_ERROR_NOT_SOLVED, "");
    fails("asset report before solve", vrtm_asset_get_report(asset, &whole), VRTM_ERROR_NOT_SOLVED, "");
    vrtm_map_desc desc = vrtm_map_desc_init();
    vrtm_map_info info = vrtm_map_info_init();
    desc.width = desc.height = MAP;
    fails("a map before solve", vrtm_tile_inspect_map(tile, &desc, &info), VRTM_ERROR_NOT_SOLVED, "solve");
    check_that(memcmp(map, before, sizeof map) == 0 && memcmp(uvs, map, sizeof uvs / 2) == 0 && report.udim == 0 &&
                   whole.tiles == 0,
               "nothing was written", "");
}

static void bad_fetch(const char *name, vrtm_fetch_kind kind, const vrtm_image_out *image, vrtm_status status,
                      const char *text)
{
    memset(map, 0x5A, sizeof map);
    fails(name, fetch_image(tile, kind, image), status, text);
    for (size_t i = 0; i < sizeof map; ++i) {
        if (((const unsigned char *)map)[i] != 0x5A) {
            check_that(0, name, "the image was written");
            break;
        }
    }
}

static void bad_dilation(const char *name, double reach, const vrtm_image_out *image, const char *text)
{
    fails(name, vrtm_tile_fetch_dilation(tile, reach, image), BAD, text);
}

static void bad_look(const char *name, const vrtm_map_desc *desc, vrtm_status status, const char *text)
{
    vrtm_map_info info = vrtm_map_info_init();
    fails(name, vrtm_tile_inspect_map(tile, desc, &info), status, text);
}

static void maps_to_come(void)
{
    vrtm_image_out image = sheet_map(map);
    vrtm_map_desc desc = vrtm_map_desc_init();
    bad_dilation("no reach", 0, &image, "reach: 0");
    bad_dilation("too far", 0.75, &image, "reach: 0.75");
    bad_dilation("nowhere", 0.1, NULL, "image is null");
    WITH(uint32_t, image.channels, 1, bad_dilation("one channel of it", 0.1, &image, "2 to 4"));

    desc.width = desc.height = MAP;
    bad_look("no desc", NULL, BAD, "desc is null");
    WITH(vrtm_fetch_kind, desc.kind, VRTM_FETCH_WARP, bad_look("no redirection", &desc, BAD, "kind"));
    WITH(vrtm_pixel_format, desc.format, VRTM_PIXEL_U8,
         bad_look("an integer format", &desc, VRTM_ERROR_UNSUPPORTED, "format"));
    WITH(vrtm_pixel_format, desc.format, 9, bad_look("no format", &desc, BAD, "desc.format is 9"));
    WITH(uint32_t, desc.height, 0, bad_look("no rows", &desc, BAD, "size"));
    WITH(uint32_t, desc.height, 20000, bad_look("too many rows", &desc, BAD, "16384"));
    fails("no place for what it says", vrtm_tile_inspect_map(tile, &desc, NULL), BAD, "info is null");
    WITH(vrtm_tile, tile, (vrtm_tile){0}, bad_look("a map of tile zero", &desc, GONE, "tile"));
}

static void prepared_tiles(void)
{
    const vrtm_image rigidity = sheet_rigidity(&s);
    vrtm_tile_estimate needs = vrtm_tile_estimate_init();
    size_t size = 0, again = 0;
    fails("no place for an estimate", vrtm_tile_get_estimate(tile, NULL), BAD, "estimate is null");
    fails("an estimate of tile zero", vrtm_tile_get_estimate((vrtm_tile){0}, &needs), GONE, "tile");
    fails("a stroke beside the map", vrtm_tile_update_rigidity(tile, &rigidity, MAP - 1, 0, 2, 1), BAD, "2x1");
    fails("null is no stroke", vrtm_tile_update_rigidity(tile, NULL, 0, 0, 1, 1), BAD, "rigidity is null");
    succeeds("the size of a tile", vrtm_tile_save(tile, NULL, 0, &size));
    unsigned char *data = malloc(size);
    fails("a byte too few", vrtm_tile_save(tile, data, size - 1, &again), BAD, "capacity");
    check_that(size > 0 && again == 0, "nothing was written", "");
    fails("no place for the size", vrtm_tile_save(tile, data, size, NULL), BAD, "size is null");
    succeeds("a tile is saved", vrtm_tile_save(tile, data, size, &again));
    check_that(again == size, "in as many bytes", "");
    WITH(unsigned char, data[size / 2], data[size / 2] ^ 1,
         fails("damaged bytes", vrtm_tile_load(tile, data, size), BAD, "damaged"));
    fails("a few bytes", vrtm_tile_load(tile, data, 10), BAD, "data");
    fails("no bytes", vrtm_tile_load(tile, NULL, size), BAD, "data is null");
    succeeds("a tile is loaded", vrtm_tile_load(tile, data, size));
    free(data);
}

static void solves_and_fetches(void)
{
    static double pose[VERTICES][4];
    typedef const void *data;
    typedef void *room;
    typedef const vrtm_image_out *target;
    sheet_pose(&s, 3, pose);
    vrtm_array positions = sheet_positions(pose);
    vrtm_solve_options options = vrtm_solve_options_init();
    vrtm_image_out image = sheet_map(map);
    succeeds("a good solve", vrtm_asset_solve(asset, &positions, &options));
    succeeds("a good fetch", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image));
    memcpy(before, map, sizeof map);

    fails("no positions", vrtm_asset_solve(asset, NULL, NULL), BAD, "positions is null");
    WITH(data, positions.data, NULL, bad_solve("no position data", &positions, NULL, "positions.data is null"));
    WITH(size_t, positions.count, VERTICES - 1, bad_solve("a vertex too few", &positions, NULL, "positions"));
    WITH(size_t, positions.stride, 8, bad_solve("a short stride", &positions, NULL, "positions.stride is 8"));
    WITH(size_t, positions.stride, SIZE_MAX / 2,
         bad_solve("a stride beyond memory", &positions, NULL, "positions.stride is 92"));
    WITH(size_t, positions.count, SIZE_MAX / 16,
         bad_solve("a count beyond memory", &positions, NULL, "positions.count: "));
    WITH(double, pose[42][1], NAN, bad_solve("a NaN position", &positions, NULL, "positions[42]"));
    WITH(double, pose[43][0], -INFINITY, bad_solve("an infinite position", &positions, NULL, "positions[43]"));
    WITH(vrtm_quality, options.quality, 2, bad_solve("quality 2", &positions, &options, "options.quality is 2"));
    WITH(vrtm_solver, options.solver, 2, bad_solve("solver 2", &positions, &options, "options.solver is 2"));
    /* Fields of the other solver are not looked at. */
    WITH(uint32_t, options.pbd.iterations, 0,
         succeeds("no iterations of the other solver", vrtm_asset_solve(asset, &positions, &options)));
    options.solver = VRTM_SOLVER_PBD;
    WITH(float, options.tolerance, 1,
         succeeds("a tolerance of the other solver", vrtm_asset_solve(asset, &positions, &options)));
    WITH(uint32_t, options.pbd.iterations, 1025,
         bad_solve("1025 iterations", &positions, &options, "options.pbd.iterations: 1025"));
    WITH(float, options.pbd.damping, 1.5f,
         bad_solve("damping 1.5", &positions, &options, "options.pbd.damping: 1.5"));
    WITH(float, options.pbd.smoothing, NAN,
         bad_solve("a NaN smoothing", &positions, &options, "options.pbd.smoothing: NaN"));
    options.solver = VRTM_SOLVER_DESCENT;
    succeeds("the other solver again", vrtm_asset_solve(asset, &positions, &options));
    WITH(uint32_t, options.warm, 2, bad_solve("warm 2", &positions, &options, "options.warm is 2"));
    WITH(float, options.temporal_weight, -1,
         bad_solve("weight -1", &positions, &options, "options.temporal_weight: -1"));
    WITH(float, options.temporal_weight, NAN,
         bad_solve("a NaN weight", &positions, &options, "options.temporal_weight: NaN"));
    WITH(float, options.tolerance, 1, bad_solve("tolerance 1", &positions, &options, "options.tolerance"));
    WITH(float, options.time_budget_ms, NAN,
         bad_solve("a NaN budget", &positions, &options, "options.time_budget_ms"));
    WITH(uint32_t, options.struct_size, 2,
         bad_solve("options' struct_size", &positions, &options, "options.struct_size"));

    WITH(uint32_t, options.release, 4, bad_solve("release 4", &positions, &options, "options.release is 4"));

    vrtm_job job = {77};
    uint32_t vertices[2] = {0, VERTICES};
    typedef const uint32_t *numbers;
    options.dirty_vertex_count = 2;
#define SUBMIT() vrtm_asset_submit(asset, &positions, &options, &job)
    fails("no place for the job", vrtm_asset_submit(asset, &positions, NULL, NULL), BAD, "job is null");
    fails("a job without positions", vrtm_asset_submit(asset, NULL, NULL, &job), BAD, "positions is null");
    WITH(size_t, positions.count, VERTICES - 1, fails("a short job", SUBMIT(), BAD, "positions: 168 elements"));
    WITH(uint32_t, options.threads, 1025, fails("1025 threads", SUBMIT(), BAD, "options.threads: 1025"));
    WITH(uint32_t, options.replace, 2, fails("replace 2", SUBMIT(), BAD, "options.replace is 2"));
    WITH(numbers, options.dirty_vertices, vertices,
         fails("a vertex that there is not", SUBMIT(), BAD, "options.dirty_vertices[1]: 169"));
    check_that(job.id == 77, "no job was written", "");
    fails("frozen 2", vrtm_tile_freeze(tile, 2), BAD, "frozen is 2");

    const vrtm_fetch_kind redirection = VRTM_FETCH_REDIRECTION;
    bad_fetch("no image", redirection, NULL, BAD, "image is null");
    bad_fetch("kind 9", 9, &image, BAD, "kind is 9");
    bad_fetch("a kind after the last", VRTM_FETCH_CARRIED + 1, &image, BAD, "fetches[0].kind is 9");
    WITH(room, image.data, NULL, bad_fetch("no image data", redirection, &image, BAD, "image.data is null"));
    WITH(uint32_t, image.width, 0, bad_fetch("no width", redirection, &image, BAD, "image"));
    WITH(size_t, image.pixel_stride, 7, bad_fetch("a short pixel stride", redirection, &image, BAD, "pixel_stride"));
    WITH(size_t, image.row_stride, 8, bad_fetch("a short row stride", redirection, &image, BAD, "row_stride"));
    WITH(size_t, image.pixel_stride, SIZE_MAX / 2,
         bad_fetch("a pixel stride beyond memory", redirection, &image, BAD, "image: pixel_stride is 92"));
    WITH(size_t, image.row_stride, SIZE_MAX,
         bad_fetch("a row stride beyond memory", redirection, &image, BAD, "image: row_stride is 1"));
    WITH(vrtm_pixel_format, image.format, VRTM_PIXEL_U8,
         bad_fetch("an 8-bit output", redirection, &image, VRTM_ERROR_UNSUPPORTED, "image.format"));
    WITH(vrtm_pixel_format, image.format, 8,
         bad_fetch("pixel format 8", redirection, &image, BAD, "image.format is 8"));
    const vrtm_fetch_kind warp = VRTM_FETCH_WARP;
    WITH(uint32_t, image.channels, 5, bad_fetch("five channels", redirection, &image, BAD, "image: 5 channels"));
    WITH(uint32_t, image.channels, 1, bad_fetch("one channel", redirection, &image, BAD, "2 to 4"));
    WITH(uint32_t, image.channels, 2, bad_fetch("half", VRTM_FETCH_JACOBIAN, &image, BAD, "its kind has 4"));
    WITH(uint32_t, image.channels, 4, bad_fetch("a warp has no coverage", warp, &image, BAD, "2 to 3"));
    image.channels = 4;
    WITH(size_t, image.pixel_stride, 12, bad_fetch("four for three", redirection, &image, BAD, "pixel_stride"));
    image.channels = 0;
    fails("a part beside the whole", fetch_rectangle(tile, warp, &image, MAP - 7, 0, MAP, MAP), BAD, "image");
    fails("a corner too few", vrtm_asset_fetch_corner_uvs(asset, 0, uvs, CORNERS - 1), BAD, "count is 575");
    fails("no place for corner uvs", vrtm_asset_fetch_corner_uvs(asset, 0, NULL, CORNERS), BAD, "uvs is null");
    fails("no place for the report", vrtm_tile_get_report(tile, NULL), BAD, "report is null");
    uint32_t features;
    fails("no place for a count", vrtm_tile_get_worst_features(tile, NULL, 0, NULL), BAD, "count is null");
    fails("no place for features", vrtm_tile_get_worst_features(tile, NULL, 4, &features), BAD, "features is null");
    fails("no place for the asset's report", vrtm_asset_get_report(asset, NULL), BAD, "report is null");

    vrtm_asset second;
    vrtm_tile foreign;
    succeeds("a second asset", vrtm_asset_create(device, &d.mesh, &second));
    succeeds("its tile", vrtm_asset_get_tile(second, 0, &foreign));
    typedef const vrtm_tile *tiles;
    options.tile_count = 1;
    WITH(tiles, options.tiles, &foreign,
         bad_solve("another asset's tile", &positions, &options, "options.tiles[0] belongs to another asset"));
    vrtm_fetch fetches[2] = {vrtm_fetch_init(), vrtm_fetch_init()};
    vrtm_image_out other = image;
    static float elsewhere[2 * MAP * MAP];
    other.data = elsewhere;
    fetches[0].tile = fetches[1].tile = tile;
    fetches[0].image = &image;
    fetches[1].image = &other;
    memset(map, 0x5A, sizeof map);
#define REDIRECT() vrtm_asset_redirect(asset, &positions, NULL, fetches, 2)
    fails("no fetches", vrtm_asset_redirect(asset, &positions, NULL, NULL, 2), BAD, "fetches is null");
    WITH(vrtm_tile, fetches[1].tile, foreign, fails("another asset's tile", REDIRECT(), BAD, "fetches[1].tile"));
    WITH(vrtm_tile, fetches[1].tile, (vrtm_tile){0}, fails("no tile", REDIRECT(), GONE, "fetches[1].tile"));
    WITH(target, fetches[1].image, NULL, fails("no image", REDIRECT(), BAD, "fetches[1].image is null"));
    WITH(vrtm_fetch_kind, fetches[1].kind, 9, fails("kind 9", REDIRECT(), BAD, "fetches[1].kind is 9"));
    WITH(uint32_t, fetches[1].struct_size, 4, fails("a fetch's size", REDIRECT(), BAD, "fetches[1].struct_size"));
    WITH(room, other.data, map + 8, fails("images that overlap", REDIRECT(), BAD, "overlap"));
    WITH(room, other.data, (char *)pose + 8, fails("an image over the input", REDIRECT(), BAD, "positions"));
    WITH(vrtm_pixel_format, other.format, VRTM_PIXEL_U16,
         fails("the last is unsupported", REDIRECT(), VRTM_ERROR_UNSUPPORTED, "fetches[1]"));
    WITH(double, pose[44][0], NAN, fails("a NaN position", REDIRECT(), BAD, "positions[44]"));
    WITH(size_t, positions.count, 1, fails("a wrong count", REDIRECT(), BAD, "positions"));
    int kept = elsewhere[0] == 0;
    for (size_t i = 0; i < sizeof map; ++i) {
        kept &= ((const unsigned char *)map)[i] == 0x5A;
    }
    check_that(kept, "no image was written", "");
    succeeds("its end", vrtm_asset_destroy(second));
    maps_to_come();
    prepared_tiles();

    succeeds("fetch after all that", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image));
    check_that(memcmp(map, before, sizeof map) == 0, "the last good result is still there", "");
}

int main(void)
{
    sheet_make(&s);
    sheet_describe(&s, &d);
    vrtm_image rigidity = sheet_rigidity(&s);
    vrtm_device_desc desc = vrtm_device_desc_init();
    desc.threads = 1; /* one thread: this host runs under valgrind, where threads are slow; other hosts use more */
    if (!succeeds("device", vrtm_device_create(&desc, &device)) ||
        !succeeds("asset", vrtm_asset_create(device, &d.mesh, &asset)) ||
        !succeeds("tile", vrtm_asset_get_tile(asset, 0, &tile)) ||
        !succeeds("rigidity", vrtm_tile_set_rigidity(tile, &rigidity))) {
        return finish();
    }
    versions_of_structs();
    devices();
    meshes();
    handles();
    maps();
    before_a_solve();
    solves_and_fetches();
    succeeds("the asset's end", vrtm_asset_destroy(asset));
    succeeds("the device's end", vrtm_device_destroy(device));
    return finish();
}
