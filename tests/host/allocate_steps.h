/*
 * A host's work, step by step, for the programs that let allocations fail in it (allocate.c, allocate_outside.c): maps,
 * settings, estimates, saved tiles, solves of all kinds, fetches of all kinds, a carrier, a job. Each step is one call,
 * so that it does all of its work or none.
 */

#ifndef ALLOCATE_STEPS_H
#define ALLOCATE_STEPS_H

#include "allocate_model.h"

static vrtm_status make_device(work *w)
{
    vrtm_device_desc desc = vrtm_device_desc_init();
    desc.backend = w->backend;
    desc.threads = 2;
    desc.allocator = w->allocator;
    return vrtm_device_create(&desc, &w->device);
}

static vrtm_status make_asset(work *w)
{
    vrtm_array points = array_of(rest, POSITIONS), first = array_of(uvs[0], POSITIONS), second = array_of(uvs[1], POSITIONS);
    vrtm_uv_set more;
    vrtm_mesh_desc desc = vrtm_mesh_desc_init();
    memset(&more, 0, sizeof more);
    more.uvs = &second;
    more.uv_indices = quad_indices;
    more.uv_index_count = QUAD_CORNERS;
    desc.positions = &points;
    desc.face_counts = quad_counts;
    desc.face_count = QUADS * QUADS;
    desc.indices = quad_indices;
    desc.index_count = QUAD_CORNERS;
    desc.uvs = &first;
    desc.uv_indices = quad_indices;
    desc.uv_index_count = QUAD_CORNERS;
    desc.uv_sets = &more;
    desc.uv_set_count = 1;
    desc.seams = cut;
    desc.seam_count = QUADS;
    desc.weld = VRTM_WELD_POSITION;
    return vrtm_asset_create(w->device, &desc, &w->asset);
}

static vrtm_status find_tiles(work *w)
{
    vrtm_status status = vrtm_asset_get_tile(w->asset, 0, &w->tiles[0]);
    return status == VRTM_OK ? vrtm_asset_get_tile(w->asset, 1, &w->tiles[1]) : status;
}

static vrtm_status paint(work *w)
{
    vrtm_image image = map_of(painted);
    return vrtm_tile_set_rigidity(w->tiles[0], &image);
}

static vrtm_status paint_second(work *w)
{
    vrtm_image image = map_of(painted);
    image.format = VRTM_PIXEL_F32;
    image.data = painted_f32;
    return vrtm_tile_set_rigidity(w->tiles[1], &image);
}

static vrtm_status mask(work *w)
{
    vrtm_image image = map_of(masked);
    return vrtm_tile_set_mask(w->tiles[0], &image);
}

/* The second tile has a density. */
static vrtm_status settings(work *w)
{
    vrtm_tile_settings settings = vrtm_tile_settings_init();
    settings.grid_width = GRID_WIDTH;
    settings.grid_height = GRID_HEIGHT;
    settings.orientation_density = (float)w->step.tile;
    return vrtm_tile_set_settings(w->tiles[w->step.tile], &settings);
}

static vrtm_status describe(work *w)
{
    vrtm_tile_info data = vrtm_tile_info_init();
    return vrtm_tile_get_info(w->tiles[w->step.tile], &data);
}

static vrtm_status estimate(work *w)
{
    vrtm_tile_estimate needs = vrtm_tile_estimate_init();
    return vrtm_tile_get_estimate(w->tiles[0], &needs);
}

static vrtm_status save(work *w)
{
    return vrtm_tile_save(w->tiles[0], w->saved, w->saved_capacity, &w->saved_size);
}

static vrtm_status load(work *w)
{
    return vrtm_tile_load(w->tiles[0], w->saved, w->saved_size);
}

static vrtm_status solve(work *w)
{
    vrtm_array points = array_of(posed, POSITIONS);
    vrtm_solve_options options = vrtm_solve_options_init();
    pose_frame(w->step.frame, w->step.apart);
    options.quality = w->step.quality;
    options.solver = w->step.solver;
    options.warm = w->step.warm > 0;
    options.temporal_weight = w->step.warm;
    options.measure = w->step.measure;
    /* Memory is allocated in the first corrections and iterations alone; the others take most of the time. */
    options.max_corrections = options.quality == VRTM_QUALITY_DRAFT ? 0 : 2;
    options.pbd.iterations = 2;
    return vrtm_asset_solve(w->asset, &points, &options);
}

