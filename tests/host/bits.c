/*
 * Hashes of results over grids, solvers, qualities, poses, kinds and formats of maps, saved tiles and refinements: "NAME
 * HASH" per line. They are the same on all processors and systems, so that two of these lists may be compared line by
 * line. Its inputs are made with + - * / alone, since other functions differ between systems' libraries. The program's
 * argument is the number of threads, 2 without it.
 */

#include "check.h"

static sheet s;
static double pose[VERTICES][4];
static uint32_t threads = 2;

/* Stops with a message. */
static void need(vrtm_status status, const char *call)
{
    if (status != VRTM_OK) {
        printf("FAIL %s: %s\n", call, vrtm_last_error());
        exit(1);
    }
}
#define NEED(call) need(call, #call)

/* 64-bit FNV-1a. */
static uint64_t add(uint64_t hash, const void *data, size_t size)
{
    for (size_t k = 0; k < size; ++k) {
        hash = (hash ^ ((const unsigned char *)data)[k]) * 0x100000001b3u;
    }
    return hash;
}
#define SEED 0xcbf29ce484222325u

static void tell(const char *name, uint64_t hash)
{
    printf("%s %08lx%08lx\n", name, (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffffu));
    fflush(stdout);
}

/* A bulge that moves with the frame, and a twist of one half. */
static void pose_of(int frame)
{
    for (int k = 0; k < VERTICES; ++k) {
        const double x = s.points[k][0], y = s.points[k][1];
        const double dx = x - 3 - 0.5 * frame, dy = y - 5, square = dx * dx + dy * dy;
        const double turn = frame == 0 || x < 5 ? 0 : 0.03125 * (x - 5);
        pose[k][0] = x * (1 + 0.03125 * frame);
        pose[k][1] = y - turn * (y - 5) * 0.5;
        pose[k][2] = (frame == 0 ? 0 : 2.5 / (1 + 0.125 * square * square)) + turn * (y - 5);
        pose[k][3] = 1;
    }
}

static vrtm_device a_device(void)
{
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device device;
    desc.backend = VRTM_BACKEND_CPU;
    desc.threads = threads;
    NEED(vrtm_device_create(&desc, &device));
    return device;
}

static scene make(vrtm_device device, uint32_t width, uint32_t height)
{
    scene m = {device, {0}, {0}};
    vrtm_tile_settings settings = vrtm_tile_settings_init();
    settings.grid_width = width;
    settings.grid_height = height;
    const char *wrong = scene_on_device(&m, &s, 0);
    need(wrong == NULL ? VRTM_OK : VRTM_ERROR_INTERNAL, "a scene");
    NEED(vrtm_tile_set_settings(m.tile, &settings));
    return m;
}

static void solve(scene m, int frame, const vrtm_solve_options *options)
{
    const vrtm_array positions = sheet_positions(pose);
    pose_of(frame);
    NEED(vrtm_asset_solve(m.asset, &positions, options));
}

/* Continues a hash with a map. */
static uint64_t add_map(uint64_t hash, scene m, vrtm_fetch_kind kind, vrtm_pixel_format format, uint32_t size,
                        uint32_t channels)
{
    const size_t bytes = (size_t)size * size * channels * (format == VRTM_PIXEL_F32 ? 4 : format == VRTM_PIXEL_U8 ? 1 : 2);
    void *data = malloc(bytes);
    vrtm_image_out image = vrtm_image_out_init();
    image.data = data;
    image.format = format;
    image.width = image.height = size;
    image.channels = channels;
    NEED(fetch_image(m.tile, kind, &image));
    hash = add(hash, data, bytes);
    free(data);
    return hash;
}

/* Continues a hash with what a report says of the result: sums in double precision, strain, counts. */
static uint64_t add_report(uint64_t hash, scene m)
{
    vrtm_tile_report r = vrtm_tile_report_init();
    NEED(vrtm_tile_get_report(m.tile, &r));
    hash = add(hash, &r.energy_before, sizeof r.energy_before);
    hash = add(hash, &r.energy, sizeof r.energy);
    hash = add(hash, &r.min_jacobian, sizeof r.min_jacobian);
    hash = add(hash, &r.folds, sizeof r.folds);
    hash = add(hash, &r.max_displacement, sizeof r.max_displacement);
    hash = add(hash, &r.sweeps, sizeof r.sweeps);
    hash = add(hash, &r.corrections, sizeof r.corrections);
    hash = add(hash, &r.node_updates, sizeof r.node_updates);
    hash = add(hash, &r.before, sizeof r.before);
    return add(hash, &r.after, sizeof r.after);
}

static void end(scene m)
{
    NEED(vrtm_asset_destroy(m.asset));
}

static void grids(vrtm_device device)
{
    static const uint32_t sizes[][2] = {{48, 48}, {96, 160}, {250, 250}};
    for (int k = 0; k < 3; ++k) {
        char name[40];
        vrtm_solve_options options = vrtm_solve_options_init();
        scene m = make(device, sizes[k][0], sizes[k][1]);
        options.measure = 1;
        solve(m, 4, &options);
        snprintf(name, sizeof name, "grid of %u x %u", (unsigned)sizes[k][0], (unsigned)sizes[k][1]);
        tell(name, add_report(add_map(SEED, m, VRTM_FETCH_REDIRECTION, VRTM_PIXEL_F32, 100, 2), m));
        end(m);
    }
}

