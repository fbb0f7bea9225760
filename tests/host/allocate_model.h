/*
 * What a host works on in allocate_steps.h: a mesh with two UV sets and two halves that are welded by position, poses,
 * and maps.
 */

#ifndef ALLOCATE_MODEL_H
#define ALLOCATE_MODEL_H

#include "check.h"

enum {
    QUADS = 40,
    HALF = QUADS / 2,
    ROW = HALF + 1,                    /* vertices of a half's row */
    POSITIONS = 2 * ROW * (QUADS + 1),
    QUAD_CORNERS = 4 * QUADS * QUADS,
    CARRIED = 64 * 64,
    TEXELS = 160,                      /* side of the maps */
    OUT_WIDTH = 520,                   /* so wide that even a line of texels or nodes takes 4 KiB */
    OUT_HEIGHT = 20,
    OUT = OUT_WIDTH * OUT_HEIGHT,
    GRID_WIDTH = 544,
    GRID_HEIGHT = 64,
    MAX_TILES = 2
};

struct work;

/* A call, and what of these it is made with. */
typedef struct {
    const char *name;
    vrtm_status (*run)(struct work *);
    int tile, frame;
    vrtm_fetch_kind kind;
    float apart, warm;
    vrtm_quality quality;
    vrtm_solver solver;
    uint32_t measure;
} step;

typedef struct work {
    step step;
    int backend;
    const vrtm_allocator *allocator;
    vrtm_device device;
    vrtm_asset asset;
    vrtm_tile tiles[MAX_TILES];
    vrtm_carrier carrier;
    unsigned char *saved;
    size_t saved_size, saved_capacity;
    /* What calls write: compared byte for byte. */
    float out[2][OUT * 2];
    uint16_t out_half[OUT * 2];
    float corners[QUAD_CORNERS][2];
    float carried[CARRIED][3], turned[CARRIED][4];
} work;

static float rest[POSITIONS][3], posed[POSITIONS][3], uvs[2][POSITIONS][2], weights[POSITIONS];
static uint32_t quad_counts[QUADS * QUADS], quad_indices[QUAD_CORNERS], cut[2 * QUADS];
static unsigned char painted[TEXELS * TEXELS], stroked[TEXELS * TEXELS], masked[TEXELS * TEXELS];
static float painted_f32[TEXELS * TEXELS];

static int vertex(int side, int i, int j)
{
    return (j * ROW + i) + side * ROW * (QUADS + 1);
}

static void prepare_inputs(void)
{
    int face = 0;
    for (int side = 0; side < 2; ++side) {
        for (int j = 0; j <= QUADS; ++j) {
            for (int i = 0; i < ROW; ++i) {
                const int k = vertex(side, i, j);
                const float u = (float)(i + side * HALF) / QUADS, v = (float)j / QUADS;
                rest[k][0] = 10 * u;
                rest[k][1] = 10 * v;
                rest[k][2] = 0;
                uvs[0][k][0] = 0.04f + 0.92f * u;
                uvs[0][k][1] = 0.04f + 0.92f * v;
                /* The second set lies in the tile to the right, turned. */
                uvs[1][k][0] = 1.05f + 0.9f * v;
                uvs[1][k][1] = 0.05f + 0.9f * u;
                weights[k] = (i / 3 + j / 3) % 3 == 0 ? 1.0f : 0.0f;
            }
        }
    }
    for (int j = 0; j < QUADS; ++j) {
        for (int i = 0; i < QUADS; ++i, ++face) {
            const int side = i >= HALF, at = i - side * HALF;
            quad_counts[face] = 4;
            quad_indices[4 * face] = (uint32_t)vertex(side, at, j);
            quad_indices[4 * face + 1] = (uint32_t)vertex(side, at + 1, j);
            quad_indices[4 * face + 2] = (uint32_t)vertex(side, at + 1, j + 1);
            quad_indices[4 * face + 3] = (uint32_t)vertex(side, at, j + 1);
        }
    }
    /* A seam across both halves. */
    for (int i = 0; i < QUADS; ++i) {
        const int side = i >= HALF, at = i - side * HALF;
        cut[2 * i] = (uint32_t)vertex(side, at, QUADS / 2);
        cut[2 * i + 1] = (uint32_t)vertex(side, at + 1, QUADS / 2);
    }
    for (int y = 0; y < TEXELS; ++y) {
        for (int x = 0; x < TEXELS; ++x) {
            const int k = y * TEXELS + x;
            const double dx = fmod(x + 0.5, 16) - 8, dy = fmod(y + 0.5, 16) - 8;
            painted[k] = dx * dx + dy * dy < 20 ? 255 : 0;
            painted_f32[k] = dx * dx + dy * dy < 30 ? 1.0f : 0.0f;
            stroked[k] = x > 60 && x < 72 && y > 30 && y < 44 ? 200 : painted[k];
            masked[k] = x > 20 ? 255 : 0;
        }
    }
}

/* Frame 0 is the rest; `apart` pulls the halves apart. */
static void pose_frame(int frame, float apart)
{
    for (int k = 0; k < POSITIONS; ++k) {
        const float dx = rest[k][0] - 3 - 0.5f * (float)frame, dy = rest[k][1] - 4;
        posed[k][0] = rest[k][0] * (1 + 0.03f * (float)frame);
        posed[k][1] = rest[k][1];
        posed[k][2] = 2.0f * expf(-(dx * dx + dy * dy) / 3) + (k >= POSITIONS / 2 ? apart : 0);
    }
}

static vrtm_array array_of(const void *data, size_t count)
{
    vrtm_array array = vrtm_array_init();
    array.data = data;
    array.count = count;
    return array;
}

static vrtm_image map_of(const unsigned char *texels)
{
    vrtm_image image = vrtm_image_init();
    image.format = VRTM_PIXEL_U8;
    image.data = texels;
    image.width = image.height = TEXELS;
    return image;
}

static vrtm_image_out image_of(void *data, vrtm_pixel_format format)
{
    vrtm_image_out image = vrtm_image_out_init();
    image.format = format;
    image.data = data;
    image.width = OUT_WIDTH;
    image.height = OUT_HEIGHT;
    return image;
}

#endif