static vrtm_status fetch(work *w)
{
    vrtm_image_out image = image_of(w->out[0], VRTM_PIXEL_F32);
    return fetch_image(w->tiles[w->step.tile], w->step.kind, &image);
}

static vrtm_status fetch_half(work *w)
{
    vrtm_image_out image = image_of(w->out_half, VRTM_PIXEL_F16);
    return fetch_image(w->tiles[1], VRTM_FETCH_REDIRECTION, &image);
}

static vrtm_status fetch_part(work *w)
{
    vrtm_image_out image = image_of(w->out[1], VRTM_PIXEL_F32);
    return fetch_rectangle(w->tiles[0], VRTM_FETCH_WARP, &image, 700, 300, 2048, 1024);
}

static vrtm_status fetch_dilation(work *w)
{
    vrtm_image_out image = image_of(w->out[0], VRTM_PIXEL_F32);
    return vrtm_tile_fetch_dilation(w->tiles[0], 0.1, &image);
}

static vrtm_status fetch_corners(work *w)
{
    return vrtm_asset_fetch_corner_uvs(w->asset, 1, w->corners[0], QUAD_CORNERS);
}

/* A refinement of the second set, extended and read. */
static vrtm_status refine(work *w)
{
    static float pairs[1 << 20];
    vrtm_refinement refinement;
    vrtm_refinement_desc desc = vrtm_refinement_desc_init();
    vrtm_refinement_info data = vrtm_refinement_info_init();
    vrtm_status status;
    desc.uv_set = 1;
    desc.max_triangles = 10000;
    status = vrtm_refinement_create(w->asset, &desc, &refinement);
    if (status == VRTM_OK) {
        status = vrtm_refinement_extend(refinement);
        if (status == VRTM_OK) {
            status = vrtm_refinement_get_info(refinement, &data);
        }
        if (status == VRTM_OK) {
            status = vrtm_refinement_fetch_corner_uvs(refinement, pairs, (size_t)data.corners);
        }
        vrtm_refinement_destroy(refinement);
    }
    return status;
}

/* Points of the first set, given by UV: more than one block of memory of each kind. */
static vrtm_status make_carrier(work *w)
{
    static float at[CARRIED][2], heights[CARRIED];
    vrtm_array points = array_of(at, CARRIED), above = array_of(heights, CARRIED);
    vrtm_carrier_desc desc = vrtm_carrier_desc_init();
    for (int k = 0; k < CARRIED; ++k) {
        at[k][0] = (float)(k % 64 + 0.5) / 64;
        at[k][1] = (float)(k / 64 + 0.5) / 64;
        heights[k] = 0.01f * (float)(k % 3);
    }
    desc.uvs = &points;
    desc.heights = &above;
    return vrtm_carrier_create(w->asset, &desc, &w->carrier);
}

static vrtm_status carry(work *w)
{
    vrtm_array_out positions = vrtm_array_out_init(), rotations = vrtm_array_out_init();
    vrtm_carried carried = vrtm_carried_init();
    positions.data = w->carried;
    rotations.data = w->turned;
    positions.count = rotations.count = CARRIED;
    carried.positions = &positions;
    carried.rotations = &rotations;
    return vrtm_carrier_fetch(w->carrier, &carried);
}

static vrtm_status stroke(work *w)
{
    vrtm_image image = map_of(stroked);
    return vrtm_tile_update_rigidity(w->tiles[0], &image, 60, 30, 13, 15);
}

/* Two maps of one tile and one of the other. */
static vrtm_status redirect(work *w)
{
    vrtm_array points = array_of(posed, POSITIONS);
    vrtm_image_out images[3];
    vrtm_fetch fetches[3];
    vrtm_solve_options options = vrtm_solve_options_init();
    options.quality = VRTM_QUALITY_DRAFT;
    options.measure = 1;
    pose_frame(7, 0);
    images[0] = image_of(w->out[0], VRTM_PIXEL_F32);
    images[1] = image_of(w->out[1], VRTM_PIXEL_F32);
    images[2] = image_of(w->out_half, VRTM_PIXEL_F16);
    for (int k = 0; k < 3; ++k) {
        fetches[k] = vrtm_fetch_init();
        fetches[k].tile = w->tiles[k == 1];
        fetches[k].kind = k == 1 ? VRTM_FETCH_WARP : VRTM_FETCH_REDIRECTION;
        fetches[k].image = &images[k];
    }
    return vrtm_asset_redirect(w->asset, &points, &options, fetches, 3);
}