static void efforts(vrtm_device device)
{
    static const char *names[] = {"normal", "draft", "seven corrections", "pbd", "a warm start", "a budget of corrections"};
    for (int k = 0; k < 6; ++k) {
        vrtm_solve_options options = vrtm_solve_options_init();
        scene m = make(device, 128, 128);
        options.measure = 1;
        if (k < 2) {
            options.quality = (vrtm_quality)k;
        } else if (k == 2) {
            options.max_corrections = 7;
        } else if (k == 3) {
            options.solver = VRTM_SOLVER_PBD;
        } else if (k == 4) {
            options.warm = 1;
            options.temporal_weight = 0.125f;
            solve(m, 5, &options);
        } else {
            options.max_corrections = 1;
        }
        solve(m, 6, &options);
        tell(names[k], add_report(add_map(SEED, m, VRTM_FETCH_WARP, VRTM_PIXEL_F32, 129, 2), m));
        end(m);
    }
}

static void frames(vrtm_device device)
{
    scene m = make(device, MAP, MAP);
    for (int frame = 0; frame < 4; ++frame) {
        static float corners[2 * CORNERS];
        char name[40];
        solve(m, 3 * frame, NULL);
        NEED(vrtm_asset_fetch_corner_uvs(m.asset, 0, corners, CORNERS));
        snprintf(name, sizeof name, "frame %d", 3 * frame);
        tell(name, add(add_map(SEED, m, VRTM_FETCH_REDIRECTION, VRTM_PIXEL_F32, MAP, 2), corners, sizeof corners));
    }
    end(m);
}

static void kinds_and_formats(vrtm_device device)
{
    static const struct {
        const char *name;
        vrtm_fetch_kind kind;
        vrtm_pixel_format format;
        uint32_t size, channels;
    } maps[] = {
        {"redirection with coverage", VRTM_FETCH_REDIRECTION, VRTM_PIXEL_F32, 90, 4},
        {"redirection of 16 bits", VRTM_FETCH_REDIRECTION, VRTM_PIXEL_F16, 90, 2},
        {"redirection among tiles", VRTM_FETCH_REDIRECTION_UDIM, VRTM_PIXEL_F32, 90, 2},
        {"delta in f16", VRTM_FETCH_REDIRECTION_DELTA, VRTM_PIXEL_F16, 90, 2},
        {"warp", VRTM_FETCH_WARP, VRTM_PIXEL_F32, MAP + 1, 2},
        {"derivatives", VRTM_FETCH_JACOBIAN, VRTM_PIXEL_F32, 90, 4},
        {"filter's scale", VRTM_FETCH_FILTER_SCALE, VRTM_PIXEL_F32, 90, 1},
    };
    scene m = make(device, MAP, MAP);
    solve(m, 7, NULL);
    for (size_t k = 0; k < sizeof maps / sizeof maps[0]; ++k) {
        tell(maps[k].name, add_map(SEED, m, maps[k].kind, maps[k].format, maps[k].size, maps[k].channels));
    }

    size_t size = 0;
    NEED(vrtm_tile_save(m.tile, NULL, 0, &size));
    unsigned char *bytes = malloc(size);
    NEED(vrtm_tile_save(m.tile, bytes, size, &size));
    tell("a saved tile", add(SEED, bytes, size));
    free(bytes);

    vrtm_refinement refinement;
    vrtm_refinement_desc desc = vrtm_refinement_desc_init();
    vrtm_refinement_info data = vrtm_refinement_info_init();
    NEED(vrtm_refinement_create(m.asset, &desc, &refinement));
    NEED(vrtm_refinement_get_info(refinement, &data));
    float *uvs = malloc(data.corners * 2 * sizeof(float));
    NEED(vrtm_refinement_fetch_corner_uvs(refinement, uvs, data.corners));
    tell("a refined mesh", add(SEED, uvs, data.corners * 2 * sizeof(float)));
    free(uvs);
    NEED(vrtm_refinement_destroy(refinement));
    end(m);
}

int main(int count, char **arguments)
{
    threads = count > 1 ? (uint32_t)atoi(arguments[1]) : 2;
    sheet_make(&s);
    uint64_t inputs = add(add(SEED, s.points, sizeof s.points), s.uvs, sizeof s.uvs);
    inputs = add(inputs, s.rigidity, sizeof s.rigidity);
    for (int frame = 0; frame < 10; ++frame) {
        pose_of(frame);
        inputs = add(inputs, pose, sizeof pose);
    }
    tell("inputs", inputs);
    vrtm_device device = a_device();
    grids(device);
    efforts(device);
    frames(device);
    kinds_and_formats(device);
    NEED(vrtm_device_destroy(device));
    return 0;
}