/* A job: its inputs are copied, and it is solved on another thread. */
static vrtm_status submit(work *w)
{
    vrtm_array points = array_of(posed, POSITIONS);
    vrtm_solve_options options = vrtm_solve_options_init();
    vrtm_job job;
    vrtm_status status;
    options.quality = VRTM_QUALITY_DRAFT;
    pose_frame(8, 0);
    status = vrtm_asset_submit(w->asset, &points, &options, &job);
    if (status == VRTM_OK) {
        status = vrtm_job_wait(job, VRTM_FOREVER);
        vrtm_job_destroy(job);
    }
    return status;
}

static vrtm_status weigh(work *w)
{
    vrtm_array array = array_of(weights, POSITIONS);
    return vrtm_asset_set_vertex_rigidity(w->asset, &array);
}

static vrtm_status hold(work *w)
{
    vrtm_array array = array_of(weights, POSITIONS);
    return vrtm_asset_set_vertex_mask(w->asset, &array);
}

static const step steps[] = {
    {"device", .run = make_device},
    {"asset", .run = make_asset},
    {"tiles", .run = find_tiles},
    {"rigidity", .run = paint},
    {"rigidity of f32", .run = paint_second},
    {"mask", .run = mask},
    {"settings", .run = settings},
    {"settings with a density", .run = settings, .tile = 1},
    {"estimate", .run = estimate},
    {"tile info", .run = describe},
    {"tile info with a density", .run = describe, .tile = 1},
    {"save", .run = save},
    {"load", .run = load},
    {"solve", .run = solve, .frame = 1},
    {"redirection", .run = fetch},
    {"delta", .run = fetch, .tile = 1, .kind = VRTM_FETCH_REDIRECTION_DELTA},
    {"warp", .run = fetch, .kind = VRTM_FETCH_WARP},
    {"redirection of f16", .run = fetch_half},
    {"part of a warp", .run = fetch_part},
    {"dilation", .run = fetch_dilation},
    {"corner UVs", .run = fetch_corners},
    {"refinement", .run = refine},
    {"carrier", .run = make_carrier},
    {"stroke", .run = stroke},
    {"solve after the stroke", .run = solve, .frame = 1},
    {"carried points", .run = carry},
    {"solve, draft", .run = solve, .frame = 2, .quality = VRTM_QUALITY_DRAFT},
    {"solve, warm", .run = solve, .frame = 4, .warm = 0.1f},
    {"solve, measured", .run = solve, .frame = 5, .quality = VRTM_QUALITY_DRAFT, .measure = 1},
    {"solve, torn", .run = solve, .frame = 5, .apart = 3, .quality = VRTM_QUALITY_DRAFT},
    {"solve, paper's", .run = solve, .frame = 6, .solver = VRTM_SOLVER_PBD},
    {"redirect", .run = redirect},
    {"job", .run = submit},
    {"vertex rigidity", .run = weigh},
    {"solve of vertex rigidity", .run = solve, .frame = 2, .quality = VRTM_QUALITY_DRAFT},
    {"vertex mask", .run = hold},
    {"solve of vertex mask", .run = solve, .frame = 2, .quality = VRTM_QUALITY_DRAFT},
};

enum { STEPS = sizeof steps / sizeof steps[0] };

static vrtm_status run_plain(int step, work *w)
{
    w->step = steps[step];
    return w->step.run(w);
}

static void work_begin(work *w, int backend, const vrtm_allocator *allocator)
{
    memset(w, 0, sizeof *w);
    w->backend = backend;
    w->allocator = allocator;
    w->saved_capacity = 16u << 20;
    w->saved = calloc(1, w->saved_capacity);
}

static void work_end(work *w)
{
    /* Nothing happens to what was not made. */
    vrtm_carrier_destroy(w->carrier);
    vrtm_asset_destroy(w->asset);
    vrtm_device_destroy(w->device);
    free(w->saved);
}

#endif
